//! Work budgets of queries, and cancellation by the caller.
//!
//! Work is counted, not timed, so that results are the same on every machine and in every run. A
//! unit is about the cost of comparing two edges; more expensive operations count as several units.

use core::cell::{Cell, RefCell};
use core::ops::ControlFlow;

/// Progress of the computation of a polygon, or of a membership query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Units of work done.
    pub done: usize,
    /// The limit on the work. Most queries end far below it.
    pub of: usize,
}

/// The caller cancelled the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the work was cancelled")]
pub struct Cancelled;

/// Approximate largest number of units of work between two progress reports.
const BETWEEN_REPORTS: usize = 10_000;

/// The caller's callback, which decides whether to continue.
type Report<'a> = RefCell<&'a mut dyn FnMut(Progress) -> ControlFlow<()>>;

/// The remaining work of a query.
pub(super) struct Budget<'a> {
    units: usize,
    left: Cell<usize>,
    aside: Cell<usize>,
    spent: Cell<bool>,
    /// When `left` falls to this number of units, the next progress report is due.
    next_report: Cell<usize>,
    report: Option<&'a dyn Fn(Progress) -> ControlFlow<()>>,
    cancelled: Cell<bool>,
}

impl<'a> Budget<'a> {
    /// A budget of `units` without progress reports.
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

    /// Runs `work` with a budget of `units` that reports to `progress`.
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

    /// Subtracts units. If too few are left, or if the caller cancels, the budget counts as spent. The
    /// computation then stops at its next check and leaves an unfinished result.
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

    /// Asks the caller whether to continue.
    fn ask(&self) {
        let left = self.left.get();
        self.next_report.set(left.saturating_sub(BETWEEN_REPORTS));
        let now = Progress { done: self.done(), of: self.units };
        if self.report.is_some_and(|report| report(now).is_break()) {
            self.cancelled.set(true);
            self.spent.set(true);
        }
    }

    /// Sets aside one of `parts` equal parts of the remaining units until [`Self::give_back`]. Returns
    /// the number of units set aside.
    pub(super) fn set_aside(&self, parts: usize) -> usize {
        let units = self.left.get() / parts;
        self.left.set(self.left.get() - units);
        self.next_report.set(self.next_report.get().saturating_sub(units));
        self.aside.set(self.aside.get() + units);
        units
    }

    /// Gives back the units set aside. Units spent in the meantime stay spent.
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

    /// Whether the units ran out or the caller cancelled.
    pub(super) fn is_spent(&self) -> bool {
        self.spent.get()
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.cancelled.get()
    }
}
