//! The database's file: its address, its permissions, its lock, and whether it is still the same file.

use crate::store::error::StoreError;
use crate::store::opening::{OpenError, Purpose};
use crate::support::private;
use rustix::fs::{Access, StatVfs, StatVfsMountFlags, access, statvfs};
use std::fs::{File, TryLockError};
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// The first bytes of every SQLite file.
pub const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// The free space (bytes) below which the server reports that it is not ready.
pub const LEAST_FREE_BYTES: u64 = 4 << 20;

/// Number of attempts to take a lock that another process may hold briefly, and the pause between them.
const ATTEMPTS: usize = 10;
const PAUSE: Duration = Duration::from_millis(50);

/// The reason why a name is refused.
pub(in crate::store) const COMPANION: &str =
    "its name ends with -wal, -shm or -journal, like the files that SQLite keeps beside a database";

/// A database file with its write-ahead log.
#[derive(Clone, Debug)]
pub(in crate::store) struct DatabaseFile {
    path: PathBuf,
    log: PathBuf,
}

/// The identity of a file, independent of its name: device and inode number.
pub(in crate::store) type Identity = (u64, u64);

impl DatabaseFile {
    /// Parses an address `sqlite:FILE`. The error describes what was found instead.
    pub(in crate::store) fn of_url(url: &str) -> Result<Self, String> {
        let Some(name) = url.strip_prefix("sqlite:") else {
            return Err(match url.contains([':', '=']) {
                true => "another kind of address".to_owned(),
                false => format!("a file's name; write sqlite:{url}"),
            });
        };
        let is_of_server = name.contains("://") || names_a_host(name);
        let name = name.strip_prefix("//").unwrap_or(name);
        if is_of_server && !Path::new(name).exists() {
            return Err("another kind of address".to_owned());
        }
        if let Some((file, options)) = name.split_once('?')
            && options.contains('=')
            && !Path::new(name).exists()
        {
            return Err(format!(
                "options, {options:?}, which a file does not support; write sqlite:{file}"
            ));
        }
        if name.is_empty() || name.contains(":memory:") || name.contains("mode=memory") {
            return Err("no file; results must survive a restart".to_owned());
        }
        Ok(Self::at(Path::new(name)))
    }

    /// Refuses a path that is not a file, and a file that this user is not allowed to read. Also
    /// refuses a file with several names (hard links) if it is opened to be written, or if another
    /// of its names has a log. In these cases, SQLite would only report that it cannot open the
    /// file, or it would keep one log per name.
    pub(in crate::store) fn check(file: &Path, purpose: Purpose) -> Result<(), OpenError> {
        let refuse = |reason: String| {
            Err(OpenError::Unusable { database: file.display().to_string(), reason })
        };
        if Self::is_companion(file) && !begins_like_a_database(file) {
            return refuse(format!("{COMPANION}; choose another name"));
        }
        let Ok(found) = std::fs::metadata(file) else {
            return match file.is_symlink() {
                true => refuse("it is a symbolic link to a file that does not exist".to_owned()),
                false => Ok(()),
            };
        };
        if !found.is_file() {
            return refuse("it is a directory, a pipe or a device, not a file".to_owned());
        }
        if found.nlink() > 1 && (purpose != Purpose::Read || Self::at(file).has_log_of_other_name())
        {
            return refuse(
                "it has several names (hard links), and SQLite would keep a log for each; delete the names without a -wal beside \
                 them"
                    .to_owned(),
            );
        }
        match File::open(file) {
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => refuse(format!(
                "{error}; give this user the permission to read it, or run as its owner"
            )),
            _ => Ok(()),
        }
    }

    /// Whether a file has a name that SQLite gives to files beside a database. SQLite can overwrite
    /// or delete such a file.
    pub(in crate::store) fn is_companion(file: &Path) -> bool {
        let name = file.file_name().unwrap_or_default().as_encoded_bytes();
        ["-wal", "-shm", "-journal"].iter().any(|end| name.ends_with(end.as_bytes()))
    }

    pub(in crate::store) fn at(path: &Path) -> Self {
        // SQLite keeps the log beside the target file, even if the path is a symbolic link.
        let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        Self { path: path.to_owned(), log: with_end(&target, "-wal") }
    }

    /// The file that SQLite keeps beside this one, with this suffix.
    fn beside(&self, end: &str) -> PathBuf {
        with_end(&self.path.canonicalize().unwrap_or_else(|_| self.path.clone()), end)
    }

    /// Whether the log is not empty. In this case, a server uses the file, or exited without
    /// closing it.
    pub(in crate::store) fn has_log(&self) -> bool {
        std::fs::metadata(&self.log).is_ok_and(|log| log.len() > 0)
    }

