//! Checks that the file that was opened is still at its path and has the content that SQLite wrote.
//!
//! SQLite does not notice when another process deletes, moves, replaces, overwrites or truncates
//! its open file. So this is checked before each read, before and after each commit, and regularly
//! by [`Watch`](super::watch::Watch).

mod content;
mod rescued;

use super::connection;
use super::file::{DatabaseFile, Identity};
use super::log::Index;
use super::mark::{self, Log, Mark, Place};
use crate::store::error::StoreError;
use crate::store::opening::Misplaced;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

/// The file that was opened.
#[derive(Debug)]
pub(super) struct Original {
    file: DatabaseFile,
    identity: Identity,
    /// This handle stays open until the end, because closing any handle of the file releases
    /// SQLite's locks on it.
    handle: File,
    mark: Mutex<Option<(String, Place)>>,
    /// The highest number of commits seen in the file without its log, and the greatest length of
    /// the file (bytes).
    commits: AtomicU64,
    length: AtomicU64,
    /// The change that another process made to the content, if any. It is never cleared.
    changed: OnceLock<&'static str>,
    /// State of the file at the last check.
    written: Mutex<Looked>,
    /// Whether the file must be checked for damage.
    is_suspected: AtomicBool,
    /// Whether the process that changed the content also overwrote data that may exist nowhere else.
    is_overwritten: AtomicBool,
    /// The mark after the last commit of this process.
    last: Mutex<Option<Mark>>,
    /// The log that the writer has open.
    open_log: Mutex<Option<File>>,
    /// The identities of the log and of its index, while the writer has them open.
    companions: Mutex<Option<[Option<Identity>; 2]>>,
    /// The salts of the index, and the highest number of frames seen with them.
    frames: Mutex<([u8; 8], u64)>,
    /// State of the log at the last check.
    log: Mutex<Seen>,
    /// Whether the log is what SQLite wrote.
    has_log: AtomicBool,
    /// State of the log and its index when they were last compared.
    log_read: Mutex<Option<LogRead>>,
    /// Every index of the log that this process has opened. They stay locked and open, because closing
    /// one would release SQLite's locks on it.
    indices: Mutex<Vec<(Identity, File)>>,
    /// Whether rescued data may be written to other folders.
    goes_elsewhere: AtomicBool,
    /// The rescued copy, while the file is not usable.
    rescued: Mutex<Option<PathBuf>>,
    /// The reason why the file could not be used when the writer ended, if its data were not rescued.
    lost: OnceLock<StoreError>,
}

/// When a log was last written to, and the fingerprint of its index.
type LogRead = (SystemTime, Option<u64>);

/// State of a log.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    salts: [u8; 8],
    /// Length of the log (bytes).
    length: u64,
}

/// When a file was last written to, and how many frames of the log checkpoints had copied into it
/// until that time. A checkpoint changes both values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Written {
    at: SystemTime,
    salts: [u8; 8],
    frames: u32,
}

/// State of the checks for writes that other processes make directly to the file.
#[derive(Debug, Default)]
struct Looked {
    last: Option<Written>,
    /// Whether the file was written to without a checkpoint. In this case, another process may be
    /// about to record a checkpoint.
    is_odd: bool,
}

impl Original {
    /// The file that is now at this path. All migrations must be applied. The first regular check
    /// looks for damage if the file is served.
    pub(super) fn new(file: DatabaseFile, is_served: bool) -> Result<Self, StoreError> {
        let identity = file.identity()?;
        let unreadable = |error: std::io::Error| StoreError::Unavailable(error.to_string());
        let handle = File::open(file.path()).map_err(unreadable)?;
        // The mark of a new or newly migrated file may still be only in the log.
        let mark = mark::of_file(&file)?.map(|(mark, place)| (mark.identity, place));
        let length = handle.metadata().map_err(unreadable)?.len();
        Ok(Self {
            file,
            identity,
            handle,
            mark: Mutex::new(mark),
            commits: AtomicU64::new(0),
            length: AtomicU64::new(length),
            changed: OnceLock::new(),
            written: Mutex::default(),
            is_suspected: AtomicBool::new(is_served),
            is_overwritten: AtomicBool::new(false),
            last: Mutex::default(),
            open_log: Mutex::default(),
            companions: Mutex::default(),
            frames: Mutex::default(),
            log: Mutex::default(),
            has_log: AtomicBool::new(true),
            log_read: Mutex::default(),
            indices: Mutex::default(),
            goes_elsewhere: AtomicBool::new(false),
            rescued: Mutex::default(),
            lost: OnceLock::new(),
        })
    }

