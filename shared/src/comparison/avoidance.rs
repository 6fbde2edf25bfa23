//! When avoidance begins and ends: the paper's D_start and D_end.

use serde::{Deserialize, Serialize};

/// First and last step of one trajectory in which somebody avoids, human or model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avoidance {
    /// The first step; none if there is no avoidance.
    pub first: Option<usize>,
    /// The last step.
    pub last: Option<usize>,
}

impl Avoidance {
    /// Of the steps of one trajectory.
    #[must_use]
    pub fn of(avoids: impl Iterator<Item = bool>) -> Self {
        let mut steps = avoids.enumerate().filter_map(|(step, avoids)| avoids.then_some(step));
        let first = steps.next();
        Self { first, last: steps.last().or(first) }
    }
}

/// How far the model's first and last steps are from the human's, in steps, over some
/// trajectories. Without its `trajectories` the second form rewards a model that never predicts
/// avoidance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distances {
    /// D_start, the mean over all trajectories; no avoidance counts as one past the last step.
    pub start_penalised: f64,
    /// D_end likewise; no avoidance counts as step −1.
    pub end_penalised: f64,
    /// D_start over the trajectories in which both avoid; none where there is no such.
    pub start_both: Option<f64>,
    /// D_end likewise.
    pub end_both: Option<f64>,
    /// In how many trajectories both avoid.
    pub both: usize,
    /// All trajectories.
    pub trajectories: usize,
}

impl Distances {
    /// Over trajectories of `steps` steps, each with the human's avoidance and the model's.
    #[must_use]
    pub fn of(steps: usize, trajectories: &[(Avoidance, Avoidance)]) -> Self {
        let first = |who: &Avoidance| who.first.map_or(steps as f64, |step| step as f64);
        let last = |who: &Avoidance| who.last.map_or(-1.0, |step| step as f64);
        let start = |(human, model): &(_, _)| f64::abs(first(human) - first(model));
        let end = |(human, model): &(_, _)| f64::abs(last(human) - last(model));
        let both: Vec<_> = trajectories
            .iter()
            .filter(|(human, model)| human.first.is_some() && model.first.is_some())
            .copied()
            .collect();
        let mean = |of: &[(Avoidance, Avoidance)], distance: &dyn Fn(&(_, _)) -> f64| {
            (!of.is_empty()).then(|| of.iter().map(distance).sum::<f64>() / of.len() as f64)
        };
        Self {
            start_penalised: mean(trajectories, &start).unwrap_or(0.0),
            end_penalised: mean(trajectories, &end).unwrap_or(0.0),
            start_both: mean(&both, &start),
            end_both: mean(&both, &end),
            both: both.len(),
            trajectories: trajectories.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn avoidance(steps: &str) -> Avoidance {
        Avoidance::of(steps.chars().map(|step| step == 'a'))
    }

    #[test]
    fn both_forms_by_hand() {
        assert_eq!(avoidance("..a.a."), Avoidance { first: Some(2), last: Some(4) });
        assert_eq!(avoidance("...a.."), Avoidance { first: Some(3), last: Some(3) });
        assert_eq!(avoidance("......"), Avoidance { first: None, last: None });
        let found = Distances::of(
            6,
            &[
                (avoidance("..a.a."), avoidance(".aaa..")),
                (avoidance("..aa.."), avoidance("......")),
                (avoidance("......"), avoidance("......")),
            ],
        );
        assert_eq!((found.start_penalised, found.end_penalised), (5.0 / 3.0, 5.0 / 3.0));
        assert_eq!((found.start_both, found.end_both), (Some(1.0), Some(1.0)));
        assert_eq!((found.both, found.trajectories), (1, 3));
        assert_eq!(Distances::of(6, &[]).start_both, None);
    }
}
