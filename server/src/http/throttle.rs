//! Rate limits, counted in memory or in a shared database.

use crate::store::Store;
use crate::store::throttles::Allowance;
use crate::support::secrets;
use std::collections::HashMap;
use std::hash::Hash;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A token bucket for each of many keys, such as client addresses. A bucket holds at most `burst`
/// tokens, and regains one token after each `pause`. Every counted action takes one token. The
/// buckets are in this server's memory.
#[derive(Debug)]
pub struct Throttle<Who> {
    burst: u32,
    pause: Duration,
    /// The time at which the bucket of each key will be full again.
    full_at: Mutex<HashMap<Who, Instant>>,
}

/// A rate limit for rare actions. The limit must not grow with the number of servers, so servers
/// that share a database use the same counts.
#[derive(Debug)]
pub struct SharedThrottle {
    here: Throttle<IpAddr>,
    /// The kind of action, as stored in the database.
    kind: &'static str,
    /// The database, if several servers share it.
    store: Option<Store>,
    /// For each address, the time until which the database refuses it. The server does not ask the
    /// database again before this time, so the refused requests of a flood do not load the database.
    told: Mutex<HashMap<IpAddr, Instant>>,
}

impl SharedThrottle {
    /// A rate limit of this kind. It is counted in the database if several servers share it, and
    /// otherwise in memory.
    #[must_use]
    pub fn new(store: &Store, kind: &'static str, burst: u32, pause: Duration) -> Self {
        let store = store.is_shared().then(|| store.clone());
        Self { here: Throttle::new(burst, pause), kind, store, told: Mutex::default() }
    }

    fn allowed(&self) -> Allowance {
        let ms = |time: Duration| i64::try_from(time.as_millis()).unwrap_or(i64::MAX);
        Allowance {
            kind: self.kind,
            pause_ms: ms(self.here.pause),
            burst_ms: ms(self.here.whole()),
        }
    }

    /// Takes a token for this address.
    ///
    /// # Errors
    /// The waiting time, if no token is available now. In this case nothing is counted.
    pub async fn take(&self, who: IpAddr) -> Result<(), Duration> {
        let Some(store) = &self.store else { return self.here.take(who) };
        if let Some(wait) = self.told_to_wait(who, Instant::now()) {
            return Err(wait);
        }
        match store.take_turn(self.allowed(), hashed(who)).await {
            Ok(taken) => taken.map_err(|ms| {
                let wait = Duration::from_millis(ms.unsigned_abs());
                self.tell_to_wait(who, Instant::now(), wait);
                wait
            }),
            // While the database is unavailable, each server counts on its own.
            Err(_) => self.here.take(who),
        }
    }

    /// The remaining waiting time, if the database refused this address.
    fn told_to_wait(&self, who: IpAddr, now: Instant) -> Option<Duration> {
        let told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        told.get(&who)?.checked_duration_since(now).filter(|wait| !wait.is_zero())
    }

    fn tell_to_wait(&self, who: IpAddr, now: Instant, wait: Duration) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if told.len() >= MANY {
            told.retain(|_, until| *until > now);
        }
        if told.len() < MANY {
            told.insert(who, now + wait);
        }
    }

    /// Whether no token is available now.
    pub async fn is_spent(&self, who: IpAddr) -> bool {
        if let Some(store) = &self.store
            && let Ok(spent) = store.has_no_turn(self.allowed(), hashed(who)).await
        {
            return spent;
        }
        self.here.is_spent(&who)
    }
}

fn hashed(who: IpAddr) -> [u8; 32] {
    secrets::hash(&who.to_string())
}

/// Table size at which expired entries are removed.
const MANY: usize = 10_000;

impl<Who: Eq + Hash> Throttle<Who> {
    /// A new rate limit.
    #[must_use]
    pub fn new(burst: u32, pause: Duration) -> Self {
        Self { burst, pause, full_at: Mutex::default() }
    }

    /// Takes a token for this key.
    ///
    /// # Errors
    /// The waiting time, if no token is available now. In this case nothing is counted.
    pub fn take(&self, who: Who) -> Result<(), Duration> {
        self.take_at(who, Instant::now())
    }

    /// Whether no token is available now.
    pub fn is_spent(&self, who: &Who) -> bool {
        let full_at = self.full_at.lock().unwrap_or_else(PoisonError::into_inner);
        let left = full_at.get(who).map(|at| at.saturating_duration_since(Instant::now()));
        left.is_some_and(|left| left + self.pause > self.whole())
    }

    /// The time in which an empty bucket becomes full.
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

/// The value of `Retry-After` for this waiting time, in whole seconds, at least one.
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
    async fn who_was_told_to_wait_is_refused_until_then() {
        let folder = tempfile::tempdir().unwrap();
        let url = format!("sqlite:{}", folder.path().join("study.db").display());
        let store = Store::open(&url, crate::store::Purpose::Create).await.unwrap();
        let throttle = SharedThrottle::new(&store, "tries", 1, Duration::from_secs(1));
        let [who, other] = [1, 2].map(|last| IpAddr::from([127, 0, 0, last]));
        let now = Instant::now();
        assert_eq!(throttle.told_to_wait(who, now), None);
        let second = Duration::from_secs(1);
        throttle.tell_to_wait(who, now, second);
        assert_eq!(throttle.told_to_wait(who, now + second / 4), Some(second * 3 / 4));
        assert_eq!(throttle.told_to_wait(who, now + second * 2), None);
        assert_eq!(throttle.told_to_wait(other, now), None);
        for last in 0..30_000_u32 {
            throttle.tell_to_wait(std::net::Ipv4Addr::from(last).into(), now, second);
        }
        assert!(throttle.told.lock().unwrap().len() <= MANY);
    }

    #[test]
    fn who_has_spent_all_is_known() {
        let throttle = Throttle::new(2, Duration::from_secs(60));
        for spent in [false, false, true] {
            assert_eq!(throttle.is_spent(&7), spent);
            let _ = throttle.take(7);
        }
        assert!(!throttle.is_spent(&8));
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
