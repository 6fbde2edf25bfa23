//! Studies and trials, for experimenters.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::{Manager, Reader};
use crate::http::params::{Params, PathText};
use crate::http::studies::named;
use crate::store::Store;
use crate::store::trials::{StoredTrial, TrialHead};
use crate::support::clock::now_ms;
use crate::trial_content::Content;
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::{
    Action, DataCheck, PilotsDeleted, SelfCheck, StudySummary, TrialDetail, TrialPage, TrialSummary,
};
use sidestep::invalid::Invalid;
use sidestep::scene::Evader;
use sidestep::trial::{simulation_fingerprint, verify};
use std::sync::Arc;

/// `GET /api/v1/admin/studies`.
pub async fn studies(
    _: Reader,
    State(app): State<Arc<App>>,
) -> Result<Json<Vec<StudySummary>>, ApiError> {
    Ok(Json(app.store.summaries(None, now_ms()).await?))
}

/// `GET /api/v1/admin/studies/{slug}`.
pub async fn study(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<StudySummary>, ApiError> {
    let found = app.store.summaries(Some(slug), now_ms()).await?.pop();
    found.map(Json).ok_or_else(|| ApiError::not_found("study"))
}

/// `DELETE /api/v1/admin/studies/{slug}/pilots`: deletes all pilots with their trials.
pub async fn delete_pilots(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<PilotsDeleted>, ApiError> {
    let study = named(&app.store, &slug).await?;
    let entry = me.does(Action::PilotsDeleted, Some(&slug), None);
    Ok(Json(PilotsDeleted { deleted: app.store.delete_pilots(study.id, entry).await? }))
}

/// The query of a page of a list.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct PageParams {
    /// Maximum number of entries on the page, from 1 to 500. The default is 50.
    #[schemars(range(min = 1, max = 500))]
    limit: Option<i64>,
    /// Only entries before this sequence number, which is the `next_before` of the previous page.
    before: Option<i64>,
}

impl PageParams {
    /// The limit, and the sequence number before which the page begins.
    ///
    /// # Errors
    /// [`Invalid`] for a limit outside 1 to 500.
    pub fn checked(&self) -> Result<(i64, i64), Invalid> {
        let limit = self.limit.unwrap_or(50);
        if !(1..=500).contains(&limit) {
            return Err(Invalid::new("limit", "a whole number from 1 to 500", limit));
        }
        Ok((limit, self.before.unwrap_or(i64::MAX)))
    }
}

/// The first `limit` items of `found`, which was queried for `limit` + 1 items. Also returns the
/// sequence number before which the next page begins, if there is a next page.
pub fn page<T>(
    mut found: Vec<T>,
    limit: i64,
    sequence: impl Fn(&T) -> i64,
) -> (Vec<T>, Option<i64>) {
    let more = found.len() as i64 > limit;
    found.truncate(limit as usize);
    let next_before = found.last().filter(|_| more).map(sequence);
    (found, next_before)
}

/// `GET /api/v1/admin/studies/{slug}/trials?limit=&before=`: newest first.
pub async fn trials(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    Params(params): Params<PageParams>,
) -> Result<Json<TrialPage>, ApiError> {
    let (limit, before) = params.checked()?;
    let study = named(&app.store, &slug).await?;
    let heads = app.store.trials_page(study.id, before, limit + 1).await?;
    let (heads, next_before) = page(heads, limit, |head| head.sequence);
    Ok(Json(TrialPage { next_before, trials: heads.into_iter().map(summary).collect() }))
}

/// `GET /api/v1/admin/trials/{trial_id}`.
pub async fn trial(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(trial_id): PathText,
) -> Result<Json<TrialDetail>, ApiError> {
    let trial = stored(&app.store, &trial_id).await?;
    let parameters = app.store.config(&trial.config_hash).await?.parameters;
    let synthetic = trial.is_synthetic();
    let Content { inputs, states, .. } = trial.content;
    let start = states.first().copied().unwrap_or_else(|| trial.scene.start());
    let replay = verify(&parameters, &trial.scene.starting_at(start), &inputs, &states);
    let hash = &trial.config_hash;
    let value_function_hr = app.store.value_function_id(hash, Evader::Human).await?;
    let value_function_rh = app.store.value_function_id(hash, Evader::Robot).await?;
    let [previous, next] = app.store.neighbours(&trial_id).await?;
    Ok(Json(TrialDetail {
        summary: summary(trial.head),
        study: trial.study,
        synthetic,
        parameters,
        scene: trial.scene,
        inputs,
        states,
        replay,
        value_function_hr,
        value_function_rh,
        previous,
        next,
    }))
}

/// Seed and number of trials of [`self_check`].
const SELF_CHECK: (u64, usize) = (20_180_918, 10_000);

/// `GET /api/v1/admin/self-check`.
pub async fn self_check(
    _: Reader,
    State(app): State<Arc<App>>,
) -> Result<Json<SelfCheck>, ApiError> {
    let (seed, trials) = SELF_CHECK;
    let compute = || async {
        let fingerprint =
            tokio::task::spawn_blocking(move || simulation_fingerprint(seed, trials)).await?;
        Ok::<_, tokio::task::JoinError>(SelfCheck { seed, trials, fingerprint })
    };
    let check = app.self_check.get_or_try_init(compute).await;
    Ok(Json(check.context("self-check")?.clone()))
}

/// `GET /api/v1/admin/data-check`.
pub async fn data_check(_: Reader, State(app): State<Arc<App>>) -> Json<DataCheck> {
    Json(app.data_check.borrow().clone())
}

/// The trial with this id.
///
/// # Errors
/// 404 if the trial does not exist.
pub async fn stored(store: &Store, trial_id: &str) -> Result<StoredTrial, ApiError> {
    store.trial(trial_id).await?.ok_or_else(|| ApiError::not_found("trial"))
}

/// The summary of a trial in a list.
#[must_use]
pub fn summary(head: TrialHead) -> TrialSummary {
    TrialSummary {
        trial_id: head.trial_id,
        participant_id: head.participant_id,
        participant_number: head.participant_number,
        phase: head.phase,
        index: head.index,
        attempt: head.attempt,
        received_at_ms: head.received_at_ms,
        outcome: head.outcome,
        flags: head.flags,
    }
}