    /// Whether the file's log is beside another name (hard link) of the file. This is assumed if
    /// this name has no log, and a server holds the file's lock or another name in the folder has a
    /// log.
    pub(in crate::store) fn has_log_of_other_name(&self) -> bool {
        let is_twin = |other: &Self| {
            self.path.file_name() != other.path.file_name()
                && other.has_log()
                && identity(&other.path).is_ok_and(|other| Ok(other) == self.identity())
        };
        let names = std::fs::read_dir(self.folder()).into_iter().flatten().flatten();
        !self.has_log()
            && (self.lock().is_ok_and(|lock| lock.is_none())
                || names.map(|entry| Self::at(&entry.path())).any(|other| is_twin(&other)))
    }

    /// If SQLite would misinterpret a file beside this one, the reason and advice to the user.
    /// SQLite ignores a log beside a symbolic link, and applies a rollback journal even if it
    /// belongs to another file.
    pub(super) fn misleading(&self) -> Option<String> {
        let is_filled = |path: &Path| std::fs::metadata(path).is_ok_and(|file| file.len() > 0);
        let log = with_end(&self.path, "-wal");
        let is_link = std::fs::symlink_metadata(&self.path).is_ok_and(|link| link.is_symlink());
        if is_link && is_filled(&log) && identity(&log).ok() != identity(&self.log).ok() {
            return Some(format!(
                "{} is a log beside a symbolic link, and SQLite looks for the log beside the file itself: if it belongs to \
                 the file, stop all servers and move it to {}; otherwise move it away",
                log.display(),
                self.log.display()
            ));
        }
        if std::fs::metadata(&self.log).is_ok_and(|log| !log.is_file()) {
            return Some(format!("{} is not a file; move it away", self.log.display()));
        }
        let journal = self.beside("-journal");
        let mut first = [0];
        // SQLite ignores a journal whose first byte is 0.
        let is_journal = File::open(&journal).and_then(|mut file| file.read_exact(&mut first));
        (is_journal.is_ok() && first != [0]).then(|| {
            format!(
                "{} has the name of a rollback journal, which SQLite would write into the database; Sidestep uses none: \
                 if another program was interrupted while it changed this file, open the file with that program first; \
                 otherwise the journal belongs to another database: move it away",
                journal.display()
            )
        })
    }

    /// Whether there is a log without its database. SQLite would delete the log.
    pub(super) fn is_log_alone(&self) -> bool {
        std::fs::metadata(&self.path).map_or(true, |file| file.len() == 0) && self.has_log()
    }

    /// Whether this user cannot change the file and no process uses it (there is no log).
    pub(super) fn is_fixed(&self) -> bool {
        let is_writable = |path: &Path| access(path, Access::WRITE_OK).is_ok();
        let is_used = std::fs::exists(&self.log).unwrap_or(true);
        let may_change = is_writable(&self.path) && is_writable(self.folder());
        !is_used && !may_change
    }

    /// Whether a server uses the file, or exited without closing it.
    pub(in crate::store) fn is_in_use(&self) -> bool {
        self.has_log() || self.lock().is_ok_and(|lock| lock.is_none())
    }

    pub(super) fn log(&self) -> &Path {
        &self.log
    }

    pub(in crate::store) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether there is no database yet: no file, or an empty one without a log.
    pub(super) fn is_empty(&self) -> bool {
        match std::fs::metadata(&self.path) {
            Ok(file) => file.len() == 0 && !self.has_log(),
            Err(error) => error.kind() == io::ErrorKind::NotFound,
        }
    }

    /// Creates an empty file if there is none. Only its owner can read it, because it will contain
    /// external ids of participants. SQLite gives its log the same permissions.
    pub(super) fn create(&self) -> io::Result<()> {
        match private::new_file(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            made => made.map(drop),
        }
    }

    /// The identity of the file that is now at the database's path.
    pub(in crate::store) fn identity(&self) -> Result<Identity, StoreError> {
        identity(&self.path)
    }

    /// The path of the write-ahead log's index.
    pub(super) fn index(&self) -> PathBuf {
        self.beside("-shm")
    }

    /// The identities of the files that are now at the paths of the log and its index, or `None`
    /// for a missing file.
    pub(super) fn companions(&self) -> [Option<Identity>; 2] {
        [&self.log, &*self.index()].map(|path| identity(path).ok())
    }

    /// Whether a connection opened now would share the server's index of the log. The server keeps its
    /// index locked. Returns `true` if no server uses the file. If the index was deleted, SQLite would
    /// create another index, and the two writers would be unaware of each other.
    pub(super) fn shares_index(&self) -> bool {
        let is_locked = |path: &Path| {
            File::open(path)
                .is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
        };
        // A server locks its file shortly before its index exists, so the check is repeated.
        (0..ATTEMPTS).any(|attempt| {
            std::thread::sleep(if attempt == 0 { Duration::ZERO } else { PAUSE });
            is_locked(&self.index()) || !is_locked(&self.path)
        })
    }

