//! Handling of Ctrl-C during long computations, while the interpreter is released.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// Interval between two checks for interrupts.
const BETWEEN_LOOKS: Duration = Duration::from_millis(100);

/// Checks at intervals whether the user pressed Ctrl-C or whether a callable raised an exception.
pub(crate) struct Watch {
    looked: Instant,
    raised: Option<PyErr>,
}

impl Watch {
    pub(crate) fn new() -> Self {
        Self { looked: Instant::now(), raised: None }
    }

    /// Performs a check if one is due. Returns whether to continue.
    pub(crate) fn look(&mut self) -> ControlFlow<()> {
        self.tell(|_| Ok(()))
    }

    /// If a check is due, performs it and calls `told`. Returns whether to continue.
    pub(crate) fn tell(
        &mut self,
        told: impl FnOnce(Python<'_>) -> PyResult<()>,
    ) -> ControlFlow<()> {
        if self.raised.is_none() {
            if self.looked.elapsed() < BETWEEN_LOOKS {
                return ControlFlow::Continue(());
            }
            let answer = Python::attach(|py| {
                py.check_signals()?;
                told(py)
            });
            self.raised = answer.err();
            self.looked = Instant::now();
        }
        if self.raised.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Raises the pending exception, if any.
    pub(crate) fn end(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

/// Computes one result for each of `count` items while the interpreter is released. Ctrl-C cancels
/// the computation.
pub(crate) fn each<T: Send>(
    py: Python<'_>,
    count: usize,
    of: impl FnMut(usize) -> T + Send,
) -> PyResult<Vec<T>> {
    let mut watch = Watch::new();
    let mut of = of;
    let found = py.detach(|| {
        let mut found = Vec::with_capacity(count);
        for i in 0..count {
            if watch.look().is_break() {
                break;
            }
            found.push(of(i));
        }
        found
    });
    watch.end()?;
    Ok(found)
}
