//! Checks whether the content of a file is still the database that was opened.

use super::super::mark::{self, Log, Mark, Place};
use super::Original;
use std::os::unix::fs::FileExt;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::Duration;

impl Original {
    /// The change that another process made to the content, if any.
    pub(super) fn found(&self) -> Option<&'static str> {
        let length = self.handle.metadata().map_or(0, |found| found.len());
        if length < self.length.fetch_max(length, Ordering::Relaxed) {
            return Some("cut off");
        }
        let mark = self.mark.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (identity, place) = mark?;
        self.found_at(&identity, place)
    }

    /// Like [`Self::found`], for a mark with this identity at this place.
    fn found_at(&self, identity: &str, place: Place) -> Option<&'static str> {
        let mut page = vec![0; place.length];
        let read = self.handle.read_exact_at(&mut page, place.offset);
        match read.ok().and_then(|()| Mark::find(&page)) {
            Some(mark) if mark.identity != identity => Some("overwritten with another database"),
            Some(mark)
                if mark.commits < self.commits.fetch_max(mark.commits, Ordering::Relaxed) =>
            {
                Some("overwritten with an older copy")
            }
            Some(_) => None,
            None => Some("overwritten"),
        }
    }

    /// Whether the mark is found by a retry, or on the page to which VACUUM has moved it. While
    /// SQLite writes the page, a read may be torn.
    pub(super) fn is_found_again(&self) -> bool {
        (1..=4).any(|attempt| {
            std::thread::sleep(Duration::from_millis(5 * attempt));
            self.found().is_none() || self.is_elsewhere()
        })
    }

    /// Whether VACUUM has moved the mark.
    fn is_elsewhere(&self) -> bool {
        let Ok(Some((found, place))) = mark::by_sqlite(&self.file) else { return false };
        let known = self.mark.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Some((identity, _)) = known.filter(|(known, _)| *known == found.identity) else {
            return false;
        };
        // A copy that was written over the file can also have its mark on another page. But then
        // the log has no mark on this page.
        let log = Log::read(self.file.log(), Some(&(found, place)), None);
        if !log.is_ok_and(|log| log.is_none_or(|log| log.is_of_place())) {
            return false;
        }
        // VACUUM shortens the file. The header contains the page size and the new number of pages.
        let mut header = [0; 100];
        let length = self.handle.metadata().map_or(0, |found| found.len());
        if self.handle.read_exact_at(&mut header, 0).is_err() {
            return false;
        }
        let page = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            page => u64::from(page),
        };
        let pages = u32::from_be_bytes([header[28], header[29], header[30], header[31]]);
        if length < page * u64::from(pages) || self.found_at(&identity, place).is_some() {
            return false;
        }
        *self.mark.lock().unwrap_or_else(PoisonError::into_inner) = Some((identity, place));
        self.length.store(length, Ordering::Relaxed);
        self.found().is_none()
    }
}
