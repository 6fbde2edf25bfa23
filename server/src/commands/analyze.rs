//! `sidestep analyze`.

use super::json_file::Document;
use super::solving::{Interrupt, bar, safety_levels};
use super::trials_file::Faults;
use super::trials_source::TrialsArgs;
use super::{CommandError, print_json, table_file, unwritable};
use crate::formats::atomic_folder::Draft;
use crate::formats::features_csv;
use crate::jobs::analysis::{AnalysisTask, TaskError};
use crate::jobs::fit_cache::FolderCache;
use crate::report;
use sidestep::comparison::{AnalysisError, DataError, Progress, Request};
use sidestep::dataset::GivenFeatures;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Run the paper's comparison: do safety levels help to predict people?
///
/// Trains and tests a model for every participant, feature set (hrd, hr, hd, rd, h, r, d of the
/// paper; hrd_body and d_body with the robot's position in the human's body frame), experiment (1:
/// right, straight or left; 2: avoid or not) and kind of model (svm_rbf, svm_linear, svm: the
/// better of both in cross-validation, dt, lr). The hyper-parameters are chosen by five-fold
/// cross-validation over whole trials of the first four fifths of the tasks. The last fifth tests
/// the model. Participants are excluded if they have fewer than five tasks, only one kind of input,
/// or an invalid row: an impossible value, a step that is missing, repeated, out of order or
/// impossible for the vehicles, or features that do not match the trials. stderr, the printed line
/// and the report name them with line and reason; all others are compared. The whole file is
/// refused (exit code 2) if a row cannot be assigned to a participant (a missing column, a wrong
/// number of fields, no participant, text that is not UTF-8), if headings do not point in the
/// direction of motion (such as headings in degrees), if headings turn against omega or match the
/// omega of another row, or if no participant is left. Trials that do not replay from their inputs
/// are counted as flagged.
///
/// Writes to --out: cells.csv (every fit), table1.csv (mean accuracy, per cent) and table2.csv
/// (D_start and D_end, steps) as in the paper, tests.csv, beside.csv, ablation.csv,
/// calibration.csv, rollouts.csv (predictors fed with their own predictions), predictions.csv,
/// leakage.csv with --leakage, behaviour.csv and behaviour_trials.csv (the behaviour of people),
/// behaviour_robots.csv (by robot, if the study names its robots),
/// learning.csv (fewer training tasks), unseen.csv (models trained on other people), importance.csv
/// (the accuracy that models lose without a feature), figures/ (every figure of the report as SVG),
/// models/ (a predictor.json for each fit; earlier files there are deleted), report.html,
/// tables.tex and numbers.json (every number of the report with all digits). The same input gives
/// the same bytes for any number of threads and any order of participants. Fits are cached in
/// --out/.cache and reused if nothing they depend on has changed. Prints one line of JSON.
#[derive(Clone, Debug, clap::Args)]
pub struct AnalyzeArgs {
    #[command(flatten)]
    trials: TrialsArgs,
    /// Threads [default: one per processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Features to use instead of the computed ones, with a row for every step.
    ///
    /// The file is written by `sidestep features`, or has the columns
    /// participant,trial,step,apx,apy,dpsi,cosd,sind,vh,vr,d,y1.
    #[arg(long, value_name = "FILE.csv")]
    features: Option<PathBuf>,
    /// Further feature sets, grids and options, as JSON; - reads stdin.
    ///
    /// {"sets": {"NAME": ["v_h", "distance", …], …}, "grids": {"rbf_c": […], "rbf_gamma": […],
    /// "linear_c": […], "tree_depth": [3, null], "tree_leaf": […], "logistic_c": […],
    /// "boosted_depth": […]}, "leakage": true, "paper_only": true, "synthetic": true}. Every field
    /// is optional. Sets are compared in addition to those of the paper; `sidestep features --help`
    /// lists the features. A set is the complete list, so include abs_dx, abs_dy, dpsi, cos_dpsi
    /// and sin_dpsi for the paper's B. Grids replace the protocol's.
    #[arg(long, value_name = "FILE.json")]
    settings: Option<PathBuf>,
    /// Also split by time step, to show how much this wrong split overstates accuracy (leakage.csv).
    #[arg(long)]
    leakage: bool,
    /// Skip analyses that the paper does not have: learning curves, models for unseen people,
    /// feature importance.
    ///
    /// Saves about a third of the time.
    #[arg(long)]
    paper_only: bool,
    /// State in the report that the data are synthetic (automatic for files of `sidestep simulate`).
    #[arg(long)]
    synthetic: bool,
    /// Folder for the files; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Compares the predictors and writes the folder.
///
/// # Errors
/// [`CommandError`] for bad flags or data, with file and line (input), or an error of the disk or
/// the database (failure).
pub async fn run(args: AnalyzeArgs) -> Result<(), CommandError> {
    let start = Instant::now();
    let request = args.request()?;
    let recording = args.trials.recording(Faults::Exclude).await?;
    let origin = recording.provenance.origin.to_string();
    let told = recording.exclusions.len();
    let given = args.features.as_deref().map(read_features).transpose()?;
    let draft = Draft::begin(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let kept = args.out.join(".cache");
    let cache = Arc::new(FolderCache::open(&kept).map_err(|e| unwritable(&kept, &e))?);
    let interrupt = Interrupt::listen();
    let safety = safety_levels(&recording.scene, &interrupt).await?;
    interrupt.check()?;
    let task = AnalysisTask {
        recording,
        given,
        safety,
        request,
        cache: Arc::clone(&cache),
        threads: args.threads.map(usize::from),
        cancel: interrupt.token.clone(),
    };
    let bar = bar(0, "comparing [{bar:40}] {pos}/{len}  {elapsed_precise}  {eta} left");
    let shown = bar.clone();
    let progress = move |progress: Progress| {
        shown.set_length(progress.of as u64);
        shown.set_position(progress.done as u64);
    };
    let found = task.run(progress).await;
    bar.finish_and_clear();
    interrupt.check()?;
    let analysis = found.map_err(|error| args.complain(&origin, &error))?;
    for exclusion in &analysis.data.exclusions[told..] {
        eprintln!("sidestep: {origin}: excluded: {exclusion}");
    }
    report::write(&analysis, draft.path()).map_err(|e| unwritable(&args.out, &e))?;
    let kept_or = |e| interrupt.check().err().unwrap_or_else(|| unwritable(&args.out, &e));
    // Delete the leakage.csv and behaviour_robots.csv of an earlier analysis in this folder, which
    // the new analysis may lack. The other files of that analysis are replaced.
    draft.keep(&["leakage.csv", "behaviour_robots.csv"], &interrupt.token).map_err(kept_or)?;
    // The folder is complete now. If an error occurs before this line, all computed fits stay cached.
    cache.forget_unused().map_err(|e| unwritable(&kept, &e))?;
    let data = &analysis.data;
    print_json(&serde_json::json!({
        "folder": args.out,
        "participants": analysis.comparison.participants.len(),
        "excluded": data.exclusions,
        "flagged": data.flagged,
        "same_trials": data.same_trials,
        "copied_trials": data.copied_trials,
        "safety": data.safety,
        "cells": analysis.comparison.cells.len(),
        "models": analysis.counts().models,
        "version": env!("CARGO_PKG_VERSION"),
        "data_sha256": data.sha256,
        "synthetic": data.synthetic.is_some(),
        "wall_s": start.elapsed().as_secs_f64(),
    }))
}

impl AnalyzeArgs {
    /// The request from the settings file and the flags, checked before the computation.
    fn request(&self) -> Result<Request, CommandError> {
        let document = Document(self.settings.as_deref().unwrap_or(Path::new("")));
        let said: Request = match self.settings {
            Some(_) => document.read()?,
            None => Request::default(),
        };
        said.settings().map_err(|invalid| document.complain(&invalid))?;
        Ok(Request {
            leakage: said.leakage || self.leakage,
            paper_only: said.paper_only || self.paper_only,
            synthetic: said.synthetic || self.synthetic,
            ..said
        })
    }

    /// Converts an error of the task to an error of the command.
    fn complain(&self, origin: &str, error: &TaskError) -> CommandError {
        match error {
            TaskError::Thread(_) | TaskError::Analysis(AnalysisError::Stopped) => {
                CommandError::failure(error)
            }
            TaskError::Analysis(AnalysisError::Data(DataError::Features(fault))) => {
                let file = self.features.as_deref().unwrap_or(Path::new("")).display();
                CommandError::Input(format!("{file}: {fault}"))
            }
            error => CommandError::Input(format!("{origin}: {error}")),
        }
    }
}

fn read_features(path: &Path) -> Result<GivenFeatures, CommandError> {
    let complain =
        |e: &dyn std::fmt::Display| CommandError::Input(format!("{}: {e}", table_file::name(path)));
    let file = table_file::open(path).map_err(|e| complain(&format!("cannot read: {e}")))?;
    let (features, dialect) = features_csv::read(file).map_err(|e| complain(&e))?;
    table_file::tell(path, dialect);
    Ok(features)
}
