//! Hyper-parameters of boosting.

use crate::invalid::{Invalid, positive};

/// Hyper-parameters of boosting.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BoostingSettings {
    /// Maximum number of trees for each score.
    pub rounds: usize,
    /// Cross-validation stops after more than this many successive rounds without a lower log loss.
    pub patience: usize,
    /// Maximum depth of the trees.
    pub depth: usize,
    /// Learning rate: the fraction of each Newton step that is applied.
    pub rate: f64,
    /// Minimum number of rows in a leaf.
    pub min_leaf: usize,
    /// λ ≥ 0 in the penalty ½ λ w² on the value w of each leaf.
    pub penalty: f64,
    /// Maximum number of bins per column.
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
    /// Sets [`Self::rounds`], the maximum number of trees for each score.
    #[must_use]
    pub fn with_rounds(self, rounds: usize) -> Self {
        Self { rounds, ..self }
    }

    /// Sets [`Self::patience`], the number of rounds that cross-validation waits for a lower log
    /// loss.
    #[must_use]
    pub fn with_patience(self, patience: usize) -> Self {
        Self { patience, ..self }
    }

    /// Sets [`Self::depth`], the maximum depth of the trees.
    #[must_use]
    pub fn with_depth(self, depth: usize) -> Self {
        Self { depth, ..self }
    }

    /// Sets [`Self::rate`], the fraction of each Newton step that is applied.
    #[must_use]
    pub fn with_rate(self, rate: f64) -> Self {
        Self { rate, ..self }
    }

    /// Sets [`Self::min_leaf`], the minimum number of rows in a leaf.
    #[must_use]
    pub fn with_min_leaf(self, min_leaf: usize) -> Self {
        Self { min_leaf, ..self }
    }

    /// Sets [`Self::penalty`], the factor λ of the penalty on leaf values.
    #[must_use]
    pub fn with_penalty(self, penalty: f64) -> Self {
        Self { penalty, ..self }
    }

    /// Sets [`Self::bins`], the maximum number of bins per column.
    #[must_use]
    pub fn with_bins(self, bins: usize) -> Self {
        Self { bins, ..self }
    }

    /// Checks that the settings are in range.
    ///
    /// # Errors
    /// [`Invalid`] with the name of the setting that is out of range.
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
