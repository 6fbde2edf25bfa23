//! How near the models, the comparison and its tests are to scikit-learn and scipy, measured; one
//! JSON object. `cargo xtask validate learning` makes `docs/validation/learning.md` of it.
//!
//! Nothing here is timed or random, so that the answer is the same every time.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

mod cells;
mod fingerprints;
mod people;
mod tables;
#[path = "../../tests/learning/mod.rs"]
mod learning;

use std::error::Error;

use learning::apart::{self, LogisticApart, SvmsApart, TreesApart};
use learning::ranks::{self, RanksApart};
use serde::Serialize;

/// Everything that the page says. Pairs are experiment I and II.
#[derive(Serialize)]
struct Report {
    logistic: [LogisticApart; 2],
    machines: [SvmsApart; 2],
    trees: [TreesApart; 2],
    cells: cells::Check,
    tables: Vec<tables::Table>,
    ranks: RanksApart,
    fingerprints: fingerprints::Count,
}

fn main() -> Result<(), Box<dyn Error>> {
    let step = |name: &str| eprintln!("    {name}");
    step("models");
    let (logistic, machines, trees) =
        ([1, 2].map(apart::logistic), [1, 2].map(apart::svms), [1, 2].map(apart::trees));
    step("comparison");
    let people = people::people()?;
    let comparison = people::compared(&people)?;
    let cells = cells::check(&comparison, &people)?;
    let tables = tables::check(&comparison)?;
    step("tests of differences");
    let ranks = ranks::ranks();
    let fingerprints = fingerprints::count()?;
    let report = Report { logistic, machines, trees, cells, tables, ranks, fingerprints };
    println!("{}", serde_json::to_string(&report)?);
    Ok(())
}
