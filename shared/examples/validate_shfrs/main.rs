//! Measures the accuracy of the reachable sets and of their probabilities, and prints one JSON
//! object. From this object `cargo xtask validate` makes `docs/validation/shfrs.md`.
//!
//! The output is reproducible, because nothing is timed and random numbers come from fixed seeds.
//! Names of numbers end with their unit.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

#[path = "../../tests/reach/cases.rs"]
mod reach_cases;
#[path = "../../tests/reach/starts.rs"]
mod starts;
#[path = "../../tests/library/recorded/mod.rs"]
mod recorded;
mod drives;
mod polygons;
mod enumeration;
mod closed_form;
mod twin;
mod membership;
mod reacting;
mod coverage;
mod danger;
mod families;

use std::error::Error;

use serde_json::Value;

/// The study's vehicle and time step.
const SPEED_MPS: f64 = 2.0;
const RATE_RADPS: f64 = 0.5;
const STEP_S: f64 = 0.2;

/// The results for one part of the page.
type Found = Result<Value, Box<dyn Error>>;

/// A part of the page: its name in the page's template, and the function that checks it.
type Part = (&'static str, fn() -> Found);

const PARTS: [Part; 9] = [
    ("vectors", || Ok(serde_json::to_value(reach_cases::measured())?)),
    ("polygons", polygons::check),
    ("enumeration", enumeration::check),
    ("closed_form", closed_form::check),
    ("twin", twin::check),
    ("membership", membership::check),
    ("coverage", coverage::check),
    ("danger", danger::check),
    ("families", families::check),
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut report = Value::default();
    for (name, check) in PARTS {
        eprintln!("    {name}");
        report[name] = check()?;
    }
    println!("{report}");
    Ok(())
}
