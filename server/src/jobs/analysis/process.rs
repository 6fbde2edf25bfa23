//! One analysis, computed by a child process. The server sends the study's data to the process, and
//! stores the results in the database.

use crate::jobs::children::{Children, Ended, Running};
use crate::jobs::frames::{FromChild, ToChild};
use crate::jobs::safety;
use crate::store::Store;
use crate::store::analyses::Job;
use crate::store::studies::StoredStudy;
use crate::study_recording::{People, Person};
use crate::support::clock::now_ms;
use anyhow::Context;
use sidestep::api::AnalysisResult;
use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Progress of an analysis.
#[derive(Debug, Default)]
pub(super) struct HowFar {
    done: AtomicUsize,
    of: AtomicUsize,
    /// Number of pieces of work that were computed and not taken from the cache.
    fresh: AtomicUsize,
}

impl HowFar {
    /// The numbers of finished pieces of work, of all pieces, and of pieces that were not taken
    /// from the cache.
    pub(super) fn numbers(&self) -> [usize; 3] {
        [&self.done, &self.of, &self.fresh].map(|number| number.load(Ordering::Relaxed))
    }
}

/// The outcome of an analysis.
pub(super) enum Outcome {
    /// The analysis is done. Its files and models are in the database.
    Done {
        result: Box<AnalysisResult>,
        /// The names of the participants who were compared.
        compared: HashSet<String>,
        /// The keys of the cells that the analysis needs.
        used: HashSet<String>,
    },
    /// The analysis failed for this reason.
    Failed(String),
    /// The process received a signal to terminate.
    AskedToEnd,
    /// The analysis is no longer wanted.
    Unwanted,
}

/// Computes the analysis of `study` that `job` requests.
///
/// # Errors
/// If the database fails, or the process cannot be started.
pub(super) async fn compute(
    store: &Store,
    study: &StoredStudy,
    job: &Job,
    children: &Children,
    how_far: &HowFar,
) -> anyhow::Result<Outcome> {
    let functions = match safety::ensure(store, study, children).await? {
        Ok(functions) => functions,
        Err(Ended::Failed(why)) => return Ok(Outcome::Failed(why)),
        Err(Ended::Asked) => return Ok(Outcome::AskedToEnd),
    };
    let mut child = children.start()?;
    let first = ToChild::Analyse {
        request: Box::new(job.request.clone()),
        study: study.slug.clone(),
        scene: study.config.parameters,
        human: functions.human().len(),
    };
    let beside = [functions.human(), functions.robot()].concat();
    let mut going = child.tell(&first, &beside).await.is_ok();
    let mut people = People::of(store, study).await?;
    while going && let Some(person) = people.next().await? {
        let (message, beside) = match &person {
            Person::Drove(participant) => ToChild::participant(participant),
            Person::Excluded(exclusion) => {
                let (name, reason) = (exclusion.participant.clone(), exclusion.reason.clone());
                (ToChild::Excluded(name, reason), Vec::new())
            }
        };
        going = child.tell(&message, &beside).await.is_ok();
    }
    if going {
        // An error means that the child has ended. The next read then fails, too.
        let _ = child.tell(&ToChild::Begin, &[]).await;
    }
    let outcome = keep_all(store, job, &mut child, how_far).await?;
    Ok(match outcome {
        Some(outcome) => outcome,
        None => match child.ended().await {
            Ended::Failed(why) => Outcome::Failed(why),
            Ended::Asked => Outcome::AskedToEnd,
        },
    })
}

/// Answers the child's queries and stores its messages until it is done. Returns `None` if the child
/// ends earlier.
async fn keep_all(
    store: &Store,
    job: &Job,
    child: &mut Running,
    how_far: &HowFar,
) -> anyhow::Result<Option<Outcome>> {
    let mut used = HashSet::new();
    while let Ok((message, beside)) = child.hear().await {
        let wanted = match message {
            FromChild::Progress { done, of } => {
                how_far.done.fetch_max(done, Ordering::Relaxed);
                how_far.of.store(of, Ordering::Relaxed);
                true
            }
            FromChild::Wanted(key) => {
                // Cells that cannot be read are computed again.
                let kept = store.cells(job.study_id, &key).await.ok().flatten();
                let answer = ToChild::Cells { kept: kept.is_some() };
                if kept.is_some() {
                    used.insert(key);
                }
                // An error means that the child has ended. The next read then fails, too.
                let _ = child.tell(&answer, &kept.unwrap_or_default()).await;
                true
            }
            FromChild::Computed(key) => {
                how_far.fresh.fetch_add(1, Ordering::Relaxed);
                if let Err(error) = store.put_cells(job, &key, beside).await {
                    // Cells that are not cached are only computed again.
                    tracing::warn!(%error, "cells of an analysis were not cached");
                }
                used.insert(key);
                true
            }
            FromChild::File { name, octets } => {
                store.put_analysis_file(job, &name, octets, beside, now_ms()).await?
            }
            FromChild::Models(rows) => {
                let rows = rows.into_iter().map(Into::into).collect();
                store.put_predictors(job, rows).await?
            }
            FromChild::Tasks(rows) => {
                let rows = rows.into_iter().map(Into::into).collect();
                store.put_used_tasks(job, rows).await?
            }
            FromChild::Done { result, compared } => {
                let compared = compared.into_iter().collect();
                return Ok(Some(Outcome::Done { result, compared, used }));
            }
            FromChild::Failed(why) => return Ok(Some(Outcome::Failed(why))),
            other @ (FromChild::Solved { .. } | FromChild::Checked { .. }) => {
                return Err(anyhow::anyhow!("expected a part of an analysis, found {other:?}"));
            }
        };
        if !wanted {
            return Ok(Some(Outcome::Unwanted));
        }
    }
    Ok(None)
}

/// The versions of the study under which the compared participants enrolled.
///
/// # Errors
/// If the database fails.
pub(super) async fn study_versions(
    store: &Store,
    study: &StoredStudy,
    compared: &HashSet<String>,
) -> anyhow::Result<Vec<u32>> {
    let roster = store.roster(study.id, false).await.context("the study's participants")?;
    let hashes: HashSet<String> = roster
        .into_iter()
        .filter(|entry| compared.contains(&entry.number.to_string()))
        .map(|entry| entry.config_hash)
        .collect();
    let versions = store.study_versions(study.id).await?;
    let used = versions.iter().filter(|version| hashes.contains(&version.hash));
    Ok(used.map(|version| version.number).collect())
}
