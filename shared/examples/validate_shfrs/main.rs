//! What the reachable sets and their probabilities are worth, measured; one JSON object.
//! `cargo xtask validate` makes `docs/validation/shfrs.md` of it.
//!
//! Nothing here is timed, and random numbers come from fixed seeds, so that the answer is
//! the same every time.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

mod closed_form;
mod coverage;
mod danger;
mod drives;
mod enumeration;
mod families;
mod membership;
mod people;
mod polygons;
mod reacting;
mod twin;
mod vectors;

use std::error::Error;

use serde::Serialize;

/// The study's vehicle and clock.
const SPEED_MPS: f64 = 2.0;
const RATE_RADPS: f64 = 0.5;
const STEP_S: f64 = 0.2;

/// Everything that the page says.
#[derive(Serialize)]
struct Report {
    vectors: Vec<vectors::Case>,
    polygons: polygons::Check,
    enumeration: Vec<enumeration::Check>,
    closed_form: closed_form::Check,
    twin: twin::Check,
    membership: membership::Check,
    coverage: coverage::Check,
    danger: danger::Check,
    families: families::Check,
}

fn main() -> Result<(), Box<dyn Error>> {
    let step = |name: &str| eprintln!("    {name}");
    step("reference cases");
    let vectors = vectors::check()?;
    step("random drives and conservative polygons");
    let polygons = polygons::check()?;
    step("enumerated inputs");
    let enumeration = enumeration::check()?;
    let closed_form = closed_form::check()?;
    step("level-set solver");
    let twin = twin::check()?;
    step("membership");
    let membership = membership::check()?;
    step("guarantees");
    let coverage = coverage::check()?;
    let danger = danger::check()?;
    step("families");
    let families = families::check()?;
    let report = Report {
        vectors,
        polygons,
        enumeration,
        closed_form,
        twin,
        membership,
        coverage,
        danger,
        families,
    };
    println!("{}", serde_json::to_string(&report)?);
    Ok(())
}
