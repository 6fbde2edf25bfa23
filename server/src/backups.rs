//! Backups. A backup is one SQLite file with the whole database. It is complete and checked before
//! it gets its name.

use crate::database_check::{self, Report};
use crate::store::{OpenError, Purpose, Store, StoreError};
use crate::support::clock::date_time;
use crate::support::private::Unfinished;
use crate::transfer::{self, TransferError};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use tokio_util::sync::CancellationToken;

/// Name prefix of the temporary folders in which backups are written or restored.
pub(crate) const UNFINISHED: &str = ".sidestep-backup-";

/// The reason why a backup failed.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// The database or its copy cannot be read.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The copy cannot be opened.
    #[error("{0}")]
    Open(#[from] OpenError),
    /// The copy is incomplete.
    #[error("{0}")]
    Transfer(#[from] TransferError),
    /// The file cannot be written.
    #[error("{}: cannot write: {error}", file.display())]
    Unwritable {
        /// The backup.
        file: PathBuf,
        /// The cause.
        error: io::Error,
    },
    /// The database has faults.
    #[error("{}: the database is not sound, nothing was written: {first}; see 'sidestep check'", file.display())]
    Unsound {
        /// The backup.
        file: PathBuf,
        /// The first fault.
        first: String,
    },
}

/// How a backup treats faulty trials. A trial is faulty if it does not replay from its inputs, or
/// does not match the numbers stored with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultyTrials {
    /// A backup with a faulty trial is refused.
    Refused,
    /// Faulty trials are copied unchanged and do not prevent the backup.
    Kept,
}

/// A backup that was written.
#[derive(Debug)]
pub struct Written {
    /// Length (bytes).
    pub bytes: u64,
    /// The check of its content.
    pub report: Report,
}

/// Writes a backup to `out`, a new file that only its owner can read. Every trial is replayed
/// before the file gets its name. A faulty trial is an error unless `accepted` is
/// [`FaultyTrials::Kept`]; damage to the database file is always an error. If the database is
/// PostgreSQL, participants are copied one by one, and `progress` gets the number of copied
/// participants and their total.
///
/// # Errors
/// [`BackupError`]; in this case no file is created.
pub async fn write(
    store: &Store,
    out: &Path,
    accepted: FaultyTrials,
    cancel: &CancellationToken,
    progress: impl FnMut(usize, usize),
) -> Result<Written, BackupError> {
    let unwritable = |error| BackupError::Unwritable { file: out.to_owned(), error };
    let parent = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    // When the backup is opened, SQLite would apply this log to it, although the log belongs to
    // another database.
    if Store::has_log(out) {
        let found =
            "there is the write-ahead log of a database of this name; move it to another folder";
        return Err(unwritable(io::Error::other(found)));
    }
    let folder = Unfinished::within(UNFINISHED, parent).map_err(unwritable)?;
    let file = folder.path().join("backup.db");
    let url = format!("sqlite:{}", file.display());
    let full = |error| match error {
        StoreError::Full => unwritable(io::ErrorKind::StorageFull.into()),
        other => other.into(),
    };
    if !store.write_snapshot(&file).await.map_err(full)? {
        let copy = Store::open(&url, Purpose::Create).await?;
        transfer::copy(store, &copy, &store.slugs().await?, cancel, progress).await?;
        copy.put_access_copy(store.access_copy().await?).await?;
        copy.close().await;
    }
    let copy = Store::open(&url, Purpose::Read).await?;
    let report = cancel.run_until_cancelled(database_check::report(&copy)).await;
    copy.close().await;
    let report = report.ok_or(TransferError::Stopped)??;
    sound(out, &report, accepted)?;
    File::open(&file)
        .and_then(|written| written.sync_all())
        .and_then(|()| std::fs::hard_link(&file, out))
        .and_then(|()| File::open(parent)?.sync_all())
        .map_err(unwritable)?;
    let bytes = std::fs::metadata(out).map_err(unwritable)?.len();
    Ok(Written { bytes, report })
}

/// Refuses a database with faults. If `accepted` is [`FaultyTrials::Kept`], faulty trials are
/// allowed, and only damage is refused.
///
/// # Errors
/// [`BackupError::Unsound`] with the first fault.
pub fn sound(file: &Path, report: &Report, accepted: FaultyTrials) -> Result<(), BackupError> {
    match report.first() {
        None => Ok(()),
        Some(_) if accepted == FaultyTrials::Kept && report.damage.is_empty() => Ok(()),
        Some(first) => Err(BackupError::Unsound { file: file.to_owned(), first }),
    }
}

/// Suffix of the names of a database's backups. `code` is the database's [`Store::code`].
fn end(code: &str) -> String {
    format!("Z-{code}.db")
}

/// Name of a backup that is written at `now_ms` (ms since 1970), such as
/// `sidestep-20261125T043000Z-1f0c9a37.db`. `code` is the database's [`Store::code`].
#[must_use]
pub fn name(code: &str, now_ms: i64) -> String {
    let time: String = date_time(now_ms).chars().filter(|c| !"-:".contains(*c)).collect();
    format!("sidestep-{}{}", time.trim_end_matches('Z'), end(code))
}

/// The backups of a database in a folder, oldest first. All other files are ignored, including the
/// backups of other databases.
///
/// # Errors
/// If the folder cannot be read.
pub fn list(folder: &Path, code: &str) -> io::Result<Vec<PathBuf>> {
    let end = end(code);
    let is_one = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str());
        let time = name.and_then(|name| name.strip_prefix("sidestep-")?.strip_suffix(&*end));
        time.is_some_and(|time| {
            let is_digit =
                |(i, b): (usize, u8)| if i == 8 { b == b'T' } else { b.is_ascii_digit() };
            time.len() == 15 && time.bytes().enumerate().all(is_digit)
        })
    };
    let entries = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut found: Vec<_> = entries.collect::<io::Result<_>>()?;
    found.retain(is_one);
    found.sort();
    Ok(found)
}

/// Deletes the backups of a database in a folder, except for the newest `keep` backups and the
/// backup with the name `written`. Returns the number of deleted files.
///
/// # Errors
/// If a file cannot be deleted.
pub fn prune(folder: &Path, code: &str, keep: usize, written: &str) -> io::Result<usize> {
    let mut old = list(folder, code)?;
    old.truncate(old.len().saturating_sub(keep));
    // If the clock was wrong, older backups can have later times in their names.
    old.retain(|file| *file != folder.join(written));
    old.iter().try_for_each(std::fs::remove_file)?;
    Ok(old.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn the_newest_backups_are_kept_and_other_files_too() {
        let folder = TempDir::new().unwrap();
        let names = [0, 86_400_000, 1_795_000_000_000].map(|at_ms| name("1f0c9a37", at_ms));
        assert_eq!(names[0], "sidestep-19700101T000000Z-1f0c9a37.db");
        let another = name("00000000", 0);
        let others = [&*another, "sidestep.db", "sidestep-19700101T00000xZ-1f0c9a37.db"];
        for name in names.iter().map(String::as_str).chain(others) {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let prune = |keep, written| prune(folder.path(), "1f0c9a37", keep, written).unwrap();
        assert_eq!(prune(3, &names[2]), 0);
        assert_eq!(prune(2, &names[0]), 0);
        assert_eq!(prune(2, &names[2]), 1);
        let left = list(folder.path(), "1f0c9a37").unwrap();
        assert_eq!(left, [&names[1], &names[2]].map(|name| folder.path().join(name)));
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
    }
}
