//! Limits how fast an address can guess keys.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Counts wrong keys by address, in memory, over the last minute.
#[derive(Debug, Default)]
pub struct Throttle {
    failures: Mutex<HashMap<IpAddr, (Instant, u32)>>,
}

/// Number of wrong keys that an address may send in a minute.
const ALLOWED: u32 = 10;
const WINDOW: Duration = Duration::from_secs(60);

impl Throttle {
    /// Seconds to wait, if `address` has sent too many wrong keys. Right keys are refused then as well;
    /// otherwise guessing would continue unhindered.
    pub fn wait_s(&self, address: IpAddr) -> Option<u64> {
        let failures = self.failures.lock().unwrap_or_else(PoisonError::into_inner);
        let (since, count) = failures.get(&address).copied()?;
        let left = WINDOW.checked_sub(since.elapsed())?;
        (count >= ALLOWED).then_some(left.as_secs() + 1)
    }

    /// Counts a wrong key.
    pub fn failed(&self, address: IpAddr) {
        let mut failures = self.failures.lock().unwrap_or_else(PoisonError::into_inner);
        // Old entries are removed here, so the table covers at most a minute.
        failures.retain(|_, (since, _)| since.elapsed() < WINDOW);
        failures.entry(address).or_insert((Instant::now(), 0)).1 += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_wrong_keys_and_out_but_only_from_there() {
        let throttle = Throttle::default();
        let (here, there) = (IpAddr::from([127, 0, 0, 1]), IpAddr::from([127, 0, 0, 2]));
        for _ in 0..ALLOWED {
            assert_eq!(throttle.wait_s(here), None);
            throttle.failed(here);
        }
        assert!(throttle.wait_s(here).is_some_and(|s| (1..=60).contains(&s)));
        assert_eq!(throttle.wait_s(there), None);
    }
}
