//! What the value functions of this library are worth, measured; one JSON object.
//! `cargo xtask validate` makes `docs/validation/reachability.md` of it.
//!
//! Nothing here is timed, and random states come from fixed seeds, so that the answer is
//! the same every time.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

mod cartesian;
mod closed_form;
mod errors;
mod figures;
#[path = "../measure/mod.rs"]
mod measure;
mod pictures;
mod polar;
mod unequal;

use std::collections::BTreeMap;
use std::error::Error;
use std::ops::ControlFlow;

use serde::Serialize;
use sidestep::reachability::{Options, PursuitGame, Solved, solve};
use sidestep::vehicle::VehicleModel;

use measure::MITCHELL;

/// The game of the study: v = 2 m/s, ω = 0.5 rad/s, R = 3 m, both.
const PAPER: PursuitGame = {
    let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 }
};

/// Everything that the page says.
#[derive(Serialize)]
struct Report {
    closed_form: Vec<closed_form::Check>,
    polar: Vec<polar::Check>,
    chase: polar::Chase,
    cartesian: cartesian::Check,
    unequal: unequal::Check,
    traced: errors::Errors,
    /// Relative headings of the slices that are drawn, degrees.
    slices_deg: Vec<f64>,
    error_map: pictures::ErrorMap,
    /// SVG by the file's name.
    figures: BTreeMap<&'static str, String>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let [paper, mitchell] = [("paper", PAPER), ("mitchell", MITCHELL)];
    let step = |name: &str| eprintln!("    {name}");
    step("closed form");
    let closed_form = vec![closed_form::check(paper)?, closed_form::check(mitchell)?];
    step("polar solver");
    let polar = [polar::check(paper)?, polar::check(mitchell)?].concat();
    let chase = polar::chase()?;
    step("Cartesian solver");
    let cartesian = cartesian::check()?;
    step("unequal vehicles");
    let unequal = unequal::check()?;
    step("pictures");
    let (traced, slices) = (pictures::traced()?, pictures::slices()?);
    let error_map = pictures::error_map()?;
    let figures = figures::all(&slices, &polar, &error_map, &cartesian);
    let slices_deg = slices.iter().map(|slice| slice.psi_deg).collect();
    let report = Report {
        closed_form,
        polar,
        chase,
        cartesian,
        unequal,
        traced,
        slices_deg,
        error_map,
        figures,
    };
    println!("{}", serde_json::to_string(&report)?);
    Ok(())
}

/// The solution of `game` as `options` ask for it.
fn solved(game: PursuitGame, options: &Options) -> Result<Solved, Box<dyn Error>> {
    Ok(solve(game, options, &mut |_| ControlFlow::Continue(()))?)
}
