//! Compares every cell with the reference (scikit-learn), and finds the reason why some cells
//! differ.

use std::error::Error;

use serde::Deserialize;
use serde_json::{Value, json};
use sidestep::comparison::ParticipantData;
use sidestep::comparison::cell::{Cell, Experiment};
use sidestep::comparison::fit::fit;
use sidestep::comparison::models::{Grids, ModelName};
use sidestep::comparison::sets::NamedSet;
use sidestep::comparison::split::Split;
use sidestep::comparison::tables::Comparison;

use crate::learning::lines;
use crate::learning::ranks::{Reference, reference};
use crate::learning::why::{Choice, Right, same_numbers, same_setting, why};

/// Numbers of training and test rows of a person.
const ROWS: [f64; 2] = [2000.0, 500.0];

/// The result of scikit-learn for one setting of a cell whose accuracy differs from the reference
/// (`tests/peers/learning_again.py`).
#[derive(Deserialize)]
struct Again {
    model: String,
    experiment: u8,
    features: String,
    participant: usize,
    hyperparameters: String,
    cv_right: usize,
    test_right: usize,
    cv_least: usize,
    cv_most: usize,
    test_least: usize,
    test_most: usize,
}

/// Counts the cells of each model whose test accuracy equals the reference's. Lists the other
/// cells, with the setting that the reference chose and with the setting that we chose.
pub(crate) fn check(
    comparison: &Comparison,
    people: &[ParticipantData],
) -> Result<Value, Box<dyn Error>> {
    let again: Vec<Again> = lines(include_str!("../../tests/data/sklearn_again.csv"));
    let (mut models, mut different) = (Vec::new(), Vec::new());
    for of in reference().chunk_by(|a, b| a.model == b.model) {
        let mut equal = 0;
        for theirs in of {
            let ours = comparison.cells.iter().find(|cell| is(cell, theirs));
            let ours = ours.ok_or("a cell is missing")?;
            if (ours.test.accuracy() - theirs.test_accuracy).abs() < 1e-9 {
                equal += 1;
                continue;
            }
            let choice = |setting: &str| choice(setting, ours, theirs, people, &again);
            let (of_reference, own) =
                (choice(&theirs.hyperparameters)?, choice(&ours.hyperparameters)?);
            let why = why(&theirs.model, &of_reference, &own);
            // Lists a single choice if the reference and we chose the same setting.
            let choices = match same_setting(&of_reference, &own) {
                true => vec![("both", own)],
                false => vec![("reference", of_reference), ("ours", own)],
            };
            different.push(json!({
                "model": theirs.model,
                "experiment": theirs.experiment,
                "features": theirs.features,
                "participant": theirs.participant,
                "why": why,
                "choices": choices,
            }));
        }
        models.push(json!({ "model": of[0].model, "cells": of.len(), "equal": equal }));
    }
    let sum = |what: &str| models.iter().filter_map(|of| of[what].as_u64()).sum::<u64>();
    Ok(json!({
        "cells": sum("cells"),
        "equal": sum("equal"),
        "models": models,
        "different": different,
    }))
}

/// The accuracy with a setting, for our model and for scikit-learn's model.
fn choice(
    hyperparameters: &str,
    ours: &Cell,
    theirs: &Reference,
    people: &[ParticipantData],
    again: &[Again],
) -> Result<Choice, Box<dyn Error>> {
    let wanted: Value = serde_json::from_str(hyperparameters)?;
    let cell = under(&wanted, ours, &people[ours.participant])?;
    let same = |again: &&Again| {
        (&again.model, again.experiment, &again.features, again.participant)
            == (&theirs.model, theirs.experiment, &theirs.features, theirs.participant)
            && serde_json::from_str(&again.hyperparameters)
                .is_ok_and(|of: Value| same_numbers(&of, &wanted))
    };
    let again = again.iter().find(same).ok_or_else(|| {
        format!("sklearn_again.csv lacks {} {hyperparameters}: see that script", theirs.model)
    })?;
    let [cv, test] = ROWS;
    Ok(Choice {
        hyperparameters: wanted,
        ours: Right {
            cv: (cv * cell.cv_accuracy).round() as usize,
            test: (test * cell.test.accuracy()).round() as usize,
        },
        scikit_learn: Right { cv: again.cv_right, test: again.test_right },
        to_the_end: [
            Right { cv: again.cv_least, test: again.test_least },
            Right { cv: again.cv_most, test: again.test_most },
        ],
    })
}

fn is(cell: &Cell, theirs: &Reference) -> bool {
    (cell.model.word(), cell.experiment.number(), cell.features.as_str(), cell.participant)
        == (&theirs.model, theirs.experiment, &theirs.features, theirs.participant)
}

/// Computes the cell with grids that contain only this setting.
fn under(setting: &Value, cell: &Cell, person: &ParticipantData) -> Result<Cell, Box<dyn Error>> {
    let number = |name: &str| setting[name].as_f64().ok_or_else(|| format!("{setting}: no {name}"));
    let whole = |name: &str| setting[name].as_u64().map(|n| n as usize);
    let mut grids = Grids::default();
    match cell.model {
        ModelName::SvmRbf => {
            (grids.rbf_c, grids.rbf_gamma) = (vec![number("C")?], vec![number("gamma")?]);
        }
        ModelName::SvmLinear => grids.linear_c = vec![number("C")?],
        ModelName::Dt => {
            grids.tree_depth = vec![whole("max_depth")];
            grids.tree_leaf = vec![whole("min_samples_leaf").ok_or("a tree without leaves")?];
        }
        _ => grids.logistic_c = vec![number("C")?],
    }
    let sets = NamedSet::papers()?;
    let set = sets.iter().find(|set| set.name == cell.features).ok_or("no such set")?;
    let data = person.data.select(&set.features)?;
    let cells =
        fit(cell.model, &data, &Split::grouped(&data), &grids, &set.name, cell.participant)?;
    let place = Experiment::ALL.iter().position(|one| *one == cell.experiment);
    Ok(cells[place.ok_or("no such experiment")?].clone())
}
