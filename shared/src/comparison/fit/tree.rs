//! Decision trees.

use super::{Chosen, Problem, Rows, Training, best, sorted};
use crate::comparison::models::Grids;
use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::learn::tree;
use crate::predict::Predictor;
use crate::predict::scale::Scale;
use crate::predict::tree::Tree;
use serde_json::{Value, json};

pub(super) struct DecisionTree;

impl Training for DecisionTree {
    fn grid(&self, grids: &Grids) -> Value {
        json!([grids.tree_depth, grids.tree_leaf])
    }

    fn fit(&self, problems: &[Problem<'_>], grids: &Grids) -> Result<Vec<Chosen>, Invalid> {
        problems.iter().map(|problem| problem.tree(grids)).collect()
    }

    fn cost_s(&self, grids: &Grids, thousands: f64) -> f64 {
        let (leaves, depths) = (grids.tree_leaf.len() as f64, grids.tree_depth.len() as f64);
        (0.0042 + 0.0003 * leaves + 0.00008 * depths) * sorted(thousands)
    }
}

impl Problem<'_> {
    fn tree(&self, grids: &Grids) -> Result<Chosen, Invalid> {
        // Settings are ordered by depth, then by leaf size. One tree per leaf size is enough,
        // because it can be truncated to every depth.
        let grow = |rows: &Rows, depth, leaves: &[usize]| -> Result<Vec<Tree>, Invalid> {
            let (scale, values) = Scale::standardised(self.width(), &rows.values);
            let samples = Samples::new(self.width(), &values, &rows.labels, rows.classes.len())?;
            let grown = tree::grow_each(&samples, depth, leaves)?;
            Ok(grown.iter().map(|tree| tree.unscaled(&scale)).collect())
        };
        let settings: Vec<(Option<usize>, usize)> = (grids.tree_depth.iter())
            .flat_map(|&depth| (0..grids.tree_leaf.len()).map(move |leaf| (depth, leaf)))
            .collect();
        let models = |rows: &Rows| -> Result<Vec<Tree>, Invalid> {
            let grown = grow(rows, None, &grids.tree_leaf)?;
            let cut = |tree: &Tree, depth: Option<usize>| match depth {
                Some(depth) => tree.truncated(depth),
                None => tree.clone(),
            };
            Ok(settings.iter().map(|&(depth, leaf)| cut(&grown[leaf], depth)).collect())
        };
        let accuracy = self.validated(settings.len(), models, |tree, row| tree.class(row))?;
        let best = best(&accuracy)?;
        let (depth, leaf) = (settings[best].0, grids.tree_leaf[settings[best].1]);
        let tree = grow(&self.training, depth, &[leaf])?.remove(0);
        let (features, classes) = (self.data.features.clone(), self.training.classes.clone());
        Ok(Chosen {
            cv_accuracy: accuracy[best],
            hyperparameters: json!({ "max_depth": depth, "min_samples_leaf": leaf }).to_string(),
            predictor: Predictor::tree(features, classes, tree),
        })
    }
}
