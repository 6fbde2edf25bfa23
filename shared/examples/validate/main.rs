//! Measures the accuracy of this library's value functions, and prints numbers and pictures as one
//! JSON object. From this object `cargo xtask validate` makes `docs/validation/reachability.md`.
//!
//! With the argument `reference`, it prints `shared/tests/data/states_faster.csv` instead. This
//! takes an hour.
//!
//! The output is reproducible, because nothing is timed and random states come from fixed seeds.
//! Lengths without a unit are in metres.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

#[path = "../measure/mod.rs"]
mod measure;
mod errors;
mod closed_form;
mod polar;
mod cartesian;
mod unequal;
mod finite;
mod pictures;
mod figures;

use std::error::Error;
use std::ops::ControlFlow;

use serde_json::json;
use sidestep::reachability::{Options, PursuitGame, Solved, solve};
use sidestep::vehicle::VehicleModel;

use measure::MITCHELL;

/// The game of the study: v = 2 m/s and ω = 0.5 rad/s for both vehicles, R = 3 m.
const PAPER: PursuitGame = {
    let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 }
};

/// A game of identical vehicles, which has a closed form, and its reference data.
struct Known {
    name: &'static str,
    game: PursuitGame,
    /// The reference's volume of {V ≤ 0} (m²·rad).
    volume: f64,
    /// CSV of points on the reference's barrier. `states` is a CSV of states and the reference's
    /// values.
    barrier: &'static str,
    states: &'static str,
}

const KNOWN: [Known; 2] = [
    Known {
        name: "paper",
        game: PAPER,
        volume: 358.14141,
        barrier: include_str!("../../tests/data/barrier_paper.csv"),
        states: include_str!("../../tests/data/states_paper.csv"),
    },
    Known {
        name: "mitchell",
        game: MITCHELL,
        volume: measure::VOLUME,
        barrier: include_str!("../../tests/data/barrier_mitchell.csv"),
        states: include_str!("../../tests/data/states_mitchell.csv"),
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    if std::env::args().any(|argument| argument == "reference") {
        return finite::reference();
    }
    let step = |name: &str| eprintln!("    {name}");
    step("closed form");
    let closed_form = KNOWN.iter().map(closed_form::check).collect::<Result<Vec<_>, _>>()?;
    step("polar solver");
    let [paper, mitchell] = [polar::solutions(PAPER)?, polar::solutions(MITCHELL)?];
    let polar = [polar::check(&KNOWN[0], &paper)?, polar::check(&KNOWN[1], &mitchell)?].concat();
    let chase = polar::chase(&paper[polar::STANDARD])?;
    step("Cartesian solver");
    let cartesian = cartesian::check()?;
    step("unequal vehicles");
    let unequal = unequal::check()?;
    step("finite horizons");
    let finite = finite::check()?;
    step("pictures");
    let traced = pictures::traced(&mitchell[polar::STANDARD])?;
    let slices = pictures::slices(&mitchell[polar::STANDARD])?;
    let map = pictures::error_map(&paper[polar::STANDARD])?;
    let report = json!({
        "closed_form": closed_form,
        "polar": polar,
        "chase": chase,
        "cartesian": cartesian,
        "unequal": unequal,
        "finite": finite,
        "traced": traced,
        "slices_deg": slices.iter().map(|slice| slice.psi_deg).collect::<Vec<_>>(),
        "error_map": map,
        "figures": {
            "slices.svg": figures::sliced(&slices).svg(),
            "polar-errors.svg": figures::exceedance(&polar).svg(),
            "error-map.svg": figures::error_map(&map).svg(),
            "convergence.svg": figures::convergence(&cartesian).svg(),
        },
    });
    println!("{report}");
    Ok(())
}

/// Solves `game` with `options`.
fn solved(game: PursuitGame, options: &Options) -> Result<Solved, Box<dyn Error>> {
    Ok(solve(game, options, &mut |_| ControlFlow::Continue(()))?)
}
