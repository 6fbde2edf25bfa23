//! The flags of `sidestep serve` for backups and checks of the stored data.

use super::CommandError;
use crate::jobs::keeper::Keeping;
use crate::support::private;
use std::path::PathBuf;
use std::time::Duration;

/// The time from the start of the server to the first check.
const FIRST: Duration = Duration::from_secs(60);

/// Backups and checks of the stored data.
#[derive(Clone, Debug, clap::Args)]
pub struct KeepingArgs {
    /// Folder for daily backups (see --check-every), on another disk if possible.
    ///
    /// The server also deletes the oldest backups of this database (see --backups-kept). If several
    /// servers share a database, only one of them needs this flag.
    #[arg(long, value_name = "DIR")]
    pub backups: Option<PathBuf>,
    /// Number of backups to keep in --backups.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 14,
        requires = "backups",
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    pub backups_kept: u16,
    /// Interval between checks of the stored data (hours), each followed by a backup; 0 for never.
    ///
    /// A check replays every trial, in a process of the lowest priority. The laboratory shows the result.
    #[arg(
        long,
        value_name = "HOURS",
        default_value = "24",
        value_parser = hours,
        allow_negative_numbers = true
    )]
    pub check_every: f64,
    /// The time from the start of the server to the first check.
    #[arg(skip = FIRST)]
    pub first: Duration,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|&hours| hours == 0.0 || (0.01..=8784.0).contains(&hours));
    hours.ok_or_else(|| "expected 0, or a number from 0.01 to 8784".to_owned())
}

impl KeepingArgs {
    /// The settings for this database. [`Keeping::code`] is left empty, because the code is not
    /// known yet.
    ///
    /// # Errors
    /// [`CommandError::Input`] if the folder for backups is not a folder or not writable, or if
    /// there is a folder for backups but no check.
    pub(super) fn keeping(&self, database: &str) -> Result<Keeping, CommandError> {
        if self.backups.is_some() && self.check_every == 0.0 {
            return Err(CommandError::Input(
                "--check-every 0: expected a number from 0.01 to 8784 with --backups, found 0, which writes none"
                    .to_owned(),
            ));
        }
        let backups = self.backups.as_ref().map(|folder| {
            let refused = |error: std::io::Error| {
                CommandError::Input(format!(
                    "--backups {}: expected a folder in which files can be written, found: {error}",
                    folder.display()
                ))
            };
            private::make_folder(folder)
                .and_then(|()| tempfile::tempfile_in(folder))
                .map_err(refused)?;
            Ok::<_, CommandError>((folder.clone(), usize::from(self.backups_kept)))
        });
        let every =
            (self.check_every > 0.0).then(|| Duration::from_secs_f64(3600.0 * self.check_every));
        let database = database.to_owned();
        let code = String::new();
        Ok(Keeping { database, code, backups: backups.transpose()?, every, first: self.first })
    }
}
