//! CPU work for requests: a few pieces at a time, and a few more that wait.

use crate::http::error::ApiError;
use crate::store::StoreError;
use anyhow::Context;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use tokio::sync::Semaphore;

/// Runs pieces of work on threads of their own: as many at a time as leave a processor to the
/// other requests. A client that goes away before its turn costs nothing.
#[derive(Debug)]
pub struct Bounded {
    turns: Arc<Semaphore>,
    waiting: AtomicUsize,
    most_waiting: usize,
}

impl Bounded {
    /// At most `most_waiting` pieces of work wait; further ones are refused.
    #[must_use]
    pub fn new(most_waiting: usize) -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let turns = Arc::new(Semaphore::new((processors - 1).max(1)));
        Self { turns, waiting: AtomicUsize::new(0), most_waiting }
    }

    /// A place in the line, to be used when there is work.
    ///
    /// # Errors
    /// 503 if too many pieces of work are waiting.
    pub fn queue(&self) -> Result<InLine<'_>, ApiError> {
        let waiting = Waiting::among(&self.waiting);
        if waiting.ahead >= self.most_waiting {
            return Err(StoreError::Busy.into());
        }
        Ok(InLine { turns: &self.turns, waiting })
    }
}

/// A place in the line.
#[derive(Debug)]
pub struct InLine<'a> {
    turns: &'a Arc<Semaphore>,
    waiting: Waiting<'a>,
}

impl InLine<'_> {
    /// Runs `work` when it is its turn, and returns its result.
    ///
    /// # Errors
    /// If the work panics.
    pub async fn run<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let turn = Arc::clone(self.turns).acquire_owned().await.context("a turn")?;
        drop(self.waiting);
        let done = tokio::task::spawn_blocking(move || {
            // Held until the work is done, even if no request waits for it any more.
            let _turn = turn;
            work()
        });
        Ok(done.await.context("work for a request")?)
    }
}

/// Counts as waiting until it is dropped.
#[derive(Debug)]
struct Waiting<'a> {
    all: &'a AtomicUsize,
    ahead: usize,
}

impl<'a> Waiting<'a> {
    fn among(all: &'a AtomicUsize) -> Self {
        Self { all, ahead: all.fetch_add(1, Ordering::Relaxed) }
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.all.fetch_sub(1, Ordering::Relaxed);
    }
}
