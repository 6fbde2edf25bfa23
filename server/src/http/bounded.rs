//! Runs CPU-bound jobs for requests. Only a few jobs run at a time, and the other jobs wait in a queue.

use crate::http::error::ApiError;
use crate::store::StoreError;
use crate::support::threads;
use anyhow::Context;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Instant;
use tokio::sync::{Semaphore, oneshot};

/// Runs jobs on separate threads. If possible, one processor stays free for other requests. If a client
/// disconnects while its job waits, the job never runs.
#[derive(Debug)]
pub struct Bounded {
    turns: Arc<Semaphore>,
    waiting: AtomicUsize,
    most_waiting: usize,
    /// The pause after a job, as a multiple of the duration of the job.
    pause: u32,
}

impl Bounded {
    /// Allows at most `most_waiting` jobs to wait, and refuses further jobs.
    #[must_use]
    pub fn new(most_waiting: usize) -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let turns = Arc::new(Semaphore::new((processors - 1).max(1)));
        Self { turns, waiting: AtomicUsize::new(0), most_waiting, pause: 0 }
    }

    /// Adds a pause after each job, `pause` times as long as the job. Even during a flood of requests,
    /// the jobs then occupy their threads for only 1/(1 + `pause`) of the time.
    #[must_use]
    pub fn with_pauses(self, pause: u32) -> Self {
        Self { pause, ..self }
    }

    /// Reserves a place in the queue for a job.
    ///
    /// # Errors
    /// 503 if too many jobs are waiting.
    pub fn queue(&self) -> Result<InLine<'_>, ApiError> {
        let waiting = Waiting::among(&self.waiting);
        if waiting.ahead >= self.most_waiting {
            return Err(StoreError::Busy.into());
        }
        Ok(InLine { turns: &self.turns, waiting, pause: self.pause })
    }
}

/// Runs jobs that unauthenticated clients can request without limit. No request is refused, but each
/// origin has at most one job in the queue. So a flood from one origin delays another origin only by
/// the jobs in progress and by one job per waiting origin.
#[derive(Debug)]
pub struct TakingTurns {
    work: Bounded,
    /// One permit per origin, so that only one request of each origin is in the queue.
    turns: Mutex<HashMap<IpAddr, Weak<Semaphore>>>,
}

impl Default for TakingTurns {
    fn default() -> Self {
        Self { work: Bounded::new(usize::MAX), turns: Mutex::default() }
    }
}

impl TakingTurns {
    /// Waits for the permit of the origin and for a free thread, runs `work`, and returns its result.
    ///
    /// # Errors
    /// If the work panics.
    pub async fn run<T: Send + 'static>(
        &self,
        origin: IpAddr,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let _turn = self.turn(origin).acquire_owned().await.context("a turn")?;
        self.work.queue()?.run(work).await
    }

    fn turn(&self, origin: IpAddr) -> Arc<Semaphore> {
        let mut turns = self.turns.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(turn) = turns.get(&origin).and_then(Weak::upgrade) {
            return turn;
        }
        turns.retain(|_, turn| turn.strong_count() > 0);
        let turn = Arc::new(Semaphore::new(1));
        turns.insert(origin, Arc::downgrade(&turn));
        turn
    }
}

/// A place in the queue.
#[derive(Debug)]
pub struct InLine<'a> {
    turns: &'a Arc<Semaphore>,
    waiting: Waiting<'a>,
    pause: u32,
}

impl InLine<'_> {
    /// Waits for a free thread, runs `work`, and returns its result.
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
        // Hold the permit until the job and its pause are over, even if the request is cancelled.
        tokio::spawn(async move {
            let begun = Instant::now();
            let done = threads::run_in_spare_time("for-a-request", work).await;
            let took = begun.elapsed();
            // If the request was cancelled, there is no receiver.
            let _ = answer.send(done);
            tokio::time::sleep(took * pause).await;
            drop(turn);
        });
        let done = answered.await.context("work for a request")?;
        Ok(done.context("work for a request")?)
    }
}

/// Counts one waiting job until it is dropped.
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;
    use std::time::Duration;

    #[tokio::test]
    async fn another_origin_waits_for_one_piece_of_a_flood() {
        let turns = Arc::new(TakingTurns::default());
        let [flood, other] = [1, 2].map(|last| IpAddr::V4(Ipv4Addr::new(192, 0, 2, last)));
        let done = Arc::new(AtomicUsize::new(0));
        let ask = |origin| {
            let (turns, done) = (Arc::clone(&turns), Arc::clone(&done));
            tokio::spawn(async move {
                let work = move || {
                    std::thread::sleep(Duration::from_millis(10));
                    done.fetch_add(1, Ordering::SeqCst)
                };
                turns.run(origin, work).await.unwrap()
            })
        };
        let asked: Vec<_> = (0..200).map(|_| ask(flood)).collect();
        while done.load(Ordering::SeqCst) == 0 {
            tokio::task::yield_now().await;
        }
        let before = ask(other).await.unwrap();
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        assert!(before < 4 + 2 * processors, "{before} pieces of the flood came first");
        for asked in asked {
            asked.await.unwrap();
        }
        assert_eq!(done.load(Ordering::SeqCst), 201, "nobody was refused");
        drop(turns.turn(other));
        assert_eq!(turns.turns.lock().unwrap().len(), 1, "who is gone is forgotten");
    }
}
