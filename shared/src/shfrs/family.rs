//! Nested families of predicted sets: one trait for SHFRS and the baselines.

use super::window::Window;
use crate::invalid::Invalid;

/// Sets that are predicted at the start of a window and grow with a *level*. For SHFRS with `base`
/// roll-outs the level is ε (rad/s); other families define their own level. Levels range from 0 to
/// [`Family::most`]. The set of the largest level contains every window.
///
/// Scores and comparisons use only these functions, so a new predictor of sets needs only one file.
pub trait Family {
    /// The name of the family in tables and files.
    fn name(&self) -> String;

    /// The name of the family's level, with its unit.
    fn level_name(&self) -> &'static str {
        "ε (rad/s)"
    }

    /// The level of the largest set.
    fn most(&self) -> f64;

    /// The score S of a window: the least level, from 0 to [`Self::most`], whose set contains the
    /// window's trajectory at every step.
    ///
    /// # Errors
    /// [`Invalid`] if the prediction fails.
    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid>;

    /// Area (m²) of all positions that the set at a level contains within the window's steps.
    ///
    /// # Errors
    /// [`Invalid`] if the prediction fails.
    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid>;
}
