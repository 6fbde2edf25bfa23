//! Checks a database or writes a backup, in the child process.

use super::Server;
use crate::backups::{self, BackupError, FaultyTrials, Written};
use crate::database_check;
use crate::jobs::frames::FromChild;
use crate::store::{Purpose, Store};
use std::io;
use std::path::Path;
use tokio_util::sync::CancellationToken;

/// Checks the database, or writes a backup and checks the backup.
pub(super) fn run(server: &Server, database: &str, backup: Option<&Path>) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let said = match runtime.block_on(checked(database, backup)) {
        Ok(Written { bytes, report }) => FromChild::Checked { report: Box::new(report), bytes },
        Err(error) => FromChild::Failed(error.to_string()),
    };
    server.tell(&said, &[])
}

async fn checked(database: &str, backup: Option<&Path>) -> Result<Written, BackupError> {
    let store = Store::open(database, Purpose::Read).await?;
    let written = match backup {
        Some(file) => {
            // A faulty trial must not prevent all backups. It is reported, and earlier backups are kept.
            let kept = FaultyTrials::Kept;
            backups::write(&store, file, kept, &CancellationToken::new(), |_, _| ()).await
        }
        None => {
            let report = database_check::report(&store).await;
            report.map(|report| Written { bytes: 0, report }).map_err(BackupError::from)
        }
    };
    store.close().await;
    written
}
