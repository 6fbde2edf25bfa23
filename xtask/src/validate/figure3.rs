//! The paper's Figure 3, reproduced with public commands: `sidestep bounds` computes the bounds,
//! `sidestep reach` computes the areas and `sidestep plot` draws the picture.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::{answer, read, write};
use crate::workspace::{Workspace, output_of, stage};

/// The panels in order. Each has the areas (m²) of its five tubes in the reference.
const PANELS: [(&str, [f64; 5]); 3] = [
    ("left", [1.66, 2.50, 3.05, 3.88, 5.33]),
    ("middle", [2.78, 3.33, 3.61, 4.15, 5.33]),
    ("right", [1.12, 2.10, 2.77, 3.76, 5.33]),
];

/// Builds the program and uses it to compute and draw the panels.
///
/// # Errors
/// When the program cannot be built or rejects an input, or a file cannot be read or written.
pub(super) fn panels(workspace: &Workspace, docs: &Path) -> Result<Value> {
    stage("server", workspace.compile("build").args(["--bin", "sidestep"]))?;
    eprintln!("==> Figure 3");
    let input = |name: &str| docs.join("figure3").join(name).with_extension("json");
    let mut draw = Command::new(workspace.server());
    draw.args(["plot", "--kind", "regions"]);
    for (name, _) in PANELS {
        draw.arg("--input").arg(input(name));
    }
    output_of("sidestep plot", draw.arg("--out").arg(docs.join("figure3.svg")))?;
    let panels = PANELS.map(|(name, reference)| panel(workspace, &input(name), name, reference));
    panels.into_iter().collect()
}

fn panel(workspace: &Workspace, path: &Path, name: &str, reference: [f64; 5]) -> Result<Value> {
    let call = |command: &str, input: &Path| {
        let mut program = Command::new(workspace.server());
        answer(&format!("sidestep {command}"), program.arg(command).arg("--input").arg(input))
    };
    let input: Value =
        serde_json::from_str(&read(path)?).with_context(|| path.display().to_string())?;
    let bounds = call("bounds", path)?;
    let sides = ["lo", "hi"].map(|side| bounds[side].as_array().into_iter().flatten());
    let [lo, hi] = sides;
    let sets: Vec<Value> = lo.zip(hi).map(|(lo, hi)| json!({ "lo": lo, "hi": hi })).collect();
    let question = json!({
        "speed": input["speed"],
        "dt": input["dt"],
        "turn_rate": input["turn_rate"],
        "initial": input["human"],
        "sets": sets,
    });
    let asked = workspace.example(&format!("figure3-{name}")).with_extension("json");
    write(&asked, &question.to_string())?;
    let reached = call("reach", &asked)?;
    fs::remove_file(&asked).with_context(|| asked.display().to_string())?;
    let area = |set: &Value| set["tube"]["area"].as_f64().context("sidestep reach: no area");
    let areas: Vec<f64> =
        reached["sets"].as_array().into_iter().flatten().map(area).collect::<Result<_>>()?;
    let apart = areas.iter().zip(reference).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    Ok(json!({
        "name": name,
        "epsilon": input["epsilon"],
        "k": input["k"],
        "raw": counted(bounds["raw"].as_array().context("sidestep bounds: no raw bounds")?),
        "areas": areas,
        "reference": reference,
        "apart": apart,
    }))
}

/// Run-length encodes the bounds of the steps. Returns pairs (number of steps, bounds).
fn counted(bounds: &[Value]) -> Vec<(usize, &Value)> {
    bounds.chunk_by(|a, b| a == b).map(|run| (run.len(), &run[0])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_bounds_are_counted() {
        let bounds = [json!([-0.5, 0.0]), json!([-0.5, 0.0]), json!([-0.5, -0.5])];
        assert_eq!(counted(&bounds), [(2, &bounds[0]), (1, &bounds[2])]);
    }
}
