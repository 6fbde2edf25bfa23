//! The `sidestep` command: one module per subcommand.

pub mod check;
pub mod languages;
pub mod hash_key;
mod degrees;
mod solving;
mod table_file;
pub mod copy;
pub mod backup;
pub mod salvage;
pub mod retention;
pub mod export;
pub mod game;
pub mod solve;
pub mod value;
pub mod json_file;
mod prediction;
pub mod bounds;
pub mod reach;
mod trials_file;
pub mod import;
pub mod plot;
mod trials_source;
pub mod shfrs;
pub mod features;
pub mod analyze;
pub mod simulate;
pub mod design;
mod demo;
pub mod child;
pub mod analysis_args;
pub mod keeping_args;
pub mod serve;

use crate::backups::BackupError;
use crate::client::ClientError;
use crate::formats::exports::ExportError;
use crate::store::studies::StoredStudy;
use crate::store::{OpenError, Store, StoreError};
use crate::transfer::TransferError;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde::Serialize;
use sidestep::document::did_you_mean;
use std::io::{self, Write};
use std::path::Path;

/// The reason why a command failed. The message is one line that names the input and says what to
/// do.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// Usage or bad input: exit code 2.
    #[error("{0}")]
    Input(String),
    /// Anything else: exit code 1.
    #[error("{0}")]
    Failure(String),
    /// The reader closed the output early, as `head` does: exit code 0, no message.
    #[error("nobody reads the output")]
    Unread,
}

impl CommandError {
    /// Turns any error into a failure.
    pub fn failure(error: impl std::fmt::Display) -> Self {
        Self::Failure(error.to_string())
    }

    /// The error for a failed write to stdout.
    pub fn of_stdout(error: &io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::Unread,
            _ => Self::Failure(format!("stdout: {error}")),
        }
    }

    /// 2 for usage and bad input, 0 if the reader closed the output, and 1 otherwise.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Failure(_) => 1,
            Self::Unread => 0,
        }
    }

    /// The message for stderr, if any.
    #[must_use]
    pub fn said(&self) -> Option<&str> {
        match self {
            Self::Input(said) | Self::Failure(said) => Some(said),
            Self::Unread => None,
        }
    }
}

impl From<OpenError> for CommandError {
    fn from(error: OpenError) -> Self {
        match &error {
            OpenError::Address { .. } => Self::Input(error.to_string()),
            _ => Self::failure(error),
        }
    }
}

impl From<ClientError> for CommandError {
    fn from(error: ClientError) -> Self {
        Self::failure(error)
    }
}

impl From<StoreError> for CommandError {
    fn from(error: StoreError) -> Self {
        match &error {
            StoreError::Corrupt(_) => Self::Failure(format!(
                "{error}; 'sidestep check' says where, 'sidestep restore' restores a backup, and 'sidestep salvage' saves \
                 the readable part"
            )),
            _ => Self::failure(error),
        }
    }
}

impl From<ExportError> for CommandError {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Store(error) => error.into(),
            other => Self::failure(other),
        }
    }
}

impl From<BackupError> for CommandError {
    fn from(error: BackupError) -> Self {
        match error {
            BackupError::Store(error) | BackupError::Transfer(TransferError::Store(error)) => {
                error.into()
            }
            other => Self::failure(other),
        }
    }
}

/// The values of a flag. Each has the word on the command line, the value, and the help text.
type Words<T> = &'static [(&'static str, T, &'static str)];

/// A parser that accepts one of these words.
fn one_of<T: Clone + Send + Sync + 'static>(words: Words<T>) -> impl TypedValueParser<Value = T> {
    let values = words.iter().map(|(word, _, help)| PossibleValue::new(*word).help(*help));
    PossibleValuesParser::new(values).try_map(move |given| {
        let known = words.iter().find(|(word, ..)| *word == given);
        known.map(|(_, value, _)| value.clone()).ok_or("no such word")
    })
}

/// The study that `--study` names.
///
/// # Errors
/// [`CommandError::Input`] naming the existing studies.
async fn study_named(store: &Store, slug: &str) -> Result<StoredStudy, CommandError> {
    if let Some(study) = store.study(slug).await? {
        return Ok(study);
    }
    let known = store.slugs().await?;
    let meant = did_you_mean(slug, known.iter().map(String::as_str));
    let known = match known.len() {
        0 => "no study".to_owned(),
        _ => known.join(", "),
    };
    Err(CommandError::Input(format!(
        "--study {slug}: no such study in {}, which has {known}{meant}",
        store.name()
    )))
}

/// The error for a file that cannot be written.
fn unwritable(path: &Path, error: &dyn std::fmt::Display) -> CommandError {
    CommandError::Failure(format!("{}: cannot write: {error}", path.display()))
}

/// Returns a failure, because the printed result contains faults. It does not matter whether the
/// reader closed the output early.
fn failed(printed: Result<(), CommandError>, why: String) -> Result<(), CommandError> {
    match printed {
        Err(CommandError::Unread) | Ok(()) => Err(CommandError::Failure(why)),
        other => other,
    }
}

/// In an error about a database address, replaces `--database` with this flag.
fn of_flag(flag: &'static str) -> impl Fn(OpenError) -> CommandError {
    move |error| match error.into() {
        CommandError::Input(said) => CommandError::Input(said.replacen("--database", flag, 1)),
        other => other,
    }
}

/// Writes a result to stdout as one line of JSON.
fn print_json(result: &impl Serialize) -> Result<(), CommandError> {
    let line = serde_json::to_string(result).map_err(CommandError::failure)?;
    print_line(&line)
}

fn print_line(line: &str) -> Result<(), CommandError> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")
        .and_then(|()| out.flush())
        .map_err(|error| CommandError::of_stdout(&error))
}
