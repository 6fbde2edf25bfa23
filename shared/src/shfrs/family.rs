//! Nested families of predicted sets, one concept for SHFRS and what they are compared with.

use super::window::Window;
use crate::invalid::Invalid;

/// Sets that are predicted from what is known at the beginning of a window and grow with a
/// *level*. For SHFRS with `base` roll-outs the level is ε, rad/s; another family names its
/// own. Levels run from 0 to [`Family::most`], where the set holds every window.
///
/// Whatever is tuned, tested or compared needs only these few answers, so a new predictor
/// of sets is one file.
pub trait Family {
    /// The family in tables and files.
    fn name(&self) -> String;

    /// What a level is, with its unit.
    fn level_name(&self) -> &'static str {
        "ε (rad/s)"
    }

    /// The level of the largest set.
    fn most(&self) -> f64;

    /// The score S of a window: the least level, from 0 to [`Self::most`], whose set its
    /// trajectory stays inside at every step.
    ///
    /// # Errors
    /// [`Invalid`] if the prediction fails.
    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid>;

    /// Area, m², in the plane of the set of a level that is predicted for a window: of all
    /// positions within its steps.
    ///
    /// # Errors
    /// [`Invalid`] if the prediction fails.
    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid>;
}
