//! The SQLite back end: one file, many readers and one writer thread.
//!
//! Reads (`readers`) and writes (`writer`) are separate, because SQLite allows only one writer at a
//! time, while readers never wait in WAL mode.

mod file;
mod connection;
mod log;
mod mark;
mod trees;
mod damaged;
mod original;
mod readers;
mod write_back;
mod writer;

use super::error::StoreError;
use super::lanes::Lane;
use super::migrations::{self, Failure, State};
use super::sql::{self, Connection, Question};
use super::{OpenError, Purpose};
use crate::store::commits::Commits;
use file::Copied;
use log::Index;
use original::{Original, Watch};
use readers::Readers;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use writer::Writer;

pub(super) use connection::open;
pub use damaged::copy_damaged;
pub(super) use file::{DatabaseFile, Identity};
pub use file::{LEAST_FREE_BYTES, MAGIC};
pub use mark::Misplaced;

/// An open database file with the schema of this version.
#[derive(Debug)]
pub(super) struct Sqlite {
    /// The file that the user named.
    named: DatabaseFile,
    /// The file in use: the named file, or a migrated copy of it.
    file: DatabaseFile,
    original: Arc<Original>,
    readers: Arc<Readers>,
    writer: Writer,
    watch: Mutex<Option<Watch>>,
    /// The lock for exclusive use of the file, if it was taken.
    lock: Mutex<Option<File>>,
    #[expect(dead_code, reason = "it is deleted when this is dropped")]
    copy: Option<Copied>,
}

