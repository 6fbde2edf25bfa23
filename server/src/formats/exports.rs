//! Exports a study's data as files. `sidestep export` writes a folder. The HTTP route sends an
//! archive of the same files. It also sends the steps as one CSV file, for scripts that need
//! nothing else.
//!
//! Participants are read one after another, so memory does not grow with the study. Each read is short,
//! because a long read would prevent SQLite from checkpointing its log. Each participant's rows come
//! from one snapshot.

mod filter;
mod damage;
mod person;
mod table;
mod format;
mod hashed;
mod dataset;
mod table_file;
mod printing;
mod written;
mod psych_ds;
mod companions;
mod sqlite;
mod folder;
mod archive;

pub use archive::archive;
pub use companions::{FileEntry, MANIFEST, Manifest};
pub use damage::{Damage, Damaged};
pub use dataset::Dataset;
pub use filter::{Filter, Quality};
pub use folder::write;
pub use format::Format;

use self::person::Person;
use super::table::{Batch, csv_header, csv_rows};
use super::tables::steps;
use crate::store::roster::RosterEntry;
use crate::store::studies::StoredStudy;
use crate::store::{Store, StoreError};
use futures_util::stream::{self, Stream};
use sidestep::invalid::Invalid;
use std::io;

/// The reason why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The database cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The files cannot be written.
    #[error(transparent)]
    Disk(#[from] io::Error),
    /// Trials were deleted during the export.
    #[error("participant {participant}: trials were deleted during the export; export again")]
    Changed {
        /// The participant's number.
        participant: i64,
    },
    /// The folder contains the export of another study.
    #[error("it has the export of study {0}; name another folder")]
    Occupied(String),
    /// A defect of this program.
    #[error("the export was aborted: {0}")]
    Defect(#[from] tokio::task::JoinError),
}

/// Checks the format of a download of one table, which must be `csv`.
///
/// # Errors
/// [`Invalid`] naming the format.
pub fn check_format(format: &str) -> Result<(), Invalid> {
    if format == "csv" { Ok(()) } else { Err(Invalid::new("format", "csv", format!("{format:?}"))) }
}

/// Streams the table of steps as CSV, in pieces. After an error, the stream ends with this error, so
/// that the download is aborted and does not look complete.
pub fn stream(
    store: Store,
    study: StoredStudy,
) -> impl Stream<Item = Result<Vec<u8>, StoreError>> + Send + 'static {
    enum Stage {
        Header,
        People(std::vec::IntoIter<RosterEntry>),
        End,
    }
    stream::unfold(Stage::Header, move |stage| {
        let (store, study_id) = (store.clone(), study.id);
        async move {
            match stage {
                Stage::Header => match store.roster(study_id, false).await {
                    Ok(people) => {
                        let header = csv_header(&steps::columns());
                        Some((Ok(header), Stage::People(people.into_iter())))
                    }
                    Err(error) => Some((Err(error), Stage::End)),
                },
                Stage::People(mut people) => match steps_of(&store, &people.next()?).await {
                    Ok(rows) => Some((Ok(rows), Stage::People(people))),
                    Err(error) => Some((Err(error), Stage::End)),
                },
                Stage::End => None,
            }
        }
    })
}

/// The steps of a participant. A damaged trial is marked. An unreadable trial is an error, because
/// there is no other file that could report it.
async fn steps_of(store: &Store, entry: &RosterEntry) -> Result<Vec<u8>, StoreError> {
    let person = Person::read(store, entry).await?;
    if let Some(damaged) = person.damaged().find(|damaged| !damaged.is_readable) {
        return Err(StoreError::Corrupt(damaged.to_string()));
    }
    let (columns, mut rows) = (steps::columns(), Vec::new());
    let mut batch = Batch::new(&columns);
    person.driven().for_each(|driven| steps::add(&mut batch, &driven));
    csv_rows(&columns, &batch, &mut rows);
    Ok(rows)
}
