//! `sidestep salvage`.

use super::backup::{absent, new_database, no_address};
use super::solving::Interrupt;
use super::{CommandError, failed, print_json};
use crate::database_check::Report;
use crate::salvage;
use crate::store::copying::salvage::Lost;
use crate::store::{OpenError, Purpose, Store, copy_damaged};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Save the readable part of a damaged database file into a new database.
///
/// Replays every trial. Rows that are readable and sound are saved. stderr names each lost row with
/// its table, its key and the reason. The damaged file is not changed. If there is a backup,
/// restore it first, and salvage only the data that it lacks.
///
/// Prints a JSON summary. The exit code is 1 if anything was lost.
#[derive(Clone, Debug, clap::Args)]
pub struct SalvageArgs {
    /// Damaged SQLite file. If its -wal is beside it, this file is read too.
    #[arg(long, value_name = "FILE")]
    pub from: PathBuf,

    /// Database to create: sqlite:FILE, which must not exist, or postgres://USER@HOST/DATABASE without tables.
    #[arg(long, value_name = "URL")]
    pub database: String,
}

#[derive(Serialize)]
struct Saved {
    studies: usize,
    participants: usize,
    trials: usize,
    /// Number of lines on stderr. There is one line per lost row, or per range of rows or pages if
    /// the single rows are not known.
    lost: usize,
}

/// Saves the data, prints the losses on stderr, and prints a summary.
///
/// # Errors
/// [`CommandError::Input`] if the file is not a database, or the new database already exists;
/// [`CommandError::Failure`] if anything was lost, or the new database fails.
pub async fn run(args: SalvageArgs) -> Result<(), CommandError> {
    no_address("--from", &args.from)?;
    absent(&args.database).await?;
    let interrupt = Interrupt::listen();
    let fill =
        async |folder: &Path, url: &str| interrupt.unless_stopped(fill(&args, folder, url)).await?;
    let saved = new_database(&args.database, fill).await?;
    let printed = print_json(&saved);
    match saved.lost {
        0 => printed,
        1 => failed(printed, "the line above says what was lost; the rest was saved".to_owned()),
        lost => {
            failed(printed, format!("{lost} lines above say what was lost; the rest was saved"))
        }
    }
}

async fn fill(args: &SalvageArgs, folder: &Path, url: &str) -> Result<Saved, CommandError> {
    let named = args.from.display().to_string();
    let unreadable = |error: &dyn std::fmt::Display| {
        CommandError::Input(format!("--from {named}: cannot read: {error}"))
    };
    let copy = folder.join("damaged.db");
    let parts = copy_damaged(&args.from, &copy).map_err(|error| match error.kind() {
        std::io::ErrorKind::StorageFull => CommandError::Failure(format!(
            "{}: cannot write a copy of --from: {error}",
            folder.display()
        )),
        _ => unreadable(&error),
    })?;
    let from = Store::open(&format!("sqlite:{}", copy.display()), Purpose::Change).await;
    let from = from.map_err(|error| match error.named(named.clone()) {
        OpenError::Absent(_) => unreadable(&"it is empty"),
        OpenError::Unusable { reason, .. } => {
            unreadable(&reason.split("; ").next().unwrap_or(&reason))
        }
        error => CommandError::Input(format!("--from {error}")),
    })?;
    let to = Store::open(url, Purpose::Copy).await?;
    to.claim_copy("salvage").await?;
    let mut lost = 0;
    let mut lose = |row: Lost| {
        lost += 1;
        eprintln!("sidestep: {row}");
    };
    for (kind, part, why) in parts {
        lose(Lost::new(kind, part, why));
    }
    let saved = salvage::salvage(&from, &to, lose);
    let saved = match saved.await {
        Ok(saved) => to.end_copy().await.map(|()| saved),
        failed => failed,
    };
    from.close().await;
    to.close().await;
    let Report { studies, participants, trials, .. } = saved.map_err(|error| {
        CommandError::Failure(match to.is_shared() {
            true => format!("{}: {error}; it is incomplete, delete it", to.name()),
            false => format!("nothing was saved: {error}"),
        })
    })?;
    Ok(Saved { studies, participants, trials, lost })
}