impl Sqlite {
    /// Opens the file and applies missing migrations. If the purpose is to read, a copy is migrated instead.
    pub(super) fn open(named: DatabaseFile, purpose: Purpose) -> Result<Self, OpenError> {
        let name = || named.path().display().to_string();
        let is_alone = matches!(purpose, Purpose::Alone | Purpose::Copy);
        let unusable = |reason: String| OpenError::Unusable { database: name(), reason };
        let advice = match purpose {
            Purpose::Read => "check the path, that it may be read, and that its disk has room",
            _ => "check the path, that it is writable, and that its disk has room",
        };
        let hint = |reason: String| unusable(format!("{reason}; {advice}"));
        let sqlite = |error: StoreError| match error {
            StoreError::Corrupt(reason) => {
                let if_it_was =
                    if reason.contains("not a database") { "if it was one, " } else { "" };
                unusable(format!(
                    "{reason}; {if_it_was}restore a backup with 'sidestep restore', or save what can still be read with \
                     'sidestep salvage'"
                ))
            }
            StoreError::Locked => {
                unusable("database is locked; another program writes to it, try again".to_owned())
            }
            StoreError::Unavailable(reason) => hint(reason),
            other => hint(other.to_string()),
        };
        let refused = |error: sql::Error| sqlite(error.into());
        let misfit = |failure: Failure| match failure {
            Failure::Unusable(error) => sqlite(error),
            Failure::Misfit(reason) => OpenError::Version { database: name(), reason },
        };
        let disk = |error: io::Error| hint(error.to_string());
        if named.is_log_alone() {
            return Err(OpenError::LogAlone { database: name(), log: named.log().to_owned() });
        }
        if let Some(reason) = named.misleading() {
            return Err(unusable(reason));
        }
        // The index that a killed process left behind shows how many frames the log had.
        let index = || Index::read(&File::open(named.index()).ok()?, false);
        if let Some(why) = mark::misplaced(&named, index).map_err(disk)? {
            let (database, log) = (name(), named.log().to_owned());
            return Err(match why {
                Misplaced::Damaged => OpenError::DamagedLog { database, log },
                why => OpenError::Misplaced { database, log, why },
            });
        }
        // Servers of versions that had no marks do not lock the index.
        let has_mark = matches!(mark::of_file(&named), Ok(Some(_)));
        if !is_alone && has_mark && !named.shares_index() {
            return Err(unusable(format!(
                "a server uses it with another index of its write-ahead log than {}: the server's index was deleted or \
                 replaced; stop that server first",
                named.index().display()
            )));
        }
        match purpose {
            Purpose::Alone | Purpose::Copy | Purpose::Create => {
                named.sweep_copies();
                named.create().map_err(disk)?;
            }
            Purpose::Change | Purpose::Read if named.is_empty() => {
                return Err(OpenError::Absent(name()));
            }
            Purpose::Change | Purpose::Read => {}
        }
        // If this program cannot use the file, or another server uses it, not a single byte of the
        // file is changed.
        let untouching = connection::untouching(&named).map_err(refused)?;
        let checked = migrations::check(&untouching).and_then(|state| {
            if state != State::Empty && purpose != Purpose::Copy {
                migrations::check_finished(&untouching)?;
            }
            Ok(state)
        });
        // A copy made while a server was writing mixes two states. Applying a log to the copy would
        // not repair it.
        let is_left = checked.is_ok()
            && purpose != Purpose::Read
            && named.has_log()
            && matches!(named.lock(), Ok(Some(_)));
        let torn = match is_left {
            true => connection::first_damage(&untouching).map_err(refused)?,
            false => None,
        };
        drop(untouching);
        if checked.is_err() {
            connection::leave_no_log(&named);
        }
        let state = checked.map_err(misfit)?;
        if let Some(found) = torn {
            return Err(sqlite(StoreError::Corrupt(format!(
                "the file and its write-ahead log are not whole together ({found}), and nothing was changed; keep both"
            ))));
        }
        let is_current = state == State::Current;
        let lock = match (is_alone, purpose, is_current) {
            // A server of an older version may be using the file. It could not continue after a migration.
            (true, ..) | (_, Purpose::Create | Purpose::Change, false) => {
                let lock = named.lock_soon().map_err(|error| unusable(error.to_string()))?;
                Some(lock.ok_or_else(|| OpenError::Served(name()))?)
            }
            _ => None,
        };
        let is_copied = purpose == Purpose::Read && !is_current;
        let copy = is_copied.then(|| named.new_copy()).transpose().map_err(disk)?;
        let file = match &copy {
            None => named.clone(),
            Some(copy) => {
                let place = copy.file();
                let full = |error: sql::Error| match error.into() {
                    StoreError::Full => unusable(format!(
                        "it is of an older version, and there is no room for a copy of it in {}",
                        place.folder().display()
                    )),
                    other => sqlite(other),
                };
                connection::copy(&named, place.path()).map_err(full)?;
                copy.file()
            }
        };
        if purpose != Purpose::Read || is_copied {
            let db = connection::migrating(file.path()).map_err(refused)?;
            migrations::apply(&db).map_err(misfit)?;
            if state == State::Empty && purpose == Purpose::Copy {
                migrations::begin_copy(&db).map_err(sqlite)?;
            }
        }
        let original =
            Arc::new(Original::new(file.clone(), purpose == Purpose::Alone).map_err(sqlite)?);
        let only_reads = purpose == Purpose::Read;
        let readers = Arc::new(Readers::new(file.clone(), Arc::clone(&original), only_reads));
        let writer = match only_reads {
            true => Ok(Writer::none()),
            false => Writer::start(file.clone(), Arc::clone(&original), Arc::clone(&readers)),
        };
        let writer = writer.map_err(sqlite)?;
        let watch = match only_reads {
            true => None,
            false => Some(Watch::start(Arc::clone(&original), writer.rescue()).map_err(sqlite)?),
        };
        let (watch, lock) = (Mutex::new(watch), Mutex::new(lock));
        Ok(Self { named, file, original, readers, writer, watch, lock, copy })
    }

    /// Checks that the database accepts writes now.
    pub(super) async fn ready(&self) -> Result<(), StoreError> {
        const PATIENCE: Duration = Duration::from_secs(2);
        self.original.check()?;
        // After a failed write, only a real write shows whether the disk accepts writes again.
        let probe = match self.writer.has_failed() {
            true => "UPDATE mark SET text = text",
            false => "UPDATE mark SET text = text WHERE FALSE",
        };
        let begun = self.write(Lane::Request, move |db| Ok(db.execute(probe, [])?));
        tokio::time::timeout(PATIENCE, begun).await.unwrap_or(Err(StoreError::Locked))?;
        self.file.check_disk()
    }

