//! Every cell of the comparison against the reference's, and why some differ.

use std::error::Error;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sidestep::comparison::ParticipantData;
use sidestep::comparison::cell::{Cell, Experiment, ModelName, NamedSet};
use sidestep::comparison::fit::{Grids, ModelFamily, fit};
use sidestep::comparison::split::Split;
use sidestep::comparison::tables::Comparison;

use crate::learning::lines;
use crate::learning::ranks::{Reference, reference};

/// How many cells are equal, and those that are not.
#[derive(Serialize)]
pub(crate) struct Check {
    models: Vec<OfModel>,
    different: Vec<Different>,
}

/// Cells of one model.
#[derive(Serialize)]
struct OfModel {
    model: String,
    cells: usize,
    /// With the same test accuracy.
    equal: usize,
}

/// A cell in which test accuracies differ: under the setting that the reference chose, and under
/// the one that we did.
#[derive(Serialize)]
struct Different {
    model: String,
    experiment: u8,
    features: String,
    participant: usize,
    reference: Choice,
    ours: Choice,
}

/// One setting.
#[derive(Serialize)]
struct Choice {
    hyperparameters: Value,
    /// By our models.
    ours: Right,
    /// By scikit-learn as the reference called it.
    scikit_learn: Right,
    /// By scikit-learn to the end, or the fewest and most of many random states of trees.
    to_the_end: [Right; 2],
}

/// Rows that are predicted right.
#[derive(Serialize)]
struct Right {
    /// Of the training rows, where their fold is held out.
    cv: usize,
    /// Of the test rows.
    test: usize,
}

/// Training and test rows of a person.
const ROWS: [f64; 2] = [2000.0, 500.0];

impl Right {
    fn of(cv_accuracy: f64, test_accuracy: f64) -> Self {
        let [cv, test] = ROWS;
        Self {
            cv: (cv * cv_accuracy).round() as usize,
            test: (test * test_accuracy).round() as usize,
        }
    }
}

/// A setting of a cell that differs, by scikit-learn again (`tests/peers/learning_again.py`).
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

pub(crate) fn check(
    comparison: &Comparison,
    people: &[ParticipantData],
) -> Result<Check, Box<dyn Error>> {
    let again: Vec<Again> = lines(include_str!("../../tests/data/sklearn_again.csv"));
    let mut check = Check { models: Vec::new(), different: Vec::new() };
    for theirs in reference() {
        let ours =
            comparison.cells.iter().find(|cell| is(cell, &theirs)).ok_or("a cell is missing")?;
        let last = check.models.last();
        if last.is_none_or(|of| of.model != theirs.model) {
            check.models.push(OfModel { model: theirs.model.clone(), cells: 0, equal: 0 });
        }
        let equal = (ours.test.accuracy() - theirs.test_accuracy).abs() < 1e-9;
        if let Some(of) = check.models.last_mut() {
            of.cells += 1;
            of.equal += usize::from(equal);
        }
        if !equal {
            let choice = |hyperparameters: &str| -> Result<Choice, Box<dyn Error>> {
                let wanted: Value = serde_json::from_str(hyperparameters)?;
                let cell = under(&wanted, ours, &people[ours.participant])?;
                let same = |again: &&Again| {
                    (&again.model, again.experiment, &again.features, again.participant)
                        == (&theirs.model, theirs.experiment, &theirs.features, theirs.participant)
                        && serde_json::from_str(&again.hyperparameters)
                            .is_ok_and(|of: Value| same_numbers(&of, &wanted))
                };
                let again = again.iter().find(same).ok_or_else(|| {
                    format!(
                        "sklearn_again.csv lacks {} {hyperparameters}: see that script",
                        theirs.model
                    )
                })?;
                Ok(Choice {
                    hyperparameters: wanted,
                    ours: Right::of(cell.cv_accuracy, cell.test.accuracy()),
                    scikit_learn: Right { cv: again.cv_right, test: again.test_right },
                    to_the_end: [
                        Right { cv: again.cv_least, test: again.test_least },
                        Right { cv: again.cv_most, test: again.test_most },
                    ],
                })
            };
            let (reference, own) =
                (choice(&theirs.hyperparameters)?, choice(&ours.hyperparameters)?);
            check.different.push(Different {
                model: theirs.model,
                experiment: theirs.experiment,
                features: theirs.features,
                participant: theirs.participant,
                reference,
                ours: own,
            });
        }
    }
    Ok(check)
}

fn is(cell: &Cell, theirs: &Reference) -> bool {
    (cell.model.word(), cell.experiment.number(), cell.features.as_str(), cell.participant)
        == (&theirs.model, theirs.experiment, &theirs.features, theirs.participant)
}

/// Whether two objects have the same entries, 1 being 1.0.
fn same_numbers(a: &Value, b: &Value) -> bool {
    let (Some(a), Some(b)) = (a.as_object(), b.as_object()) else { return false };
    a.len() == b.len()
        && a.iter().all(|(name, a)| b.get(name).is_some_and(|b| a.as_f64() == b.as_f64()))
}

/// The cell as it is when nothing but this setting may be chosen.
fn under(setting: &Value, cell: &Cell, person: &ParticipantData) -> Result<Cell, Box<dyn Error>> {
    let number = |name: &str| setting[name].as_f64().ok_or_else(|| format!("{setting}: no {name}"));
    let whole = |name: &str| setting[name].as_u64().map(|n| n as usize);
    let mut grids = Grids::default();
    let family = match cell.model {
        ModelName::SvmRbf => {
            (grids.rbf_c, grids.rbf_gamma) = (vec![number("C")?], vec![number("gamma")?]);
            ModelFamily::Rbf
        }
        ModelName::SvmLinear => {
            grids.linear_c = vec![number("C")?];
            ModelFamily::Linear
        }
        ModelName::Dt => {
            grids.tree_depth = vec![whole("max_depth")];
            grids.tree_leaf = vec![whole("min_samples_leaf").ok_or("a tree without leaves")?];
            ModelFamily::Tree
        }
        _ => {
            grids.logistic_c = vec![number("C")?];
            ModelFamily::Logistic
        }
    };
    let sets = NamedSet::papers()?;
    let set = sets.iter().find(|set| set.name == cell.features).ok_or("no such set")?;
    let data = person.data.select(&set.features)?;
    let cells = fit(family, &data, &Split::grouped(&data), &grids, &set.name, cell.participant)?;
    let place = Experiment::ALL.iter().position(|one| *one == cell.experiment);
    Ok(cells[place.ok_or("no such experiment")?].clone())
}
