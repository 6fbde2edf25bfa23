//! Copies studies between databases. Every participant is compared by a hash after the copy.

use crate::store::copying::{CopyRefusal, CopyTarget, PutCopy};
use crate::store::{Store, StoreError};
use serde::Serialize;
use sha2::{Digest, Sha256};
use tokio_util::sync::CancellationToken;

/// The counts of a copy. All participants were compared after the copy.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Copied {
    /// Number of studies.
    pub studies: usize,
    /// Number of participants, including pilots.
    pub participants: usize,
    /// Number of participants who were already present, unchanged.
    pub present: usize,
    /// Number of trials.
    pub trials: usize,
    /// Number of analyses.
    pub analyses: usize,
    /// SHA-256 of the hashes of all participants' rows. It is the same for both databases.
    pub sha256: String,
}

/// The reason why a copy is incomplete. The data that were already copied are kept, and the next
/// copy continues after them.
#[derive(Debug, thiserror::Error)]
pub enum TransferError {
    /// The destination has another study of this name.
    #[error(
        "study {0}: the destination has another study of this name; copy to \
         another database"
    )]
    OtherStudy(String),
    /// A participant's data differ after the copy.
    #[error(
        "study {slug}: participant {id} changed while they were copied; stop the servers of both \
         databases and copy again"
    )]
    Changed {
        /// The study.
        slug: String,
        /// The participant.
        id: String,
    },
    /// In the destination, a participant has new data, or was deleted, since they were copied.
    #[error(
        "study {slug}: participant {id} has new data, or was deleted, in the destination since they were copied; \
         the destination is left unchanged: copy to another database"
    )]
    Ahead {
        /// The study.
        slug: String,
        /// The participant.
        id: String,
    },
    /// The copy was cancelled.
    #[error("stopped")]
    Stopped,
    /// A database failed.
    #[error("{0}")]
    Store(#[from] StoreError),
}

/// Copies studies, one after another. `progress` gets the number of copied participants and their total.
///
/// # Errors
/// [`TransferError`].
pub async fn copy(
    from: &Store,
    to: &Store,
    slugs: &[String],
    stop: &CancellationToken,
    mut progress: impl FnMut(usize, usize),
) -> Result<Copied, TransferError> {
    let mut copied = Copied::default();
    let mut all = Sha256::new();
    let mut studies = Vec::new();
    for slug in slugs {
        if let Some(study) = from.study_copy(slug).await? {
            let ids = from.copied_ids(study.study_id).await?;
            studies.push((study, ids));
        }
    }
    let of = studies.iter().map(|(_, [participants, _])| participants.len()).sum();
    for (study, [participants, analyses]) in studies {
        let slug = study.slug.clone();
        let target = match to.begin_copy(study).await? {
            Ok(target) => target,
            Err(CopyRefusal::OtherStudy) => return Err(TransferError::OtherStudy(slug)),
        };
        for id in participants {
            if stop.is_cancelled() {
                return Err(TransferError::Stopped);
            }
            all.update(participant(from, to, target, &slug, &id, &mut copied).await?);
            progress(copied.participants, of);
        }
        for id in analyses {
            if stop.is_cancelled() {
                return Err(TransferError::Stopped);
            }
            if let Some(analysis) = from.analysis_copy(&id).await? {
                to.put_analysis_copy(target, analysis).await?;
                copied.analyses += 1;
            }
        }
        copied.studies += 1;
    }
    copied.sha256 = hex::encode(all.finalize());
    Ok(copied)
}

/// Copies a participant and reads their rows again from both databases. Returns the hash of the rows.
async fn participant(
    from: &Store,
    to: &Store,
    target: CopyTarget,
    slug: &str,
    id: &str,
    copied: &mut Copied,
) -> Result<[u8; 32], TransferError> {
    let changed = || TransferError::Changed { slug: slug.to_owned(), id: id.to_owned() };
    let rows = from.participant_copy(id).await?.ok_or_else(changed)?;
    let (hash, trials) = (rows.hash(), rows.trials());
    match to.put_participant_copy(target, rows).await? {
        PutCopy::Stored => {}
        PutCopy::Present => copied.present += 1,
        PutCopy::Ahead => {
            return Err(TransferError::Ahead { slug: slug.to_owned(), id: id.to_owned() });
        }
    }
    for store in [from, to] {
        let again = store.participant_copy(id).await?.ok_or_else(changed)?;
        if again.hash() != hash {
            return Err(changed());
        }
    }
    copied.participants += 1;
    copied.trials += trials;
    Ok(hash)
}
