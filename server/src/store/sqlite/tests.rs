use super::*;
use crate::store::sql::Connection;
use std::os::unix::fs::FileExt;

async fn read<T: Send + 'static>(
    db: &Sqlite,
    work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    result_of(None, once(work), async |operation| db.read(operation)).await
}

async fn write<T: Send + 'static>(
    db: &Sqlite,
    work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    result_of(None, once(work), async |operation| db.write(Lane::Request, operation)).await
}

/// After a disk error, the writer closes its connection. So it has no open connection when the file
/// is deleted.
#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_file_is_rescued_through_a_reader() {
    let folder = tempfile::tempdir().unwrap();
    let file = DatabaseFile::at(&folder.path().join("study.db"));
    let db = Sqlite::open(file.clone(), Purpose::Alone).unwrap();
    let add = "INSERT INTO study_config (hash, json) VALUES ('kept', '{}')";
    let added = write(&db, |db| Ok(db.execute(add, [])?)).await.unwrap();
    assert_eq!(added, 1);
    let kept = |db: &Connection| {
        let count = "SELECT count(*) FROM study_config";
        Ok(db.query_row(count, [], |row| row.get::<_, i64>(0))?)
    };
    assert_eq!(read(&db, kept).await.unwrap(), 1);
    let failed = write(&db, |_| Err::<(), _>(StoreError::Full)).await;
    assert_eq!(failed, Err(StoreError::Full));
    std::fs::remove_file(file.path()).unwrap();
    while db.original.rescued().is_none() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    db.close();
    let rescued = DatabaseFile::at(&db.original.rescued().unwrap());
    assert_eq!(rescued.path().extension().unwrap(), "db");
    let rescued = Sqlite::open(rescued, Purpose::Read).unwrap();
    assert_eq!(read(&rescued, kept).await.unwrap(), 1);
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
        write(db, add).await.unwrap();
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
        // This check compares the log with its index. The log does not change afterwards.
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
        assert_eq!(read(&db, rows).await.unwrap(), 30, "{name}");
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

/// SQLite would write the pages of the journal into the database, although the pages belong to another
/// database.
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
    other.batch("BEGIN; PRAGMA cache_spill = 1; PRAGMA cache_size = 1; DELETE FROM study").unwrap();
    other.batch("CREATE TABLE filler AS SELECT randomblob(100000) AS bytes").unwrap();
    let journal = std::fs::read(folder.path().join("other.db-journal")).unwrap();
    assert!(journal.len() > 1000);
    with_rows(&of("study.db"), 0..3).await.close();
    let before = std::fs::read(of("study.db").path()).unwrap();
    let beside = folder.path().join("study.db-journal");
    for content in [b"of another program".to_vec(), journal] {
        std::fs::write(&beside, content).unwrap();
        for purpose in [Purpose::Read, Purpose::Alone, Purpose::Change] {
            let said = Sqlite::open(of("study.db"), purpose).unwrap_err().to_string();
            assert!(said.contains("study.db-journal has the name of a rollback journal"), "{said}");
        }
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
            let db = Sqlite::open(copy.clone(), Purpose::Read).unwrap();
            assert_eq!(read(&db, rows).await.unwrap(), 8);
        }
        match (Sqlite::open(copy.clone(), Purpose::Alone), words) {
            (Ok(db), None) => assert_eq!(read(&db, rows).await.unwrap(), 8),
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
        write(&db, move |db| Ok(db.execute(add, [key.to_string(), json])?)).await.unwrap();
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
    // When a process is killed, its index remains. After a power failure, the index is never ahead
    // of the log.
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
    // Logs that are too short for a frame. SQLite would delete them.
    let log = std::fs::read(of("study.db").log()).unwrap();
    for (content, told) in [
        (&log[..20], Some(Misplaced::Damaged)),
        (&log[..32], None),
        (&[0; 32], None),
        (b"a text", Some(Misplaced::Unmarked)),
    ] {
        std::fs::write(of("whole.db").log(), content).unwrap();
        assert_eq!(mark::misplaced(&of("whole.db"), || None).unwrap(), told, "{content:?}");
    }
    db.close();
}

