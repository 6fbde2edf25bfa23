//! The steps of a slice in which the bounds leave a choice.

use super::super::paths::Paths;

/// The paths of a number of steps that end with a given heading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span<'a> {
    pub(super) paths: &'a Paths,
    /// Number of steps of the paths.
    pub(super) steps: usize,
    /// The first step with a choice, and the step after the last one with a choice. All paths move and
    /// turn identically in earlier and in later steps.
    pub(super) first: usize,
    pub(super) last: usize,
    /// Heading at the end (rad in the human's frame, not wrapped).
    pub(super) heading: f64,
}

impl<'a> Span<'a> {
    pub(super) fn new(paths: &'a Paths, steps: usize, heading: f64) -> Self {
        let choice = |step: &usize| paths.lo[*step] < paths.hi[*step];
        let first = (0..steps).find(choice).unwrap_or(0);
        let last = (first..steps).rfind(choice).map_or(first, |step| step + 1);
        Self { paths, steps, first, last, heading }
    }

    /// The lowest and highest rate of each step from `first` to before `last` (rad/s).
    pub(super) fn bounds(&self) -> impl Iterator<Item = (f64, f64)> + use<'a> {
        let (lo, hi) = (&self.paths.lo, &self.paths.hi);
        (self.first..self.last).map(|step| (lo[step], hi[step]))
    }

    /// Heading after the last step with a choice (rad).
    pub(super) fn last_heading(&self) -> f64 {
        let low = &self.paths.low;
        self.heading - (low.heading(self.steps) - low.heading(self.last))
    }
}
