//! Prediction methods and predicted sets.

use super::Learned;
use crate::bounds::{BoundsSettings, in_proportion};
use crate::chart::fixed;
use crate::invalid::Invalid;
use crate::shfrs::NestedSet;
use crate::shfrs::baselines::{EmpiricalFamily, EmpiricalSet, EmpiricalSets};
use crate::vehicle::VehicleModel;

/// A method that predicts where the human may be.
#[allow(
    clippy::large_enum_variant,
    reason = "there is one for each pane; with 32 bits it is small"
)]
pub enum Method {
    /// A learned function. Algorithm 1 computes sets from its predictions.
    Learned(Learned),
    /// Sets learned from recorded futures. They have no probabilities of inputs.
    Empirical(Box<EmpiricalSets>),
}

impl Method {
    /// Scales the paper's settings to the human's turn rate, so that the widest set admits every turn.
    ///
    /// # Errors
    /// The errors of [`BoundsSettings::new`].
    pub fn for_human(mut self, human: &VehicleModel) -> Result<Self, Invalid> {
        if let Self::Learned(learned) = &mut self {
            let usual = &learned.settings.bounds;
            learned.settings.bounds = BoundsSettings::new(
                in_proportion(usual.epsilon(), human.turn_rate_radps),
                usual.choice().clone(),
                usual.rollout(),
                learned.predictor.classes().len(),
            )?;
        }
        Ok(self)
    }
}

impl From<Learned> for Method {
    fn from(learned: Learned) -> Self {
        Self::Learned(learned)
    }
}

impl From<EmpiricalSets> for Method {
    fn from(sets: EmpiricalSets) -> Self {
        Self::Empirical(Box::new(sets))
    }
}

/// One of the nested sets predicted at a moment, by any method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedSet<'a> {
    /// Its level in the family.
    pub level: Level,
    /// Area of all positions within the steps ahead (m²).
    pub area_m2: f64,
    /// Closed counter-clockwise polygons in the world frame (m). Their union is the set of all
    /// positions within the steps ahead.
    pub tube: &'a [Vec<[f64; 2]>],
    /// The positions after each step, as one polygon per step. Empty unless requested.
    pub steps: &'a [Vec<[f64; 2]>],
}

/// The parameter that determines the size of a set in a nested family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// The widening ε of the turn-rate bounds (rad/s).
    Widening(f64),
    /// The set encloses this share of the recorded futures that followed the currently held input.
    /// At 1, the set is the whole reachable set.
    Share(f64),
    /// The Mahalanobis radius of ellipsoids of the future pose.
    Radius(f64),
}

impl Level {
    /// The level as a number.
    #[must_use]
    pub fn value(self) -> f64 {
        match self {
            Self::Widening(value) | Self::Share(value) | Self::Radius(value) => value,
        }
    }

    /// Column header for levels of this kind.
    #[must_use]
    pub fn column(self) -> &'static str {
        match self {
            Self::Widening(_) => "ε / rad s⁻¹",
            Self::Share(_) => "share",
            Self::Radius(_) => "radius",
        }
    }

    /// Description of the level, with its number.
    #[must_use]
    pub fn words(self) -> String {
        let number = fixed(self.value(), 2);
        match self {
            Self::Widening(_) => format!("ε = {number} rad/s"),
            Self::Share(_) => format!("share of futures {number}"),
            Self::Radius(_) => format!("Mahalanobis radius {number}"),
        }
    }
}

impl<'a> From<&'a NestedSet> for PredictedSet<'a> {
    fn from(set: &'a NestedSet) -> Self {
        Self {
            level: Level::Widening(set.epsilon),
            area_m2: set.area_m2,
            tube: core::slice::from_ref(&set.tube),
            steps: &set.steps,
        }
    }
}

impl<'a> PredictedSet<'a> {
    pub(super) fn of(family: EmpiricalFamily, set: &'a EmpiricalSet) -> Self {
        let level = match family {
            EmpiricalFamily::Empirical => Level::Share(set.level),
            EmpiricalFamily::Gaussian => Level::Radius(set.level),
        };
        Self { level, area_m2: set.area_m2, tube: &set.tube, steps: &set.steps }
    }
}
