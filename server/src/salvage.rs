//! Copies the readable part of a damaged database into a new database.

use crate::database_check::{self, Report, Wrong};
use crate::store::copying::salvage::{Lost, Salvaged};
use crate::store::{Store, StoreError};
use std::collections::{HashMap, HashSet};
use tokio::sync::mpsc;

/// Fills a new database with all data of `from` that are readable and sound, after replaying every trial.
/// `lost` gets every row that is not saved. Returns the report on the new database, which has no fault.
///
/// # Errors
/// [`StoreError`] if `from` cannot be read at all, or `to` fails.
pub async fn salvage(
    from: &Store,
    to: &Store,
    mut lost: impl FnMut(Lost),
) -> Result<Report, StoreError> {
    // Several studies can have the same configuration, so a lost row can be found several times.
    let mut named = HashSet::new();
    let mut lost = |row: Lost| {
        if named.insert((row.table.clone(), row.key.clone())) {
            lost(row);
        }
    };
    let (sender, found) = mpsc::channel(4);
    let reading = from.salvage(sender);
    let writing = async {
        // This block owns the receiver. If writing ends early, the receiver is dropped, so that
        // reading does not wait forever.
        let mut found = found;
        let mut targets = HashMap::new();
        while let Some(found) = found.recv().await {
            match found {
                Salvaged::Lost(row) => lost(row),
                Salvaged::Study(study) => {
                    let id = study.study_id;
                    let mut begun = to.begin_copy((*study).clone()).await;
                    if let Err(error) = &begun
                        && is_of_a_value(error)
                        && study.has_functions()
                    {
                        // Copy the study without its value functions, which can be computed again.
                        let key = format!("of study {}", study.slug);
                        lost(Lost::new("safety_function", key, error.to_string()));
                        begun = to.begin_copy(study.without_functions()).await;
                    }
                    match begun {
                        Ok(Ok(target)) => drop(targets.insert(id, target)),
                        Ok(Err(refusal)) => {
                            lost(Lost::new("study", id.to_string(), format!("{refusal:?}")))
                        }
                        Err(error) if is_of_a_value(&error) => {
                            lost(Lost::new("study", id.to_string(), error.to_string()))
                        }
                        Err(error) => return Err(error),
                    }
                }
                Salvaged::Participant(study, rows) => match targets.get(&study) {
                    Some(&target) => match to.put_participant_copy(target, rows.clone()).await {
                        Err(error) if is_of_a_value(&error) => {
                            let refused = to.put_rows_apart(Some(target), rows).await?;
                            refused.into_iter().for_each(&mut lost);
                        }
                        put => drop(put?),
                    },
                    None => rows.rows_lost("its study is lost").for_each(&mut lost),
                },
                Salvaged::Analysis(study, rows) => {
                    let id = rows.id.clone();
                    let put = match targets.get(&study) {
                        Some(&target) => to.put_analysis_copy(target, rows).await.map(drop),
                        None => Err(StoreError::Corrupt("its study is lost".to_owned())),
                    };
                    if let Err(error) = put {
                        lost(Lost::new("analysis", id, error.to_string()));
                    }
                }
                Salvaged::Access(rows) => match to.put_access_copy(rows.clone()).await {
                    Err(error) if is_of_a_value(&error) => {
                        let refused = to.put_rows_apart(None, rows).await?;
                        refused.into_iter().for_each(&mut lost);
                    }
                    put => drop(put?),
                },
            }
        }
        Ok::<_, StoreError>(())
    };
    let (read, written) = tokio::join!(reading, writing);
    // If writing failed, it also stopped reading, so the error of writing comes first.
    written.and(read)?;
    let found = database_check::report(to).await?;
    for Wrong { trial_id, what } in &found.wrong {
        to.drop_unsound(trial_id).await?;
        lost(Lost::new("trial", &**trial_id, format!("not sound: {what}")));
    }
    for id in to.wrong_tallies().await? {
        to.count_again(&id).await?;
    }
    let report = match found.faults() {
        0 => found,
        _ => database_check::report(to).await?,
    };
    match report.first() {
        None => Ok(report),
        Some(first) => Err(StoreError::Defect(format!("the saved data are not sound: {first}"))),
    }
}

/// Whether this error might mean that the new database rejected a value of the old one.
fn is_of_a_value(error: &StoreError) -> bool {
    matches!(error, StoreError::Defect(_) | StoreError::Corrupt(_) | StoreError::Locked)
}
