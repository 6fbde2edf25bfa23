//! Logistic regression.

use super::{Chosen, Problem, Rows, Training, best};
use crate::comparison::metrics::highest;
use crate::comparison::models::Grids;
use crate::invalid::Invalid;
use crate::learn::logistic::{LogisticSettings, fit_path};
use crate::learn::samples::Samples;
use crate::predict::Predictor;
use crate::predict::logistic::Logistic;
use crate::predict::scale::Scale;
use serde_json::{Value, json};

pub(super) struct Regression;

impl Training for Regression {
    fn grid(&self, grids: &Grids) -> Value {
        json!(grids.logistic_c)
    }

    fn strengths<'a>(&self, grids: &'a Grids) -> Option<&'a [f64]> {
        Some(&grids.logistic_c)
    }

    fn fit(&self, problems: &[Problem<'_>], grids: &Grids) -> Result<Vec<Chosen>, Invalid> {
        problems.iter().map(|problem| problem.logistic(&grids.logistic_c)).collect()
    }

    fn cost_s(&self, grids: &Grids, thousands: f64) -> f64 {
        (0.003 + 0.00075 * grids.logistic_c.len() as f64) * thousands
    }
}

impl Problem<'_> {
    fn logistic(&self, strengths: &[f64]) -> Result<Chosen, Invalid> {
        let train = |rows: &Rows, strengths: &[f64]| -> Result<Vec<(Scale, Logistic)>, Invalid> {
            let (scale, values) = Scale::standardised(self.width(), &rows.values);
            let samples = Samples::new(self.width(), &values, &rows.labels, rows.classes.len())?;
            let models = fit_path(&samples, strengths, LogisticSettings::default())?;
            Ok(models.into_iter().map(|model| (scale.clone(), model)).collect())
        };
        let says = |(scale, model): &(Scale, Logistic), row: &[f64]| {
            let mut p = vec![0.0; model.intercepts().len()];
            model.probabilities_into(scale, row, &mut p);
            highest(&p).unwrap_or(0)
        };
        let accuracy = self.validated(strengths.len(), |rows| train(rows, strengths), says)?;
        let best = best(&accuracy)?;
        let c = strengths[best];
        let mut models = train(&self.training, &[c])?;
        let (scale, model) = models.remove(0);
        let features = self.data.features.clone();
        Ok(Chosen {
            cv_accuracy: accuracy[best],
            hyperparameters: json!({ "C": c }).to_string(),
            predictor: Predictor::logistic(features, self.training.classes.clone(), scale, model),
        })
    }
}
