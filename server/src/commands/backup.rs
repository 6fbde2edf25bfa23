//! `sidestep backup` and `sidestep restore`.

use super::copy::{copying, whole};
use super::solving::Interrupt;
use super::{CommandError, print_json};
use crate::backups::{self, FaultyTrials, Written};
use crate::soundness::{self, Report};
use crate::store::{Missing, OpenError, Store};
use serde::Serialize;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Back a database up into one file, also while a server uses it.
///
/// The file is a SQLite database with everything: `sidestep restore` makes a database of it, of SQLite or
/// PostgreSQL. It is complete and checked, every trial by replaying it, before it gets its name. It
/// contains external ids: only its owner can read it.
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

/// Make a database of a backup.
///
/// Checks the backup first, every trial by replaying it, and the new database afterwards. A database that
/// is there already is refused and not changed.
///
/// Prints a JSON summary.
#[derive(Clone, Debug, clap::Args)]
pub struct RestoreArgs {
    /// The backup.
    #[arg(long, value_name = "FILE")]
    pub from: PathBuf,

    /// Database to make: sqlite:FILE, which must not exist, or postgres://USER@HOST/DATABASE without tables.
    #[arg(long, value_name = "URL")]
    pub database: String,

    /// Restore a backup in which trials are faulty, too: they stay as they are. A server with --backups writes such a
    /// backup rather than none.
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

/// Writes a backup, checks it, and prints what is in it.
///
/// # Errors
/// [`CommandError::Input`] if the file is there already; [`CommandError::Failure`] if the database or the
/// disk refuse, or the backup is not sound.
pub async fn back_up(args: BackupArgs) -> Result<(), CommandError> {
    let out = &args.out;
    if out.exists() {
        let message = format!("--out {}: expected a file that does not exist", out.display());
        return Err(CommandError::Input(message));
    }
    let store = Store::open(&args.database, Missing::Refuse).await?;
    let interrupt = Interrupt::listen();
    let (bar, progress) = copying();
    let written =
        backups::write(&store, out, FaultyTrials::Refused, &interrupt.token, progress).await;
    bar.finish_and_clear();
    store.close().await;
    let Written { bytes, report } = written.map_err(CommandError::failure)?;
    print_json(&Done { file: out, bytes, report })
}

/// The write-ahead log of a file: what SQLite has not yet written back.
fn log_of(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push("-wal");
    name.into()
}

/// Makes a database of a backup, checks it, and prints what is in it.
///
/// # Errors
/// [`CommandError::Input`] if there is a database already; [`CommandError::Failure`] if the backup is not
/// sound or the database refuses.
pub async fn restore(args: RestoreArgs) -> Result<(), CommandError> {
    match Store::open(&args.database, Missing::Refuse).await {
        Err(OpenError::Absent(_)) => {}
        Err(error) => return Err(error.into()),
        Ok(store) => {
            let expected = "expected a database that does not exist";
            let message = format!("--database {}: {expected}; it has data", store.name());
            return Err(CommandError::Input(message));
        }
    }
    if log_of(&args.from).metadata().is_ok_and(|log| log.len() > 0) {
        let message = format!(
            "--from {}: expected a backup, found a database that a server uses, or did not close; write one with \
             'sidestep backup'",
            args.from.display()
        );
        return Err(CommandError::Input(message));
    }
    let folder = TempDir::new().map_err(CommandError::failure)?;
    // The backup itself stays as it is: an earlier version's is migrated in a copy.
    let file = folder.path().join("backup.db");
    std::fs::copy(&args.from, &file).map_err(|error| {
        CommandError::Input(format!("--from {}: cannot read: {error}", args.from.display()))
    })?;
    let backup = Store::open(&format!("sqlite:{}", file.display()), Missing::Refuse).await?;
    let before = soundness::report(&backup).await?;
    let accepted = if args.with_faulty_trials { FaultyTrials::Kept } else { FaultyTrials::Refused };
    backups::sound(&args.from, &before, accepted).map_err(CommandError::failure)?;
    let to = Store::open(&args.database, Missing::Create).await?;
    let name = to.name();
    whole(&backup, &to, &backup.slugs().await?, true).await.map_err(|error| {
        CommandError::Failure(format!("{name}: it is not whole, delete it: {error}"))
    })?;
    let report = soundness::report(&to).await?;
    backup.close().await;
    to.close().await;
    if report != before {
        let message = format!("{name}: what was restored differs from the backup: delete it");
        return Err(CommandError::Failure(message));
    }
    print_json(&report)
}
