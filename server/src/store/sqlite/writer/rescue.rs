//! Rescuing the data of a file that another process has changed.

use super::super::connection;
use super::super::file::DatabaseFile;
use super::Thread;
use crate::store::error::StoreError;
use crate::store::sql::Connection;
use crate::support::private;
use std::io::Seek;
use std::path::{Path, PathBuf};

impl Thread {
    /// Rescues the data into another file. If the content is intact, writes all data. Otherwise, if
    /// the file is still at its path, copies only the log. If the file is not at its path, copies
    /// the open file and its log.
    pub(super) fn rescue(&mut self) {
        if !self.original.lacks_rescue() {
            return;
        }
        let reader = if self.db.is_none() { self.readers.take_idle() } else { None };
        let is_whole = self.original.is_whole() && self.original.has_log();
        let open = self.db.as_ref().or(reader.as_ref()).filter(|_| is_whole);
        let is_in_place = self.original.is_in_place();
        let (what, end) = match open {
            None if is_in_place => ("the log of the database, with the latest data,", "-wal"),
            None => ("the file that the server has open, as it is, and its log", ".db"),
            Some(_) => ("the data of the database", ".db"),
        };
        for name in self.original.rescue_names() {
            let (unfinished, name) = (ended(&name, ".part"), ended(&name, end));
            let written = match open {
                Some(open) => match rescue_all(open, &unfinished) {
                    // SQLite stops at a damaged page, but 'sidestep salvage' can read the other
                    // pages of a plain copy.
                    Err(StoreError::Corrupt(_)) if !is_in_place => {
                        let _ = std::fs::remove_file(&unfinished);
                        self.rescue_file(&unfinished, &name)
                    }
                    written => written,
                },
                None if is_in_place => self.rescue_log(&unfinished),
                None => self.rescue_file(&unfinished, &name),
            };
            match written.and_then(|()| std::fs::rename(&unfinished, &name).map_err(refused)) {
                Ok(()) => {
                    tracing::error!(file = %name.display(), "{what} was written to this file");
                    self.original.note_rescued(Some(name));
                    break;
                }
                Err(error) => {
                    let file = name.display();
                    tracing::error!(%error, %file, "{what} could not be written to this file yet");
                    let _ = std::fs::remove_file(unfinished);
                }
            }
        }
        // Closing the reader may delete a log that belongs to another file, or is the only copy of the data.
        std::mem::forget(reader);
    }

    fn rescue_log(&self, to: &Path) -> Result<(), StoreError> {
        let copied = private::new_file(to).and_then(|mut to| {
            let mut log = self.original.open_log().ok_or(std::io::ErrorKind::NotFound)?;
            log.rewind()?;
            std::io::copy(&mut log, &mut to)?;
            to.sync_all()
        });
        copied.map_err(refused)
    }

    /// Writes the file to `to`, and its log beside `name`, the file's final name.
    fn rescue_file(&self, to: &Path, name: &Path) -> Result<(), StoreError> {
        let copied = private::new_file(to).and_then(|to| self.original.copy_to(&to));
        copied.map_err(refused)?;
        match self.original.open_log() {
            Some(_) => self.rescue_log(&ended(name, "-wal")),
            None => Ok(()),
        }
    }
}

fn rescue_all(open: &Connection, to: &Path) -> Result<(), StoreError> {
    DatabaseFile::at(to).create().map_err(refused)?;
    Ok(connection::copy_of(open, to)?)
}

fn refused(error: std::io::Error) -> StoreError {
    StoreError::Unavailable(error.to_string())
}

fn ended(path: &Path, end: &str) -> PathBuf {
    let mut path = path.as_os_str().to_owned();
    path.push(end);
    path.into()
}
