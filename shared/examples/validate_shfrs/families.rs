//! Coverage against area for SHFRS and the baselines, on drives of synthetic people.

use std::error::Error;

use serde_json::json;
use sidestep::bounds::ActionChoice;
use sidestep::learn::participant::Driven;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::pareto::{Compared, ParetoRow, ParetoSettings, pareto};
use sidestep::shfrs::tuning::{TuningSettings, candidates, tune};
use sidestep::shfrs::window::WindowChoice;
use sidestep::shfrs::window_sets::Prediction;

use crate::Found;
use crate::recorded::{self, CALIBRATION, TRAINING};

const STEPS: usize = 10;
const TARGETS: [f64; 3] = [0.75, 0.9, 0.95];
const SPLITS: u64 = 12;
const CONFIDENCE: f64 = 0.95;

/// A family at the level that is calibrated for a target: area of the tube (m²), coverage, and the
/// lower and upper end of the coverage's confidence interval.
type Cell = [f64; 4];

/// The families, each with one cell per target.
type Table = Vec<(String, Vec<Cell>)>;

/// Choices of actions, by their name on the page. For each name, the best choice is selected on the
/// training part.
fn choices() -> Vec<(&'static str, Vec<ActionChoice>)> {
    let (adaptive, schedules) = candidates(3, STEPS)
        .into_iter()
        .partition(|choice| matches!(choice, ActionChoice::Adaptive { .. }));
    let of_the_paper = ActionChoice::TopK((0..STEPS).map(|i| if i < 2 { 2 } else { 1 }).collect());
    vec![
        ("SHFRS, best adaptive set", adaptive),
        ("SHFRS, best schedule of k", schedules),
        ("SHFRS, the paper's k", vec![of_the_paper]),
    ]
}

fn table(
    drives: &[Driven],
    seed: u64,
    safety: &SafetyLevels,
    parameters: &SceneParameters,
) -> Result<Table, Box<dyn Error>> {
    let (predictor, sample) = recorded::split(drives, seed, safety);
    let human = PredictedHuman::new(&predictor, safety, parameters)?;
    let prediction = Prediction::new(parameters, &human);
    let windows = WindowChoice::RandomOne { seed };
    let mut found = Table::new();
    for (name, candidates) in choices() {
        let mut cells = Vec::new();
        for p in TARGETS {
            let settings = TuningSettings::new(p, Guarantee::Conformal, candidates.clone())
                .with_windows(windows)
                .with_confidence(CONFIDENCE);
            let tuned = tune(&sample, prediction, &settings)?;
            let coverage = tuned.coverage;
            cells.push([tuned.mean_area_m2, coverage.value, coverage.low, coverage.high]);
        }
        found.push((name.to_owned(), cells));
    }
    let family = |compared: Compared| compared.family(prediction, &sample.training, STEPS);
    let mut families =
        Compared::BASELINES.into_iter().map(family).collect::<Result<Vec<_>, _>>()?;
    let settings = ParetoSettings::new(TARGETS.to_vec(), CONFIDENCE, windows, STEPS, 2)?;
    let compared = pareto(&mut families, &sample.calibration, &sample.test, &settings)?;
    for rows in compared.rows.chunks(TARGETS.len()) {
        let cell =
            |row: &ParetoRow| [row.mean_area_m2, row.coverage, row.coverage_low, row.coverage_high];
        found.push((rows[0].family.clone(), rows.iter().map(cell).collect()));
    }
    Ok(found)
}

pub(crate) fn check() -> Found {
    let drives = recorded::drives();
    let parameters = SceneParameters::default();
    let safety = recorded::safety();
    let tables = (0..SPLITS).map(|seed| table(&drives, seed, &safety, &parameters));
    let tables: Vec<Table> = tables.collect::<Result<_, _>>()?;
    // A family's cell for a target, averaged over the splits.
    let cell = |family: usize, target: usize| -> Cell {
        std::array::from_fn(|i| {
            tables.iter().map(|table| table[family].1[target][i]).sum::<f64>() / SPLITS as f64
        })
    };
    let names: Vec<&String> = tables[0].iter().map(|(name, _)| name).collect();
    let row = |(family, name): (usize, &&String)| {
        let cells = [0, 1, 2].map(|target| {
            let [area_m2, coverage, low, high] = cell(family, target);
            json!({ "area_m2": area_m2, "coverage": coverage, "low": low, "high": high })
        });
        json!({ "family": name, "cells": cells })
    };
    let least = |target: usize| {
        let area = |family: &usize| cell(*family, target)[0];
        (0..names.len()).min_by(|a, b| area(a).total_cmp(&area(b)))
    };
    let best: Vec<_> = (0..TARGETS.len()).map(|target| (least(target), TARGETS[target])).collect();
    let run = |run: &[(Option<usize>, f64)]| {
        let targets: Vec<f64> = run.iter().map(|(_, p)| *p).collect();
        json!({ "family": run[0].0.map(|family| names[family]), "targets": targets })
    };
    Ok(json!({
        "drives": drives.len(),
        "training": TRAINING,
        "calibration": CALIBRATION,
        "test": drives.len() - TRAINING - CALIBRATION,
        "splits": SPLITS,
        "steps": STEPS,
        "targets": TARGETS,
        "confidence": CONFIDENCE,
        "families": names.iter().enumerate().map(row).collect::<Vec<_>>(),
        // The family with the smallest area, for each range of targets.
        "least": best.chunk_by(|a, b| a.0 == b.0).map(run).collect::<Vec<_>>(),
    }))
}
