//! Whether the file that was opened is still there, and as SQLite left it.
//!
//! SQLite does not notice when somebody deletes, moves, replaces, overwrites or cuts off the file that it has open. So
//! this is looked at before each read, before and after each commit, and by [`Watch`] all the time.

use super::connection;
use super::file::{DatabaseFile, Identity};
use super::log::Index;
use super::mark::{self, Log, Mark, Misplaced, Place};
use crate::store::error::StoreError;
use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// How often the file is looked at when nobody uses it.
const WATCH: Duration = Duration::from_millis(250);

/// In which of these rounds the whole log is read, if it was written to.
const READ_LOG: usize = 3;

/// After which pause a rescue that failed is tried again.
const AGAIN: Duration = Duration::from_secs(2);

/// The file that was opened first.
#[derive(Debug)]
pub(super) struct Original {
    file: DatabaseFile,
    identity: Identity,
    /// Kept open until the end: whoever closes any handle of the file gives up SQLite's locks on it.
    handle: File,
    mark: Mutex<Option<(String, Place)>>,
    /// The most commits that the file itself has had, and its greatest length, bytes.
    commits: AtomicU64,
    length: AtomicU64,
    /// What somebody has done to the content; it cannot be undone.
    changed: OnceLock<&'static str>,
    /// The file when it was last looked at.
    written: Mutex<Looked>,
    /// Whether it is to be searched for damage.
    is_suspected: AtomicBool,
    /// The log and its index, as the writer has them open.
    companions: Mutex<Option<[Option<Identity>; 2]>>,
    /// The log when it was last looked at.
    log: Mutex<Seen>,
    /// Whether the log is what SQLite wrote.
    has_log: AtomicBool,
    /// When the log was last written to, as of the last time that all of it was read.
    log_read: Mutex<Option<SystemTime>>,
    /// Each index of the log that was open here, locked. None is ever closed: SQLite's locks on it would be given up.
    indices: Mutex<Vec<(Identity, File)>>,
    /// Whether what is rescued may be written to other folders.
    goes_elsewhere: AtomicBool,
    /// Where what was stored is safe, while the file is not.
    rescued: Mutex<Option<PathBuf>>,
}

/// What was seen of a log.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    salts: [u8; 8],
    /// Bytes.
    length: u64,
}

/// When a file was last written to, and how much of its log was in it then: whoever writes the log back changes both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Written {
    at: SystemTime,
    salts: [u8; 8],
    frames: u32,
}

/// What was seen of a file in place.
#[derive(Debug, Default)]
struct Looked {
    last: Option<Written>,
    /// Whether it was written to, and nothing of the log came into it. Another process may be about to say so.
    is_odd: bool,
}

