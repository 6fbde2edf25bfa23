//! Measures how closely the models, the comparison and its statistical tests agree with
//! scikit-learn and scipy, and prints one JSON object. From this object `cargo xtask validate
//! learning` makes `docs/validation/learning.md`.
//!
//! The output is reproducible, because nothing is timed or random.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

#[path = "../../tests/library/learning/mod.rs"]
mod learning;
#[path = "../../tests/library/recorded/mod.rs"]
mod recorded;
mod people;
mod cells;
mod tables;

use std::error::Error;

use serde_json::json;
use sidestep::comparison::learning_fingerprints;

use learning::{apart, ranks};

fn main() -> Result<(), Box<dyn Error>> {
    let step = |name: &str| eprintln!("    {name}");
    // Each pair holds the results of experiments I and II.
    step("models");
    let (logistic, machines, trees) =
        ([1, 2].map(apart::logistic), [1, 2].map(apart::svms), [1, 2].map(apart::trees));
    step("comparison");
    let (people, comparison) = people::compared()?;
    let cells = cells::check(&comparison, &people)?;
    step("tests of differences");
    let ranks = ranks::ranks();
    // Stages for which the tests compare all bits between this machine and WebAssembly.
    let stages = learning_fingerprints()?;
    let count = |stage: &str| stages.iter().filter(|(name, _)| name.ends_with(stage)).count();
    let report = json!({
        "logistic": logistic,
        "machines": machines,
        "trees": trees,
        "cells": cells,
        "tables": tables::check(&comparison)?,
        "ranks": ranks,
        "fingerprints": {
            "all": stages.len(),
            "training": count("training"),
            "inference": count("inference"),
            "features": count("features"),
        },
    });
    println!("{report}");
    Ok(())
}
