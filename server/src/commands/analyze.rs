//! `sidestep analyze`.

use super::json_file::Document;
use super::solving::{Interrupt, bar, safety_levels};
use super::trials_file::SceneArgs;
use super::{CommandError, print_json, trials_file, unwritable};
use crate::formats::atomic_folder::Draft;
use crate::formats::features_csv::{self, FeatureRows};
use crate::formats::trials_csv::Contents;
use crate::jobs::fit_cache::FolderCache;
use crate::report::{CompareError, Excluded, Tasks};
use crate::store::{Missing, Store};
use crate::synthetic;
use crate::threads;
use sidestep::comparison::{Progress, Request};
use sidestep::invalid::Invalid;
use std::fs::File;
use std::io::BufReader;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// The paper's comparison: do safety levels help to predict people?
///
/// For every person, feature set (hrd, hr, hd, rd, h, r, d of the paper; hrd_body and d_body with
/// the robot's position in the human's body frame), experiment (1: right, straight or left; 2:
/// avoid or not) and model (svm_rbf, svm_linear, svm: the better of both in cross-validation, dt,
/// lr), hyper-parameters are chosen by five-fold cross-validation over whole trials of the first
/// four fifths of the tasks, and the model is tested on the last fifth.
///
/// People with fewer than five tasks or one kind of input are left out, and so is who has a wrong
/// row: a value that cannot be, a step that is missing, there twice or out of order, or features
/// that do not go with the trials. They are named with line and reason on stderr, in the printed
/// line and in the report, and all others are compared. A file is refused as a whole (exit code 2)
/// where it cannot be told whose its rows are: without a column that is needed, with a row of more
/// or fewer fields than the header or without a participant, or as text that is not UTF-8; and
/// where nobody is left.
///
/// Writes to --out: cells.csv (every fit), table1.csv (mean accuracy, per cent) and table2.csv
/// (D_start and D_end, steps) as in the paper, tests.csv, beside.csv, ablation.csv, calibration.csv,
/// rollouts.csv (predictors fed with what they said), predictions.csv, leakage.csv with
/// --leakage, models/ (a predictor.json for each fit; what was in it before is deleted),
/// report.html and tables.tex. The same input gives the same bytes whatever the number of threads
/// or the order of people. Fits are kept in --out/.cache and used again where nothing they depend
/// on has changed. Prints one line of JSON.
#[derive(Clone, Debug, clap::Args)]
pub struct AnalyzeArgs {
    #[command(flatten)]
    source: Source,
    /// Name of the study in addresses, with --database.
    #[arg(long, value_name = "SLUG", default_value = "default", conflicts_with = "trials")]
    study: String,
    /// Threads [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// File of `sidestep features`, or one with the columns
    /// participant,trial,step,apx,apy,dpsi,cosd,sind,vh,vr,d,y1: its features are used instead of
    /// computed ones, and must have a row for every step.
    #[arg(long, value_name = "FILE.csv")]
    features: Option<PathBuf>,
    /// What else is to be compared, as JSON: {"sets": {"NAME": ["v_h", "distance", …], …},
    /// "grids": {"rbf_c": […], "rbf_gamma": […], "linear_c": […], "tree_depth": [3, null],
    /// "tree_leaf": […], "logistic_c": […], "boosted_depth": […]}, "leakage": true,
    /// "synthetic": true}. Sets come beside the paper's, of any features that `sidestep features
    /// --help` names; a set is the whole list, so name abs_dx, abs_dy, dpsi, cos_dpsi and sin_dpsi
    /// too where it is to have the paper's B. Grids take the place of the protocol's. Everything
    /// may be left out; - reads stdin.
    #[arg(long, value_name = "FILE.json")]
    settings: Option<PathBuf>,
    /// Also split by time step, which is wrong, to show by how much it deceives (leakage.csv).
    #[arg(long)]
    leakage: bool,
    /// Say that the data are synthetic. Files of `sidestep simulate` say so themselves.
    #[arg(long)]
    synthetic: bool,
    /// The vehicles; the human is the evader. With --database the study's own.
    #[command(flatten)]
    scene: SceneArgs,
    /// Folder for the files, made where there is none.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// CSV file with at least the columns
    /// participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega in any order. Only tasks count.
    #[arg(long, value_name = "FILE.csv")]
    trials: Option<PathBuf>,
    /// Database: sqlite: and a file.
    #[arg(long, value_name = "URL", conflicts_with_all = ["GameArgs", "SceneArgs"])]
    database: Option<String>,
}

