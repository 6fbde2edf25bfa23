//! `sidestep backup` and `sidestep restore`.

use super::check::{self, Report};
use super::copy::whole;
use super::{CommandError, print_json, unwritable};
use crate::store::{Missing, OpenError, Store};
use serde::Serialize;
use std::fs::File;
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
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = TempDir::with_prefix_in(".sidestep-backup-", folder.unwrap_or(Path::new(".")));
    let folder = folder.map_err(|error| unwritable(out, &error))?;
    let file = folder.path().join("backup.db");
    let report = write(&store, &file).await?;
    store.close().await;
    sound(out, &report)?;
    let persisted = File::open(&file)
        .and_then(|written| written.sync_all())
        .and_then(|()| std::fs::hard_link(&file, out))
        .and_then(|()| File::open(folder.path().parent().unwrap_or(Path::new(".")))?.sync_all());
    persisted.map_err(|error| unwritable(out, &error))?;
    let bytes = std::fs::metadata(out).map_err(|error| unwritable(out, &error))?.len();
    print_json(&Done { file: out, bytes, report })
}

/// Writes all of a database into a new file, and checks the file.
async fn write(store: &Store, file: &Path) -> Result<Report, CommandError> {
    let url = format!("sqlite:{}", file.display());
    if !store.write_snapshot(file).await? {
        let copy = Store::open(&url, Missing::Create).await?;
        whole(store, &copy, &store.slugs().await?, true).await?;
        copy.close().await;
    }
    let copy = Store::open(&url, Missing::Refuse).await?;
    let report = check::report(&copy).await;
    copy.close().await;
    report
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
    let folder = TempDir::new().map_err(CommandError::failure)?;
    // The backup itself stays as it is: an earlier version's is migrated in a copy.
    let file = folder.path().join("backup.db");
    std::fs::copy(&args.from, &file).map_err(|error| {
        CommandError::Input(format!("--from {}: cannot read: {error}", args.from.display()))
    })?;
    let backup = Store::open(&format!("sqlite:{}", file.display()), Missing::Refuse).await?;
    let before = check::report(&backup).await?;
    sound(&args.from, &before)?;
    let to = Store::open(&args.database, Missing::Create).await?;
    whole(&backup, &to, &backup.slugs().await?, true).await?;
    let report = check::report(&to).await?;
    backup.close().await;
    let name = to.name();
    to.close().await;
    if report != before {
        let message = format!("{name}: what was restored differs from the backup: delete it");
        return Err(CommandError::Failure(message));
    }
    print_json(&report)
}

/// Refuses a database with faults.
fn sound(path: &Path, report: &Report) -> Result<(), CommandError> {
    let faults = report.damage.iter().cloned();
    let wrong =
        report.wrong.iter().map(|wrong| format!("trial {}: {}", wrong.trial_id, wrong.what));
    match faults.chain(wrong).next() {
        None => Ok(()),
        Some(first) => Err(CommandError::Failure(format!(
            "{}: the database is not sound, nothing was written: {first}; see 'sidestep check'",
            path.display()
        ))),
    }
}
