//! Checks finite horizons in polar coordinates against the closed form where it holds, against finer grids,
//! and against solutions on rectangular grids.

use core::ops::ControlFlow;
use std::error::Error;

use serde::Serialize;
use serde_json::{Value, json};
use sidestep::reachability::{
    Accuracy, CartesianGrid, Nodes, Options, PursuitGame, SampledValue, Solved, polar,
};
use sidestep::vehicle::VehicleModel;

use crate::errors::{Errors, numbers, random_states};
use crate::polar::{ACCURACIES, STATES, counts};
use crate::unequal::{CARTESIAN, GAME, HORIZON_S};
use crate::{MITCHELL, solved};

/// A game in which the pursuer is faster but turns more slowly. Its value has not converged at
/// [`HORIZON_S`].
const FASTER: PursuitGame = PursuitGame {
    evader: VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.7 },
    pursuer: VehicleModel { speed_mps: 2.4, turn_rate_radps: 0.4 },
    radius_m: 2.5,
};
/// If the value of a state in the game of unequal vehicles differs from the reference by more than
/// this (m), the state is checked again.
const APART_M: f64 = 0.04;

/// Errors for one game at one accuracy.
#[derive(Serialize)]
struct Check {
    game: &'static str,
    accuracy: &'static str,
    nodes: [usize; 2],
    range_m: f64,
    steps: usize,
    errors: Errors,
}

/// Numbers of nodes in range and angle: of the reference solution for [`FASTER`], and of a coarser
/// solution that estimates the reference's error.
const REFERENCE: [[usize; 2]; 2] = [[257, 704], [193, 528]];
/// Number of states in the reference.
const REFERENCE_STATES: usize = 2000;

/// Prints the reference for [`FASTER`]: states near {V = 0}, V on the finest grid, and its
/// difference from V on a coarser grid (m).
pub(crate) fn reference() -> Result<(), Box<dyn Error>> {
    let fine = Options::default().with_horizon(HORIZON_S).with_accuracy(Accuracy::Fine);
    let Nodes::Polar { range_m, .. } = solved(FASTER, &fine)?.samples.nodes() else {
        unreachable!("the polar solver leaves polar nodes");
    };
    let on = |[range_nodes, angle_nodes]: [usize; 2]| {
        let settings = polar::Settings::default().with_horizon(HORIZON_S).with_range(range_m);
        let settings = settings.with_range_nodes(range_nodes).with_angle_nodes(angle_nodes);
        let solution = polar::solve::<f32>(&FASTER, &settings, &mut |_| ControlFlow::Continue(()))?;
        Ok::<_, Box<dyn Error>>(SampledValue::from_polar(FASTER, &solution)?)
    };
    let [coarser, finest] = [on(REFERENCE[1])?, on(REFERENCE[0])?];
    println!("x,y,psi,value,error_estimate");
    let states = random_states(3, STATES, 25.0);
    let known = states.into_iter().map(|state| (state, finest.state(state).value));
    let near = known.filter(|(state, value)| counts(&FASTER, *state, *value));
    for (state, value) in near.take(REFERENCE_STATES) {
        let [x, y, psi] = state;
        let off = (coarser.state(state).value - value).abs();
        println!("{x:.9},{y:.9},{psi:.9},{value:.6},{off:.6}");
    }
    Ok(())
}

/// Measures finite horizons.
pub(crate) fn check() -> Result<Value, Box<dyn Error>> {
    // The horizon is long enough for the value to converge.
    let horizon_s = 3.2;
    let exact = MITCHELL.exact()?;
    let states = random_states(3, STATES, 25.0).into_iter();
    let values: States = states
        .map(|state| (state, exact.value(state)))
        .filter(|(state, value)| counts(&MITCHELL, *state, *value))
        .collect();
    let mut checks = compared("mitchell", &solutions(MITCHELL, horizon_s)?, &values);
    let reference = numbers(include_str!("../../tests/data/states_faster.csv"))?;
    let known: States = reference.iter().map(|row| ([row[0], row[1], row[2]], row[3])).collect();
    checks.extend(compared("faster", &solutions(FASTER, HORIZON_S)?, &known));
    Ok(json!({
        "mitchell_s": horizon_s,
        "faster": FASTER,
        "faster_s": HORIZON_S,
        "reference": REFERENCE,
        "reference_errors": Errors::of(reference.iter().map(|row| row[4]).collect()),
        "checks": checks,
        "apart": apart()?,
    }))
}

fn solutions(game: PursuitGame, horizon_s: f64) -> Result<Vec<Solved>, Box<dyn Error>> {
    let of = |accuracy| Options::default().with_horizon(horizon_s).with_accuracy(accuracy);
    ACCURACIES.iter().map(|(_, accuracy)| solved(game, &of(*accuracy))).collect()
}

/// States and their values.
type States = Vec<([f64; 3], f64)>;

fn compared(game: &'static str, solutions: &[Solved], known: &States) -> Vec<Check> {
    let of = |((accuracy, _), solved): ((&'static str, Accuracy), &Solved)| {
        let Nodes::Polar { range_m, range_nodes, angle_nodes, .. } = solved.samples.nodes() else {
            unreachable!("the polar solver leaves polar nodes");
        };
        let errors =
            known.iter().map(|(state, value)| (solved.function.value(*state) - value).abs());
        Check {
            game,
            accuracy,
            nodes: [range_nodes, angle_nodes],
            range_m,
            steps: solved.steps,
            errors: Errors::of(errors.collect()),
        }
    };
    ACCURACIES.into_iter().zip(solutions).map(of).collect()
}

/// Solves the game of unequal vehicles on two rectangular grids and on a fine polar grid. Compares
/// the solutions at the states of the independent reference solution.
fn apart() -> Result<Value, Box<dyn Error>> {
    let options = Options::default().with_horizon(HORIZON_S);
    let polar = solved(GAME, &options.with_accuracy(Accuracy::Fine))?;
    let grid = |nodes: [usize; 3]| CartesianGrid::new(nodes, [-20.0, 20.0, -20.0, 20.0]);
    let coarse = solved(GAME, &options.with_grid(grid(CARTESIAN)))?;
    let twice = CARTESIAN.map(|nodes| 2 * nodes);
    let finer = solved(GAME, &options.with_grid(grid(twice)))?;
    let (mut differences, mut within) = (Vec::new(), 0);
    // Differences of both rectangular grids from the polar solution, at the states that are checked
    // again.
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
