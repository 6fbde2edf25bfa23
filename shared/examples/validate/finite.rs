//! Finite horizons in polar coordinates: against the closed form where it holds, finer grids, and solutions
//! on rectangular grids.

use std::error::Error;

use serde::Serialize;
use serde_json::{Value, json};
use sidestep::reachability::{Accuracy, CartesianGrid, Nodes, Options, PursuitGame, Solved};
use sidestep::vehicle::VehicleModel;

use crate::errors::{Errors, numbers, random_states};
use crate::polar::{ACCURACIES, STATES, counts};
use crate::unequal::{CARTESIAN, GAME, HORIZON_S};
use crate::{MITCHELL, solved};

/// A faster pursuer that turns worse. Its value for [`HORIZON_S`] is not yet the converged one.
const FASTER: PursuitGame = PursuitGame {
    evader: VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.7 },
    pursuer: VehicleModel { speed_mps: 2.4, turn_rate_radps: 0.4 },
    radius_m: 2.5,
};
/// Where the reference of the unequal pair differs by more than this, it is looked at again, m.
const APART_M: f64 = 0.04;

/// One accuracy of one game.
#[derive(Serialize)]
struct Check {
    game: &'static str,
    accuracy: &'static str,
    nodes: [usize; 2],
    range_m: f64,
    steps: usize,
    errors: Errors,
}

/// Measures finite horizons.
pub(crate) fn check() -> Result<Value, Box<dyn Error>> {
    // So long that the value is the converged one.
    let horizon_s = 3.2;
    let known = solutions(MITCHELL, horizon_s)?;
    let exact = MITCHELL.exact()?;
    let mut checks = against(MITCHELL, "mitchell", &known, |state| exact.value(state));
    let faster = solutions(FASTER, HORIZON_S)?;
    let [coarser @ .., fine] = &faster[..] else { unreachable!("three accuracies") };
    checks.extend(against(FASTER, "faster", coarser, |state| fine.function.value(state)));
    Ok(json!({
        "mitchell_s": horizon_s,
        "faster": FASTER,
        "faster_s": HORIZON_S,
        "checks": checks,
        "apart": apart()?,
    }))
}

fn solutions(game: PursuitGame, horizon_s: f64) -> Result<Vec<Solved>, Box<dyn Error>> {
    let of = |accuracy| Options::default().with_horizon(horizon_s).with_accuracy(accuracy);
    ACCURACIES.iter().map(|(_, accuracy)| solved(game, &of(*accuracy))).collect()
}

fn against(
    game: PursuitGame,
    name: &'static str,
    solutions: &[Solved],
    truth: impl Fn([f64; 3]) -> f64,
) -> Vec<Check> {
    let states = random_states(3, STATES, 25.0);
    let known: Vec<([f64; 3], f64)> = states
        .into_iter()
        .map(|state| (state, truth(state)))
        .filter(|(state, value)| counts(&game, *state, *value))
        .collect();
    let of = |((accuracy, _), solved): ((&'static str, Accuracy), &Solved)| {
        let Nodes::Polar { range_m, range_nodes, angle_nodes, .. } = solved.samples.nodes() else {
            unreachable!("the polar solver leaves polar nodes");
        };
        let errors =
            known.iter().map(|(state, value)| (solved.function.value(*state) - value).abs());
        Check {
            game: name,
            accuracy,
            nodes: [range_nodes, angle_nodes],
            range_m,
            steps: solved.steps,
            errors: Errors::of(errors.collect()),
        }
    };
    ACCURACIES.into_iter().zip(solutions).map(of).collect()
}

/// The unequal pair on two rectangular grids and a fine polar one, at the states of the independent solution.
fn apart() -> Result<Value, Box<dyn Error>> {
    let options = Options::default().with_horizon(HORIZON_S);
    let polar = solved(GAME, &options.with_accuracy(Accuracy::Fine))?;
    let grid = |nodes: [usize; 3]| CartesianGrid::new(nodes, [-20.0, 20.0, -20.0, 20.0]);
    let coarse = solved(GAME, &options.with_grid(grid(CARTESIAN)))?;
    let twice = CARTESIAN.map(|nodes| 2 * nodes);
    let finer = solved(GAME, &options.with_grid(grid(twice)))?;
    let (mut differences, mut within) = (Vec::new(), 0);
    // At states that are apart: the differences of both grids from the polar one.
    let mut apart: Vec<[f64; 2]> = Vec::new();
    for row in numbers(include_str!("../../tests/data/states_unequal.csv"))? {
        let state = [row[0], row[1], row[2]];
        let found = polar.function.state(state);
        if found.inside {
            let difference = (found.value - row[3]).abs();
            within += usize::from(difference <= row[4]);
            differences.push(difference);
            if difference > APART_M {
                let off = |grid: &Solved| (grid.function.value(state) - found.value).abs();
                apart.push([off(&coarse), off(&finer)]);
            }
        }
    }
    let mean =
        |which: usize| apart.iter().map(|off| off[which]).sum::<f64>() / apart.len().max(1) as f64;
    Ok(json!({
        "states": differences.len(),
        "within": within,
        "differences": Errors::of(differences),
        "apart_m": APART_M,
        "apart": apart.len(),
        "nearer": apart.iter().filter(|[coarse, finer]| finer < coarse).count(),
        "coarse_m": mean(0),
        "finer_m": mean(1),
        "finer": twice,
    }))
}
