//! The file of an import. It is read twice: the first pass checks the whole file, and the second pass
//! imports it.

use crate::commands::table_file;
use crate::formats::csv_lines::Dialect;
use crate::formats::exports::MANIFEST;
use crate::formats::trials_csv::{self, Order};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use sidestep::invalid::Invalid;
use sidestep::recording::RecordedParticipant;
use sidestep::scene::SceneParameters;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::ops::ControlFlow;
use std::path::Path;

/// A file that can be read twice.
pub(super) struct Source {
    file: File,
    /// The SHA-256 of the file, according to the manifest beside it.
    sha256: Option<String>,
}

impl Source {
    /// Opens the file; - is stdin. Input that can be read only once, such as a pipe, is first copied to
    /// a temporary file.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let copied = |mut from: &mut dyn Read| {
            let mut copy = tempfile::tempfile()?;
            io::copy(&mut from, &mut copy)?;
            io::Result::Ok(copy)
        };
        let file = match table_file::is_stdin(path) {
            true => copied(&mut io::stdin())?,
            false => {
                let mut file = File::open(path)?;
                if file.metadata()?.is_file() { file } else { copied(&mut file)? }
            }
        };
        Ok(Self { file, sha256: expected_hash(path) })
    }

    /// Checks the file. Also returns its dialect.
    ///
    /// # Errors
    /// The fault, with its line.
    pub(super) fn checked(
        self,
        parameters: &SceneParameters,
    ) -> Result<(Checked, Dialect), String> {
        let mut file = Hashing { file: self.rewound()?, hash: Sha256::new() };
        let order = trials_csv::check(&mut file, parameters);
        if let Some(expected) = &self.sha256 {
            // Read the rest of the file even after a fault, to compute the hash.
            io::copy(&mut file, &mut io::sink()).map_err(said)?;
            let found = hex::encode(file.hash.finalize());
            if found != *expected {
                let expected = format!("{expected}, as {MANIFEST} beside it says");
                let hint = "the file was cut off or changed; export again, or move it to a folder of its \
                            own to import it as it is";
                return Err(format!("{}; {hint}", Invalid::new("SHA-256", expected, found)));
            }
        }
        let (order, dialect) = order.map_err(said)?;
        let checked = match order {
            Order::Together => Checked::Together(self),
            Order::Scattered => {
                let people = trials_csv::read(self.rewound()?, parameters).map_err(said)?;
                Checked::Scattered(people)
            }
        };
        Ok((checked, dialect))
    }

    fn rewound(&self) -> Result<&File, String> {
        (&self.file).rewind().map_err(said)?;
        Ok(&self.file)
    }
}

fn said(error: impl Display) -> String {
    error.to_string()
}

/// A file without faults.
pub(super) enum Checked {
    /// The rows of each participant are adjacent, so the file is read again.
    Together(Source),
    /// The rows of a participant are scattered, so the whole file is in memory.
    Scattered(Vec<RecordedParticipant>),
}

impl Checked {
    /// Passes the participants one by one to `to`, until it returns `Break`.
    ///
    /// # Errors
    /// The fault, if the file changed since the check.
    pub(super) fn each(
        self,
        parameters: &SceneParameters,
        mut to: impl FnMut(RecordedParticipant) -> ControlFlow<()>,
    ) -> Result<(), String> {
        match self {
            Self::Together(source) => {
                trials_csv::each(source.rewound()?, parameters, to).map_err(said)
            }
            Self::Scattered(people) => {
                let _ = people.into_iter().try_for_each(&mut to);
                Ok(())
            }
        }
    }
}

/// The SHA-256 of this file in the manifest of an export. Returns `None` if no manifest names the file.
fn expected_hash(path: &Path) -> Option<String> {
    #[derive(Deserialize)]
    struct Manifest {
        files: Vec<Entry>,
    }
    #[derive(Deserialize)]
    struct Entry {
        name: String,
        sha256: String,
    }
    let name = path.file_name()?.to_str()?;
    let text = std::fs::read(path.with_file_name(MANIFEST)).ok()?;
    let manifest: Manifest = serde_json::from_slice(&text).ok()?;
    manifest.files.into_iter().find(|entry| entry.name == name).map(|entry| entry.sha256)
}

struct Hashing<R> {
    file: R,
    hash: Sha256,
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.hash.update(&buffer[..count]);
        Ok(count)
    }
}
