//! The configurations of studies, which experimenters edit. The handlers check, show and store
//! drafts of study files.
//!
//! A configuration in use is never edited. Enrolled participants keep their configuration, and new
//! participants get the new one.

use crate::design;
use crate::formats::study_toml::{StudyFile, read_unchecked, written};
use crate::formats::toml_lines::{Complaint, one_line};
use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::{Experimenter, Manager, Reader};
use crate::http::json::JsonBody;
use crate::http::params::PathText;
use crate::http::studies::named;
use crate::jobs::safety;
use crate::store::Store;
use crate::store::studies::{ChangeStudy, StoredStudy};
use crate::support::clock::now_ms;
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde_json::{Value, json};
use sidestep::api::{
    Action, Change, Configuration, ConfigurationVersion, Draft, DraftChecked, FormDraft, NewStatus,
    Problem, Remark,
};
use sidestep::document::from_value;
use sidestep::invalid::Invalid;
use sidestep::study::StudyConfig;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Maximum number of scenes in the picture of a draft. The picture shows fewer participants if
/// necessary.
const MOST_SCENES: u64 = 3_000;

/// `GET /api/v1/admin/studies/{slug}/configuration`.
pub async fn show(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<Configuration>, ApiError> {
    configuration(&app, named(&app.store, &slug).await?).await.map(Json)
}

/// `POST /api/v1/admin/drafts`: checks a draft. An invalid draft also gets a 200, with the error in the
/// response.
pub async fn check(
    _: Reader,
    State(app): State<Arc<App>>,
    JsonBody(draft): JsonBody<Draft>,
) -> Result<Json<DraftChecked>, ApiError> {
    checked(&app, draft).await.map(Json)
}

/// `POST /api/v1/admin/drafts/form`: like [`check`], but the draft is given as form values. The server
/// first converts these values to a study file.
pub async fn check_form(
    _: Reader,
    State(app): State<Arc<App>>,
    JsonBody(draft): JsonBody<FormDraft>,
) -> Result<Json<DraftChecked>, ApiError> {
    let FormDraft { config, base } = draft;
    let unwritten = |field: Option<String>, message: String| {
        let complaint = Some(Remark { line: None, field, message });
        let (config, languages) = (Some(config.clone()), languages(&app));
        Ok(Json(DraftChecked { complaint, config, languages, ..DraftChecked::default() }))
    };
    // A missing slug would default to the paper's study. JSON arrays, which are never a study, are
    // rejected here too.
    if !config.get("slug").is_some_and(Value::is_string) {
        let found = config.get("slug").map_or_else(|| "none".to_owned(), Value::to_string);
        let invalid = Invalid::new("slug", "the study's name in addresses", found);
        return unwritten(Some(invalid.field.clone()), invalid.to_string());
    }
    let study = match from_value::<StudyConfig>(&config) {
        Ok(study) => study,
        Err(invalid) => {
            let invalid = with_range(&config, invalid);
            return unwritten(Some(invalid.field.clone()), invalid.to_string());
        }
    };
    // This fails for integers above 2⁶³ − 1, which TOML does not support.
    let toml = match written(&study) {
        Ok(toml) => toml,
        Err(error) => return unwritten(None, one_line(&error.to_string())),
    };
    let checked = checked(&app, Draft { toml: toml.clone(), base }).await?;
    Ok(Json(DraftChecked { toml: Some(toml), ..checked }))
}

/// Adds the valid range to a complaint about a field that is null or has a number of the wrong
/// type. To find the range, tries extreme numbers until the study's own check complains about this
/// field.
fn with_range(config: &Value, invalid: Invalid) -> Invalid {
    let pointer = format!("/{}", invalid.field.replace(['.', '['], "/").replace(']', ""));
    if !matches!(config.pointer(&pointer), Some(Value::Null | Value::Number(_))) {
        return invalid;
    }
    let outside = [json!(0), json!(u8::MAX), json!(u32::MAX), json!(-1), json!(1e12)];
    let expected = outside.into_iter().find_map(|number| {
        let mut other = config.clone();
        *other.pointer_mut(&pointer)? = number;
        let complaint = from_value::<StudyConfig>(&other).ok()?.check().err()?;
        (complaint.field == invalid.field).then_some(complaint.expected)
    });
    Invalid { expected: expected.unwrap_or(invalid.expected), ..invalid }
}

fn languages(app: &App) -> Vec<String> {
    app.library.languages().tags().map(str::to_owned).collect()
}

async fn checked(app: &Arc<App>, draft: Draft) -> Result<DraftChecked, ApiError> {
    let Draft { toml, base } = draft;
    let languages = languages(app);
    let (file, warnings) = match read_draft(app, toml.clone()).await? {
        Ok(read) => read,
        Err(complaint) => {
            let complaint = Some(remark(complaint));
            // A form cannot show a number that JSON does not support, such as NaN.
            let config = read_unchecked(&toml).ok().and_then(|study| {
                let config = serde_json::to_value(study).ok()?;
                from_value::<StudyConfig>(&config).is_ok().then_some(config)
            });
            return Ok(DraftChecked { complaint, config, languages, ..DraftChecked::default() });
        }
    };
    let study = Arc::new(file.config().clone());
    let there = app.store.study(&study.slug).await?;
    let refused = |languages, invalid: &Invalid| -> Result<DraftChecked, ApiError> {
        let complaint = Some(remark(file.located(invalid)));
        let config = Some(serde_json::to_value(&*study).context("a configuration as JSON")?);
        Ok(DraftChecked { complaint, config, languages, ..DraftChecked::default() })
    };
    if base.is_none() && there.is_some() {
        let invalid = Invalid::new("slug", "a name that no study has", &study.slug);
        return refused(languages, &invalid);
    }
    let present = there.filter(|_| base.is_some());
    let changes = match present {
        Some(present) => {
            let participants = participants(&app.store, &study.slug).await?;
            if let Err(invalid) = present.config.check_successor(&study, participants) {
                return refused(languages, &invalid);
            }
            changes(&present.config, &study)?
        }
        None => Vec::new(),
    };
    let drawn = Arc::clone(&study);
    let picture = app.drawing.queue()?.run(move || picture(&drawn)).await??;
    Ok(DraftChecked {
        complaint: None,
        warnings: warnings.into_iter().map(remark).collect(),
        changes,
        config: Some(serde_json::to_value(&*study).context("a configuration as JSON")?),
        toml: None,
        languages,
        picture: Some(picture),
    })
}

/// `POST /api/v1/admin/studies`: 201 with the new study.
pub async fn make(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    JsonBody(draft): JsonBody<Draft>,
) -> Result<(StatusCode, Json<Configuration>), ApiError> {
    let file = accepted(&app, draft.toml).await?;
    let slug = &file.config().slug;
    let entry = me.does(Action::StudyMade, Some(slug), None);
    let taken = || ApiError::conflict("taken", format!("there is a study {slug} already"));
    let study = app.store.make_study(file.config(), entry).await?.ok_or_else(taken)?;
    Ok((StatusCode::CREATED, Json(stored(&app, study).await?)))
}

/// `PUT /api/v1/admin/studies/{slug}/configuration`: changes the configuration for new participants. 409
/// `changed` if the study no longer has the configuration on which the draft is based.
pub async fn change(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    JsonBody(draft): JsonBody<Draft>,
) -> Result<Json<Configuration>, ApiError> {
    let present = named(&app.store, &slug).await?;
    let base = draft.base.unwrap_or_default();
    let file = accepted(&app, draft.toml).await?;
    let new = file.config();
    if new.slug != slug {
        let expected = format!("{slug}, since a study keeps its name in addresses");
        return Err(Invalid::new("slug", expected, &new.slug).into());
    }
    replace(&app, &me, &present, new, base).await.map(Json)
}

/// `PUT /api/v1/admin/studies/{slug}/status`: opens, closes or archives a study. The rest of its
/// configuration is unchanged.
pub async fn set_status(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    JsonBody(new): JsonBody<NewStatus>,
) -> Result<Json<Configuration>, ApiError> {
    let present = named(&app.store, &slug).await?;
    let config = StudyConfig { status: new.status, ..(*present.config).clone() };
    let base = present.config_hash.clone();
    replace(&app, &me, &present, &config, base).await.map(Json)
}

async fn replace(
    app: &App,
    me: &Experimenter,
    present: &StoredStudy,
    new: &StudyConfig,
    base: String,
) -> Result<Configuration, ApiError> {
    let slug = &present.slug;
    present.config.check_successor(new, participants(&app.store, slug).await?)?;
    let fields: Vec<_> =
        changes(&present.config, new)?.into_iter().map(|change| change.field).collect();
    // Field names are not personal data, so the audit trail can contain them.
    let subject = if fields.is_empty() { "nothing".to_owned() } else { fields.join(", ") };
    let entry = me.does(Action::StudyChanged, Some(slug), Some(subject));
    match app.store.change_study(new, base, entry).await? {
        ChangeStudy::Stored(study) => stored(app, study).await,
        ChangeStudy::ChangedMeanwhile => {
            let message = "somebody else has changed this study since you began; look at its \
                           present configuration before you change it";
            Err(ApiError::conflict("changed", message))
        }
        ChangeStudy::Unknown => Err(ApiError::not_found("study")),
    }
}

/// Must be called after a study was stored. Stores its value functions if they have a closed form, and
/// notifies the solver. Returns the configuration.
async fn stored(app: &App, study: StoredStudy) -> Result<Configuration, ApiError> {
    safety::keep_exact(&app.store, &study).await?;
    app.study_stored.notify_one();
    configuration(app, study).await
}

async fn configuration(app: &App, study: StoredStudy) -> Result<Configuration, ApiError> {
    let participants = participants(&app.store, &study.slug).await?;
    Ok(Configuration {
        toml: written(&study.config).context("a configuration as TOML")?,
        versions: versions(app, &study).await?,
        study: study.slug,
        hash: study.config_hash,
        participants,
    })
}

/// Number of participants of a study, without pilots.
async fn participants(store: &Store, slug: &str) -> Result<u64, ApiError> {
    let counts = store.summaries(Some(slug.to_owned()), now_ms()).await?;
    Ok(counts.first().map_or(0, |study| study.participants))
}

/// The configurations that a study has had, newest first.
async fn versions(app: &App, study: &StoredStudy) -> Result<Vec<ConfigurationVersion>, ApiError> {
    let stored = app.store.study_versions(study.id).await?;
    let mut versions = Vec::with_capacity(stored.len());
    for (i, version) in stored.iter().enumerate() {
        let before = i.checked_sub(1).map(|before| &stored[before].config);
        let changed = match before {
            Some(before) => changes(before, &version.config)?,
            None => Vec::new(),
        };
        versions.push(ConfigurationVersion {
            number: version.number,
            hash: version.hash.clone(),
            label: version.config.version.clone(),
            since_ms: version.since_ms,
            participants: version.participants,
            toml: written(&version.config).context("a configuration as TOML")?,
            changed: changed.into_iter().map(|change| change.field).collect(),
        });
    }
    versions.reverse();
    Ok(versions)
}

/// Reads a draft and draws its scenes, which takes time.
async fn read_draft(
    app: &Arc<App>,
    toml: String,
) -> Result<Result<(StudyFile, Vec<Complaint>), Complaint>, ApiError> {
    let shared = Arc::clone(app);
    app.drawing.queue()?.run(move || shared.library.languages().read_draft(&toml)).await
}

/// The study of a valid draft.
async fn accepted(app: &Arc<App>, toml: String) -> Result<StudyFile, ApiError> {
    let read = read_draft(app, toml).await?;
    let (file, _) = read.map_err(|Complaint { line, what, .. }| {
        let message = format!("line {line}: {what}");
        let (code, field) = ("invalid".to_owned(), Some("toml".to_owned()));
        let problem = Problem { code, message, field, return_url: None };
        ApiError::Problem { status: StatusCode::UNPROCESSABLE_ENTITY, problem }
    })?;
    Ok(file)
}

fn remark(complaint: Complaint) -> Remark {
    let Complaint { line, field, what } = complaint;
    Remark { line: Some(line), field, message: what }
}

fn picture(study: &StudyConfig) -> Result<String, ApiError> {
    let scenes: u64 = study.phases.iter().map(|phase| phase.scenes as u64).sum();
    let people = design::usual_participants(study).min(MOST_SCENES / scenes.max(1)).max(1);
    Ok(design::picture(study, &design::draw(study, people)?).svg())
}

/// The fields in which two configurations differ, ordered by name. Arrays of tables are compared
/// element by element, and other arrays as a whole.
fn changes(before: &StudyConfig, after: &StudyConfig) -> Result<Vec<Change>, ApiError> {
    let leaves = |config: &StudyConfig| -> Result<BTreeMap<String, String>, ApiError> {
        let document = serde_json::to_value(config).context("a configuration as JSON")?;
        let mut found = BTreeMap::new();
        collect(&document, String::new(), &mut found);
        Ok(found)
    };
    let (before, after) = (leaves(before)?, leaves(after)?);
    let mut fields: Vec<&String> = before.keys().chain(after.keys()).collect();
    fields.sort();
    fields.dedup();
    let change = |field: &String| Change {
        field: field.clone(),
        before: before.get(field).cloned(),
        after: after.get(field).cloned(),
    };
    let changes = fields.into_iter().map(change);
    Ok(changes.filter(|change| change.before != change.after).collect())
}

fn collect(value: &Value, path: String, found: &mut BTreeMap<String, String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                collect(value, path, found);
            }
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            for (i, item) in items.iter().enumerate() {
                collect(item, format!("{path}[{i}]"), found);
            }
        }
        value => {
            found.insert(path, value.to_string());
        }
    }
}
