//! Gradient-boosted trees. They are not in the paper and are trained in experiment I only.

use super::{Chosen, Problem, Rows, Training};
use crate::comparison::cell::Experiment;
use crate::comparison::metrics::highest;
use crate::comparison::models::Grids;
use crate::invalid::Invalid;
use crate::learn::boosting::{self, BoostingSettings};
use crate::learn::samples::Samples;
use crate::math::pow;
use crate::predict::Predictor;
use crate::predict::boosting::Boosted;
use crate::predict::scale::Scale;
use serde_json::{Value, json};

pub(super) struct BoostedTrees;

impl Training for BoostedTrees {
    fn experiments(&self) -> &'static [Experiment] {
        &[Experiment::TurnDirection]
    }

    fn grid(&self, grids: &Grids) -> Value {
        json!(grids.boosted_depth)
    }

    fn fit(&self, problems: &[Problem<'_>], grids: &Grids) -> Result<Vec<Chosen>, Invalid> {
        problems.iter().map(|problem| problem.boosted(&grids.boosted_depth)).collect()
    }

    fn cost_s(&self, grids: &Grids, thousands: f64) -> f64 {
        0.02 * grids.boosted_depth.len() as f64 * pow(thousands, 1.2)
    }
}

impl Problem<'_> {
    fn boosted(&self, depths: &[usize]) -> Result<Chosen, Invalid> {
        let (scale, values) = Scale::standardised(self.width(), &self.training.values);
        let Rows { labels, classes, .. } = &self.training;
        let samples = Samples::new(self.width(), &values, labels, classes.len())?;
        let settings = BoostingSettings::default();
        let (model, chosen) =
            boosting::fit_by_folds(&samples, &self.split.folds, depths, &settings)?;
        // The depth and the number of rounds were chosen by the log loss. The table also needs the
        // accuracy of this setting, so its models are trained once more.
        let settings = BoostingSettings { depth: chosen.depth, rounds: chosen.rounds, ..settings };
        let again = |rows: &Rows| -> Result<Vec<(Scale, usize, Boosted)>, Invalid> {
            let (scale, values) = Scale::standardised(self.width(), &rows.values);
            let samples = Samples::new(self.width(), &values, &rows.labels, rows.classes.len())?;
            Ok(vec![(scale, rows.classes.len(), boosting::fit(&samples, &settings)?)])
        };
        let says = |(scale, classes, model): &(Scale, usize, Boosted), row: &[f64]| {
            let mut p = vec![0.0; *classes];
            model.probabilities_into(&scale.row(row), &mut p);
            highest(&p).unwrap_or(0)
        };
        let accuracy = self.validated(1, again, says)?;
        let features = self.data.features.clone();
        Ok(Chosen {
            cv_accuracy: accuracy[0],
            hyperparameters: json!({ "max_depth": chosen.depth, "rounds": chosen.rounds })
                .to_string(),
            predictor: Predictor::boosted(features, classes.clone(), model.unscaled(&scale)),
        })
    }
}
