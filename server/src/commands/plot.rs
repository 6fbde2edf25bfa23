//! `sidestep plot`.

mod replay;

use self::replay::ReplayArgs;
use super::game::FunctionArgs;
use super::json_file::Document;
use super::prediction::{Prediction, PredictorArgs, named};
use super::reach::MOST_STEPS;
use super::solving::Interrupt;
use super::{CommandError, print_json, unwritable};
use crate::figure::{self, RegionsPanel};
use crate::formats::atomic_file;
use sidestep::chart::{Drawing, lowered, number};
use sidestep::invalid::Invalid;
use std::path::{Path, PathBuf};

/// Draw level sets of the value function, predicted regions, or a moment of a trial, as SVG or PNG.
#[derive(Clone, Debug, clap::Args)]
pub struct PlotArgs {
    #[command(flatten)]
    function: FunctionArgs,
    /// File to write. Its extension (.svg or .png) selects the format.
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    out: PathBuf,
    /// The figure to draw.
    #[arg(long, value_enum, default_value = "slices")]
    kind: Kind,
    /// Slices: relative headings (degrees).
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(default_value = "0,45,90,135,180")]
    psi: Vec<f64>,
    /// Slices: levels of V (m), in ascending order.
    #[arg(long, value_name = "M,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(default_value = "0,1,2")]
    levels: Vec<f64>,
    /// Regions: a document for `sidestep bounds`. Repeat the flag for more panels.
    #[arg(long, value_name = "FILE.json")]
    input: Vec<PathBuf>,
    #[command(flatten)]
    predictor: PredictorArgs,
    #[command(flatten)]
    replay: ReplayArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Curves of equal V in the evader's frame, one panel for each relative heading.
    Slices,
    /// The surface V = 0 over the plane, with the relative heading upwards.
    Tube,
    /// The predicted positions of the human: the sets of `sidestep bounds` in the paper's colours.
    /// The upper row shows all positions within the steps ahead, and the lower row the positions at
    /// single steps.
    Regions,
    /// A moment of a recorded trial from above, as in the laboratory's replay: level sets,
    /// predicted sets, likely futures, paths.
    Replay,
}

/// Upper bounds on the number of panels and of levels.
const PANELS: usize = 36;
const LEVELS: usize = 20;