/// With an older index, SQLite reads an earlier state of the database.
#[tokio::test(flavor = "multi_thread")]
async fn an_older_index_is_noticed_before_a_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = DatabaseFile::at(&folder.path().join("study.db"));
    let db = with_rows(&file, 0..3).await;
    let older = std::fs::read(file.index()).unwrap();
    add_rows(&db, 3..6).await;
    assert_eq!(read(&db, rows).await.unwrap(), 6);
    let index = File::options().write(true).open(file.index()).unwrap();
    index.write_all_at(&older, 0).unwrap();
    let refused = read(&db, rows).await;
    assert!(
        matches!(&refused, Err(StoreError::Gone(what)) if what.contains("-shm")),
        "{refused:?}"
    );
    db.close();
}

/// Runs VACUUM like another program, on a file or into a copy of it.
fn vacuum(file: &DatabaseFile, into: Option<&DatabaseFile>) {
    let db = connection::writing(file.path()).unwrap();
    let into = into.map_or(String::new(), |to| format!(" INTO '{}'", to.path().display()));
    db.batch(&format!("VACUUM{into}")).unwrap();
}

/// When another program runs `VACUUM INTO`, the copy has the same mark, but its pages are arranged
/// differently.
#[tokio::test(flavor = "multi_thread")]
async fn a_log_is_not_applied_to_a_vacuumed_copy() {
    for is_on_the_same_page in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
        let (file, copy) = (of("study.db"), of("copy.db"));
        with_rows(&file, 0..3).await.close();
        if is_on_the_same_page {
            vacuum(&file, None);
        }
        let db = with_rows(&file, 3..6).await;
        vacuum(&file, Some(&copy));
        add_rows(&db, 6..9).await;
        std::fs::copy(file.log(), copy.log()).unwrap();
        assert_eq!(mark::misplaced(&copy, || None).unwrap(), Some(Misplaced::Fork));
        assert_eq!(mark::misplaced(&file, || None).unwrap(), None);

        // A copy that overwrites the file leaves the log, which is rescued.
        std::fs::copy(copy.path(), file.path()).unwrap();
        while db.original.rescued().is_none() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        assert!(read(&db, rows).await.is_err());
        db.close();
    }
}

/// After the VACUUM, the mark is on different pages in the file and in the log.
#[tokio::test(flavor = "multi_thread")]
async fn a_log_that_begins_with_a_vacuum_is_the_files_own() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
    with_rows(&of("study.db"), 0..3).await.close();
    let db = with_rows(&of("study.db"), 3..3).await;
    vacuum(&of("study.db"), None);
    add_rows(&db, 3..6).await;
    assert_eq!(mark::misplaced(&of("study.db"), || None).unwrap(), None);
    for end in ["", "-wal"] {
        let of = |name| folder.path().join(format!("{name}{end}"));
        std::fs::copy(of("study.db"), of("killed.db")).unwrap();
    }
    let killed = Sqlite::open(of("killed.db"), Purpose::Alone).unwrap();
    assert_eq!(read(&killed, rows).await.unwrap(), 6);
    killed.close();
    db.close();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_with_a_long_name_is_rescued() {
    let folder = tempfile::tempdir().unwrap();
    let file = DatabaseFile::at(&folder.path().join("n".repeat(239) + ".db"));
    let db = with_rows(&file, 0..3).await;
    std::fs::remove_file(file.path()).unwrap();
    while db.original.rescued().is_none() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    db.close();
    let rescued = DatabaseFile::at(&db.original.rescued().unwrap());
    assert_eq!(rescued.folder(), folder.path());
    assert_eq!(read(&Sqlite::open(rescued, Purpose::Read).unwrap(), rows).await.unwrap(), 3);
}
