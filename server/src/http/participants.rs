//! Progress, comprehension check, answers, completion and withdrawal of participants.

use crate::http::app::App;
use crate::http::auth::{Me, MeOrGone, Writer, check_study};
use crate::http::endings::{completed_url, screened_out_url, standing, withdrawn_url};
use crate::http::enrolment::plan;
use crate::http::error::ApiError;
use crate::http::evidence::EvidenceBody;
use crate::http::json::JsonBody;
use crate::http::params::Params;
use crate::store::participants::{Completion, Scope};
use crate::store::scenes::PlannedRow;
use crate::support::clock::now_ms;
use crate::support::secrets;
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use sidestep::api::{
    Answers, Completed, ComprehensionResult, ComprehensionStored, Progress, Withdrawn,
};
use sidestep::invalid::Invalid;
use sidestep::study::Question;
use std::sync::Arc;

/// `GET /api/v1/participants/me`. The request shows that the participant is present, so they keep their
/// place in a study with a quota.
pub async fn show(
    State(app): State<Arc<App>>,
    Me(visitor): Me,
) -> Result<Json<Progress>, ApiError> {
    let me = &visitor.participant;
    let config = app.store.config(&me.config_hash).await?;
    let rows = app.store.plan(&me.id).await?;
    let (there, state) = (me.clone(), Arc::clone(&app));
    // Progress must be shown even if nothing can be written.
    tokio::spawn(async move {
        if let Err(error) = state.store.note_presence(&there, now_ms()).await {
            tracing::warn!(%error, "noting that a participant is there");
        }
    });
    let id = |row: &PlannedRow| row.trial_id.clone();
    let stored: Vec<_> = rows.iter().filter(|row| row.stored).map(id).collect();
    let code = me.completion_code.clone().filter(|_| visitor.may_see_code());
    let check = &config.comprehension;
    let has_check = check.standard || !check.questions.is_empty();
    Ok(Json(Progress {
        participant_id: me.id.clone(),
        study: config.slug.clone(),
        plan: plan(&config, &rows),
        next: rows.iter().find(|row| !row.stored).map(id),
        return_url: match &code {
            Some(code) => completed_url(&config, me, code),
            None => standing(&config, me).1,
        },
        completion_code: code,
        complete: me.completion_code.is_some(),
        // A participant with stored trials has passed the check, or began when the study had no check.
        understood: me.understood || !has_check || !stored.is_empty(),
        comprehension_attempts: visitor.attempts() as usize,
        answered: me.answered || config.questions.is_empty(),
        stored,
        pilot: me.pilot,
        may_withdraw: visitor.scope == Scope::Full,
    }))
}

/// `PUT /api/v1/participants/me/comprehension`: stores the result of the comprehension check. A
/// repeated request gets the same response.
pub async fn check_understanding(
    State(app): State<Arc<App>>,
    MeOrGone(visitor): MeOrGone,
    JsonBody(result): JsonBody<ComprehensionResult>,
) -> Result<Json<ComprehensionStored>, ApiError> {
    const MOST_ATTEMPTS: usize = 1_000;
    let me = &visitor.participant;
    let config = app.store.config(&me.config_hash).await?;
    if me.withdrawn_at_ms.is_some() {
        return Err(ApiError::withdrawn(withdrawn_url(&config, me)));
    }
    check_study(&app, &visitor).await?;
    if !(1..=MOST_ATTEMPTS).contains(&result.attempts) {
        let expected = format!("a whole number from 1 to {MOST_ATTEMPTS}");
        return Err(Invalid::new("attempts", expected, result.attempts).into());
    }
    let most = config.comprehension.attempts;
    let continues = (visitor.scope == Scope::Continue).then_some(visitor.token_hash);
    let screened_out =
        app.store.check_understanding(&me.id, continues, result, most, now_ms()).await?;
    let return_url = screened_out.then(|| screened_out_url(&config, me)).flatten();
    let after_wrong = config.comprehension.after_wrong;
    Ok(Json(ComprehensionStored { screened_out, after_wrong, return_url }))
}