/// Compares and writes the folder.
///
/// # Errors
/// [`CommandError`] for bad flags or data, with file and line (input), or what the disk or the
/// database refuses (failure).
pub async fn run(args: AnalyzeArgs) -> Result<(), CommandError> {
    let start = Instant::now();
    let request = args.request()?;
    let complain =
        |e: Invalid| Document(args.settings.as_deref().unwrap_or(Path::new(""))).complain(&e);
    let settings = request.settings().map_err(complain)?;
    let (source, mut tasks) = args.tasks().await?;
    if request.synthetic {
        tasks.synthetic = Some("said by the experimenter".to_owned());
    }
    let say = |excluded: &[Excluded]| {
        excluded.iter().for_each(|who| eprintln!("sidestep: {source}: left out: {who}"));
    };
    say(&tasks.exclusions);
    let said = tasks.exclusions.len();
    let given = args.features.as_deref().map(read_features).transpose()?;
    let draft = Draft::begin(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let kept = args.out.join(".cache");
    let cache = Arc::new(FolderCache::open(&kept).map_err(|e| unwritable(&kept, &e))?);
    let interrupt = Interrupt::listen();
    let safety = safety_levels(&tasks.scene, &interrupt).await?;
    interrupt.check()?;
    let bar = bar(0, "comparing [{bar:40}] {pos}/{len}  {elapsed_precise}  {eta} left");
    let work = {
        let (cache, token, bar) = (Arc::clone(&cache), interrupt.token.clone(), bar.clone());
        move || {
            let step = |progress: Progress| {
                bar.set_length(progress.of as u64);
                bar.set_position(progress.done as u64);
                if token.is_cancelled() {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            tasks.compare(&safety, given.as_ref(), &settings, &*cache, &step)
        }
    };
    let compared = threads::run("analyze", args.threads.map(usize::from), work).await;
    bar.finish_and_clear();
    let analysis = match compared.map_err(CommandError::failure)? {
        Ok(analysis) => analysis,
        Err(CompareError::Stopped) => return Err(interrupt.check().err().unwrap_or_else(stopped)),
        Err(error @ CompareError::Features(_)) => {
            let file = args.features.as_deref().unwrap_or(Path::new("")).display().to_string();
            return Err(CommandError::Input(format!("{file}: {error}")));
        }
        Err(error) => return Err(CommandError::Input(format!("{source}: {error}"))),
    };
    say(&analysis.exclusions[said..]);
    analysis.write(draft.path()).map_err(|e| unwritable(&args.out, &e))?;
    let kept_or = |e| interrupt.check().err().unwrap_or_else(|| unwritable(&args.out, &e));
    // Of a former analysis in this folder, whose other files are replaced.
    draft.keep(&["leakage.csv"], &interrupt.token).map_err(kept_or)?;
    // Only once the folder is complete: a failure before leaves all that was computed.
    cache.forget_unused().map_err(|e| unwritable(&kept, &e))?;
    print_json(&serde_json::json!({
        "folder": args.out,
        "participants": analysis.comparison.participants.len(),
        "excluded": analysis.exclusions,
        "flagged": analysis.flagged,
        "same_trials": analysis.same_trials,
        "safety": analysis.safety,
        "cells": analysis.comparison.cells.len(),
        "synthetic": analysis.synthetic.is_some(),
        "wall_s": start.elapsed().as_secs_f64(),
    }))
}

impl AnalyzeArgs {
    /// What is asked for, by the file and by flags.
    fn request(&self) -> Result<Request, CommandError> {
        let said = self.settings.as_deref().map(|path| Document(path).read()).transpose()?;
        let said: Request = said.unwrap_or_default();
        Ok(Request {
            leakage: said.leakage || self.leakage,
            synthetic: said.synthetic || self.synthetic,
            ..said
        })
    }

    /// Whence the tasks are, and they.
    async fn tasks(&self) -> Result<(String, Tasks), CommandError> {
        if let Some(path) = &self.source.trials {
            let scene = self.scene.scene()?;
            let Contents { people, faults } = trials_file::each_ones_tasks(path, &scene)?;
            let exclusions = faults.into_iter().map(Excluded::from).collect();
            let synthetic = synthetic::recognised(&people);
            let tasks = Tasks { people, exclusions, scene, synthetic };
            return Ok((path.display().to_string(), tasks));
        }
        let url = self.source.database.clone().unwrap_or_default();
        let source = format!("--study {}", self.study);
        let store = Store::open(&url, Missing::Refuse).await?;
        let study = store
            .study(&self.study)
            .await?
            .ok_or_else(|| CommandError::Input(format!("{source}: no such study in {url}")))?;
        let tasks = Tasks::of_study(&store, &study).await?;
        store.close().await;
        Ok((source, tasks))
    }
}

fn stopped() -> CommandError {
    CommandError::Failure("stopped; nothing was written".to_owned())
}

fn read_features(path: &Path) -> Result<FeatureRows, CommandError> {
    let complain =
        |e: &dyn std::fmt::Display| CommandError::Input(format!("{}: {e}", path.display()));
    let file = File::open(path).map_err(|e| complain(&format!("cannot read: {e}")))?;
    features_csv::read(BufReader::new(file)).map_err(|e| complain(&e))
}
