//! Estimates the cost of a comparison before anything is computed.
//!
//! The coefficients were fitted to measurements of this code with the paper's features and 400 to
//! 4000 training rows per person, on one thread of a server's processor. The estimate only needs to
//! distinguish minutes from days.

use super::models::{CURVE_MODELS, Grids, ModelName, UNSEEN_MODELS};
use super::plan::{COMPARED_SETS, FIRST_TASKS, MOST_GROUPS};
use super::settings::Settings;
use super::split::{LEAST_TASKS, first_test_task};

/// Estimated cost of a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Processor time (s), summed over all threads.
    pub processor_s: f64,
    /// Peak memory (bytes).
    pub memory_bytes: f64,
}

/// Memory (bytes) of a comparison without participants: the program and its tables.
const PROGRAM_BYTES: f64 = 25e6;

/// Memory (bytes) per row: the row's states, all its features, and the splits that contain it.
const ROW_BYTES: f64 = 900.0;

/// Memory (bytes) per row and thread for the pooled data of the models trained on other people. It
/// covers the row itself and its entries in the splits.
const SHARED_ROW_BYTES: f64 = 450.0;

/// Memory (bytes) per row and feature set, for support vectors and predictions.
const SET_ROW_BYTES: f64 = 230.0;

/// Time (s) per person and feature set for the work after the fits.
const FINISH_S: f64 = 0.018;

impl Cost {
    /// The cost on `threads` threads for people with these numbers of tasks. Each task has `steps`
    /// steps.
    #[must_use]
    pub fn of(settings: &Settings, tasks: &[usize], steps: usize, threads: usize) -> Self {
        let people: Vec<usize> =
            tasks.iter().copied().filter(|tasks| *tasks >= LEAST_TASKS).collect();
        let compared = match settings.paper_only {
            true => 0,
            false => settings.sets.iter().filter(|set| is_compared(&set.name)).count(),
        };
        let rows = |tasks: usize| (tasks * steps) as f64;
        let own: f64 = people.iter().map(|&tasks| own_s(settings, tasks, compared, rows)).sum();
        let all_rows: f64 = people.iter().map(|&tasks| rows(tasks)).sum();
        let groups = if people.len() > 1 { people.len().min(MOST_GROUPS) as f64 } else { 0.0 };
        // These models are trained only on other people's rows. Counting all rows is close enough.
        let shared: f64 = UNSEEN_MODELS
            .iter()
            .map(|model| fit_s(*model, &settings.grids, all_rows, USUAL_WIDTH))
            .sum();
        let unseen = groups * compared as f64 * shared;
        let most_rows = people.iter().map(|&tasks| rows(tasks)).fold(0.0, f64::max);
        // Each thread has two kernel matrices over one person's rows, and the columns of the pooled
        // rows.
        let kernels = 2.0 * 8.0 * most_rows * most_rows;
        let columns = if compared > 0 { SHARED_ROW_BYTES * all_rows } else { 0.0 };
        let held = (ROW_BYTES + SET_ROW_BYTES * settings.sets.len() as f64) * all_rows;
        Self {
            processor_s: own + unseen,
            memory_bytes: PROGRAM_BYTES + held + threads as f64 * (kernels + columns),
        }
    }
}

fn is_compared(name: &str) -> bool {
    COMPARED_SETS.contains(&name)
}

/// The number of features of the paper's largest set.
const USUAL_WIDTH: usize = 8;

/// Time (s) of the fits on one person's rows.
fn own_s(settings: &Settings, tasks: usize, compared: usize, rows: impl Fn(usize) -> f64) -> f64 {
    let grids = &settings.grids;
    let training = first_test_task(tasks);
    let papers = |width| -> f64 {
        let fits = ModelName::TRAINED.iter();
        fits.map(|model| fit_s(*model, grids, rows(training), width)).sum()
    };
    let tables: f64 = settings.sets.iter().map(|set| papers(set.features.len())).sum();
    let beyond: f64 = settings
        .beyond()
        .map(|(set, model)| fit_s(model, grids, rows(training), set.features.len()))
        .sum();
    let leakage = if settings.leakage { papers(settings.sets[0].features.len()) } else { 0.0 };
    let fewer = FIRST_TASKS.into_iter().filter(|first| *first < training);
    let curve = |first| -> f64 {
        let fits = CURVE_MODELS.iter();
        fits.map(|model| fit_s(*model, grids, rows(first), USUAL_WIDTH)).sum()
    };
    let finish = FINISH_S * settings.sets.len() as f64;
    tables + beyond + leakage + compared as f64 * fewer.map(curve).sum::<f64>() + finish
}

/// Time (s) to fit one model in both experiments: cross-validation over its grid, and the final
/// fit.
fn fit_s(model: ModelName, grids: &Grids, rows: f64, width: usize) -> f64 {
    // Half of the work is proportional to the number of columns.
    let wide = 0.5 + 0.5 * width as f64 / USUAL_WIDTH as f64;
    model.training().map_or(0.0, |training| wide * training.cost_s(grids, rows / 1000.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Request;

    fn cost(json: &str, people: usize, tasks: usize) -> Cost {
        let request: Request = serde_json::from_str(json).unwrap();
        Cost::of(&request.settings().unwrap(), &vec![tasks; people], 50, 1)
    }

    #[test]
    fn more_of_anything_costs_more() {
        let usual = cost("{}", 8, 50);
        for asked in [
            r#"{"leakage": true}"#,
            r#"{"sets": {"mine": ["v_h", "distance"]}}"#,
            r#"{"grids": {"rbf_gamma": [0.01, 0.03, 0.1, 0.3, 30]}}"#,
            r#"{"grids": {"rbf_c": [1, 2, 3, 4, 5]}}"#,
            r#"{"grids": {"linear_c": [1, 2, 3, 4, 5]}}"#,
            r#"{"grids": {"tree_leaf": [1, 2, 3, 4, 5]}}"#,
            r#"{"grids": {"tree_depth": [1, 2, 3, 4, 5, 6, 7]}}"#,
            r#"{"grids": {"logistic_c": [1, 2, 3, 4, 5, 6, 7]}}"#,
            r#"{"grids": {"boosted_depth": [1, 2, 3]}}"#,
        ] {
            assert!(cost(asked, 8, 50).processor_s > usual.processor_s, "{asked}");
        }
        let papers = cost(r#"{"paper_only": true}"#, 8, 50);
        assert!(papers.processor_s < usual.processor_s && papers.memory_bytes < usual.memory_bytes);
        for (people, tasks) in [(9, 50), (8, 51)] {
            let more = cost("{}", people, tasks);
            assert!(more.processor_s > usual.processor_s, "{people} {tasks}");
            assert!(more.memory_bytes > usual.memory_bytes, "{people} {tasks}");
        }
    }

    #[test]
    fn people_who_are_not_compared_cost_nothing() {
        assert_eq!(cost("{}", 100, 4).processor_s, 0.0);
        assert_eq!(cost("{}", 0, 0), cost("{}", 100, 4));
    }
}