/// `PUT /api/v1/participants/me/answers`: 204. The browser that enrolled may replace earlier answers
/// until the participation is complete.
pub async fn answer(
    State(app): State<Arc<App>>,
    Writer(visitor): Writer,
    EvidenceBody(Answers { answers }): EvidenceBody<Answers>,
) -> Result<StatusCode, ApiError> {
    let me = &visitor.participant;
    let config = app.store.config(&me.config_hash).await?;
    for (name, value) in answers.iter() {
        let question = config.questions.iter().find(|question| question.name == name);
        let unknown = || {
            let names: Vec<_> = config.questions.iter().map(|q| q.name.as_str()).collect();
            let expected = match names.len() {
                0 => "no answers, since the study has no questions".to_owned(),
                _ => format!("one of {}", names.join(", ")),
            };
            Invalid::new("answers", expected, "the name of no question")
        };
        question.ok_or_else(unknown)?.check_answer(value)?;
    }
    let is_given = |question: &Question| match answers.get(&question.name) {
        Some(Value::String(text)) => !text.trim().is_empty(),
        Some(_) => true,
        None => false,
    };
    if let Some(missing) = config.questions.iter().find(|q| q.required && !is_given(q)) {
        let field = format!("answers.{}", missing.name);
        return Err(Invalid::new(field, "an answer", "none").into());
    }
    let json = serde_json::to_string(&answers).context("answers as JSON")?;
    match app.store.put_answers(&me.id, visitor.scope, json, now_ms()).await? {
        true => Ok(StatusCode::NO_CONTENT),
        false if visitor.scope == Scope::Full => {
            let message = "this participation is complete; its answers stay as they are";
            Err(ApiError::conflict("complete", message))
        }
        false => {
            let message = "other answers are stored; only the browser that enrolled replaces them";
            Err(ApiError::conflict("answered", message))
        }
    }
}

/// `POST /api/v1/participants/me/complete`: returns the completion code if all trials and the
/// required answers are stored.
pub async fn complete(
    State(app): State<Arc<App>>,
    Writer(visitor): Writer,
) -> Result<Json<Completed>, ApiError> {
    let me = &visitor.participant;
    let config = app.store.config(&me.config_hash).await?;
    let required = config.questions.iter().any(|question| question.required);
    let mut code = secrets::completion_code()?;
    if me.pilot {
        code.insert_str(0, "PILOT-");
    }
    match app.store.complete(&visitor, required, code, now_ms()).await? {
        Completion::Complete { code, visible: true } => {
            let return_url = completed_url(&config, me, &code);
            Ok(Json(Completed { completion_code: code, return_url }))
        }
        Completion::Complete { visible: false, .. } => Err(ApiError::not_yours()),
        Completion::Incomplete { missing, of } => {
            let message = format!("{missing} of {of} trials are not stored yet");
            Err(ApiError::conflict("incomplete", message))
        }
        Completion::Unanswered => {
            let message = "a question that must be answered is not answered yet";
            Err(ApiError::conflict("unanswered", message))
        }
        Completion::Withdrawn => Err(ApiError::withdrawn(withdrawn_url(&config, me))),
    }
}

/// The effect of a withdrawal on the participant's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// The trials so far may be used.
    Keep,
    /// All data are deleted at once.
    Delete,
}

/// The query of a withdrawal.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct WithdrawParams {
    /// The effect on the data so far.
    data: Fate,
}

/// `DELETE /api/v1/participants/me?data=keep|delete`. Idempotent; `keep` can be followed by
/// `delete`. Possible even in an archived study, and after being screened out.
pub async fn withdraw(
    State(app): State<Arc<App>>,
    MeOrGone(visitor): MeOrGone,
    Params(params): Params<WithdrawParams>,
) -> Result<Json<Withdrawn>, ApiError> {
    if visitor.scope != Scope::Full {
        return Err(ApiError::not_yours());
    }
    let me = &visitor.participant;
    let config = app.store.config(&me.config_hash).await?;
    app.store.withdraw(&me.id, params.data == Fate::Delete, now_ms(), None).await?;
    Ok(Json(Withdrawn { return_url: withdrawn_url(&config, me) }))
}
