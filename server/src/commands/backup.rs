//! `sidestep backup` and `sidestep restore`.

use super::copy::{copying, whole};
use super::solving::Interrupt;
use super::{CommandError, print_json};
use crate::backups::{self, FaultyTrials, Written};
use crate::database_check::{self, Report};
use crate::store::{MAGIC, OpenError, Purpose, Store};
use crate::support::private::{self, Unfinished};
use crate::transfer::TransferError;
use serde::Serialize;
use std::fs::{self, File};
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

/// Back up a database into one file, even while a server uses it.
///
/// The file is a SQLite database with all data. `sidestep restore` restores it to SQLite or
/// PostgreSQL. The backup is complete and checked, with every trial replayed, before it gets its
/// name. Only its owner can read it, because it contains external ids.
///
/// Prints a JSON summary.
#[derive(Clone, Debug, clap::Args)]
pub struct BackupArgs {
    /// Database: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,

    /// File to write; it must not exist.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// Restore a backup into a new database.
///
/// Checks the backup first, replaying every trial, and checks the new database afterwards. Refuses
/// an existing database and leaves it unchanged.
///
/// Prints a JSON summary.
#[derive(Clone, Debug, clap::Args)]
pub struct RestoreArgs {
    /// Backup to restore.
    #[arg(long, value_name = "FILE")]
    pub from: PathBuf,

    /// Database to create: sqlite:FILE, which must not exist, or postgres://USER@HOST/DATABASE without tables.
    #[arg(long, value_name = "URL")]
    pub database: String,

    /// Also restore a backup with faulty trials, leaving them as they are.
    ///
    /// A server with --backups writes such a backup rather than no backup.
    #[arg(long)]
    pub with_faulty_trials: bool,
}

#[derive(Serialize)]
struct Done<'a> {
    file: &'a Path,
    bytes: u64,
    #[serde(flatten)]
    report: Report,
}

/// Writes a backup, checks it, and prints a summary of its content.
///
/// # Errors
/// [`CommandError::Input`] if the file already exists; [`CommandError::Failure`] if the database or
/// the disk fails, or the backup is not sound.
pub async fn back_up(args: BackupArgs) -> Result<(), CommandError> {
    let out = &args.out;
    no_address("--out", out)?;
    if let Some(why) = Store::refused_name(out) {
        let message = format!("--out {}: {why}; choose another name", out.display());
        return Err(CommandError::Input(message));
    }
    if out.exists() {
        let message = format!("--out {}: expected a file that does not exist", out.display());
        return Err(CommandError::Input(message));
    }
    let store = Store::open(&args.database, Purpose::Read).await?;
    let interrupt = Interrupt::listen();
    let (bar, progress) = copying();
    let written =
        backups::write(&store, out, FaultyTrials::Refused, &interrupt.token, progress).await;
    bar.finish_and_clear();
    store.close().await;
    let Written { bytes, report } = written?;
    print_json(&Done { file: out, bytes, report })
}

/// Restores a backup into a new database, checks it, and prints a summary of its content.
///
/// # Errors
/// [`CommandError::Input`] if the database already exists; [`CommandError::Failure`] if the backup
/// is not sound or the database fails.
pub async fn restore(args: RestoreArgs) -> Result<(), CommandError> {
    no_address("--from", &args.from)?;
    absent(&args.database).await?;
    let found = fs::metadata(&args.from).map_err(|error| unreadable(&args.from, error))?;
    if !found.is_file() {
        return Err(unreadable(&args.from, "it is a directory or a pipe"));
    }
    if Store::is_in_use(&args.from) {
        let message = format!(
            "--from {}: expected a backup, found a database that a server uses, or did not close; write one with \
             'sidestep backup'",
            args.from.display()
        );
        return Err(CommandError::Input(message));
    }
    let interrupt = Interrupt::listen();
    let fill = async |folder: &Path, url: &str| fill(&args, folder, url, &interrupt).await;
    print_json(&new_database(&args.database, fill).await?)
}

/// Refuses a database address where a file is expected. The error does not repeat the address,
/// because it might contain a password.
pub(super) fn no_address(flag: &str, file: &Path) -> Result<(), CommandError> {
    let text = file.to_string_lossy();
    if text.contains("://") || text.starts_with("sqlite:") {
        return Err(CommandError::Input(format!("{flag}: expected a file, found an address")));
    }
    Ok(())
}

fn unreadable(from: &Path, why: impl std::fmt::Display) -> CommandError {
    CommandError::Input(format!("--from {}: cannot read: {why}", from.display()))
}