    /// Checks that the file is the one that was opened, and has the content that SQLite wrote.
    pub(super) fn check(&self) -> Result<(), StoreError> {
        let what = match self.changed.get() {
            Some(what) => what,
            None if !self.is_in_place() => "deleted, moved or replaced",
            None if self.has_older_index() => self.overwritten_index(),
            None => match self.found() {
                None => return Ok(()),
                Some(_) if self.is_found_again() => return Ok(()),
                Some(what) => self.overwritten(what),
            },
        };
        Err(self.gone(what))
    }

    /// Records that another process overwrote the file or the log.
    fn overwritten(&self, what: &'static str) -> &'static str {
        self.is_overwritten.store(true, Ordering::Relaxed);
        self.changed.get_or_init(|| what)
    }

    /// Records that another program has written another database into the file, through SQLite.
    fn replaced(&self) -> &'static str {
        self.overwritten(
            "overwritten with another database, by a program that uses SQLite; stop the server and keep all files: \
             'sidestep salvage' saves what the write-ahead log still has of what was there before",
        )
    }

    /// Checks the mark that the writer reads at the beginning of a transaction.
    pub(super) fn check_mark(&self, found: Option<&Mark>) -> Result<(), StoreError> {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match last.as_ref().is_none_or(|last| found.is_some_and(|found| last.is_before(found))) {
            true => Ok(()),
            false => Err(self.gone(self.replaced())),
        }
    }

