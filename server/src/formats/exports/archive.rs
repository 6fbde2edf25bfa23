//! An export as one ZIP archive, written sequentially so that it can be sent during the export. The
//! same data give the same bytes.

use super::companions::{FileEntry, MANIFEST, Manifest, plain};
use super::damage::Damage;
use super::dataset::Dataset;
use super::folder;
use super::hashed::Hashed;
use super::printing::Printing;
use super::table::Table;
use super::table_file::{Place, TableFile};
use super::written::Written;
use super::{ExportError, Format};
use crate::formats::tables::participants::Participants;
use crate::store::Store;
use crate::support::clock::date_time;
use crate::support::private::Unfinished;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::runtime::Handle;
use tokio_util::sync::CancellationToken;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Capacity of the output buffer (bytes).
const PIECE: usize = 1 << 16;

type Archive<W> = ZipWriter<StreamWriter<BufWriter<Gate<W>>>>;

/// An archive, the manifest entries of its files, and the damage.
type Filled<W> = (Archive<W>, Vec<FileEntry>, Damage);

/// Writes an export as an archive, with the manifest last. After an error the output is not a valid
/// archive, because it has no central directory. The participants are read once for each table, so that
/// memory does not grow with the study. Only a database (`sqlite`) is first written as a file in `scratch`.
///
/// Returns the damage, which is also in the manifest.
///
/// This function blocks, and reads from the store with `runtime`.
///
/// # Errors
/// [`ExportError`], also if `out` fails.
pub fn archive<W: Write + Send + 'static>(
    store: &Store,
    dataset: &Dataset,
    format: Format,
    runtime: &Handle,
    scratch: &Path,
    out: W,
) -> Result<Damage, ExportError> {
    let failed = Arc::new(AtomicBool::new(false));
    let gate = Gate { out, failed: Arc::clone(&failed) };
    let zip: Archive<W> = ZipWriter::new_stream(BufWriter::with_capacity(PIECE, gate));
    let _entered = runtime.enter();
    let written = match format {
        Format::Sqlite => with_database(store, dataset, zip, scratch, &failed),
        _ => table_by_table(store, dataset, format, zip, &failed),
    };
    let (mut zip, files, damage) = written?;
    let created_at = date_time(dataset.changed_at_ms().unwrap_or(0));
    let manifest = Manifest::new(dataset, format, created_at, files, damage.clone());
    begin(&mut zip, MANIFEST)?;
    zip.write_all(&manifest.text()?)?;
    zip.finish().map_err(io::Error::from)?.into_inner().flush()?;
    Ok(damage)
}

fn table_by_table<W: Write + Send + 'static>(
    store: &Store,
    dataset: &Dataset,
    format: Format,
    mut zip: Archive<W>,
    failed: &Arc<AtomicBool>,
) -> Result<Filled<W>, ExportError> {
    let (mut entries, mut written) = (Vec::new(), Vec::new());
    let mut damage = Damage::default();
    let participants = Participants::new(&dataset.study.config, &dataset.people);
    for table in [Table::Steps, Table::Trials, Table::KeyEvents, Table::Participants] {
        let name = format.file(&dataset.study.slug, table);
        begin(&mut zip, &name)?;
        let columns = match table {
            Table::Participants => participants.columns(),
            driven => driven.columns(),
        };
        let place = Place::File(name.clone(), zip);
        let mut file = TableFile::begin(format, table, columns.clone(), place)?;
        if table == Table::Participants {
            file.write(&participants.rows())?;
        } else {
            let people = dataset.driven(store, Arc::clone(failed));
            let mut printing = Printing::of(format, &dataset.filter, vec![file]);
            let added = printing.add_all(people, &CancellationToken::new());
            // Set `failed` before the archive is dropped, because the drop would otherwise complete
            // the archive.
            failed.fetch_or(added.is_err(), Ordering::SeqCst);
            added?;
            // Every pass finds the same damage.
            let mut files;
            (files, damage) = printing.finish();
            file = files.remove(0);
        }
        let rows = file.rows;
        let Some(hashed) = file.finish()? else { unreachable!("a file of its own") };
        let (out, bytes, sha256) = hashed.finish();
        zip = out;
        entries.push(FileEntry { name: name.clone(), rows, bytes, sha256 });
        written.push(Written { name, table, columns });
    }
    for file in plain(dataset, format, &written)? {
        begin(&mut zip, &file.name)?;
        let mut out = Hashed::new(zip);
        out.write_all(&file.content)?;
        let (out, bytes, sha256) = out.finish();
        zip = out;
        entries.push(FileEntry { name: file.name, rows: file.rows, bytes, sha256 });
    }
    Ok((zip, entries, damage))
}

