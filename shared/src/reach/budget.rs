//! How much work a polygon may take.
//!
//! Work is counted, not timed, so that polygons are the same on every machine and in every run. A unit is about what
//! the comparison of two edges takes; what takes longer counts as several.

use core::cell::Cell;

/// The work that is left.
#[derive(Debug)]
pub(super) struct Budget {
    left: Cell<usize>,
    spent: Cell<bool>,
}

impl Budget {
    /// With this many units.
    pub(super) fn new(units: usize) -> Self {
        Self { left: Cell::new(units), spent: Cell::new(false) }
    }

    /// Takes units off. Once there are too few, the budget is spent, and whoever works stops where that is
    /// convenient and leaves an unfinished result.
    pub(super) fn spend(&self, units: usize) {
        let left = self.left.get();
        self.left.set(left.saturating_sub(units));
        if units > left {
            self.spent.set(true);
        }
    }

    /// Whether more was to be spent than there was.
    pub(super) fn is_spent(&self) -> bool {
        self.spent.get()
    }
}
