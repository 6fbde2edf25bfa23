//! The features of the synthetic participants, and scikit-learn's results for them
//! (`tests/data/README.md`).
#![allow(dead_code, reason = "each test uses some of it")]

pub(crate) mod apart;
pub(crate) mod ranks;
pub(crate) mod why;

use serde::Deserialize;
use sidestep::learn::samples::Samples;
use sidestep::predict::scale::Scale;
use std::collections::HashMap;

pub(crate) const PEOPLE: usize = 8;

/// Number of columns of B_hrd.
pub(crate) const WIDTH: usize = 8;

/// The features B_hrd at one step, and the labels of this step in experiments I and II.
#[derive(Deserialize)]
pub(crate) struct FeatureRow {
    pub(crate) participant: usize,
    pub(crate) trial: usize,
    pub(crate) step: usize,
    pub(crate) features: [f64; WIDTH],
    pub(crate) y1: i8,
    y2: i8,
}

/// The rows of `features.csv` in order.
pub(crate) fn feature_rows() -> Vec<FeatureRow> {
    let mut reader = csv::Reader::from_reader(include_str!("../../data/features.csv").as_bytes());
    let rows = reader.records().map(|record| record.and_then(|record| record.deserialize(None)));
    rows.collect::<Result<_, _>>().expect("rows of features")
}

/// The lines of a reference table.
pub(crate) fn lines<T: serde::de::DeserializeOwned>(text: &str) -> Vec<T> {
    let lines = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
    lines.collect::<Result<_, _>>().expect("lines of a table")
}

/// Rows of one person, and their labels in experiment I or II.
#[derive(Default)]
pub(crate) struct Rows {
    /// Trial and step of each row.
    pub(crate) places: Vec<(usize, usize)>,
    pub(crate) values: Vec<f64>,
    pub(crate) labels: Vec<usize>,
}

impl Rows {
    pub(crate) fn samples(&self, experiment: usize) -> Samples<'_> {
        Samples::new(WIDTH, &self.values, &self.labels, classes(experiment))
            .expect("rows of numbers")
    }

    /// Returns the scaler fitted to the rows, and the scaled rows.
    pub(crate) fn standardised(self) -> (Scale, Self) {
        let (scale, values) = Scale::standardised(WIDTH, &self.values);
        (scale, Self { values, ..self })
    }

    fn push(&mut self, row: &FeatureRow, experiment: usize) {
        self.places.push((row.trial, row.step));
        self.values.extend(row.features);
        self.labels.push(if experiment == 1 { (row.y1 + 1) as usize } else { row.y2 as usize });
    }
}

pub(crate) fn classes(experiment: usize) -> usize {
    if experiment == 1 { 3 } else { 2 }
}

/// The class with label 0. The classes are −1, 0, 1 in experiment I, and 0, 1 in experiment II.
pub(crate) fn lowest_class(experiment: usize) -> f64 {
    if experiment == 1 { -1.0 } else { 0.0 }
}

/// Unscaled rows of a person: trials 0–39 for training, and trials 40–49 for testing.
pub(crate) fn person(participant: usize, experiment: usize) -> (Rows, Rows) {
    let (mut training, mut test) = (Rows::default(), Rows::default());
    for row in feature_rows().iter().filter(|row| row.participant == participant) {
        let part = if row.trial < 40 { &mut training } else { &mut test };
        part.push(row, experiment);
    }
    (training, test)
}

#[derive(Deserialize)]
pub(crate) struct Peer {
    pub(crate) mean: Vec<f64>,
    pub(crate) scale: Vec<f64>,
    pub(crate) lr: Lr,
    pub(crate) svc: Svc,
}

#[derive(Deserialize)]
pub(crate) struct Lr {
    pub(crate) coef: Vec<Vec<f64>>,
    pub(crate) intercept: Vec<f64>,
}

#[derive(Deserialize)]
pub(crate) struct Svc {
    pub(crate) gamma: f64,
}

/// scikit-learn's model of a person.
pub(crate) fn peer(participant: usize, experiment: usize) -> Peer {
    let text = include_str!("../../data/sk_open_hrd_models.json");
    let mut all: HashMap<String, serde_json::Value> = serde_json::from_str(text).expect("models");
    let model = all.remove(&format!("p{participant}_exp{experiment}")).expect("a model");
    serde_json::from_value(model).expect("a model")
}

/// scikit-learn's logistic regression of a person, fitted by its Newton solver.
pub(crate) fn peer_by_newton(participant: usize, experiment: usize, c: f64) -> Lr {
    let text = include_str!("../../data/sklearn_newton.json");
    let mut all: HashMap<String, Lr> = serde_json::from_str(text).expect("models");
    all.remove(&format!("p{participant}_exp{experiment}_c{c}")).expect("a model")
}

/// Outputs of scikit-learn's models for a person's trials 40–49, by column name.
pub(crate) fn said(participant: usize, experiment: usize) -> Vec<HashMap<String, f64>> {
    let text = match experiment {
        1 => include_str!("../../data/sk_open_hrd_exp1.csv"),
        _ => include_str!("../../data/sk_open_hrd_exp2.csv"),
    };
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names = reader.headers().expect("names").clone();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.expect("a row");
        let cells = names.iter().zip(&record).filter(|(_, cell)| !cell.is_empty());
        let row: HashMap<String, f64> =
            cells.map(|(name, cell)| (name.to_owned(), cell.parse().expect("a number"))).collect();
        if row["participant"] == participant as f64 {
            rows.push(row);
        }
    }
    rows
}
