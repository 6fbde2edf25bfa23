//! `sidestep plot`.

use super::game::FunctionArgs;
use super::solving::Interrupt;
use super::{CommandError, print_json, unwritable};
use crate::{figure, whole_file};
use std::path::{Path, PathBuf};

/// Draw level sets of the value function.
#[derive(Clone, Debug, clap::Args)]
pub struct PlotArgs {
    #[command(flatten)]
    function: FunctionArgs,
    /// File to write; its ending says which format: .svg or .png.
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    out: PathBuf,
    /// What is drawn.
    #[arg(long, value_enum, default_value = "slices")]
    kind: Kind,
    /// Slices: relative headings, degrees.
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(default_values_t = [0.0, 45.0, 90.0, 135.0, 180.0])]
    psi: Vec<f64>,
    /// Slices: levels of V, m, from the lowest up.
    #[arg(long, value_name = "M,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(default_values_t = [0.0, 1.0, 2.0])]
    levels: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Curves of equal V in the evader's frame, one panel a relative heading.
    Slices,
    /// The surface V = 0 over the plane, relative heading upwards.
    Tube,
}

/// Most panels, and most levels.
const PANELS: usize = 36;
const LEVELS: usize = 20;

/// Draws and writes the file.
///
/// # Errors
/// [`CommandError`] for flags or a file that cannot be (input), or a figure that
/// cannot be written (failure).
pub async fn run(args: PlotArgs) -> Result<(), CommandError> {
    let as_png = is_png(&args.out)?;
    check(&args)?;
    whole_file::check(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let interrupt = Interrupt::listen();
    let function = args.function.function(&interrupt).await?;
    let radius_m = function.game().radius_m;
    if let Some(low) = args.levels.iter().find(|level| **level <= -radius_m) {
        let message =
            format!("--levels: expected numbers above -{radius_m} (minus the radius), found {low}");
        return Err(CommandError::Input(message));
    }
    let svg = match args.kind {
        Kind::Slices => figure::slices(&function, &args.psi, &args.levels),
        Kind::Tube => figure::tube(&function),
    };
    let svg = svg.map_err(CommandError::failure)?;
    let octets =
        if as_png { figure::png(&svg).map_err(CommandError::failure)? } else { svg.into_bytes() };
    whole_file::write(&args.out, &interrupt.stop, |out| out.write_all(&octets))
        .map_err(|e| interrupt.check().err().unwrap_or_else(|| unwritable(&args.out, &e)))?;
    print_json(&serde_json::json!({ "file": args.out, "octets": octets.len() }))
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
