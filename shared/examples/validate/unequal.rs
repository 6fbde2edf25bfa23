//! Games of unequal vehicles. They have no known closed form, so solutions are compared with each
//! other.

use std::error::Error;

use serde_json::{Value, json};
use sidestep::reachability::{Accuracy, CartesianGrid, Options, PursuitGame};
use sidestep::vehicle::VehicleModel;

use crate::errors::{Errors, numbers, random_states};
use crate::polar::{STATES, by_polar};
use crate::solved;

pub(crate) const GAME: PursuitGame = PursuitGame {
    evader: VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 },
    pursuer: VehicleModel { speed_mps: 1.5, turn_rate_radps: 0.8 },
    radius_m: 3.0,
};

/// The finite horizon (s).
pub(crate) const HORIZON_S: f64 = 6.0;
/// Numbers of nodes of the rectangular grid.
pub(crate) const CARTESIAN: [usize; 3] = [81, 81, 60];

/// Measures both solvers on the game of unequal vehicles.
pub(crate) fn check() -> Result<Value, Box<dyn Error>> {
    let grid = CartesianGrid::new(CARTESIAN, [-20.0, 20.0, -20.0, 20.0]);
    let finite = solved(GAME, &Options::default().with_horizon(HORIZON_S).with_grid(grid))?;
    let standard = by_polar(GAME, Accuracy::Standard)?;
    let fine = by_polar(GAME, Accuracy::Fine)?;

    let rows = numbers(include_str!("../../tests/data/states_unequal.csv"))?;
    let (mut differences, mut within, mut above_finite) = (Vec::new(), 0, 0.0_f64);
    for row in &rows {
        let state = [row[0], row[1], row[2]];
        let difference = (finite.function.value(state) - row[3]).abs();
        within += usize::from(difference <= row[4]);
        differences.push(difference);
        above_finite = above_finite.max(fine.function.value(state) - row[3] - row[4]);
    }
    let near = random_states(2, STATES, 20.0).into_iter().filter_map(|state| {
        let value = fine.function.value(state);
        (value.abs() < 0.5).then(|| (standard.function.value(state) - value).abs())
    });
    Ok(json!({
        "parameters": GAME,
        "horizon_s": HORIZON_S,
        "nodes": CARTESIAN,
        // Number of reference states, and number of states whose difference is within the
        // reference's own error estimate.
        "states": rows.len(),
        "within": within,
        "differences": Errors::of(differences),
        // |standard − fine| of the polar solver at random states where the fine solution has |V| <
        // 0.5 m.
        "standard_and_fine": Errors::of(near.collect()),
        // Maximum excess of the converged (fine) value over the finite-horizon value, beyond the
        // reference's error estimate. Only errors can make it positive.
        "above_finite": above_finite,
    }))
}
