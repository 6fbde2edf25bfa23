//! JSON input and output of commands.

use super::{CommandError, print_json, print_line, table_file, unwritable};
use crate::formats::{atomic_file, text};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sidestep::document::{Unread, object_from_json};
use sidestep::invalid::Invalid;
use std::io::Read;
use std::path::{Path, PathBuf};
use tokio_util::sync::CancellationToken;

/// Source of a document and destination of the answer.
#[derive(Clone, Debug, clap::Args)]
pub struct JsonArgs {
    /// JSON file to read; - reads stdin.
    #[arg(long, value_name = "FILE.json")]
    input: PathBuf,
    /// File for the answer, as one line of JSON [default: stdout].
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
}

impl JsonArgs {
    /// Checks that the answer can be written, before the computation starts.
    ///
    /// # Errors
    /// [`CommandError`] naming the file.
    pub(super) fn check_out(&self) -> Result<(), CommandError> {
        match &self.out {
            Some(out) => atomic_file::check(out).map_err(|e| unwritable(out, &e)),
            None => Ok(()),
        }
    }

    /// Checks that the answer can be written, and reads the document.
    pub(super) fn read<T: DeserializeOwned>(&self) -> Result<T, CommandError> {
        self.check_out()?;
        self.document().read()
    }

    /// The document.
    pub(super) fn document(&self) -> Document<'_> {
        Document(&self.input)
    }

    /// Writes the whole answer or nothing.
    pub(super) fn answer(&self, answer: &impl Serialize) -> Result<(), CommandError> {
        let line = serde_json::to_string(answer).map_err(CommandError::failure)?;
        let Some(out) = &self.out else {
            return print_line(&line);
        };
        atomic_file::write(out, &CancellationToken::new(), |file| writeln!(file, "{line}"))
            .map_err(|e: std::io::Error| unwritable(out, &e))?;
        print_json(&serde_json::json!({ "file": out, "bytes": line.len() + 1 }))
    }
}

/// A JSON document, given by its path; - is stdin.
#[derive(Clone, Copy)]
pub(super) struct Document<'a>(pub(super) &'a Path);

impl Document<'_> {
    /// The document's name in errors.
    pub(super) fn name(self) -> String {
        table_file::name(self.0)
    }

    pub(super) fn is_stdin(self) -> bool {
        table_file::is_stdin(self.0)
    }

    pub(super) fn read<T: DeserializeOwned>(self) -> Result<T, CommandError> {
        let refused =
            |e: &dyn std::fmt::Display| CommandError::Input(format!("{}: {e}", self.name()));
        let mut bytes = Vec::new();
        table_file::open(self.0)
            .and_then(|mut file| file.read_to_end(&mut bytes))
            .map_err(|e| refused(&format!("cannot read: {e}")))?;
        let (text, encoding) =
            text::whole(&bytes).map_err(|found| refused(&format!("not JSON: found {found}")))?;
        if let Some(encoding) = encoding.remark() {
            eprintln!("sidestep: {}: read as {encoding}", self.name());
        }
        object_from_json(&text).map_err(|unread| match unread {
            Unread::NotJson(why) => refused(&format!("not JSON: {why}")),
            Unread::Invalid(invalid) => self.complain(&invalid),
        })
    }

    /// An error about a field of the document.
    pub(super) fn complain(self, invalid: &Invalid) -> CommandError {
        CommandError::Input(format!("{}: {invalid}", self.name()))
    }
}
