//! Commands that turn one JSON document into another one.

use super::{CommandError, print_json, print_line, unwritable};
use crate::formats::atomic_file;
use crate::formats::complaint::plain;
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use sidestep::invalid::Invalid;
use std::io::Read;
use std::path::{Path, PathBuf};
use tokio_util::sync::CancellationToken;

/// Where a document comes from and where the answer goes.
#[derive(Clone, Debug, clap::Args)]
pub struct JsonArgs {
    /// JSON file to read; - reads stdin.
    #[arg(long, value_name = "FILE.json")]
    input: PathBuf,
    /// File for the answer, one line of JSON; without it the answer goes to stdout.
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
}

impl JsonArgs {
    /// Reads the document, once it is known that the answer can be written.
    pub(super) fn read<T: DeserializeOwned>(&self) -> Result<T, CommandError> {
        if let Some(out) = &self.out {
            atomic_file::check(out).map_err(|e| unwritable(out, &e))?;
        }
        self.document().read()
    }

    /// The document.
    pub(super) fn document(&self) -> Document<'_> {
        Document(&self.input)
    }

    /// Writes the answer: whole, or not at all.
    pub(super) fn answer(&self, answer: &impl Serialize) -> Result<(), CommandError> {
        let line = serde_json::to_string(answer).map_err(CommandError::failure)?;
        let Some(out) = &self.out else {
            return print_line(&line);
        };
        atomic_file::write(out, &CancellationToken::new(), |file| writeln!(file, "{line}"))
            .map_err(|e: std::io::Error| unwritable(out, &e))?;
        print_json(&serde_json::json!({ "file": out, "octets": line.len() + 1 }))
    }
}

/// A JSON document by its path; - is stdin.
#[derive(Clone, Copy)]
pub(super) struct Document<'a>(pub(super) &'a Path);

impl Document<'_> {
    /// What complaints call it.
    fn name(self) -> String {
        if self.is_stdin() { "stdin".to_owned() } else { self.0.display().to_string() }
    }

    pub(super) fn is_stdin(self) -> bool {
        self.0 == Path::new("-")
    }

    pub(super) fn read<T: DeserializeOwned>(self) -> Result<T, CommandError> {
        let refused =
            |e: &dyn std::fmt::Display| CommandError::Input(format!("{}: {e}", self.name()));
        let mut text = String::new();
        let read = if self.is_stdin() {
            std::io::stdin().lock().read_to_string(&mut text).map(drop)
        } else {
            std::fs::read_to_string(self.0).map(|content| text = content)
        };
        read.map_err(|e| refused(&format!("cannot read: {e}")))?;
        // First whether it is JSON at all: only then a complaint about a field helps.
        serde_json::from_str::<IgnoredAny>(&text).map_err(|e| refused(&format!("no JSON: {e}")))?;
        // A list would be taken for an object's fields in their order.
        if text.trim_start().starts_with('[') {
            return Err(refused(&"expected an object, {…}, found a list"));
        }
        let mut reader = serde_json::Deserializer::from_str(&text);
        serde_path_to_error::deserialize(&mut reader).map_err(|e| refused(&complaint(e)))
    }

    /// A complaint about a field of it.
    pub(super) fn complain(self, invalid: &Invalid) -> CommandError {
        CommandError::Input(format!("{}: {invalid}", self.name()))
    }
}

/// In the order of every complaint: field, expected, found.
fn complaint(error: serde_path_to_error::Error<serde_json::Error>) -> String {
    let path = error.path().to_string();
    let field = if path == "." { "the document".to_owned() } else { path };
    format!("{field}: {}", plain(&error.into_inner().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complaints_say_where() {
        let said = |text: &str| {
            let mut reader = serde_json::Deserializer::from_str(text);
            let read: Result<Vec<[f64; 2]>, _> = serde_path_to_error::deserialize(&mut reader);
            complaint(read.unwrap_err())
        };
        // Which column it is depends on how serde_json was built.
        let expected = "[1][1]: expected a number, found string \"x\" (line 1 column ";
        assert!(said("[[1,2],[3,\"x\"]]").starts_with(expected));
        assert!(said("[[1]]").starts_with("[0]: expected a list of 2, found 1"));
        assert!(said("{}").starts_with("the document: expected a list, […], found an object"));
    }
}
