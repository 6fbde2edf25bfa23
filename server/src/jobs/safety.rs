//! The value functions behind the safety levels of a configuration: solved once, off
//! the request path, and stored for ever.

use crate::store::studies::StoredStudy;
use crate::store::value_functions::NewValueFunction;
use crate::store::{Store, StoreError};
use anyhow::Context;
use sidestep::invalid::Invalid;
use sidestep::reachability::{SolveError, ValueFunction};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, SceneParameters};
use sidestep::study::StudyConfig;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Stores the value functions of a configuration with a closed form before the first request. The
/// [`Solver`] computes the others.
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

/// The bytes of a configuration's value functions; none until both are solved.
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

/// Bytes of V_HR and V_RH.
pub struct StoredFunctions([Vec<u8>; 2]);

impl StoredFunctions {
    /// Decodes them, in some milliseconds.
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

/// The value functions, with logged warnings about those that did not converge.
type Solutions = (Vec<NewValueFunction>, Vec<String>);

fn solve(
    parameters: &SceneParameters,
    cancel: &CancellationToken,
) -> Result<Solutions, SolveError> {
    let mut progress = |_| match cancel.is_cancelled() {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let functions = SafetyLevels::solve(parameters, &mut progress)?;
    let solutions = Evader::ALL.map(|evader| {
        let function = functions.of(evader);
        NewValueFunction { evader, id: function.id(), bytes: function.encode() }
    });
    Ok((solutions.into(), functions.complaints()))
}

/// Solves missing value functions in the background.
#[derive(Debug)]
pub struct Solver {
    cancel: CancellationToken,
    task: JoinHandle<()>,
}

impl Solver {
    /// Starts solving. A failure is logged, and browsers that need the function solve it
    /// themselves.
    #[must_use]
    pub fn start(store: Store, study_stored: Arc<Notify>) -> Self {
        let cancel = CancellationToken::new();
        let watched = cancel.clone();
        let task = tokio::spawn(async move {
            while !watched.is_cancelled() {
                if let Err(error) = solve_all(&store, &watched).await {
                    tracing::error!(error = format!("{error:#}"), "solving value functions");
                }
                tokio::select! {
                    () = study_stored.notified() => {}
                    () = watched.cancelled() => {}
                }
            }
        });
        Self { cancel, task }
    }

    /// Cancels the solve under way; it begins anew at the next start.
    pub async fn stop(self) {
        self.cancel.cancel();
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the solver ended badly");
        }
    }
}

async fn solve_all(store: &Store, cancel: &CancellationToken) -> anyhow::Result<()> {
    for (hash, config) in store.unsolved().await? {
        let begin = Instant::now();
        let study = &config.slug;
        match solve_and_keep(store, &hash, &config, cancel).await? {
            Ok(()) => {
                let ms = begin.elapsed().as_millis();
                tracing::info!(study, ms, "value functions solved");
            }
            Err(SolveError::Cancelled) => return Ok(()),
            Err(SolveError::Invalid(invalid)) => {
                tracing::error!(study, %invalid, "no value functions for these vehicles");
            }
        }
    }
    Ok(())
}

async fn solve_and_keep(
    store: &Store,
    hash: &str,
    config: &StudyConfig,
    cancel: &CancellationToken,
) -> anyhow::Result<Result<(), SolveError>> {
    let (parameters, watched) = (config.parameters, cancel.clone());
    let solved = tokio::task::spawn_blocking(move || solve(&parameters, &watched));
    let (solutions, complaints) = match solved.await.context("solving")? {
        Ok(solutions) => solutions,
        Err(error) => return Ok(Err(error)),
    };
    for complaint in complaints {
        tracing::warn!(study = config.slug, complaint, "a value function did not converge");
    }
    store.put_value_functions(hash, solutions).await?;
    Ok(Ok(()))
}

/// The value functions of a study's configuration: read from the store, or solved now and stored.
///
/// # Errors
/// The outer error if the database fails or is damaged; the inner one for a game that cannot be solved,
/// or if `cancel` was cancelled.
pub async fn ensure(
    store: &Store,
    study: &StoredStudy,
    cancel: &CancellationToken,
) -> anyhow::Result<Result<SafetyLevels, SolveError>> {
    let hash = &study.config_hash;
    let kept = stored(store, hash).await?;
    if let Some(functions) = kept {
        return Ok(Ok(functions.decode()?));
    }
    if let Err(error) = solve_and_keep(store, hash, &study.config, cancel).await? {
        return Ok(Err(error));
    }
    let kept = stored(store, hash).await?;
    Ok(Ok(kept.context("value functions that were just kept")?.decode()?))
}