/// Draws the figure and writes the file.
///
/// # Errors
/// [`CommandError`] for invalid flags or files (input), or if the figure cannot be written (failure).
pub async fn run(args: PlotArgs) -> Result<(), CommandError> {
    let as_png = is_png(&args.out)?;
    check(&args)?;
    atomic_file::check(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let interrupt = Interrupt::listen();
    let drawing = match args.kind {
        Kind::Regions => regions(&args.input, &args.predictor).await?,
        Kind::Replay => {
            let predictor = args.predictor.read([])?;
            replay::replay(&args.replay, args.function.game(), predictor, &interrupt).await?
        }
        Kind::Slices | Kind::Tube => level_sets(&args, &interrupt).await?,
    };
    let bytes = if as_png {
        figure::png(&drawing).map_err(CommandError::failure)?
    } else {
        drawing.svg().into_bytes()
    };
    atomic_file::write(&args.out, &interrupt.token, |out| out.write_all(&bytes))
        .map_err(|e| interrupt.check().err().unwrap_or_else(|| unwritable(&args.out, &e)))?;
    print_json(&serde_json::json!({ "file": args.out, "bytes": bytes.len() }))
}

async fn level_sets(args: &PlotArgs, interrupt: &Interrupt) -> Result<Drawing, CommandError> {
    let function = args.function.function(interrupt).await?;
    let radius_m = function.game().radius_m;
    if let Some(low) = args.levels.iter().find(|level| **level <= -radius_m) {
        let message =
            format!("--levels: expected numbers above -{radius_m} (minus the radius), found {low}");
        return Err(CommandError::Input(message));
    }
    Ok(match args.kind {
        Kind::Tube => figure::tube(&function),
        _ => figure::slices(&function, &args.psi, &args.levels),
    })
}

async fn regions(files: &[PathBuf], predictor: &PredictorArgs) -> Result<Drawing, CommandError> {
    let given = predictor.read(files.iter().map(|file| Document(file)))?;
    let mut panels = Vec::new();
    let mut epsilons: Vec<Vec<f64>> = Vec::new();
    let mut first: Option<(usize, f64, usize)> = None;
    for file in files {
        let document = Document(file);
        let Prediction { now, motion, danger_radius_m, epsilon, bounds } =
            Prediction::of(document, given.as_ref()).await?;
        if bounds.raw.len() > MOST_STEPS {
            let expected = format!("at most {MOST_STEPS} steps in a picture");
            let invalid = Invalid::new("k", expected, bounds.raw.len());
            return Err(document.complain(&invalid));
        }
        let alike = (bounds.raw.len(), motion.step_s, bounds.sets.len());
        let first = *first.get_or_insert(alike);
        if first != alike {
            let words = |(steps, dt, sets)| format!("{steps} steps of {dt} s and {sets} sets");
            let expected = format!("{}, as in the first --input", words(first));
            return Err(document.complain(&Invalid::new("", expected, words(alike))));
        }
        let title = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let values: Vec<String> = epsilon.iter().map(|value| number(*value)).collect();
        let settings =
            format!("ε of F₁ to F{}: {} rad/s", lowered(values.len()), values.join(", "));
        let words = [title, settings];
        let panel = RegionsPanel::new(words, now, &bounds.sets, &motion, danger_radius_m);
        panels.push(panel.map_err(|invalid| document.complain(&named(invalid)))?);
        epsilons.push(epsilon);
    }
    let Some((_, _, sets)) = first else {
        let message =
            "--input: expected a document of `sidestep bounds` for each panel, found none";
        return Err(CommandError::Input(message.to_owned()));
    };
    let names: Vec<String> = (0..sets).map(|j| region_name(j, &epsilons)).collect();
    let note = "Region j: positions that set j adds to set j − 1; circle, if in sight: the robot’s \
                danger zone";
    Ok(figure::regions("Where the human may be", note, &panels, &names))
}

/// A region's name, such as "F₂: ε = 0.15 rad/s". If panels differ in ε, each panel shows its own ε
/// and the name is only "F₂".
fn region_name(j: usize, epsilons: &[Vec<f64>]) -> String {
    match epsilons {
        [first, others @ ..] if others.iter().all(|other| other == first) => {
            format!("F{}: ε = {} rad/s", lowered(j + 1), number(first[j]))
        }
        _ => format!("F{}", lowered(j + 1)),
    }
}

fn is_png(out: &Path) -> Result<bool, CommandError> {
    let ending = out.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "svg" => Ok(false),
        "png" => Ok(true),
        _ => {
            let found = out.display();
            let message =
                format!("--out: expected a name that ends in .svg or .png, found {found}");
            Err(CommandError::Input(message))
        }
    }
}

fn check(args: &PlotArgs) -> Result<(), CommandError> {
    if args.kind != Kind::Regions && !args.input.is_empty() {
        let message = "--input: expected only with --kind regions";
        return Err(CommandError::Input(message.to_owned()));
    }
    let predicts = matches!(args.kind, Kind::Regions | Kind::Replay);
    if !predicts && args.predictor.is_given() {
        let message = "--predictor: expected only with --kind regions or replay";
        return Err(CommandError::Input(message.to_owned()));
    }
    if args.kind != Kind::Replay && args.replay.is_given() {
        let message = "--trials, --database and --trial: expected only with --kind replay";
        return Err(CommandError::Input(message.to_owned()));
    }
    let refuse = |flag: &str, expected: &str, found: &dyn std::fmt::Display| {
        Err(CommandError::Input(format!("--{flag}: expected {expected}, found {found}")))
    };
    for (flag, numbers) in [("psi", &args.psi), ("levels", &args.levels)] {
        if let Some(bad) = numbers.iter().find(|number| !number.is_finite()) {
            return refuse(flag, "finite numbers", bad);
        }
    }
    if args.psi.len() > PANELS {
        return refuse("psi", &format!("at most {PANELS} headings"), &args.psi.len());
    }
    if args.levels.len() > LEVELS {
        return refuse("levels", &format!("at most {LEVELS} levels"), &args.levels.len());
    }
    match args.levels.windows(2).find(|pair| pair[0] >= pair[1]) {
        Some(pair) => {
            let found = format!("{} before {}", pair[0], pair[1]);
            refuse("levels", "levels from the lowest up", &found)
        }
        None => Ok(()),
    }
}