/// A database cannot be written sequentially, so it is first written to a file.
fn with_database<W: Write + Send + 'static>(
    store: &Store,
    dataset: &Dataset,
    mut zip: Archive<W>,
    scratch: &Path,
    failed: &Arc<AtomicBool>,
) -> Result<Filled<W>, ExportError> {
    let folder = Unfinished::within(".sidestep-export-", scratch);
    let written = folder.map_err(ExportError::from).and_then(|folder| {
        let people = dataset.driven(store, Arc::clone(failed));
        let entries = folder::tables(folder.path(), dataset, Format::Sqlite, |printing| {
            printing.add_all(people, &CancellationToken::new())
        })?;
        Ok((folder, entries))
    });
    failed.fetch_or(written.is_err(), Ordering::SeqCst);
    let (folder, (entries, damage)) = written?;
    for entry in &entries {
        begin(&mut zip, &entry.name)?;
        let copied = File::open(folder.path().join(&entry.name))
            .and_then(|mut file| io::copy(&mut file, &mut zip));
        failed.fetch_or(copied.is_err(), Ordering::SeqCst);
        copied?;
    }
    Ok((zip, entries, damage))
}

/// Begins a file of an archive. Sets no time, so that the same content gives the same bytes.
fn begin<W: Write>(zip: &mut Archive<W>, name: &str) -> io::Result<()> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(1))
        .last_modified_time(DateTime::DEFAULT)
        .unix_permissions(0o644)
        .large_file(true);
    Ok(zip.start_file(name, options)?)
}

/// A writer that refuses output after a failure. Dropping an archive writes its central directory,
/// so the output would otherwise look complete.
struct Gate<W> {
    out: W,
    failed: Arc<AtomicBool>,
}

impl<W: Write> Write for Gate<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failed.load(Ordering::SeqCst) || std::thread::panicking() {
            return Err(io::Error::other("the export was aborted"));
        }
        let written = self.out.write(bytes);
        self.failed.fetch_or(written.is_err(), Ordering::SeqCst);
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::exports::Filter;
    use crate::store::tests::{Known, someone, store, trial};
    use sidestep::vehicle::TurnInput;
    use std::io::Cursor;
    use std::sync::Mutex;

    /// Collects the output.
    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    async fn written(
        store: &Store,
        dataset: &Dataset,
        format: Format,
    ) -> (Result<Damage, ExportError>, Vec<u8>) {
        let (kept, runtime) = (Kept::default(), Handle::current());
        let (store, dataset, out) = (store.clone(), dataset.clone(), kept.clone());
        let write = move || archive(&store, &dataset, format, &runtime, &std::env::temp_dir(), out);
        let result = tokio::task::spawn_blocking(write).await.unwrap();
        let bytes = kept.0.lock().unwrap().clone();
        (result, bytes)
    }

    #[tokio::test]
    async fn the_same_instant_is_the_same_bytes_or_no_archive() {
        let (_folder, store) = store().await;
        for name in ["ada", "bob"] {
            someone(&store, name, Known::default()).await;
            let first = trial(&format!("{name}-0"), TurnInput::Left);
            store.put_trial(name, first).await.unwrap();
        }
        let study = store.study("default").await.unwrap().unwrap();
        let filter = Filter::default();
        let read = || Dataset::read(&store, &study, &filter);
        let dataset = read().await.unwrap();
        for format in [Format::Csv, Format::Parquet, Format::Sqlite] {
            let (_, before) = written(&store, &dataset, format).await;
            assert!(zip::ZipArchive::new(Cursor::new(&before[..])).is_ok());
            assert_eq!(written(&store, &dataset, format).await.1, before);
        }
        // Data stored later are not in the archive.
        let (_, before) = written(&store, &dataset, Format::Csv).await;
        store.put_trial("ada", trial("ada-1", TurnInput::Right)).await.unwrap();
        assert_eq!(written(&store, &dataset, Format::Csv).await.1, before);
        let mark = dataset.fingerprint(Format::Csv);
        let dataset = read().await.unwrap();
        assert_ne!(dataset.fingerprint(Format::Csv), mark);
        assert_ne!(dataset.fingerprint(Format::Csv), dataset.fingerprint(Format::Jsonl));
        // Data that were deleted in the meantime cannot be in the archive.
        store.withdraw("bob", true, 10, None).await.unwrap();
        for format in [Format::Csv, Format::Parquet, Format::PsychDs, Format::Sqlite] {
            let (result, bytes) = written(&store, &dataset, format).await;
            let said = result.unwrap_err().to_string();
            assert_eq!(said, "participant 2: trials were deleted during the export; export again");
            assert!(zip::ZipArchive::new(Cursor::new(&bytes[..])).is_err(), "{format:?}");
        }
    }
}
