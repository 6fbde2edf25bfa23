//! Maintains the data while the server runs. Child processes of the lowest priority replay every
//! stored trial, and write backups.

use super::children::{Children, Ended};
use super::frames::{FromChild, ToChild};
use crate::backups;
use crate::database_check::Report;
use crate::support::clock::now_ms;
use sidestep::api::{Backup, DataCheck, DataCheckState};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Maximum number of faults that are shown; `sidestep check` reports all faults.
const MOST_FAULTS: usize = 20;

/// The data to maintain, and the intervals.
#[derive(Clone, Debug)]
pub struct Keeping {
    /// The database's address.
    pub database: String,
    /// [`Store::code`](crate::store::Store::code), which identifies the database's own backups.
    pub code: String,
    /// The folder for backups, and the number of backups to keep. `None` means no backups.
    pub backups: Option<(PathBuf, usize)>,
    /// The interval between two checks or backups. `None` means no checks.
    pub every: Option<Duration>,
    /// The time from the start of the server to the first check. The first backup comes at this
    /// time or later.
    pub first: Duration,
}

/// The keeper, which runs in the background until it is stopped.
#[derive(Debug)]
pub struct Keeper {
    cancel: CancellationToken,
    task: JoinHandle<()>,
}

impl Keeper {
    /// Starts the keeper. `found` publishes the latest findings.
    #[must_use]
    pub fn start(keeping: Keeping, children: Children, found: watch::Sender<DataCheck>) -> Self {
        let cancel = CancellationToken::new();
        let stopped = cancel.clone();
        let task = tokio::spawn(async move {
            let Some(every) = keeping.every else { return };
            let newest = keeping.newest_backup();
            let keep = async {
                let mut pause = keeping.first_pause(every, newest.as_ref());
                found.send_modify(|check| check.backup = newest);
                loop {
                    tokio::time::sleep(pause).await;
                    keeping.once(&children, &found).await;
                    pause = every;
                }
            };
            // Dropping a check kills its process.
            tokio::select! {
                () = keep => {}
                () = stopped.cancelled() => {}
            }
        });
        Self { cancel, task }
    }

    /// Stops the keeper and cancels a check or backup in progress.
    pub async fn stop(self) {
        self.cancel.cancel();
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the keeper failed");
        }
    }
}

impl Keeping {
    /// The time until the first check or backup. A restart of the server does not shorten the interval
    /// after the newest backup.
    fn first_pause(&self, every: Duration, newest: Option<&Backup>) -> Duration {
        if self.backups.is_none() {
            return self.first;
        }
        let age = newest.and_then(|backup| u64::try_from(now_ms() - backup.at_ms).ok());
        let rest =
            age.map_or(Duration::ZERO, |age| every.saturating_sub(Duration::from_millis(age)));
        rest.max(self.first.min(every))
    }

    /// The newest backup in the folder. An earlier run of the server might have written it.
    fn newest_backup(&self) -> Option<Backup> {
        let (folder, _) = self.backups.as_ref()?;
        let file = backups::list(folder, &self.code).ok()?.pop()?;
        let about = file.metadata().ok()?;
        let at = about.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
        Some(Backup {
            name: file.file_name()?.to_string_lossy().into_owned(),
            at_ms: i64::try_from(at.as_millis()).ok()?,
            bytes: about.len(),
        })
    }

    /// Does one check, or writes one backup and checks it.
    async fn once(&self, children: &Children, found: &watch::Sender<DataCheck>) {
        let backup = self.backups.as_ref().map(|(folder, keep)| {
            let file = folder.join(backups::name(&self.code, now_ms()));
            (folder, *keep, file)
        });
        let file = backup.as_ref().map(|(.., file)| file.clone());
        found.send_modify(|check| check.state = DataCheckState::Running);
        let done = self.in_child(children, file.clone()).await;
        let at_ms = now_ms();
        let pruned = match (&done, &backup) {
            // If there are faults, keep older backups, because they might have data that newer
            // backups lack.
            (Ok((report, _)), Some((folder, keep, file))) if report.faults() == 0 => {
                let written = file.file_name().unwrap_or_default().to_string_lossy();
                backups::prune(folder, &self.code, *keep, &written)
            }
            _ => Ok(0),
        };
        if let Err(error) = pruned {
            tracing::warn!(%error, "an old backup was not deleted");
        }
        found.send_modify(|check| match done {
            Ok((report, bytes)) => {
                let (trials, faults) = (report.trials, report.faults());
                match faults {
                    0 => tracing::info!(trials, "every stored trial was replayed: no fault"),
                    _ => tracing::error!(
                        trials,
                        faults,
                        "stored data have faults: see 'sidestep check'"
                    ),
                }
                check.state = DataCheckState::Done;
                check.at_ms = Some(at_ms);
                check.trials = Some(trials as u64);
                check.faults = told(&report);
                check.fault_count = faults as u64;
                check.message = None;
                if let Some(file) = file.as_ref().and_then(|file| file.file_name()) {
                    let name = file.to_string_lossy().into_owned();
                    tracing::info!(name, bytes, "a backup was written");
                    check.backup = Some(Backup { name, at_ms, bytes });
                }
            }
            Err(why) => {
                tracing::error!(why, "stored data were not checked");
                check.state = DataCheckState::Failed;
                check.message = Some(why);
            }
        });
    }

    async fn in_child(
        &self,
        children: &Children,
        backup: Option<PathBuf>,
    ) -> Result<(Report, u64), String> {
        let mut child = children.start().map_err(|error| format!("{error:#}"))?;
        let folder = std::env::current_dir().map_err(|error| error.to_string())?;
        let task = ToChild::Check { folder, database: self.database.clone(), backup };
        // An error means that the child has ended. The next read then fails, too.
        let _ = child.tell(&task, &[]).await;
        match child.hear().await {
            Ok((FromChild::Checked { report, bytes }, _)) => Ok((*report, bytes)),
            Ok((FromChild::Failed(why), _)) => Err(why),
            Ok((other, _)) => Err(format!("expected a report, found {other:?}")),
            Err(_) => Err(match child.ended().await {
                Ended::Failed(why) => why,
                Ended::Asked => "its process was asked to end".to_owned(),
            }),
        }
    }
}

/// The first faults, each as a sentence.
fn told(report: &Report) -> Vec<String> {
    let wrong = report.wrong.iter().map(|it| format!("trial {}: {}", it.trial_id, it.what));
    report.damage.iter().cloned().chain(wrong).take(MOST_FAULTS).collect()
}
