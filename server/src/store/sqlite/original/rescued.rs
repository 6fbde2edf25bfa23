//! The remaining data of a file that another process has changed, and whether these data were rescued.

use super::super::log::Frames;
use super::super::mark::Log;
use super::{Original, is_log};
use crate::store::error::StoreError;
use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::{SystemTime, UNIX_EPOCH};

/// Length (bytes) above which a name is shortened, so that the name of the rescue file fits.
const LONGEST_NAME: usize = 200;

impl Original {
    pub(in crate::store::sqlite) fn rescued(&self) -> Option<PathBuf> {
        self.rescued.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Records the rescued copy, or `None` once the file is back.
    pub(in crate::store::sqlite) fn note_rescued(&self, file: Option<PathBuf>) {
        *self.rescued.lock().unwrap_or_else(PoisonError::into_inner) = file;
    }

    /// Whether the data of a changed file still have to be rescued. A rescued log is not enough
    /// once the file itself is gone.
    pub(in crate::store::sqlite) fn lacks_rescue(&self) -> bool {
        let log = || self.has_log() && (self.is_whole() || self.latest_log().is_some());
        match self.rescued() {
            None => !self.is_in_place() || log(),
            Some(rescued) => is_log(&rescued) && !self.is_in_place(),
        }
    }

    /// Whether data were overwritten and nothing was rescued.
    pub(in crate::store::sqlite) fn has_lost_data(&self) -> bool {
        self.is_overwritten.load(Ordering::Relaxed) && self.rescued().is_none()
    }

    /// When the writer ends, records why the file cannot be used, if its data were not rescued.
    pub(in crate::store::sqlite) fn note_lost(&self, error: StoreError) {
        let _ = self.lost.set(error);
    }

    /// The reason why the file could not be used when the writer ended, if its data were not rescued.
    pub(in crate::store::sqlite) fn lost(&self) -> Option<StoreError> {
        self.lost.get().cloned()
    }

    /// Copies the content of the open file into another file, even if the open file was renamed or deleted.
    pub(in crate::store::sqlite) fn copy_to(&self, mut out: &File) -> std::io::Result<()> {
        let (mut piece, mut at) = (vec![0; 1 << 20], 0);
        loop {
            let length = self.handle.read_at(&mut piece, at)?;
            if length == 0 {
                return out.sync_all();
            }
            out.write_all(&piece[..length])?;
            at += length as u64;
        }
    }

    /// The log that the writer has open, unless it is empty. Another process may have deleted or
    /// overwritten it.
    pub(in crate::store::sqlite) fn open_log(&self) -> Option<File> {
        let log = self.open_log.lock().unwrap_or_else(PoisonError::into_inner);
        let log = log.as_ref()?.try_clone().ok()?;
        log.metadata().is_ok_and(|found| found.len() > 0).then_some(log)
    }

    /// The log that the writer has open, if it contains the last commit of this process.
    pub(in crate::store::sqlite) fn latest_log(&self) -> Option<File> {
        let place = self.mark.lock().unwrap_or_else(PoisonError::into_inner).clone()?.1;
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let log = self.open_log()?;
        let Some(last) = last else { return Some(log) };
        let frames = Frames::of(log.try_clone().ok()?, Some(place.length)).ok()??;
        let found = Log::of(frames, Some(&(last.clone(), place)), None).ok()??;
        found.marks.is_some_and(|[_, found]| last.is_before(&found)).then_some(log)
    }

    /// Allows rescue files in folders other than the database's.
    pub(in crate::store::sqlite) fn rescue_elsewhere(&self) {
        self.goes_elsewhere.store(true, Ordering::Relaxed);
    }

    /// New names for a rescue file, in the order in which to try them: beside the database and, if
    /// allowed, in the working directory and in the temporary directory.
    pub(in crate::store::sqlite) fn rescue_names(&self) -> impl Iterator<Item = PathBuf> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut name = self.file.path().file_name().unwrap_or_default().to_owned();
        // File systems limit the length of a name to 255 bytes.
        if name.len() > LONGEST_NAME {
            name = name.to_string_lossy().chars().take(LONGEST_NAME / 4).collect::<String>().into();
        }
        name.push(format!(".{}.rescued", now.as_millis()));
        let elsewhere = std::env::current_dir().into_iter().chain([std::env::temp_dir()]);
        let elsewhere = elsewhere.filter(|_| self.goes_elsewhere.load(Ordering::Relaxed));
        let beside = std::path::absolute(self.file.folder());
        let beside = beside.unwrap_or_else(|_| self.file.folder().to_owned());
        let folders = std::iter::once(beside).chain(elsewhere);
        folders.map(move |folder| folder.join(&name))
    }
}