    /// Returns the folder of the file, if it has enough space for a temporary file of this size (bytes).
    pub(super) fn room(&self, bytes: u64) -> Result<PathBuf, StoreError> {
        let enough = LEAST_FREE_BYTES.saturating_mul(16).saturating_add(bytes);
        if self.file.free_bytes()? < enough {
            return Err(StoreError::Full);
        }
        Ok(self.file.folder().to_owned())
    }

    /// The identity of this file, independent of its name.
    pub(super) fn identity(&self) -> Result<Identity, StoreError> {
        self.named.identity()
    }

    pub(super) fn name(&self) -> String {
        self.named.path().display().to_string()
    }

    /// Writes a snapshot into a new file that only its owner can read.
    pub(super) async fn write_snapshot(&self, out: &Path) -> Result<(), StoreError> {
        let (from, to) = (self.file.clone(), DatabaseFile::at(out));
        let writing = tokio::task::spawn_blocking(move || {
            let refused = |error: std::io::Error| StoreError::Unavailable(error.to_string());
            to.create().map_err(refused)?;
            let copied = connection::copy(&from, to.path()).map_err(StoreError::from);
            if copied == Err(StoreError::Full)
                && let Some(what) = connection::damage(&connection::untouching(&from)?)?.pop()
            {
                // SQLite reports some kinds of damage as a full disk.
                return Err(StoreError::Corrupt(what));
            }
            copied
        });
        writing.await.map_err(|error| StoreError::Defect(error.to_string()))?
    }

    /// Lists damaged pages and dangling references.
    pub(super) async fn damage(&self) -> Result<Vec<String>, StoreError> {
        self.read_long(connection::damage).await
    }

    pub(super) fn commits(&self) -> watch::Receiver<u64> {
        self.writer.commits()
    }

    /// Empties the write-ahead log, which still contains deleted data, as soon as no reader uses it.
    pub(super) fn forget_deleted(&self) {
        self.writer.empty_log();
    }

    pub(super) fn close(&self) {
        self.watch.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.readers.close();
        self.writer.close();
        // The lock comes last, because closing any handle of the file releases SQLite's locks on it.
        self.lock.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    pub(super) fn rescue_elsewhere(&self) {
        self.original.rescue_elsewhere();
    }

    /// Returns why nothing is stored any more, if the stored data could not be rescued either.
    pub(super) fn unrescued(&self) -> Option<StoreError> {
        let gone = || self.original.check().err().filter(|_| self.original.lacks_rescue());
        self.original.lost().or_else(gone)
    }

    pub(super) fn observed(&self) -> &Commits {
        self.writer.observed()
    }

    /// Numbers of waiting trials, other requests and background jobs.
    pub(super) fn waiting(&self) -> [usize; 3] {
        self.writer.waiting()
    }

    pub(super) fn free_bytes(&self) -> Result<u64, StoreError> {
        self.file.free_bytes()
    }

    pub(super) fn read<T>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        self.readers.short(read)
    }

