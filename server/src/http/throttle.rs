//! How often somebody may do something.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Counts what each of many (addresses, tokens) does. Everybody may do it `burst` times at once, and gets one
/// more for each `pause` that passes.
///
/// The counts are in this server's memory. All that is asked of them are the two operations below, so that
/// servers of one database can keep them together.
#[derive(Debug)]
pub struct Throttle<Who> {
    burst: u32,
    pause: Duration,
    /// For each, when they will have all their `burst` again.
    full_at: Mutex<HashMap<Who, Instant>>,
}

/// The table is searched for entries that say nothing any more when it has so many.
const MANY: usize = 10_000;

impl<Who: Eq + Hash> Throttle<Who> {
    /// A throttle that has counted nothing yet.
    #[must_use]
    pub fn new(burst: u32, pause: Duration) -> Self {
        Self { burst, pause, full_at: Mutex::default() }
    }

    /// Counts one more.
    ///
    /// # Errors
    /// The time after which they may, if they may not now; then nothing is counted.
    pub async fn take(&self, who: Who) -> Result<(), Duration> {
        self.take_at(who, Instant::now())
    }

    /// Whether they may do nothing more now.
    pub async fn is_spent(&self, who: &Who) -> bool {
        let full_at = self.full_at.lock().unwrap_or_else(PoisonError::into_inner);
        let left = full_at.get(who).map(|at| at.saturating_duration_since(Instant::now()));
        left.is_some_and(|left| left + self.pause > self.whole())
    }

    /// The time in which everything that was spent comes back.
    fn whole(&self) -> Duration {
        self.pause * self.burst
    }

    fn take_at(&self, who: Who, now: Instant) -> Result<(), Duration> {
        let mut full_at = self.full_at.lock().unwrap_or_else(PoisonError::into_inner);
        if full_at.len() >= MANY && full_at.len().is_power_of_two() {
            full_at.retain(|_, at| *at > now);
        }
        let at = full_at.entry(who).or_insert(now);
        let after = (*at).max(now) + self.pause;
        let over = (after - now).saturating_sub(self.whole());
        if over > Duration::ZERO {
            return Err(over);
        }
        *at = after;
        Ok(())
    }
}

/// Whole seconds for `Retry-After`, at least one.
#[must_use]
pub fn seconds(wait: Duration) -> u64 {
    wait.as_secs() + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_and_then_one_for_each_pause() {
        let pause = Duration::from_secs(6);
        let throttle = Throttle::new(10, pause);
        let begin = Instant::now();
        for _ in 0..10 {
            assert_eq!(throttle.take_at("here", begin), Ok(()));
        }
        assert_eq!(throttle.take_at("here", begin), Err(pause));
        assert_eq!(throttle.take_at("there", begin), Ok(()));
        let later = begin + Duration::from_secs(13);
        assert_eq!([(); 3].map(|()| throttle.take_at("here", later).is_ok()), [true, true, false]);
        assert_eq!(seconds(pause), 7);
    }

    #[tokio::test]
    async fn who_has_spent_all_is_known() {
        let throttle = Throttle::new(2, Duration::from_secs(60));
        for spent in [false, false, true] {
            assert_eq!(throttle.is_spent(&7).await, spent);
            let _ = throttle.take(7).await;
        }
        assert!(!throttle.is_spent(&8).await);
    }

    #[test]
    fn the_table_forgets_what_is_over() {
        let throttle = Throttle::new(1, Duration::from_millis(1));
        let begin = Instant::now();
        for who in 0..100_000_u32 {
            let now = begin + Duration::from_millis(u64::from(who));
            assert_eq!(throttle.take_at(who, now), Ok(()));
        }
        assert!(throttle.full_at.lock().unwrap().len() <= 1 << 14);
    }
}
