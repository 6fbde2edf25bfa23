//! CPU work for requests: a few pieces at a time, and a few more that wait.

use crate::http::error::ApiError;
use crate::store::StoreError;
use crate::threads;
use anyhow::Context;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use tokio::sync::{Semaphore, oneshot};

/// Runs pieces of work on threads of their own: as many at a time as leave a processor to the
/// other requests. A client that goes away before its turn costs nothing.
#[derive(Debug)]
pub struct Bounded {
    turns: Arc<Semaphore>,
    waiting: AtomicUsize,
    most_waiting: usize,
    /// The pause after a piece of work, as a multiple of the time that the work took.
    pause: u32,
}

impl Bounded {
    /// At most `most_waiting` pieces of work wait; further ones are refused.
    #[must_use]
    pub fn new(most_waiting: usize) -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let turns = Arc::new(Semaphore::new((processors - 1).max(1)));
        Self { turns, waiting: AtomicUsize::new(0), most_waiting, pause: 0 }
    }

    /// The same, with a pause after each piece of work that is `pause` times as long as the work. A flood of
    /// requests then leaves most of the time to other requests.
    #[must_use]
    pub fn with_pauses(self, pause: u32) -> Self {
        Self { pause, ..self }
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
        Ok(InLine { turns: &self.turns, waiting, pause: self.pause })
    }
}

/// A place in the line.
#[derive(Debug)]
pub struct InLine<'a> {
    turns: &'a Arc<Semaphore>,
    waiting: Waiting<'a>,
    pause: u32,
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
        let pause = self.pause;
        let (answer, answered) = oneshot::channel();
        // The turn is held until the work and its pause are over, even if no request waits any more.
        tokio::spawn(async move {
            let begun = Instant::now();
            let done = threads::run_in_spare_time("for-a-request", work).await;
            let took = begun.elapsed();
            // Nobody hears it if the request is gone.
            let _ = answer.send(done);
            tokio::time::sleep(took * pause).await;
            drop(turn);
        });
        let done = answered.await.context("work for a request")?;
        Ok(done.context("work for a request")?)
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