    pub(super) async fn read_long<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.readers.long(read).await
    }

    pub(super) async fn write<T: Send + 'static>(
        &self,
        lane: Lane,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        // The operation runs only once, because it has its own savepoint.
        let mut work = Some(work);
        let once = move |db: &Connection| match work.take() {
            Some(work) => work(db),
            None => Err(StoreError::Defect("it ran twice".to_owned())),
        };
        self.writer.run(lane, None, once).await
    }

    /// Writes a trial. `work` runs again if another trial of its transaction fails.
    pub(super) async fn write_trial<T: Send + 'static>(
        &self,
        question: Option<Question>,
        work: impl FnMut(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.writer.run(Lane::Trial, question, work).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::FileExt;

    /// After a disk error, the writer closes its connection, so it has none open when the file is deleted.
    #[tokio::test(flavor = "multi_thread")]
    async fn a_deleted_file_is_rescued_through_a_reader() {
        let folder = tempfile::tempdir().unwrap();
        let file = DatabaseFile::at(&folder.path().join("study.db"));
        let db = Sqlite::open(file.clone(), Purpose::Alone).unwrap();
        let add = "INSERT INTO study_config (hash, json) VALUES ('kept', '{}')";
        let added = db.write(Lane::Request, |db| Ok(db.execute(add, [])?)).await.unwrap();
        assert_eq!(added, 1);
        let kept = |db: &Connection| {
            let count = "SELECT count(*) FROM study_config";
            Ok(db.query_row(count, [], |row| row.get::<_, i64>(0))?)
        };
        assert_eq!(db.read(kept).unwrap(), 1);
        let failed = db.write(Lane::Request, |_| Err::<(), _>(StoreError::Full)).await;
        assert_eq!(failed, Err(StoreError::Full));
        std::fs::remove_file(file.path()).unwrap();
        while db.original.rescued().is_none() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        db.close();
        let rescued = DatabaseFile::at(&db.original.rescued().unwrap());
        assert_eq!(rescued.path().extension().unwrap(), "db");
        let rescued = Sqlite::open(rescued, Purpose::Read).unwrap();
        assert_eq!(rescued.read(kept).unwrap(), 1);
    }

    async fn with_rows(file: &DatabaseFile, keys: std::ops::Range<u32>) -> Sqlite {
        let db = Sqlite::open(file.clone(), Purpose::Alone).unwrap();
        add_rows(&db, keys).await;
        db
    }

    async fn add_rows(db: &Sqlite, keys: std::ops::Range<u32>) {
        for key in keys {
            let add = "INSERT INTO study_config (hash, json) VALUES ($1, $2)";
            let json = format!("{{\"text\": \"{}\"}}", "x".repeat(9_000));
            let add = move |db: &Connection| Ok(db.execute(add, [key.to_string(), json])?);
            db.write(Lane::Request, add).await.unwrap();
        }
    }

    fn rows(db: &Connection) -> Result<i64, StoreError> {
        Ok(db.query_row("SELECT count(*) FROM study_config", [], |row| row.get(0))?)
    }

    /// SQLite uses the page list of the index for checkpoints, and its hash table for reads.
    #[tokio::test(flavor = "multi_thread")]
    async fn a_log_whose_index_was_overwritten_is_not_written_back() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: String| DatabaseFile::at(&folder.path().join(name));
        let (list, table) = (136, 16_384);
        for (name, at, junk) in [
            ("zeroed", list, vec![0; 400]),
            ("other pages", list + 8, vec![3; 400]),
            ("no table", table, vec![0; 16_384]),
            ("other table", table, vec![7; 16_384]),
        ] {
            let file = of(format!("{name}.db"));
            let db = with_rows(&file, 0..30).await;
            // This compares the log with its index. The log does not change after it.
            db.original.check_all().unwrap();
            let index = File::options().write(true).open(file.index()).unwrap();
            index.write_all_at(&junk, at).unwrap();
            assert!(db.original.check_all().is_err(), "{name}");
            db.close();
            // Within this process, SQLite would continue to use the overwritten index.
            let copy = of(format!("copy of {name}.db"));
            std::fs::copy(file.path(), copy.path()).unwrap();
            std::fs::copy(file.log(), copy.log()).unwrap();
            let db = Sqlite::open(copy, Purpose::Alone).unwrap();
            assert_eq!(db.read(rows).unwrap(), 30, "{name}");
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_deleted_file_with_a_damaged_page_is_rescued_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let file = DatabaseFile::at(&folder.path().join("study.db"));
        let db = with_rows(&file, 0..30).await;
        connection::write_back(&connection::writing(file.path()).unwrap()).unwrap();
        add_rows(&db, 30..40).await;
        let open = File::options().write(true).open(file.path()).unwrap();
        let (length, at) = (open.metadata().unwrap().len(), open.metadata().unwrap().modified());
        open.write_all_at(&vec![0xff; length as usize / 3], length / 3).unwrap();
        open.set_modified(at.unwrap()).unwrap();
        std::fs::remove_file(file.path()).unwrap();
        let begun = std::time::Instant::now();
        while db.original.rescued().is_none() {
            assert!(begun.elapsed() < Duration::from_secs(60), "nothing is rescued");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        db.close();
        let rescued = DatabaseFile::at(&db.original.rescued().unwrap());
        assert_eq!(std::fs::metadata(rescued.path()).unwrap().len(), length);
        assert!(rescued.has_log() && db.unrescued().is_none());
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_log_beside_a_link_is_not_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
        with_rows(&of("far.db"), 0..3).await.close();
        std::os::unix::fs::symlink("far.db", of("near.db").path()).unwrap();
        Sqlite::open(of("near.db"), Purpose::Read).unwrap();
        let log = folder.path().join("near.db-wal");
        std::fs::write(&log, b"a log").unwrap();
        for purpose in [Purpose::Read, Purpose::Alone, Purpose::Change] {
            let said = Sqlite::open(of("near.db"), purpose).unwrap_err().to_string();
            assert!(said.contains("near.db-wal is a log beside a symbolic link"), "{said}");
        }
        let copy = folder.path().join("copy.db");
        assert!(copy_damaged(of("near.db").path(), &copy).is_err());
        assert_eq!(std::fs::read(log).unwrap(), b"a log");
    }

    /// SQLite would write the pages of the journal into the database, although they belong to another one.
    #[tokio::test]
    async fn a_rollback_journal_is_not_applied() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
        with_rows(&of("other.db"), 0..3).await.close();
        let other = connection::open(
            &sqlx::sqlite::SqliteConnectOptions::new()
                .filename(of("other.db").path())
                .journal_mode(sqlx::sqlite::SqliteJournalMode::Delete),
        )
        .unwrap();
        other
            .batch("BEGIN; PRAGMA cache_spill = 1; PRAGMA cache_size = 1; DELETE FROM study")
            .unwrap();
        other.batch("CREATE TABLE filler AS SELECT randomblob(100000) AS bytes").unwrap();
        let journal = std::fs::read(folder.path().join("other.db-journal")).unwrap();
        assert!(journal.len() > 1000);
        with_rows(&of("study.db"), 0..3).await.close();
        let before = std::fs::read(of("study.db").path()).unwrap();
        let beside = folder.path().join("study.db-journal");
        std::fs::write(&beside, journal).unwrap();
        for purpose in [Purpose::Read, Purpose::Alone, Purpose::Change] {
            let said = Sqlite::open(of("study.db"), purpose).unwrap_err().to_string();
            assert!(said.contains("study.db-journal is a rollback journal"), "{said}");
        }
        assert!(std::fs::read(of("study.db").path()).unwrap() == before && beside.exists());
        // After a transaction, SQLite may leave behind an empty journal, or a journal with a zeroed header.
        std::fs::write(&beside, [0; 512]).unwrap();
        Sqlite::open(of("study.db"), Purpose::Alone).unwrap().close();
    }

    /// During a checkpoint, the file mixes two states. A crash or a copy at that time preserves the mixture.
    #[tokio::test(flavor = "multi_thread")]
    async fn a_torn_file_is_read_with_its_own_log_and_changed_with_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
        let bytes = |path: &Path| std::fs::read(path).unwrap();
        let db = with_rows(&of("study.db"), 0..8).await;
        let [old, log] = [of("study.db").path(), of("study.db").log()].map(bytes);
        connection::write_back(&connection::writing(of("study.db").path()).unwrap()).unwrap();
        let new = bytes(of("study.db").path());
        let (mark, place) = mark::by_sqlite(&of("study.db")).unwrap().unwrap();
        let (same, found) = mark::by_bytes(&of("study.db")).unwrap().unwrap();
        assert_eq!((same, found.offset, found.length), (mark, place.offset, place.length));
        add_rows(&db, 8..16).await;
        let later = bytes(of("study.db").log());
        assert!(later[..] != log[..] && new.len() > old.len());
        let _another = with_rows(&of("another.db"), 0..8).await;
        let others = bytes(of("another.db").log());
        // A checkpoint writes the pages in order. Here it ends after the page with the mark.
        let written = place.offset as usize + place.length;
        let torn = [&new[..written], old.get(written..).unwrap_or(&[])].concat();
        for (name, log, words) in [
            ("own.db", &log, None),
            ("later.db", &later, Some("not whole together")),
            ("others.db", &others, Some("another database")),
        ] {
            let copy = of(name);
            std::fs::write(copy.path(), &torn).unwrap();
            std::fs::write(copy.log(), log).unwrap();
            assert!(mark::of_file(&copy).unwrap().is_some(), "{name}");
            if words.is_none() {
                assert_eq!(
                    Sqlite::open(copy.clone(), Purpose::Read).unwrap().read(rows).unwrap(),
                    8
                );
            }
            match (Sqlite::open(copy.clone(), Purpose::Alone), words) {
                (Ok(db), None) => assert_eq!(db.read(rows).unwrap(), 8),
                (Err(error), Some(words)) => {
                    assert!(error.to_string().contains(words), "{name}: {error}");
                    assert!(bytes(copy.path()) == torn && bytes(copy.log()) == *log, "{name}");
                }
                (other, _) => panic!("{name}: {:?}", other.err()),
            }
        }
    }

    /// A power failure may truncate the last transaction. Every other difference from what SQLite
    /// wrote is damage.
    #[tokio::test(flavor = "multi_thread")]
    async fn damage_of_a_log_is_told_from_a_power_cut() {
        use std::os::unix::fs::FileExt;
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
        let db = Sqlite::open(of("study.db"), Purpose::Alone).unwrap();
        for key in 0..8 {
            let add = "INSERT INTO study_config (hash, json) VALUES ($1, $2)";
            let json = format!("{{\"text\": \"{}\"}}", "x".repeat(9_000));
            db.write(Lane::Request, move |db| Ok(db.execute(add, [key.to_string(), json])?))
                .await
                .unwrap();
        }
        let length = std::fs::metadata(of("study.db").log()).unwrap().len();
        let told = std::fs::read(of("study.db").index()).unwrap();
        let index = |name: &str| {
            let mut bytes = told.clone();
            match name {
                "told.db" | "cut and told.db" => {}
                // The page number of the second frame.
                "indexed.db" => bytes[140..144].copy_from_slice(&[7; 4]),
                _ => return None,
            }
            let path = of(name).index();
            std::fs::write(&path, bytes).unwrap();
            Index::read(&File::open(path).unwrap(), true)
        };
        let misplaced = |name: &str, at: u64, bytes: usize| {
            let copy = of(name);
            std::fs::copy(of("study.db").path(), copy.path()).unwrap();
            std::fs::copy(of("study.db").log(), copy.log()).unwrap();
            let log = std::fs::OpenOptions::new().write(true).open(copy.log()).unwrap();
            log.write_all_at(&vec![7; bytes], at).unwrap();
            mark::misplaced(&copy, || index(name)).unwrap()
        };
        assert_eq!(misplaced("whole.db", 0, 0), None);
        assert_eq!(misplaced("cut.db", length - 2_000, 2_000), None);
        // A killed process leaves the index behind; after a power failure, the index is never ahead of the log.
        assert_eq!(misplaced("told.db", 0, 0), None);
        for (name, at, bytes) in [
            ("cut and told.db", length - 2_000, 2_000),
            ("indexed.db", 0, 0),
            ("magic.db", 0, 4),
            ("header.db", 20, 4_096),
            ("salts.db", 40, 8),
            ("middle.db", length / 2, 4_096),
        ] {
            assert_eq!(misplaced(name, at, bytes), Some(Misplaced::Damaged), "{name}");
        }
        db.close();
    }
}
