//! Coverage against area: SHFRS and what it is compared with, on drives of synthetic people.

use std::error::Error;
use std::ops::ControlFlow;

use serde::Serialize;
use sidestep::bounds::ActionChoice;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::baselines::{
    Gaussian, Mode, Nominal, PerModeEmpirical, constant_velocity, hold_the_input,
    learned_disturbance, worst_case,
};
use sidestep::shfrs::family::Family;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::pareto::{ParetoSettings, pareto};
use sidestep::shfrs::prediction::Prediction;
use sidestep::shfrs::tuning::{TuningSettings, candidates, tune};
use sidestep::shfrs::window::{Window, WindowChoice};

use crate::people::{self, CALIBRATION, TRAINING};

const STEPS: usize = 10;
const TARGETS: [f64; 3] = [0.75, 0.9, 0.95];
const SPLITS: u64 = 12;
const CONFIDENCE: f64 = 0.95;

#[derive(Serialize)]
pub(crate) struct Check {
    drives: usize,
    training: usize,
    calibration: usize,
    test: usize,
    splits: u64,
    steps: usize,
    targets: [f64; 3],
    confidence: f64,
    families: Vec<Row>,
}

/// A family at the levels calibrated for each of the targets: means over the splits.
#[derive(Serialize)]
pub(crate) struct Row {
    family: String,
    cells: Vec<Cell>,
}

#[derive(Clone, Default, Serialize)]
pub(crate) struct Cell {
    area_m2: f64,
    coverage: f64,
    /// The interval about a coverage: means of its ends.
    low: f64,
    high: f64,
}

/// One family after the other, each with a cell a target.
type Table = Vec<(String, Vec<Cell>)>;

/// Choices of actions, in the words of the page; the best is made on the training part.
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
    drives: &[people::Drive],
    seed: u64,
    safety: &SafetyLevels,
    parameters: &SceneParameters,
) -> Result<Table, Box<dyn Error>> {
    let (predictor, sample) = people::split(drives, seed, safety, parameters)?;
    let human = PredictedHuman::new(&predictor, safety, parameters)?;
    let prediction = Prediction::new(parameters, &human);
    let windows = WindowChoice::RandomOne { seed };
    let mut found = Table::new();
    for (name, candidates) in choices() {
        let mut cells = Vec::new();
        for p in TARGETS {
            let settings = TuningSettings {
                p,
                guarantee: Guarantee::Conformal,
                windows,
                candidates: candidates.clone(),
                confidence: CONFIDENCE,
            };
            let tuned = tune(&sample, prediction, &settings)?;
            let coverage = tuned.coverage;
            cells.push(Cell {
                area_m2: tuned.mean_area_m2,
                coverage: coverage.value,
                low: coverage.low,
                high: coverage.high,
            });
        }
        found.push((name.to_owned(), cells));
    }
    let learned: Vec<Window<'_>> =
        WindowChoice::EveryStep.windows(&sample.training, STEPS).concat();
    let mut families: Vec<Box<dyn Family + Send + '_>> = vec![
        Box::new(worst_case(parameters)),
        Box::new(constant_velocity(parameters)),
        Box::new(hold_the_input(parameters)),
        Box::new(learned_disturbance(parameters, &human)),
        Box::new(Gaussian::learn(Nominal::Held, parameters, &learned)?),
        Box::new(PerModeEmpirical::learn(Mode::MostLikely(&human), parameters, &learned)?),
        Box::new(PerModeEmpirical::learn(Mode::<&PredictedHuman<'_>>::Held, parameters, &learned)?),
    ];
    let settings = ParetoSettings::new(TARGETS.to_vec(), CONFIDENCE, windows, STEPS, 2)?;
    let compared = pareto(&mut families, &sample.calibration, &sample.test, &settings)?;
    for rows in compared.rows.chunks(TARGETS.len()) {
        let cell = |row: &sidestep::shfrs::pareto::ParetoRow| Cell {
            area_m2: row.mean_area_m2,
            coverage: row.coverage,
            low: row.coverage_low,
            high: row.coverage_high,
        };
        found.push((rows[0].family.clone(), rows.iter().map(cell).collect()));
    }
    Ok(found)
}

pub(crate) fn check() -> Result<Check, Box<dyn Error>> {
    let drives = people::drives()?;
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    let tables = (0..SPLITS).map(|seed| table(&drives, seed, &safety, &parameters));
    let tables: Vec<Table> = tables.collect::<Result<_, _>>()?;
    let row = |(i, (family, cells)): (usize, &(String, Vec<Cell>))| {
        let mean = |j: usize, of: &dyn Fn(&Cell) -> f64| {
            tables.iter().map(|table| of(&table[i].1[j])).sum::<f64>() / SPLITS as f64
        };
        let cell = |j| Cell {
            area_m2: mean(j, &|cell| cell.area_m2),
            coverage: mean(j, &|cell| cell.coverage),
            low: mean(j, &|cell| cell.low),
            high: mean(j, &|cell| cell.high),
        };
        Row { family: family.clone(), cells: (0..cells.len()).map(cell).collect() }
    };
    Ok(Check {
        drives: drives.len(),
        training: TRAINING,
        calibration: CALIBRATION,
        test: drives.len() - TRAINING - CALIBRATION,
        splits: SPLITS,
        steps: STEPS,
        targets: TARGETS,
        confidence: CONFIDENCE,
        families: tables[0].iter().enumerate().map(row).collect(),
    })
}