/// Checks that no database exists at this address.
pub(super) async fn absent(database: &str) -> Result<(), CommandError> {
    match Store::open(database, Purpose::Read).await {
        Err(OpenError::Absent(_)) => Ok(()),
        Err(
            error @ (OpenError::LogAlone { .. }
            | OpenError::Misplaced { .. }
            | OpenError::DamagedLog { .. }),
        ) => Err(CommandError::Input(format!("--database {error}"))),
        Err(error) => Err(error.into()),
        Ok(store) => {
            let expected = "expected a database that does not exist";
            let message = format!("--database {}: {expected}; it has data", store.name());
            Err(CommandError::Input(message))
        }
    }
}

/// Creates a database at an address where none exists. `fill` gets a private folder for temporary
/// files, and the address of the database to fill.
pub(super) async fn new_database<T>(
    database: &str,
    fill: impl AsyncFnOnce(&Path, &str) -> Result<T, CommandError>,
) -> Result<T, CommandError> {
    let Some(file) = Store::file(database)? else {
        let folder = Unfinished::within(backups::UNFINISHED, &std::env::temp_dir());
        let folder = folder.map_err(CommandError::failure)?;
        return fill(folder.path(), database).await;
    };
    // The database is complete and checked before it gets its name.
    let unwritable =
        |error| CommandError::Failure(format!("{}: cannot write: {error}", file.display()));
    let parent = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    let folder = Unfinished::within(backups::UNFINISHED, parent).map_err(unwritable)?;
    let made = folder.path().join("restored.db");
    let url = format!("sqlite:{}", made.display());
    let done = fill(folder.path(), &url).await?;
    // An empty file counts as an absent database, so the new database replaces it.
    if file.metadata().is_ok_and(|found| found.len() == 0) {
        fs::remove_file(&file).map_err(unwritable)?;
    }
    File::open(&made)
        .and_then(|made| made.sync_all())
        .and_then(|()| fs::hard_link(&made, &file))
        .and_then(|()| File::open(parent)?.sync_all())
        .map_err(unwritable)?;
    Ok(done)
}

/// Fills a new database from the backup, compares the reports on the two databases, and returns the
/// report. The backup is first copied to `folder`, because migrating a backup of an earlier version
/// must not change the original.
async fn fill(
    args: &RestoreArgs,
    folder: &Path,
    url: &str,
    interrupt: &Interrupt,
) -> Result<Report, CommandError> {
    let named = args.from.display().to_string();
    let file = folder.join("backup.db");
    let mut from = File::open(&args.from).map_err(|error| unreadable(&args.from, error))?;
    let mut head = Vec::new();
    let begins = from.by_ref().take(MAGIC.len() as u64).read_to_end(&mut head);
    if begins.is_ok() && head != MAGIC {
        let message =
            format!("--from {named}: expected a backup, found a file that is not a database");
        return Err(CommandError::Input(message));
    }
    from.rewind().map_err(CommandError::failure)?;
    private::new_file(&file).and_then(|mut to| std::io::copy(&mut from, &mut to)).map_err(
        |error| {
            CommandError::Failure(format!(
                "--from {named}: cannot be copied to {}: {error}",
                folder.display()
            ))
        },
    )?;
    let backup = Store::open(&format!("sqlite:{}", file.display()), Purpose::Read).await;
    let backup = backup.map_err(|error| error.named(named))?;
    let before = interrupt.unless_stopped(database_check::report(&backup)).await??;
    let accepted = if args.with_faulty_trials { FaultyTrials::Kept } else { FaultyTrials::Refused };
    backups::sound(&args.from, &before, accepted).map_err(CommandError::failure)?;
    let to = Store::open(url, Purpose::Copy).await?;
    to.claim_copy("restore").await?;
    let filling = async {
        whole(&backup, &to, &backup.slugs().await?, true, interrupt).await?;
        let report = database_check::report(&to).await?;
        if report == before {
            to.end_copy().await?;
        }
        Ok::<_, TransferError>(report)
    };
    let filled = interrupt.token.run_until_cancelled(filling).await;
    let report = filled.unwrap_or(Err(TransferError::Stopped));
    backup.close().await;
    to.close().await;
    let failure = match report {
        Ok(report) if report == before => return Ok(report),
        Ok(_) => "the restored database differs from the backup".to_owned(),
        Err(error) => error.to_string(),
    };
    // `new_database` deletes the folder with an incomplete SQLite file. An incomplete PostgreSQL
    // database remains.
    Err(CommandError::Failure(match to.is_shared() {
        true => format!("{}: it is incomplete, delete it: {failure}", to.name()),
        false => format!("nothing was restored: {failure}"),
    }))
}
