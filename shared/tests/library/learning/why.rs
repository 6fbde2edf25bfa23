//! Reasons why a cell of the comparison differs from the reference's cell.

use serde::Serialize;
use serde_json::Value;
use std::cmp::Ordering;

/// Numbers of correctly predicted rows: training rows while their fold is held out, and test rows.
#[derive(Serialize)]
pub(crate) struct Right {
    pub(crate) cv: usize,
    pub(crate) test: usize,
}

/// A setting, and the numbers of rows that are predicted correctly with it.
#[derive(Serialize)]
pub(crate) struct Choice {
    pub(crate) hyperparameters: Value,
    /// Our models.
    pub(crate) ours: Right,
    /// scikit-learn with the reference's solver settings.
    pub(crate) scikit_learn: Right,
    /// scikit-learn run to convergence. For trees, the minimum and maximum over many random states.
    pub(crate) to_the_end: [Right; 2],
}

/// The reason, as named and explained in `docs/validation/learning.md`. `open` if it is unknown.
pub(crate) fn why(model: &str, theirs: &Choice, ours: &Choice) -> &'static str {
    if model == "dt" {
        let within = |choice: &Choice| {
            let [least, most] = &choice.to_the_end;
            (least.cv..=most.cv).contains(&choice.ours.cv)
                && (least.test..=most.test).contains(&choice.ours.test)
        };
        return if within(theirs) && within(ours) { "equal splits" } else { "open" };
    }
    let [end, of_theirs] = [&ours.to_the_end[0], &theirs.to_the_end[0]];
    // With our setting, the converged solver must get the same result as we do.
    if end.test != ours.ours.test {
        return "open";
    }
    if same_setting(theirs, ours) {
        return "stops early";
    }
    match end.cv.cmp(&of_theirs.cv) {
        _ if end.cv != ours.ours.cv => "open",
        Ordering::Equal if first_in_grid(ours, theirs) => "tie",
        Ordering::Equal => "tie, rounding",
        Ordering::Greater => "ours is better",
        Ordering::Less => "open",
    }
}

/// Compares settings by name and number. 1 and 1.0 are equal.
pub(crate) fn same_setting(one: &Choice, other: &Choice) -> bool {
    same_numbers(&one.hyperparameters, &other.hyperparameters)
}

/// Whether two objects have the same entries. 1 and 1.0 are equal.
pub(crate) fn same_numbers(a: &Value, b: &Value) -> bool {
    let (Some(a), Some(b)) = (a.as_object(), b.as_object()) else { return false };
    a.len() == b.len()
        && a.iter().all(|(name, a)| b.get(name).is_some_and(|b| a.as_f64() == b.as_f64()))
}

/// Whether `one` comes before `other` in the grid, which is ordered by increasing C and then γ.
fn first_in_grid(one: &Choice, other: &Choice) -> bool {
    let place = |choice: &Choice| ["C", "gamma"].map(|name| choice.hyperparameters[name].as_f64());
    place(one) < place(other)
}
