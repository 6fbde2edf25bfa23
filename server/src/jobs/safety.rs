//! The value functions for the safety levels of a configuration. They are solved once, outside of
//! requests, and stored permanently.

use super::children::{Children, Ended};
use super::frames::{FromChild, ToChild};
use crate::store::studies::StoredStudy;
use crate::store::value_functions::NewValueFunction;
use crate::store::{Store, StoreError};
use anyhow::Context;
use sidestep::invalid::Invalid;
use sidestep::reachability::ValueFunction;
use sidestep::safety::SafetyLevels;
use sidestep::scene::Evader;
use sidestep::study::StudyConfig;
use std::sync::Arc;
use std::time::Instant;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Stores the value functions of a configuration that has a closed-form solution. Call this before the
/// first request. The [`Solver`] computes all other value functions.
///
/// # Errors
/// If the database cannot be written.
pub async fn keep_exact(store: &Store, study: &StoredStudy) -> Result<(), StoreError> {
    // For equal vehicles, one closed form serves both roles.
    let Ok(exact) = study.config.parameters.game(Evader::Human).exact() else {
        return Ok(());
    };
    let function = ValueFunction::Exact(exact);
    let (id, bytes) = (function.id(), function.encode());
    let kept = |evader| NewValueFunction { evader, id: id.clone(), bytes: bytes.clone() };
    store.put_value_functions(&study.config_hash, Evader::ALL.map(kept).into()).await
}

/// The encoded value functions of a configuration. Returns `None` until both are solved.
///
/// # Errors
/// If the database cannot be read.
pub async fn stored(
    store: &Store,
    config_hash: &str,
) -> Result<Option<StoredFunctions>, StoreError> {
    let mut bytes = Vec::new();
    for evader in Evader::ALL {
        let Some(id) = store.value_function_id(config_hash, evader).await? else {
            return Ok(None);
        };
        bytes.extend(store.value_function(&id).await?);
    }
    Ok(<[Vec<u8>; 2]>::try_from(bytes).ok().map(StoredFunctions))
}

/// V_HR and V_RH, encoded.
pub struct StoredFunctions([Vec<u8>; 2]);

impl StoredFunctions {
    /// V_HR, encoded.
    #[must_use]
    pub fn human(&self) -> &[u8] {
        &self.0[0]
    }

    /// V_RH, encoded.
    #[must_use]
    pub fn robot(&self) -> &[u8] {
        &self.0[1]
    }

    /// Decodes the value functions, which takes some milliseconds.
    ///
    /// # Errors
    /// [`Invalid`] if they are damaged.
    pub fn decode(&self) -> Result<SafetyLevels, Invalid> {
        let [human, robot] = &self.0;
        Ok(SafetyLevels {
            human: ValueFunction::decode(human)?,
            robot: ValueFunction::decode(robot)?,
        })
    }
}

/// Solves missing value functions in the background, each in a child process.
#[derive(Debug)]
pub struct Solver {
    cancel: CancellationToken,
    task: JoinHandle<()>,
}

impl Solver {
    /// Starts the solver. If a solve fails, the solver logs the error, and browsers that need the
    /// value function compute it themselves.
    #[must_use]
    pub fn start(store: Store, study_stored: Arc<Notify>, children: Children) -> Self {
        let cancel = CancellationToken::new();
        let watched = cancel.clone();
        let task = tokio::spawn(async move {
            let solving = async {
                loop {
                    if let Err(error) = solve_all(&store, &children).await {
                        tracing::error!(error = format!("{error:#}"), "solving value functions");
                    }
                    study_stored.notified().await;
                }
            };
            // Dropping a solve kills its process.
            tokio::select! {
                () = solving => {}
                () = watched.cancelled() => {}
            }
        });
        Self { cancel, task }
    }

    /// Cancels the solve in progress. It restarts at the next start of the server.
    pub async fn stop(self) {
        self.cancel.cancel();
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the solver failed");
        }
    }
}

async fn solve_all(store: &Store, children: &Children) -> anyhow::Result<()> {
    for (hash, config) in store.unsolved().await? {
        let begin = Instant::now();
        let study = &config.slug;
        match solve_and_keep(store, &hash, &config, children).await? {
            Ok(()) => {
                let ms = begin.elapsed().as_millis();
                tracing::info!(study, ms, "value functions solved");
            }
            Err(Ended::Asked) => return Ok(()),
            Err(Ended::Failed(why)) => {
                tracing::error!(study, why, "no value functions for these vehicles");
            }
        }
    }
    Ok(())
}

async fn solve_and_keep(
    store: &Store,
    hash: &str,
    config: &StudyConfig,
    children: &Children,
) -> anyhow::Result<Result<(), Ended>> {
    let mut child = children.start()?;
    // An error means that the child has ended. The next read then fails, too.
    let _ = child.tell(&ToChild::Solve(config.parameters), &[]).await;
    let (human, complaints, bytes) = match child.hear().await {
        Ok((FromChild::Solved { human, complaints }, bytes)) => (human, complaints, bytes),
        Ok((FromChild::Failed(why), _)) => return Ok(Err(Ended::Failed(why))),
        Ok((other, _)) => anyhow::bail!("expected value functions, found {other:?}"),
        Err(_) => return Ok(Err(child.ended().await)),
    };
    for complaint in complaints {
        tracing::warn!(study = config.slug, complaint, "a value function did not converge");
    }
    let (human, robot) = bytes.split_at_checked(human).context("the value functions")?;
    let mut solutions = Vec::new();
    for (evader, bytes) in Evader::ALL.into_iter().zip([human, robot]) {
        let id = ValueFunction::decode(bytes)?.id();
        solutions.push(NewValueFunction { evader, id, bytes: bytes.to_vec() });
    }
    store.put_value_functions(hash, solutions).await?;
    Ok(Ok(()))
}

/// Returns the value functions of a study's configuration from the store. If they are missing, they are
/// solved and stored.
///
/// # Errors
/// The outer error if the database fails or the process cannot be started. The inner error if the
/// game cannot be solved.
pub async fn ensure(
    store: &Store,
    study: &StoredStudy,
    children: &Children,
) -> anyhow::Result<Result<StoredFunctions, Ended>> {
    let hash = &study.config_hash;
    if let Some(functions) = stored(store, hash).await? {
        return Ok(Ok(functions));
    }
    if let Err(ended) = solve_and_keep(store, hash, &study.config, children).await? {
        return Ok(Err(ended));
    }
    let kept = stored(store, hash).await?;
    Ok(Ok(kept.context("value functions that were just kept")?))
}
