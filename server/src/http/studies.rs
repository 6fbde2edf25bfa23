//! The public part of a study.

use crate::http::app::App;
use crate::http::auth::visitor;
use crate::http::endings::{newcomers_url, standing};
use crate::http::error::ApiError;
use crate::http::params::{Params, PathText};
use crate::store::Store;
use crate::store::enrolments::Gate;
use crate::store::participants::Visitor;
use crate::store::studies::StoredStudy;
use crate::support::clock::now_ms;
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::{Admission, StudyInfo};
use sidestep::study::{Status, StudyConfig, normalised_id};
use std::sync::Arc;

/// The query of a study.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct StudyParams {
    /// The recruiting service's id of the person who sent the request.
    external_id: Option<String>,
}

/// `GET /api/v1/studies/{slug}?external_id=`. With a participant's token, the response has the
/// configuration of their enrolment. With an external id, it states whether this person can take part,
/// or has already begun or finished. This reveals no more than an enrolment with the same id, and
/// stores nothing.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    Params(params): Params<StudyParams>,
    headers: HeaderMap,
) -> Result<Json<StudyInfo>, ApiError> {
    let study = named(&app.store, &slug).await?;
    let mut admission = match study.config.status {
        Status::Open if !study.config.admits(false) => Admission::Closed,
        status => status.into(),
    };
    if admission == Admission::Open && app.store.is_full(study.id, gate(&study)).await? {
        admission = Admission::Full;
    }
    let id = params.external_id.as_deref();
    let key = id.map(|id| normalised_id("external_id", id)).transpose()?;
    let known = match key {
        Some(key) => app.store.known(study.id, key).await?,
        None => None,
    };
    let known = match known {
        Some(me) => Some(standing(&*app.store.config(&me.config_hash).await?, &me)),
        None => None,
    };
    let return_url;
    (admission, return_url) = match known {
        // No participant can continue in an archived study.
        Some(known) if (known.0, admission) != (Admission::Open, Admission::Archived) => known,
        _ => (admission, newcomers_url(&study.config, admission, id)),
    };
    let Asked { config, .. } = asked_for(&app, &study, &headers).await?;
    Ok(Json(StudyInfo { return_url, ..StudyInfo::of(&config, admission) }))
}

/// The configuration that applies to a request.
pub struct Asked {
    /// The configuration.
    pub config: Arc<StudyConfig>,
    /// The hash of the configuration.
    pub config_hash: String,
    /// The participant whose token the request has.
    pub visitor: Option<Visitor>,
}

/// The configuration that applies to a request. With a participant's token, it is the configuration
/// of their enrolment. Otherwise it is the configuration for new participants. An edited study file
/// changes nothing for participants who have begun.
///
/// # Errors
/// If the database cannot be read.
pub async fn asked_for(
    app: &App,
    study: &StoredStudy,
    headers: &HeaderMap,
) -> Result<Asked, ApiError> {
    let visitor = visitor(app, headers).await?;
    let visitor = visitor.filter(|visitor| visitor.participant.study_id == study.id);
    let (config, config_hash) = match &visitor {
        Some(Visitor { participant, .. }) => {
            let config_hash = participant.config_hash.clone();
            (app.store.config(&config_hash).await?, config_hash)
        }
        None => (Arc::clone(&study.config), study.config_hash.clone()),
    };
    Ok(Asked { config, config_hash, visitor })
}

/// The conditions for enrolment in a study now.
#[must_use]
pub fn gate(study: &StoredStudy) -> Gate {
    let recruitment = &study.config.recruitment;
    let hold_ms = (recruitment.hold_min * 60_000.0) as i64;
    Gate {
        is_open: study.config.admits(false),
        quota: recruitment.quota,
        away_before_ms: now_ms() - hold_ms,
    }
}

/// The study with this name.
///
/// # Errors
/// 404 if the study does not exist.
pub async fn named(store: &Store, slug: &str) -> Result<StoredStudy, ApiError> {
    store.study(slug).await?.ok_or_else(|| ApiError::not_found("study"))
}
