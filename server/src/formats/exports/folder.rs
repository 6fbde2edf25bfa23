//! The folder of an export: the tables, their dictionary, the configurations, and a manifest that is
//! written last.

use super::table_file::{Format, Hashed, TableFile};
use super::{Filter, Person};
use crate::clock::{date_time, now_ms};
use crate::formats::atomic_file;
use crate::formats::atomic_folder::Draft;
use crate::formats::table::{Batch, Column};
use crate::formats::tables::participants::Participants;
use crate::formats::tables::{key_events, steps, trials};
use crate::store::studies::StoredStudy;
use crate::store::{Store, StoreError};
use serde::Serialize;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

/// The name of the manifest.
pub const MANIFEST: &str = "manifest.json";

/// What an export has. A folder without it is not complete.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    /// Name of the study in addresses.
    pub study: String,
    /// When the export began, UTC.
    pub created_at: String,
    /// Version of the program that wrote it.
    pub version: &'static str,
    /// The format of the tables.
    pub format: Format,
    /// Which data the export has.
    pub filter: Filter,
    /// The files beside it.
    pub files: Vec<FileEntry>,
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FileEntry {
    /// Its name.
    pub name: String,
    /// Rows of a table, else entries of a list.
    pub rows: u64,
    /// Its length.
    pub bytes: u64,
    /// SHA-256 of its content, as hexadecimal digits.
    pub sha256: String,
}

/// Why there is no export.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The database cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The folder cannot be written.
    #[error(transparent)]
    Disk(#[from] io::Error),
    /// A defect of this program.
    #[error("the export broke off: {0}")]
    Defect(#[from] tokio::task::JoinError),
}

/// Writes the export of a study into a folder. Files with the same names are replaced when everything new is
/// on the disk; in between there is no manifest.
///
/// # Errors
/// [`ExportError`], also if `cancel` was cancelled; the folder has no new file then, or no manifest.
pub async fn write(
    store: &Store,
    study: &StoredStudy,
    format: Format,
    filter: &Filter,
    folder: &Path,
    cancel: &CancellationToken,
) -> Result<Manifest, ExportError> {
    let created_at = date_time(now_ms());
    let draft = Draft::begin(folder)?;
    let mut people = store.roster(study.id, filter.pilots).await?;
    people.retain(|person| filter.keeps_configuration(&person.config_hash));
    let mut driven = Tables::begin(draft.path(), format, filter)?;
    // One task reads, and a thread prints.
    let (sender, mut receiver) = mpsc::channel::<Person>(4);
    let printing = tokio::task::spawn_blocking(move || {
        while let Some(person) = receiver.blocking_recv() {
            driven.add(&person)?;
        }
        driven.finish()
    });
    for person in &people {
        if cancel.is_cancelled() {
            return Err(io::Error::other("stopped").into());
        }
        let Some(person) = Person::read(store, &person.id).await? else { continue };
        if sender.send(person).await.is_err() {
            break; // The thread says why.
        }
    }
    drop(sender);
    let mut files = printing.await??;

    let table = Participants::new(&study.config, &people);
    let mut participants = TableFile::begin(draft.path(), "participants", table.columns(), format)?;
    participants.write(&table.rows())?;
    files.push(participants);
    let mut entries = Vec::new();
    let mut dictionary = Vec::new();
    for file in files {
        let meaning = |column: &Column| Meaning { file: file.name.clone(), column: column.clone() };
        dictionary.extend(file.columns.iter().map(meaning));
        let (name, rows) = (file.name.clone(), file.rows);
        let (bytes, sha256) = file.finish()?;
        entries.push(FileEntry { name, rows, bytes, sha256 });
    }
    let configurations = store.configurations(study.id).await?;
    let configurations = configurations.iter().filter(|(hash, _)| filter.keeps_configuration(hash));
    let configurations: Vec<String> = configurations.map(configuration).collect();
    let text = format!("[\n{}\n]\n", configurations.join(",\n"));
    entries.push(plain(
        draft.path(),
        "configurations.json",
        configurations.len(),
        text.as_bytes(),
    )?);
    let text = serde_json::to_vec_pretty(&dictionary).map_err(io::Error::from)?;
    entries.push(plain(draft.path(), "dictionary.json", dictionary.len(), &text)?);

    match fs::remove_file(folder.join(MANIFEST)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
        _ => {}
    }
    draft.keep(&[], cancel)?;
    let manifest = Manifest {
        study: study.slug.clone(),
        created_at,
        version: env!("CARGO_PKG_VERSION"),
        format,
        filter: filter.clone(),
        files: entries,
    };
    let text = serde_json::to_vec_pretty(&manifest).map_err(io::Error::from)?;
    // From here on it is complete but for this.
    let cancel = CancellationToken::new();
    atomic_file::write(&folder.join(MANIFEST), &cancel, |out| out.write_all(&text))?;
    Ok(manifest)
}

/// A line of the dictionary.
#[derive(Serialize)]
struct Meaning {
    file: String,
    #[serde(flatten)]
    column: Column,
}

/// An entry of configurations.json. The configuration is there byte for byte, so that its hash can be
/// computed again.
fn configuration((hash, json): &(String, String)) -> String {
    format!("{{\"configuration\": \"{hash}\", \"study\": {json}}}")
}

/// Writes a file that is no table.
fn plain(folder: &Path, name: &str, rows: usize, content: &[u8]) -> io::Result<FileEntry> {
    let mut file = Hashed::create(&folder.join(name))?;
    file.write_all(content)?;
    let (bytes, sha256) = file.finish();
    Ok(FileEntry { name: name.to_owned(), rows: rows as u64, bytes, sha256 })
}

/// The tables that follow from trials, in this order: steps, trials, key events.
struct Tables {
    filter: Filter,
    batch_rows: usize,
    files: Vec<TableFile>,
    batches: Vec<Batch>,
}

impl Tables {
    fn begin(folder: &Path, format: Format, filter: &Filter) -> io::Result<Self> {
        let tables = [
            ("steps", steps::columns()),
            ("trials", trials::columns()),
            ("key_events", key_events::columns()),
        ];
        let batches = tables.iter().map(|(_, columns)| Batch::new(columns)).collect();
        let begin = |(name, columns)| TableFile::begin(folder, name, columns, format);
        let files = tables.into_iter().map(begin).collect::<io::Result<_>>()?;
        Ok(Self { filter: filter.clone(), batch_rows: format.batch_rows(), files, batches })
    }

    /// Adds the trials of a participant.
    fn add(&mut self, person: &Person) -> Result<(), ExportError> {
        for driven in person.driven().filter(|driven| self.filter.keeps(&driven.trial.head)) {
            steps::add(&mut self.batches[0], &driven);
            trials::add(&mut self.batches[1], &driven);
            key_events::add(&mut self.batches[2], &driven).map_err(|error| {
                let id = &driven.trial.head.trial_id;
                StoreError::Corrupt(format!("trial {id}: key events: {error}"))
            })?;
        }
        let batches = self.files.iter_mut().zip(&mut self.batches);
        for (file, batch) in batches.filter(|(_, batch)| batch.rows() >= self.batch_rows) {
            file.write(batch)?;
            batch.clear();
        }
        Ok(())
    }

    /// Writes the rows that are left. Returns the tables.
    fn finish(mut self) -> Result<Vec<TableFile>, ExportError> {
        for (file, batch) in self.files.iter_mut().zip(&self.batches) {
            file.write(batch)?;
        }
        Ok(self.files)
    }
}
