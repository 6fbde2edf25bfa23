//! A cache of the lengths of archives.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::OnceCell;

/// Capacity of the cache (archives).
const REMEMBERED: usize = 32;

/// The lengths of archives by their tags. The cache keeps the most recently added tags.
#[derive(Debug, Default)]
pub struct Lengths(Mutex<VecDeque<(String, Arc<OnceCell<u64>>)>>);

impl Lengths {
    /// A cell for the length of the archive with this tag. It is empty until the length is known.
    pub fn of(&self, tag: &str) -> Arc<OnceCell<u64>> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, length)) = known.iter().find(|(other, _)| other == tag) {
            return Arc::clone(length);
        }
        known.truncate(REMEMBERED - 1);
        known.push_front((tag.to_owned(), Arc::default()));
        Arc::clone(&known[0].1)
    }
}
