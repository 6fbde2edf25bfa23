//! Tables I and II beside the reference's.

use std::error::Error;

use serde::{Deserialize, Serialize};
use sidestep::comparison::cell::{Experiment, ModelName, PAPERS_SETS};
use sidestep::comparison::tables::Comparison;

use crate::learning::lines;

/// Rows of one unit.
#[derive(Serialize)]
pub(crate) struct Table {
    /// `accuracy`, or the metric and convention of Table II.
    name: String,
    rows: Vec<Row>,
}

/// One model: a number for each of the paper's sets.
#[derive(Serialize)]
struct Row {
    model: String,
    /// 1 or 2.
    experiment: u8,
    ours: Vec<f64>,
    reference: Vec<f64>,
}

/// A line of either reference table.
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

pub(crate) fn check(comparison: &Comparison) -> Result<Vec<Table>, Box<dyn Error>> {
    let mut tables = vec![Table { name: "accuracy".to_owned(), rows: Vec::new() }];
    let first: Vec<Line<Accuracy>> = lines(include_str!("../../tests/data/sklearn_table1.csv"));
    for line in &first {
        let Accuracy { model, experiment } = line.row;
        tables[0].rows.push(Row {
            model: model.word().to_owned(),
            experiment: experiment.number(),
            ours: comparison.accuracies(model, experiment, &PAPERS_SETS),
            reference: line.numbers(),
        });
    }
    let second: Vec<Line<Distance>> = lines(include_str!("../../tests/data/sklearn_table2.csv"));
    for line in &second {
        let Distance { model, metric, convention } = &line.row;
        let distance = |set| {
            let found = comparison.distances(*model, set);
            match (metric.as_str(), convention.as_str()) {
                ("D_start", "penalised") => Ok(found.start_penalised),
                ("D_end", "penalised") => Ok(found.end_penalised),
                ("D_start", "both") => Ok(found.start_both.unwrap_or(f64::NAN)),
                ("D_end", "both") => Ok(found.end_both.unwrap_or(f64::NAN)),
                (_, "n") => Ok(found.both as f64),
                other => Err(format!("no distance is called {other:?}")),
            }
        };
        let ours = PAPERS_SETS.into_iter().map(distance).collect::<Result<_, _>>()?;
        let row = Row {
            model: model.word().to_owned(),
            experiment: Experiment::Avoidance.number(),
            ours,
            reference: line.numbers(),
        };
        let name = format!("{metric} {convention}");
        match tables.iter_mut().find(|table| table.name == name) {
            Some(table) => table.rows.push(row),
            None => tables.push(Table { name, rows: vec![row] }),
        }
    }
    Ok(tables)
}
