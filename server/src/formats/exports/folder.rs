//! An export as a folder: the tables, their companion files, and a manifest that is written last.

use super::companions::{FileEntry, MANIFEST, Manifest, dictionary, plain};
use super::damage::Damage;
use super::dataset::Dataset;
use super::hashed::Hashed;
use super::printing::Printing;
use super::sqlite;
use super::table::Table;
use super::table_file::{Place, TableFile, database};
use super::written::Written;
use super::{ExportError, Format};
use crate::database_check;
use crate::formats::atomic_file;
use crate::formats::atomic_folder::Draft;
use crate::formats::tables::participants::Participants;
use crate::store::Store;
use crate::support::clock::{date_time, now_ms};
use crate::support::private;
use serde::Deserialize;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;

/// The earlier export in a folder.
#[derive(Deserialize)]
struct Former {
    study: String,
    files: Vec<FormerFile>,
}

#[derive(Deserialize)]
struct FormerFile {
    name: String,
}

/// Writes an export into a folder. Replaces an earlier export of the same study there, in any
/// format, once all new files are on disk. During the replacement there is no manifest.
///
/// # Errors
/// [`ExportError`], also if the folder contains the export of another study, or `cancel` was cancelled.
/// After an error, the folder has no new file or no manifest.
pub async fn write(
    store: &Store,
    dataset: Dataset,
    format: Format,
    folder: &Path,
    cancel: &CancellationToken,
) -> Result<Manifest, ExportError> {
    let created_at = date_time(now_ms());
    let former = fs::read(folder.join(MANIFEST)).ok();
    let former: Option<Former> = former.and_then(|text| serde_json::from_slice(&text).ok());
    let mut obsolete = Vec::new();
    if let Some(Former { study, files }) = former {
        if study != dataset.study.slug {
            return Err(ExportError::Occupied(study));
        }
        obsolete.extend(files.into_iter().map(|file| file.name).filter(|name| !name.contains('/')));
    }
    let draft = Draft::begin_private(folder)?;
    // Also check the database itself: the replay of a trial cannot show that the trial belongs to
    // another participant.
    let database = database_check::damage_of_database(store).await?;
    let people = dataset.driven(store, Arc::default());
    let (path, asked) = (draft.path().to_owned(), cancel.clone());
    // An async task reads the participants, and this thread writes the tables.
    let writing = tokio::task::spawn_blocking(move || {
        let (files, damage) =
            tables(&path, &dataset, format, |printing| printing.add_all(people, &asked))?;
        Ok::<_, ExportError>((dataset, files, damage))
    });
    let (dataset, files, damage) = writing.await??;
    let damage = Damage { database, ..damage };
    match fs::remove_file(folder.join(MANIFEST)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
        _ => {}
    }
    let obsolete: Vec<&str> = obsolete.iter().map(String::as_str).collect();
    draft.keep(&obsolete, cancel)?;
    let manifest = Manifest::new(&dataset, format, created_at, files, damage);
    let text = manifest.text()?;
    // Ignore a cancellation from here on, because only the manifest is missing.
    let cancel = CancellationToken::new();
    atomic_file::write_private(&folder.join(MANIFEST), &cancel, |out| out.write_all(&text))?;
    Ok(manifest)
}

/// Writes all files except the manifest into a folder. `fill` adds the participants with their
/// trials. Also returns the damage.
pub(super) fn tables(
    folder: &Path,
    dataset: &Dataset,
    format: Format,
    fill: impl FnOnce(&mut Printing<File>) -> Result<(), ExportError>,
) -> Result<(Vec<FileEntry>, Damage), ExportError> {
    let shared = match format {
        Format::Sqlite => Some(database(folder)?),
        _ => None,
    };
    let begin = |table: Table, columns| {
        let place = match &shared {
            Some(database) => Place::Database(Arc::clone(database)),
            None => {
                let name = format.file(&dataset.study.slug, table);
                let file = created(&folder.join(&name))?;
                Place::File(name, file)
            }
        };
        TableFile::begin(format, table, columns, place)
    };
    let driven = Table::DRIVEN.map(|table| begin(table, table.columns()));
    let driven = driven.into_iter().collect::<io::Result<_>>()?;
    let mut printing = Printing::of(format, &dataset.filter, driven);
    fill(&mut printing)?;
    let (mut files, damage) = printing.finish();
    let table = Participants::new(&dataset.study.config, &dataset.people);
    let mut participants = begin(Table::Participants, table.columns())?;
    participants.write(&table.rows())?;
    files.push(participants);

    let (mut entries, mut written) = (Vec::new(), Vec::new());
    let mut rows_of_all = 0;
    for file in files {
        let (name, table, rows) = (file.name.clone(), file.table, file.rows);
        rows_of_all += rows;
        written.push(Written { name: name.clone(), table, columns: file.columns.clone() });
        if let Some(hashed) = file.finish()? {
            let (_, bytes, sha256) = hashed.finish();
            entries.push(FileEntry { name, rows, bytes, sha256 });
        }
    }
    if let Some(database) = shared {
        let path = sqlite::finish(database, dataset, &dictionary(format, &written), folder)?;
        entries.push(of_file(&path, rows_of_all)?);
    }
    for file in plain(dataset, format, &written)? {
        let mut out = Hashed::new(created(&folder.join(&file.name))?);
        out.write_all(&file.content)?;
        let (_, bytes, sha256) = out.finish();
        entries.push(FileEntry { name: file.name, rows: file.rows, bytes, sha256 });
    }
    Ok((entries, damage))
}

/// Creates a file and its folder. Only this user can read the file, because it can contain external
/// ids of participants.
fn created(path: &Path) -> io::Result<File> {
    if let Some(parent) = path.parent() {
        private::make_folder(parent)?;
    }
    private::new_file(path)
}

/// The manifest entry of a finished file.
fn of_file(path: &Path, rows: u64) -> io::Result<FileEntry> {
    let mut hashed = Hashed::new(io::sink());
    io::copy(&mut File::open(path)?, &mut hashed)?;
    let (_, bytes, sha256) = hashed.finish();
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(FileEntry { name, rows, bytes, sha256 })
}
