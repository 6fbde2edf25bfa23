//! What the reachable sets and their probabilities are worth, measured; one JSON object.
//! `cargo xtask validate` makes `docs/validation/shfrs.md` of it.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

mod twin;

use std::error::Error;

use serde::Serialize;

/// The study's vehicle and clock.
const SPEED_MPS: f64 = 2.0;
const STEP_S: f64 = 0.2;

#[derive(Serialize)]
struct Report {
    twin: Vec<twin::Twin>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let report = Report { twin: twin::check()? };
    println!("{}", serde_json::to_string_pretty(&report)?);
    Ok(())
}
