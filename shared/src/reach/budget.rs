//! How much work a question may take, and whether its caller still wants the answer.
//!
//! Work is counted, not timed, so that answers are the same on every machine and in every run. A unit is about what
//! the comparison of two edges takes; what takes longer counts as several.

use core::cell::{Cell, RefCell};
use core::ops::ControlFlow;

/// How far the work on a polygon or on a question of membership is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Units of work done.
    pub done: usize,
    /// The most that may be done. Most work ends long before that.
    pub of: usize,
}

/// The caller stopped the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the work was cancelled")]
pub struct Cancelled;

/// About the largest number of units of work between two questions to the caller whether to go on.
const BETWEEN_REPORTS: usize = 10_000;

/// What answers whether to go on.
type Report<'a> = RefCell<&'a mut dyn FnMut(Progress) -> ControlFlow<()>>;

/// The work that is left.
pub(super) struct Budget<'a> {
    units: usize,
    left: Cell<usize>,
    aside: Cell<usize>,
    spent: Cell<bool>,
    /// What is left when the caller is asked next.
    next_report: Cell<usize>,
    report: Option<&'a dyn Fn(Progress) -> ControlFlow<()>>,
    cancelled: Cell<bool>,
}

impl<'a> Budget<'a> {
    /// With this many units.
    pub(super) fn new(units: usize) -> Self {
        Self {
            units,
            left: Cell::new(units),
            aside: Cell::new(0),
            spent: Cell::new(false),
            next_report: Cell::new(0),
            report: None,
            cancelled: Cell::new(false),
        }
    }

    /// What `work` makes of a budget of `units` whose caller is asked through `progress`.
    pub(super) fn reported<T>(
        units: usize,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
        work: impl FnOnce(&Budget<'_>) -> T,
    ) -> Result<T, Cancelled> {
        let progress: Report<'_> = RefCell::new(progress);
        let report = |now| (progress.borrow_mut())(now);
        let next_report = Cell::new(units);
        let budget = Budget { report: Some(&report), next_report, ..Budget::new(units) };
        let done = work(&budget);
        if budget.is_cancelled() { Err(Cancelled) } else { Ok(done) }
    }

    /// Takes units off. Once there are too few, or the caller has cancelled, the budget is spent, and whoever works stops
    /// where that is convenient and leaves an unfinished result.
    pub(super) fn spend(&self, units: usize) {
        let left = self.left.get();
        self.left.set(left.saturating_sub(units));
        if units > left {
            self.spent.set(true);
        }
        if left <= self.next_report.get() && !self.spent.get() {
            self.ask();
        }
    }

    /// Whether to go on.
    fn ask(&self) {
        let left = self.left.get();
        self.next_report.set(left.saturating_sub(BETWEEN_REPORTS));
        let now = Progress { done: self.done(), of: self.units };
        if self.report.is_some_and(|report| report(now).is_break()) {
            self.cancelled.set(true);
            self.spent.set(true);
        }
    }

    /// Sets one of `parts` of what is left aside, until it is given back.
    pub(super) fn set_aside(&self, parts: usize) -> usize {
        let units = self.left.get() / parts;
        self.left.set(self.left.get() - units);
        self.next_report.set(self.next_report.get().saturating_sub(units));
        self.aside.set(self.aside.get() + units);
        units
    }

    /// Gives back what was set aside; what has been spent since stays spent.
    pub(super) fn give_back(&self, units: usize) {
        self.left.set(self.left.get() + units);
        self.next_report.set(self.next_report.get() + units);
        self.aside.set(self.aside.get() - units);
        self.spent.set(self.is_cancelled());
    }

    /// Units spent so far.
    pub(super) fn done(&self) -> usize {
        self.units - self.left.get() - self.aside.get()
    }

    /// Whether more was to be spent than there was, or the caller has cancelled.
    pub(super) fn is_spent(&self) -> bool {
        self.spent.get()
    }

    /// Whether the caller has cancelled.
    pub(super) fn is_cancelled(&self) -> bool {
        self.cancelled.get()
    }
}
