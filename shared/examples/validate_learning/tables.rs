//! Compares Tables I and II with the reference's tables.

use std::error::Error;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sidestep::comparison::cell::Experiment;
use sidestep::comparison::models::ModelName;
use sidestep::comparison::sets::PAPERS_SETS;
use sidestep::comparison::tables::Comparison;

use crate::learning::apart::furthest;
use crate::learning::lines;

/// The numbers of one model, one for each of the paper's sets.
#[derive(Serialize)]
struct Row {
    model: &'static str,
    /// Number of the experiment, 1 or 2.
    experiment: u8,
    ours: Vec<f64>,
    reference: Vec<f64>,
}

/// A line of one of the reference tables.
#[derive(Deserialize)]
struct Line<T> {
    #[serde(flatten)]
    row: T,
    hrd: f64,
    hr: f64,
    hd: f64,
    rd: f64,
    h: f64,
    r: f64,
    d: f64,
}

impl<T> Line<T> {
    fn numbers(&self) -> Vec<f64> {
        vec![self.hrd, self.hr, self.hd, self.rd, self.h, self.r, self.d]
    }
}

#[derive(Deserialize)]
struct Accuracy {
    model: ModelName,
    experiment: Experiment,
}

#[derive(Deserialize)]
struct Distance {
    model: ModelName,
    metric: String,
    convention: String,
}

/// A named table as JSON, with the maximum difference between our values and the reference's.
fn table((name, rows): (String, Vec<Row>)) -> Value {
    let largest = rows.iter().map(|row| furthest(&row.ours, &row.reference)).fold(0.0, f64::max);
    json!({ "name": name, "largest": largest, "rows": rows })
}

/// Table I under the name `accuracy`, and a table for each metric and convention of Table II.
pub(crate) fn check(comparison: &Comparison) -> Result<Vec<Value>, Box<dyn Error>> {
    let mut tables: Vec<(String, Vec<Row>)> = vec![("accuracy".to_owned(), Vec::new())];
    let first: Vec<Line<Accuracy>> = lines(include_str!("../../tests/data/sklearn_table1.csv"));
    for line in &first {
        let Accuracy { model, experiment } = line.row;
        let ours = comparison.accuracies(model, experiment, &PAPERS_SETS);
        let (model, experiment) = (model.word(), experiment.number());
        tables[0].1.push(Row { model, experiment, ours, reference: line.numbers() });
    }
    let second: Vec<Line<Distance>> = lines(include_str!("../../tests/data/sklearn_table2.csv"));
    for line in &second {
        let Distance { model, metric, convention } = &line.row;
        let distance = |set| {
            let found = comparison.distances(*model, set);
            match (metric.as_str(), convention.as_str()) {
                ("D_start", "penalised") => Ok(found.start.penalised),
                ("D_end", "penalised") => Ok(found.end.penalised),
                ("D_start", "both") => Ok(found.start.both.unwrap_or(f64::NAN)),
                ("D_end", "both") => Ok(found.end.both.unwrap_or(f64::NAN)),
                (_, "n") => Ok(found.both as f64),
                other => Err(format!("no distance is called {other:?}")),
            }
        };
        let ours = PAPERS_SETS.into_iter().map(distance).collect::<Result<_, _>>()?;
        let experiment = Experiment::Avoidance.number();
        let row = Row { model: model.word(), experiment, ours, reference: line.numbers() };
        let name = format!("{metric}, {convention}");
        match tables.iter_mut().find(|table| table.0 == name) {
            Some((_, rows)) => rows.push(row),
            None => tables.push((name, vec![row])),
        }
    }
    Ok(tables.into_iter().map(table).collect())
}
