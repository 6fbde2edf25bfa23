//! The value functions behind the safety levels of a configuration: solved once, off
//! the request path, and kept for ever.

use crate::store::{Db, Store, value_functions};
use anyhow::Context;
use sidestep::invalid::Invalid;
use sidestep::reachability::{SolveError, ValueFunction};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, SceneParameters};
use sidestep::study::StudyConfig;
use std::ops::ControlFlow;
use std::time::Instant;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Keeps the functions of a configuration that takes no solve, so that they are there
/// before the first request. Others are left to [`Solver`].
///
/// # Errors
/// If the database cannot be written.
pub async fn keep_exact(db: &mut Db, config: &StudyConfig) -> Result<(), sqlx::Error> {
    // Equal vehicles: one closed form serves both roles.
    let Ok(exact) = config.parameters.game(Evader::Human).exact() else {
        return Ok(());
    };
    let function = ValueFunction::Exact(exact);
    let (hash, id, octets) = (config.hash(), function.id(), function.encode());
    for evader in Evader::ALL {
        value_functions::put(db, &hash, evader, &id, &octets).await?;
    }
    Ok(())
}

/// The functions that a configuration's safety levels are read from, as octets; none
/// while one of them is not solved.
///
/// # Errors
/// If the database cannot be read.
pub async fn stored(
    db: &mut Db,
    config_hash: &str,
) -> Result<Option<StoredFunctions>, sqlx::Error> {
    let mut octets = Vec::new();
    for evader in Evader::ALL {
        let Some(id) = value_functions::id_of(db, config_hash, evader).await? else {
            return Ok(None);
        };
        octets.extend(value_functions::find(db, &id).await?);
    }
    Ok(<[Vec<u8>; 2]>::try_from(octets).ok().map(StoredFunctions))
}

/// Octets of V_HR and V_RH.
pub struct StoredFunctions([Vec<u8>; 2]);

impl StoredFunctions {
    /// Reads them: some milliseconds of work.
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

/// A value function as it is kept.
struct Solution {
    evader: Evader,
    id: String,
    octets: Vec<u8>,
}

/// The functions, and what is to be said of those that did not converge.
type Solutions = ([Solution; 2], Vec<String>);

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
        Solution { evader, id: function.id(), octets: function.encode() }
    });
    Ok((solutions, functions.complaints()))
}

/// Solves in the background what configurations lack.
#[derive(Debug)]
pub struct Solver {
    cancel: CancellationToken,
    task: JoinHandle<()>,
}

impl Solver {
    /// Begins; nobody has to wait for the end. What cannot be solved is logged, and
    /// browsers that need it try themselves.
    #[must_use]
    pub fn start(store: Store) -> Self {
        let cancel = CancellationToken::new();
        let watched = cancel.clone();
        let task = tokio::spawn(async move {
            if let Err(error) = solve_all(&store, &watched).await {
                tracing::error!(error = format!("{error:#}"), "solving value functions");
            }
        });
        Self { cancel, task }
    }

    /// Breaks off what is under way; it begins anew at the next start.
    pub async fn stop(self) {
        self.cancel.cancel();
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the solver ended badly");
        }
    }
}

async fn solve_all(store: &Store, cancel: &CancellationToken) -> anyhow::Result<()> {
    let unsolved = value_functions::unsolved(&mut *store.reader().await?).await?;
    for (hash, config) in unsolved {
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
    let mut db = store.write().await?;
    for Solution { evader, id, octets } in &solutions {
        value_functions::put(&mut db, hash, *evader, id, octets).await?;
    }
    db.commit().await?;
    Ok(Ok(()))
}

/// The functions of a configuration: as they are kept, or else solved now, and kept.
///
/// # Errors
/// Outside: if the database fails, or what it holds is damaged. Inside: for vehicles that have
/// none, or if `cancel` was cancelled.
pub async fn ensure(
    store: &Store,
    config: &StudyConfig,
    cancel: &CancellationToken,
) -> anyhow::Result<Result<SafetyLevels, SolveError>> {
    let hash = config.hash();
    let kept = stored(&mut *store.reader().await?, &hash).await?;
    if let Some(functions) = kept {
        return Ok(Ok(functions.decode()?));
    }
    if let Err(error) = solve_and_keep(store, &hash, config, cancel).await? {
        return Ok(Err(error));
    }
    let kept = stored(&mut *store.reader().await?, &hash).await?;
    Ok(Ok(kept.context("value functions that were just kept")?.decode()?))
}
