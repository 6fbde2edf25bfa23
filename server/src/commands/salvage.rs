//! `sidestep salvage`.

use super::backup::{DATABASE, absent, new_database};
use super::solving::Interrupt;
use super::{CommandError, failed, print_json};
use crate::private;
use crate::salvage;
use crate::soundness::Report;
use crate::store::{OpenError, Purpose, Store};
use serde::Serialize;
use std::fs::{File, TryLockError};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

/// Save what can still be read of a damaged database file into a new database.
///
/// Every trial is replayed. What reads and is sound is saved; each row that is lost is named on stderr: its table, its
/// key, and why. The damaged file is not changed. If there is a backup, restore that first, and look at what it lacks.
///
/// Prints a JSON summary. The exit code is 1 if anything was lost.
#[derive(Clone, Debug, clap::Args)]
pub struct SalvageArgs {
    /// The damaged file of SQLite; its -wal is read too, if it lies beside it.
    #[arg(long, value_name = "FILE")]
    pub from: PathBuf,

    /// Database to make: sqlite:FILE, which must not exist, or postgres://USER@HOST/DATABASE without tables.
    #[arg(long, value_name = "URL")]
    pub database: String,
}

#[derive(Serialize)]
struct Saved {
    studies: usize,
    participants: usize,
    trials: usize,
    /// Rows that are named on stderr.
    lost: usize,
}

/// Saves, names what is lost, and prints how much was saved.
///
/// # Errors
/// [`CommandError::Input`] if the file is no database, or there is a database already; [`CommandError::Failure`] if
/// anything was lost, or the new database refuses.
pub async fn run(args: SalvageArgs) -> Result<(), CommandError> {
    absent(&args.database).await?;
    let interrupt = Interrupt::listen();
    let fill =
        async |folder: &Path, url: &str| interrupt.unless_stopped(fill(&args, folder, url)).await?;
    let saved = new_database(&args.database, fill).await?;
    let printed = print_json(&saved);
    match saved.lost {
        0 => printed,
        1 => failed(printed, "1 row was lost; the rest was saved".to_owned()),
        lost => failed(printed, format!("{lost} rows were lost; the rest was saved")),
    }
}

async fn fill(args: &SalvageArgs, folder: &Path, url: &str) -> Result<Saved, CommandError> {
    let named = args.from.display().to_string();
    let unreadable = |error: &dyn std::fmt::Display| {
        CommandError::Input(format!("--from {named}: cannot read: {error}"))
    };
    let copy = folder.join("damaged.db");
    copied(&args.from, &copy).map_err(|error| unreadable(&error))?;
    let from = Store::open(&format!("sqlite:{}", copy.display()), Purpose::Change).await;
    let from = from.map_err(|error| match error.named(named.clone()) {
        OpenError::Absent(_) => unreadable(&"it is empty"),
        OpenError::Unusable { reason, .. } => {
            unreadable(&reason.split("; ").next().unwrap_or(&reason))
        }
        error => CommandError::Input(format!("--from {error}")),
    })?;
    let to = Store::open(url, Purpose::Alone).await?;
    let mut lost = 0;
    let saved = salvage::salvage(&from, &to, |row| {
        lost += 1;
        eprintln!("sidestep: {row}");
    });
    let saved = saved.await;
    from.close().await;
    to.close().await;
    let Report { studies, participants, trials, .. } = saved.map_err(|error| {
        CommandError::Failure(match to.is_shared() {
            true => format!("{}: {error}; what is there is not whole, delete it", to.name()),
            false => format!("nothing was saved: {error}"),
        })
    })?;
    Ok(Saved { studies, participants, trials, lost })
}

/// Copies a file that no server uses, and its log. Pages that are missing at its end are empty in the copy; SQLite
/// would otherwise read nothing at all.
fn copied(from: &Path, to: &Path) -> io::Result<()> {
    let mut file = File::open(from)?;
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Err(io::Error::other("a server uses it; stop the server first"));
    }
    let log = |path: &Path| {
        let mut path = path.as_os_str().to_owned();
        path.push("-wal");
        PathBuf::from(path)
    };
    match File::open(log(from)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        file => drop(io::copy(&mut file?, &mut private::new_file(&log(to))?)?),
    }
    let mut out = private::new_file(to)?;
    let length = io::copy(&mut file, &mut out)?;
    out.flush()?;
    file.rewind()?;
    let whole = whole_length(&file).unwrap_or(0);
    if length > 0 && whole > length {
        out.set_len(whole)?;
    }
    Ok(())
}

/// The length of a file of SQLite as its first page tells it.
fn whole_length(mut file: &File) -> Option<u64> {
    let mut head = [0; 32];
    io::Read::read_exact(&mut file, &mut head).ok()?;
    let page = match u16::from_be_bytes([head[16], head[17]]) {
        1 => 65_536,
        size => u64::from(size),
    };
    let pages = u32::from_be_bytes([head[28], head[29], head[30], head[31]]);
    head.starts_with(DATABASE).then_some(page * u64::from(pages))
}
