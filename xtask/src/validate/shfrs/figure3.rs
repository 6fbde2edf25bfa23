//! The paper's Figure 3, rebuilt with the commands that anyone can call: `sidestep bounds` for
//! the bounds, `sidestep reach` for the areas, `sidestep plot` for the picture.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::validate::{folder, read, write};
use crate::workspace::{Workspace, output_of, stage};

/// Inputs of the panels, beside the page.
const FOLDER: &str = "figure3";
/// The picture, beside the page.
pub(super) const PICTURE: &str = "figure3.svg";

/// The panels in their order, and what the reference found for them: areas of the five tubes,
/// m².
const PANELS: [(&str, [f64; 5]); 3] = [
    ("left", [1.66, 2.50, 3.05, 3.88, 5.33]),
    ("middle", [2.78, 3.33, 3.61, 4.15, 5.33]),
    ("right", [1.12, 2.10, 2.77, 3.76, 5.33]),
];

/// One panel.
pub(super) struct Panel {
    pub(super) name: &'static str,
    pub(super) epsilon: Vec<f64>,
    pub(super) k: Vec<usize>,
    /// Bounds before widening, rad/s, of each step.
    pub(super) raw: Vec<(f64, f64)>,
    /// Areas of the tubes, m²: found, and of the reference.
    pub(super) areas: Vec<f64>,
    pub(super) reference: [f64; 5],
}

#[derive(Deserialize)]
struct Input {
    human: Value,
    epsilon: Vec<f64>,
    k: Vec<usize>,
    speed: f64,
    dt: f64,
    turn_rate: (f64, f64),
}

#[derive(Deserialize)]
struct Bounds {
    lo: Vec<Vec<f64>>,
    hi: Vec<Vec<f64>>,
    raw: Vec<(f64, f64)>,
}

#[derive(Deserialize)]
struct Reach {
    sets: Vec<Set>,
}

#[derive(Deserialize)]
struct Set {
    tube: Tube,
}

#[derive(Deserialize)]
struct Tube {
    area: f64,
}

/// Builds the program, has it compute the panels, and draws them.
///
/// # Errors
/// When it cannot be built, refuses an input, or a file cannot be read or written.
pub(super) fn panels(workspace: &Workspace) -> Result<Vec<Panel>> {
    stage("server", workspace.compile("build").args(["--bin", "sidestep"]))?;
    eprintln!("==> Figure 3");
    let folder = folder(workspace);
    let inputs = folder.join(FOLDER);
    let panels = PANELS.map(|(name, reference)| panel(workspace, &inputs, name, reference));
    let mut draw = Command::new(workspace.server());
    draw.args(["plot", "--kind", "regions"]);
    for (name, _) in PANELS {
        draw.arg("--input").arg(inputs.join(name).with_extension("json"));
    }
    output_of("sidestep plot", draw.arg("--out").arg(folder.join(PICTURE)))?;
    panels.into_iter().collect()
}

fn panel(
    workspace: &Workspace,
    inputs: &Path,
    name: &'static str,
    reference: [f64; 5],
) -> Result<Panel> {
    let path = inputs.join(name).with_extension("json");
    let input: Input =
        serde_json::from_str(&read(&path)?).with_context(|| path.display().to_string())?;
    let Bounds { lo, hi, raw } = answer(workspace, "bounds", &path)?;
    let sets: Vec<Value> =
        lo.iter().zip(&hi).map(|(lo, hi)| json!({ "lo": lo, "hi": hi })).collect();
    let question = json!({
        "speed": input.speed,
        "dt": input.dt,
        "turn_rate": input.turn_rate,
        "initial": input.human,
        "sets": sets,
    });
    let asked = workspace.example(&format!("figure3-{name}")).with_extension("json");
    write(&asked, &question.to_string())?;
    let Reach { sets } = answer(workspace, "reach", &asked)?;
    fs::remove_file(&asked).with_context(|| asked.display().to_string())?;
    let areas = sets.iter().map(|set| set.tube.area).collect();
    Ok(Panel { name, epsilon: input.epsilon, k: input.k, raw, areas, reference })
}

/// What a command of the program answers to a file.
fn answer<R: DeserializeOwned>(workspace: &Workspace, command: &str, input: &Path) -> Result<R> {
    let what = format!("sidestep {command}");
    let text =
        output_of(&what, Command::new(workspace.server()).arg(command).arg("--input").arg(input))?;
    serde_json::from_str(&text).with_context(|| format!("{what} printed something else"))
}
