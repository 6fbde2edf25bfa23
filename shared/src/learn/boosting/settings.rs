//! Hyper-parameters of boosting.

use crate::invalid::{Invalid, positive};

/// Hyper-parameters of boosting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoostingSettings {
    /// Most trees for each score.
    pub rounds: usize,
    /// In cross-validation: stop after this many rounds in a row that do not lower the log loss.
    pub patience: usize,
    /// Depth of the trees.
    pub depth: usize,
    /// Learning rate: the share of each Newton step that is taken.
    pub rate: f64,
    /// Fewest rows of a leaf.
    pub min_leaf: usize,
    /// λ ≥ 0 of the penalty ½ λ w² on the value w of each leaf.
    pub penalty: f64,
    /// Most bins of each column.
    pub bins: usize,
}

impl Default for BoostingSettings {
    fn default() -> Self {
        Self {
            rounds: 200,
            patience: 20,
            depth: 3,
            rate: 0.1,
            min_leaf: 10,
            penalty: 1.0,
            bins: 64,
        }
    }
}

impl BoostingSettings {
    /// Accepts settings that are in range.
    ///
    /// # Errors
    /// [`Invalid`] naming the setting.
    pub(super) fn check(&self) -> Result<(), Invalid> {
        positive("rate", self.rate)?;
        if !(self.penalty.is_finite() && self.penalty >= 0.0) {
            return Err(Invalid::new("penalty", "a finite number ≥ 0", self.penalty));
        }
        for (field, found, least) in
            [("depth", self.depth, 1), ("min_leaf", self.min_leaf, 1), ("bins", self.bins, 2)]
        {
            if found < least {
                return Err(Invalid::new(field, format!("at least {least}"), found));
            }
        }
        Ok(())
    }
}