    /// Like [`Self::lock`], but retries, because a command may be testing the lock briefly.
    pub(super) fn lock_soon(&self) -> io::Result<Option<File>> {
        for _ in 1..ATTEMPTS {
            match self.lock()? {
                None => std::thread::sleep(PAUSE),
                lock => return Ok(lock),
            }
        }
        self.lock()
    }

    pub(super) fn folder(&self) -> &Path {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.unwrap_or(Path::new("."))
    }

    /// Creates an empty file for a copy in a new private folder beside the file. If the disk has
    /// too little space or the folder of the file cannot be written, the new folder is in the
    /// system's temporary directory. Also deletes copies that killed commands left in the same
    /// place.
    pub(super) fn new_copy(&self) -> io::Result<Copied> {
        let needed = std::fs::metadata(&self.path)?.len() + LEAST_FREE_BYTES;
        let beside = match self.free_bytes() {
            Ok(free) if free >= needed => Copied::within(self.folder()),
            _ => Err(io::ErrorKind::StorageFull.into()),
        };
        beside.or_else(|_| Copied::within(&std::env::temp_dir()))
    }

    /// The free space on the file's disk (bytes).
    pub(super) fn free_bytes(&self) -> Result<u64, StoreError> {
        self.disk().map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Checks that the disk has space and accepts writes.
    pub(super) fn check_disk(&self) -> Result<(), StoreError> {
        if self.disk()?.f_flag.contains(StatVfsMountFlags::RDONLY) {
            return Err(StoreError::Unavailable("its disk is read-only".to_owned()));
        }
        if self.free_bytes()? < LEAST_FREE_BYTES { Err(StoreError::Full) } else { Ok(()) }
    }

    fn disk(&self) -> Result<StatVfs, StoreError> {
        statvfs(self.folder()).map_err(|error| StoreError::Unavailable(error.to_string()))
    }

    /// Deletes copies of files that killed commands left in the same folder.
    pub(super) fn sweep_copies(&self) {
        Copied::sweep(self.folder());
    }

    /// Takes the lock that a server holds while it runs. Returns `None` if another process holds
    /// it. It is not one of SQLite's locks, so commands can use the file while the server runs.
    pub(super) fn lock(&self) -> io::Result<Option<File>> {
        let file = File::open(&self.path)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(file)),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
}

/// A temporary copy of a database, deleted on drop.
#[derive(Debug)]
pub(super) struct Copied {
    folder: TempDir,
    /// Locked while this process uses the copy.
    _lock: File,
}

impl Copied {
    const PREFIX: &str = ".sidestep-copy-";

    fn within(parent: &Path) -> io::Result<Self> {
        Self::sweep(parent);
        let folder = private::temporary_folder(Self::PREFIX, parent)?;
        let file = Self::file_in(folder.path());
        file.create()?;
        let lock = file.lock()?.ok_or(io::ErrorKind::WouldBlock)?;
        Ok(Self { folder, _lock: lock })
    }

    pub(super) fn file(&self) -> DatabaseFile {
        Self::file_in(self.folder.path())
    }

    fn file_in(folder: &Path) -> DatabaseFile {
        DatabaseFile::at(&folder.join("copy.db"))
    }

    /// Deletes copies that no process uses.
    fn sweep(parent: &Path) {
        for entry in std::fs::read_dir(parent).into_iter().flatten().flatten() {
            let is_copy = entry.file_name().to_string_lossy().starts_with(Self::PREFIX);
            if is_copy && Self::file_in(&entry.path()).lock().is_ok_and(|lock| lock.is_some()) {
                // If it cannot be deleted, it belongs to another user.
                let _ = std::fs::remove_dir_all(entry.path());
            }
        }
    }
}

/// Whether the part after `sqlite:` looks like a server's address, `//USER@HOST/…` or
/// `USER:PASSWORD@…`. Such an address can contain a password.
fn names_a_host(name: &str) -> bool {
    let part = name.strip_prefix("//").unwrap_or(name).split(['/', '?']).next().unwrap_or("");
    let user = part.rsplit_once('@').map(|(user, _)| user);
    user.is_some_and(|user| name.starts_with("//") || user.contains(':'))
}

fn begins_like_a_database(file: &Path) -> bool {
    let mut first = [0; MAGIC.len()];
    let read = File::open(file).and_then(|mut file| file.read_exact(&mut first));
    read.is_ok() && first == *MAGIC
}

fn with_end(path: &Path, end: &str) -> PathBuf {
    let mut path = path.as_os_str().to_owned();
    path.push(end);
    path.into()
}

fn identity(path: &Path) -> Result<Identity, StoreError> {
    let found = rustix::fs::stat(path)
        .map_err(|_| StoreError::Gone("deleted, moved or replaced".to_owned()))?;
    Ok((found.st_dev, found.st_ino))
}