    /// Records the mark after a commit of this process.
    pub(super) fn note_mark(&self, mark: Option<Mark>) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = mark;
    }

    fn gone(&self, what: &str) -> StoreError {
        StoreError::Gone(match self.rescued() {
            Some(rescued) if is_log(&rescued) => {
                format!("{what}; the latest data are in {}", rescued.display())
            }
            Some(rescued) => format!("{what}; its data are in {}", rescued.display()),
            None => what.to_owned(),
        })
    }

    /// Records the log and the index that the writer has open, if any.
    pub(super) fn note_companions(&self, are_open: bool) {
        let found = are_open.then(|| self.file.companions());
        if let Some([_, Some(index)]) = found {
            self.keep_index(index);
        }
        *self.companions.lock().unwrap_or_else(PoisonError::into_inner) = found;
        // Closing a handle of the log releases no lock of SQLite.
        let log = found.and_then(|_| File::open(self.file.log()).ok());
        *self.open_log.lock().unwrap_or_else(PoisonError::into_inner) = log;
    }

    /// Keeps an index locked, so that other processes can check whether they share it.
    fn keep_index(&self, identity: Identity) {
        let mut indices = self.indices.lock().unwrap_or_else(PoisonError::into_inner);
        if indices.iter().all(|(kept, _)| *kept != identity)
            && let Ok(index) = File::open(self.file.index())
        {
            // Other writers of this process may hold a lock on it, too.
            let _ = index.try_lock_shared();
            indices.push((identity, index));
        }
    }

    /// Checks the file, its log and all frames of the log. It is called before a checkpoint, which
    /// would copy into the file any frames that another process has overwritten.
    pub(super) fn check_all(&self) -> Result<(), StoreError> {
        self.check_with_log()?;
        let written = std::fs::metadata(self.file.log()).and_then(|log| log.modified()).ok();
        let now = written.map(|at| (at, self.index(true).map(|index| index.fingerprint())));
        let mut read = self.log_read.lock().unwrap_or_else(PoisonError::into_inner);
        if now.is_some() && *read == now {
            return Ok(());
        }
        let log = mark::misplaced(&self.file, || self.index(true));
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let found = connection::reading(&self.file, true).and_then(|db| mark::with_log(&db));
        if !self.is_in_place() {
            return self.check();
        }
        if let (Some(last), Ok(found)) = (last, found)
            && !found.is_some_and(|found| last.is_before(&found))
        {
            self.replaced();
        }
        if matches!(log, Ok(Some(Misplaced::Damaged))) {
            self.has_log.store(false, Ordering::Relaxed);
            self.changed.get_or_init(|| {
                "separated from a part of its write-ahead log or of that log's index (-wal, -shm), which was overwritten; stop \
                 the server and keep all files: 'sidestep check' reads everything if only the index was hit, and 'sidestep salvage' \
                 what is left"
            });
        }
        *read = now;
        self.check()
    }

    /// The index of the log that the writer has open.
    fn index(&self, is_whole: bool) -> Option<Index> {
        let [_, known] = (*self.companions.lock().unwrap_or_else(PoisonError::into_inner))?;
        let indices = self.indices.lock().unwrap_or_else(PoisonError::into_inner);
        let (_, open) = indices.iter().find(|(identity, _)| Some(*identity) == known)?;
        Index::read(open, is_whole)
    }

    /// Number of pages in the log, as its index says. `None` if the index cannot be read.
    pub(super) fn log_pages(&self) -> Option<i64> {
        i64::try_from(self.index(false)?.frames).ok()
    }

    /// Whether the index belongs to another generation of the log than the log file.
    fn has_other_index(&self) -> bool {
        let is_other = || {
            let Some(index) = self.index(false).filter(|index| index.frames > 0) else {
                return false;
            };
            let mut header = [0; 32];
            let log = File::open(self.file.log());
            log.is_ok_and(|log| log.read_exact_at(&mut header, 0).is_ok())
                && header[16..24] != index.salts
        };
        // SQLite restarts a log and its index one after the other, so the check is repeated.
        (0..3).all(|attempt| {
            std::thread::sleep(Duration::from_millis(5 * attempt));
            is_other()
        })
    }

    /// Checks the file and its log, but not the content of the log's frames.
    pub(super) fn check_with_log(&self) -> Result<(), StoreError> {
        self.check()?;
        let known = *self.companions.lock().unwrap_or_else(PoisonError::into_inner);
        if known.is_some_and(|known| known != self.file.companions()) {
            // A connection that has the log and its index open can still read everything.
            return Err(self.gone(
                "separated from its write-ahead log or the log's index (-wal, -shm), which was deleted, moved or replaced",
            ));
        }
        if let Some(what) = self.found_of_log()
            && self.found_of_log().is_some()
        {
            self.has_log.store(false, Ordering::Relaxed);
            self.overwritten(what);
        }
        if self.has_other_index() {
            self.overwritten_index();
        }
        self.check()
    }

    /// Whether the index has fewer frames than before. SQLite would then read an earlier state.
    fn has_older_index(&self) -> bool {
        // The index is read under this lock, so that a thread never compares an outdated number.
        let mut known = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(index) = self.index(false) else { return false };
        let is_older = known.0 == index.salts && index.frames < known.1;
        if !is_older {
            *known = (index.salts, index.frames);
        }
        is_older
    }

    /// Records that another process has overwritten the index of the log. The log keeps its content.
    fn overwritten_index(&self) -> &'static str {
        self.has_log.store(false, Ordering::Relaxed);
        self.changed.get_or_init(|| {
            "separated from the index (-shm) of its write-ahead log, which was overwritten; stop the server and keep all \
             files: the next start reads everything from them, and says so if the log was overwritten, too"
        })
    }

    /// The change that another process made to the log, if any.
    fn found_of_log(&self) -> Option<&'static str> {
        const CUT: &str = "separated from its write-ahead log, which was cut off";
        const OTHER: &str = "separated from its write-ahead log, which was overwritten";
        let mut header = [0; 32];
        // The caller has already checked that the log exists.
        let log = File::open(self.file.log()).ok()?;
        let length = log.metadata().ok()?.len();
        let mut known = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        let is_read = log.read_exact_at(&mut header, 0).is_ok();
        if !is_read || header == [0; 32] {
            if known.length == 0 {
                return None;
            }
            // SQLite empties the log after a complete checkpoint. The index then has no pages.
            let pages =
                connection::reading(&self.file, false).and_then(|db| connection::log_pages(&db));
            if pages != Ok(0) || is_read {
                return Some(CUT);
            }
            *known = Seen::default();
            return None;
        }
        if header[16..24] == known.salts {
            let is_shorter = length < known.length;
            known.length = known.length.max(length);
            return is_shorter.then_some(CUT);
        }
        // The log was restarted after a complete checkpoint.
        let mark = mark::of_file(&self.file).ok()?;
        let log = Log::read(self.file.log(), mark.as_ref(), None).ok()??;
        let [_, last] = log.marks?;
        let (identity, _) = self.mark.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        if last.identity != identity || last.commits < self.commits.load(Ordering::Relaxed) {
            return Some(OTHER);
        }
        *known = Seen { salts: log.salts, length };
        None
    }

    /// Runs a checkpoint. If another process writes to the file at the same time, this cannot be
    /// distinguished from the checkpoint.
    pub(super) fn writing_back<T>(&self, write_back: impl FnOnce() -> T) -> T {
        let mut looked = self.written.try_lock();
        if let Ok(looked) = &mut looked {
            self.look(looked);
            self.is_suspected.fetch_or(looked.is_odd, Ordering::Relaxed);
        }
        let done = write_back();
        if let Ok(looked) = &mut looked {
            **looked = Looked { last: self.written(), is_odd: false };
        }
        done
    }

    fn written(&self) -> Option<Written> {
        let index = self.index(false)?;
        let at = self.handle.metadata().and_then(|found| found.modified()).ok()?;
        Some(Written { at, salts: index.salts, frames: index.written_back })
    }

    /// Records whether another process has written to the file without a checkpoint. Returns
    /// whether the previous check found such a write, and the write has ended.
    fn look(&self, looked: &mut Looked) -> bool {
        let (last, found) = (looked.last, self.written());
        looked.last = found;
        let is_same_log = |(last, found): &(Written, Written)| {
            (last.salts, last.frames) == (found.salts, found.frames)
        };
        let Some((last, found)) = last.zip(found).filter(is_same_log) else {
            looked.is_odd = false;
            return false;
        };
        let was_odd = std::mem::replace(&mut looked.is_odd, last.at != found.at);
        was_odd && !looked.is_odd
    }

    /// Makes SQLite check a served file for damage once at the start, and again after another
    /// process has written directly to the file.
    pub(super) fn check_in_place(&self) {
        // This check comes first, because SQLite would delete the log of a file that was emptied.
        if self.check_with_log().is_err() {
            return;
        }
        let is_over = self.written.try_lock().is_ok_and(|mut looked| self.look(&mut looked));
        if !self.is_suspected.swap(false, Ordering::Relaxed) && !is_over {
            return;
        }
        let db = connection::reading(&self.file, true).map_err(StoreError::from);
        match db.and_then(|db| Ok(connection::first_damage(&db)?)) {
            Ok(None) if is_over => tracing::warn!(
                "another process wrote to the database file; SQLite finds no damage, and 'sidestep check' replays every trial"
            ),
            Ok(None) => {}
            // If the log had just disappeared, the file would only seem damaged.
            Ok(Some(_)) | Err(StoreError::Corrupt(_)) if self.check_with_log().is_ok() => {
                self.changed.get_or_init(
                    || "damaged; stop the server: 'sidestep check' says where, and what to do",
                );
            }
            _ => self.is_suspected.store(true, Ordering::Relaxed),
        }
    }

    /// Whether the content is what SQLite wrote. The file may still have been moved, deleted or replaced.
    pub(super) fn is_whole(&self) -> bool {
        self.changed.get().is_none()
    }

    /// Whether the log is what SQLite wrote.
    pub(super) fn has_log(&self) -> bool {
        self.has_log.load(Ordering::Relaxed)
    }

    /// Whether the file is still at its path.
    pub(super) fn is_in_place(&self) -> bool {
        self.file.identity() == Ok(self.identity)
    }
}

/// Whether a rescue file is only a log.
fn is_log(rescued: &Path) -> bool {
    rescued.extension().is_some_and(|end| end == "rescued-wal")
}