impl Original {
    /// The current file, with all migrations applied. One that is served is searched for damage first.
    pub(super) fn new(file: DatabaseFile, is_served: bool) -> Result<Self, StoreError> {
        let identity = file.identity()?;
        let unreadable = |error: std::io::Error| StoreError::Unavailable(error.to_string());
        let handle = File::open(file.path()).map_err(unreadable)?;
        // A file that is read may be of an older version, and a new one's mark may still be in the log alone.
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
            companions: Mutex::default(),
            log: Mutex::default(),
            has_log: AtomicBool::new(true),
            log_read: Mutex::default(),
            indices: Mutex::default(),
            goes_elsewhere: AtomicBool::new(false),
            rescued: Mutex::default(),
        })
    }

    /// Checks that the file is the one that was opened, and has what SQLite wrote to it.
    pub(super) fn check(&self) -> Result<(), StoreError> {
        let what = match self.changed.get() {
            Some(what) => what,
            None if !self.is_in_place() => "deleted, moved or replaced",
            None => match self.found() {
                None => return Ok(()),
                Some(_) if self.is_found_again() => return Ok(()),
                Some(what) => self.changed.get_or_init(|| what),
            },
        };
        Err(self.gone(what))
    }

    fn gone(&self, what: &str) -> StoreError {
        StoreError::Gone(match self.rescued() {
            Some(rescued) if is_log(&rescued) => {
                format!("{what}; what was stored last is in {}", rescued.display())
            }
            Some(rescued) => format!("{what}; what it had is in {}", rescued.display()),
            None => what.to_owned(),
        })
    }

    /// Notes which log and which index the writer has open, if it has any.
    pub(super) fn note_companions(&self, are_open: bool) {
        let found = are_open.then(|| self.file.companions());
        if let Some([_, Some(index)]) = found {
            self.keep_index(index);
        }
        *self.companions.lock().unwrap_or_else(PoisonError::into_inner) = found;
    }

    /// Keeps an index locked, so that others know whether they share it.
    fn keep_index(&self, identity: Identity) {
        let mut indices = self.indices.lock().unwrap_or_else(PoisonError::into_inner);
        if indices.iter().all(|(kept, _)| *kept != identity)
            && let Ok(index) = File::open(self.file.index())
        {
            // Others that write here may have locked it, too.
            let _ = index.try_lock_shared();
            indices.push((identity, index));
        }
    }

    /// The same of the file, its log and all that the log has. Whoever writes the log back calls it first: what somebody has
    /// overwritten there would be in the file then.
    pub(super) fn check_all(&self) -> Result<(), StoreError> {
        self.check_with_log()?;
        let written = std::fs::metadata(self.file.log()).and_then(|log| log.modified()).ok();
        let mut read = self.log_read.lock().unwrap_or_else(PoisonError::into_inner);
        if written.is_some() && *read == written {
            return Ok(());
        }
        let log = mark::misplaced(&self.file, || self.index(true));
        if matches!(log, Ok(Some(Misplaced::Damaged))) {
            self.has_log.store(false, Ordering::Relaxed);
            self.changed.get_or_init(|| {
                "separated from a part of its write-ahead log or of that log's index (-wal, -shm), which was overwritten; stop \
                 the server and keep all files: 'sidestep check' reads everything if only the index was hit, and 'sidestep salvage' \
                 what is left"
            });
        }
        *read = written;
        self.check()
    }

    /// The index of the log that the writer has open.
    fn index(&self, is_whole: bool) -> Option<Index> {
        let [_, known] = (*self.companions.lock().unwrap_or_else(PoisonError::into_inner))?;
        let indices = self.indices.lock().unwrap_or_else(PoisonError::into_inner);
        let (_, open) = indices.iter().find(|(identity, _)| Some(*identity) == known)?;
        Index::read(open, is_whole)
    }

    /// Whether the index is of another writing of the log than the one that is there.
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
        // SQLite begins a log and its index anew one after the other.
        (0..3).all(|attempt| {
            std::thread::sleep(Duration::from_millis(5 * attempt));
            is_other()
        })
    }

    /// The same of the file and its log.
    pub(super) fn check_with_log(&self) -> Result<(), StoreError> {
        self.check()?;
        let known = *self.companions.lock().unwrap_or_else(PoisonError::into_inner);
        if known.is_some_and(|known| known != self.file.companions()) {
            // A connection that has both open can still read everything.
            return Err(self.gone(
                "separated from its write-ahead log or that log's index (-wal, -shm), which somebody deleted, moved or \
                 replaced",
            ));
        }
        if let Some(what) = self.found_of_log()
            && self.found_of_log().is_some()
        {
            self.has_log.store(false, Ordering::Relaxed);
            self.changed.get_or_init(|| what);
        }
        self.check_index();
        self.check()
    }

    /// Notes that somebody has overwritten the index of the log. What is in the log is whole then, and stays there.
    fn check_index(&self) {
        if self.has_other_index() {
            self.has_log.store(false, Ordering::Relaxed);
            self.changed.get_or_init(|| {
                "separated from the index (-shm) of its write-ahead log, which was overwritten; stop the server and keep all \
                 files: the next start reads everything from them"
            });
        }
    }

    /// What somebody has done to the log.
    fn found_of_log(&self) -> Option<&'static str> {
        const CUT: &str = "separated from its write-ahead log, which was cut off";
        const OTHER: &str = "separated from its write-ahead log, which was overwritten";
        let mut header = [0; 32];
        // Whether it is there at all was looked at.
        let log = File::open(self.file.log()).ok()?;
        let length = log.metadata().ok()?.len();
        let mut known = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        let is_read = log.read_exact_at(&mut header, 0).is_ok();
        if !is_read || header == [0; 32] {
            if known.length == 0 {
                return None;
            }
            // SQLite makes it empty once everything was written back, and knows that.
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
        // It begins anew, after everything was written back.
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

    /// Writes the log back. What anybody else writes to the file meanwhile is not told from that.
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

    /// Notes whether somebody has written to the file without writing its log back. Returns whether that was so before,
    /// and is over.
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

    /// Has SQLite look for damage, at first and if somebody has written to the file in place.
    fn check_in_place(&self) {
        let is_over = self.written.try_lock().is_ok_and(|mut looked| self.look(&mut looked));
        if !self.is_suspected.swap(false, Ordering::Relaxed) && !is_over {
            return;
        }
        let db = connection::reading(&self.file, true).map_err(StoreError::from);
        match db.and_then(|db| Ok(connection::first_damage(&db)?)) {
            Ok(None) if is_over => tracing::warn!(
                "somebody has written to the database file; SQLite finds no damage, and 'sidestep check' replays every trial"
            ),
            Ok(None) => {}
            // Without its log it is damaged, and with it not.
            Ok(Some(_)) | Err(StoreError::Corrupt(_)) if self.check_with_log().is_ok() => {
                self.changed.get_or_init(
                    || "damaged; stop the server: 'sidestep check' says where, and what to do",
                );
            }
            _ => self.is_suspected.store(true, Ordering::Relaxed),
        }
    }

    /// Where what was stored is safe.
    pub(super) fn rescued(&self) -> Option<PathBuf> {
        self.rescued.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Notes where it is; nowhere, once the file is back.
    pub(super) fn note_rescued(&self, file: Option<PathBuf>) {
        *self.rescued.lock().unwrap_or_else(PoisonError::into_inner) = file;
    }

    /// What somebody has done to the content.
    fn found(&self) -> Option<&'static str> {
        let length = self.handle.metadata().map_or(0, |found| found.len());
        if length < self.length.fetch_max(length, Ordering::Relaxed) {
            return Some("cut off");
        }
        let mark = self.mark.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (identity, place) = mark?;
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

    /// Whether the mark is there after all: while SQLite writes the page, it may be seen half.
    fn is_found_again(&self) -> bool {
        (1..=4).any(|attempt| {
            std::thread::sleep(Duration::from_millis(5 * attempt));
            self.found().is_none() || self.is_elsewhere()
        })
    }

    /// Whether VACUUM has moved the mark.
    fn is_elsewhere(&self) -> bool {
        let Ok(Some((found, place))) = mark::by_sqlite(&self.file) else { return false };
        if let Some((identity, known)) =
            &mut *self.mark.lock().unwrap_or_else(PoisonError::into_inner)
            && *identity == found.identity
        {
            *known = place;
        }
        // VACUUM makes a file shorter, and says so in its header: the length of a page and the number of pages.
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
        if length < page * u64::from(pages) {
            return false;
        }
        self.length.store(length, Ordering::Relaxed);
        self.found().is_none()
    }

    /// Whether its content is what SQLite wrote: the file was moved, deleted or replaced at most.
    pub(super) fn is_whole(&self) -> bool {
        self.changed.get().is_none()
    }

    /// Whether its log is what SQLite wrote.
    pub(super) fn has_log(&self) -> bool {
        self.has_log.load(Ordering::Relaxed)
    }

    /// Whether the file is where it was.
    pub(super) fn is_in_place(&self) -> bool {
        self.file.identity() == Ok(self.identity)
    }

    /// Whether somebody has done something to the file, and what it had is in no other one. A log that was rescued is not
    /// enough once the file itself is gone.
    pub(super) fn lacks_rescue(&self) -> bool {
        let log =
            || self.has_log() && (self.is_whole() || self.is_own_log() && self.file.has_log());
        match self.rescued() {
            None => !self.is_in_place() || log(),
            Some(rescued) => is_log(&rescued) && !self.is_in_place(),
        }
    }

    /// Writes what the file has, whatever became of its name, into another one.
    pub(super) fn copy_to(&self, mut out: &File) -> std::io::Result<()> {
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

    /// Whether the log that lies beside the file is the one that the writer has open.
    pub(super) fn is_own_log(&self) -> bool {
        let known = *self.companions.lock().unwrap_or_else(PoisonError::into_inner);
        known.is_none_or(|[log, _]| log == self.file.companions()[0])
    }

    /// Allows other folders than the file's for what is rescued.
    pub(super) fn rescue_elsewhere(&self) {
        self.goes_elsewhere.store(true, Ordering::Relaxed);
    }

    /// New names for what is rescued: beside the file, and where that fails and is allowed, in the working directory or in
    /// that for temporary files.
    pub(super) fn rescue_names(&self) -> impl Iterator<Item = PathBuf> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut name = self.file.path().file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.rescued", now.as_millis()));
        let elsewhere = std::env::current_dir().into_iter().chain([std::env::temp_dir()]);
        let elsewhere = elsewhere.filter(|_| self.goes_elsewhere.load(Ordering::Relaxed));
        let folders = std::iter::once(self.file.folder().to_owned()).chain(elsewhere);
        folders.map(move |folder| folder.join(&name))
    }
}

/// Whether a rescued file is a log alone.
fn is_log(rescued: &Path) -> bool {
    rescued.extension().is_some_and(|end| end == "rescued-wal")
}

/// Looks at a file all the time.
#[derive(Debug)]
pub(super) struct Watch {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Starts its thread, which calls `noticed` whenever somebody has changed the file.
    pub(super) fn start(
        original: Arc<Original>,
        noticed: impl Fn() + Send + 'static,
    ) -> Result<Self, StoreError> {
        let (stop, stopped) = channel();
        let thread = std::thread::Builder::new().name("store-watch".to_owned()).spawn(move || {
            let (mut was_well, mut asked) = (true, Instant::now());
            let mut rounds = 0_usize;
            while stopped.recv_timeout(WATCH) == Err(RecvTimeoutError::Timeout) {
                rounds += 1;
                original.check_in_place();
                let found = match rounds.is_multiple_of(READ_LOG) {
                    true => original.check_all(),
                    false => original.check_with_log(),
                };
                match &found {
                    Err(error) if was_well => {
                        tracing::error!(%error, "nothing is stored any more");
                        (asked, ()) = (Instant::now(), noticed());
                    }
                    // The disk may have been full.
                    Err(_) if original.lacks_rescue() && asked.elapsed() > AGAIN => {
                        (asked, ()) = (Instant::now(), noticed());
                    }
                    Ok(()) if !was_well => {
                        tracing::info!("the database file is back");
                        original.note_rescued(None);
                    }
                    _ => {}
                }
                was_well = found.is_ok();
            }
        });
        let thread = thread.map_err(|error| StoreError::Unavailable(error.to_string()))?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
