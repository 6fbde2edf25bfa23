//! `sidestep copy`.

use super::solving::Interrupt;
use super::solving::bar;
use super::{CommandError, of_flag, print_json, study_named};
use crate::store::{Purpose, Store};
use crate::transfer::{self, TransferError};
use indicatif::ProgressBar;

/// Copy studies from one database to another, from SQLite to PostgreSQL or back.
///
/// Copies everything stored about participants (ids, trials, notes and exclusions), the study's
/// versions, value functions and analyses. Without --study, also copies the keys and the audit
/// trail, if the destination has no keys. Afterwards, compares every participant by a hash. Running
/// the command again resumes an interrupted copy. No server should use either database meanwhile.
///
/// Prints a JSON summary.
#[derive(Clone, Debug, clap::Args)]
pub struct CopyArgs {
    /// Database to copy from: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL")]
    pub from: String,

    /// Database to copy to; created if it does not exist (for PostgreSQL, only its tables).
    #[arg(long, value_name = "URL")]
    pub to: String,

    /// Only the study with this name [default: all studies, with keys and audit trail].
    #[arg(long, value_name = "SLUG")]
    pub study: Option<String>,
}

/// Copies and prints a summary.
///
/// # Errors
/// [`CommandError`] for an unknown study (input), or if a database fails (failure).
pub async fn run(args: CopyArgs) -> Result<(), CommandError> {
    let from = Store::open(&args.from, Purpose::Read).await.map_err(of_flag("--from"))?;
    let slugs = match &args.study {
        Some(slug) => vec![study_named(&from, slug).await?.slug],
        None => from.slugs().await?,
    };
    let the_same = || {
        let message = "--to: expected another database than that of --from, found the same";
        CommandError::Input(message.to_owned())
    };
    if from.is_file_at(&args.to).map_err(of_flag("--to"))? {
        return Err(the_same());
    }
    let to = Store::open(&args.to, Purpose::Copy).await.map_err(of_flag("--to"))?;
    if from.is_same(&to).await? {
        return Err(the_same());
    }
    let file = Store::file(&args.from).ok().flatten().and_then(|file| file.canonicalize().ok());
    let file = file.map_or_else(|| from.name(), |file| file.display().to_string());
    if to.claim_copy(&format!("{file} {:?}", args.study)).await? {
        return Err(CommandError::Failure(format!(
            "{}: an interrupted copy or restore from another source is in it; run that command again, or delete the database",
            to.name()
        )));
    }
    let access = args.study.is_none();
    let interrupt = Interrupt::listen();
    let copied = whole(&from, &to, &slugs, access, &interrupt).await.map_err(|error| {
        CommandError::Failure(match error {
            TransferError::Stopped => format!("{error}; run the same command again to resume"),
            other => other.to_string(),
        })
    })?;
    to.end_copy().await?;
    from.close().await;
    to.close().await;
    print_json(&copied)
}

/// Copies studies and shows a progress bar. If `access` is true, also copies the keys and the audit
/// trail.
pub(super) async fn whole(
    from: &Store,
    to: &Store,
    slugs: &[String],
    access: bool,
    interrupt: &Interrupt,
) -> Result<transfer::Copied, TransferError> {
    let (bar, progress) = copying();
    let copied = transfer::copy(from, to, slugs, &interrupt.token, progress).await;
    bar.finish_and_clear();
    let copied = copied?;
    if access {
        to.put_access_copy(from.access_copy().await?).await?;
    }
    Ok(copied)
}

/// A progress bar and the callback that updates it with the number of copied participants and their total.
pub(super) fn copying() -> (ProgressBar, impl FnMut(usize, usize)) {
    let bar = bar(0, "copying [{bar:40}] {pos:>4}/{len} participants  {elapsed_precise}");
    let moved = bar.clone();
    let progress = move |done: usize, of: usize| {
        moved.set_length(of as u64);
        moved.set_position(done as u64);
    };
    (bar, progress)
}
