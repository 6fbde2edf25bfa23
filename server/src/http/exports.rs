//! Exports of a study's data: an archive with the files of `sidestep export`, or one CSV file of the
//! steps.
//!
//! An archive is sent while it is written. A truncated archive lacks the manifest, which is the last
//! file, and the table of contents. The same data give the same bytes and the same `ETag`. So a client
//! can resume an interrupted download (`Range`) while the data are unchanged (`If-Range`, `If-Match`).

mod body;
mod range;

use self::body::{Outlet, body, measure};
use self::range::Wanted;
use crate::formats::exports::{self, Dataset, Filter, Format, Quality};
use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::Exporter;
use crate::http::params::{Params, PathText};
use crate::http::studies::named;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::TryStreamExt;
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::Action;
use sidestep::invalid::Invalid;
use sidestep::trial::Phase;
use std::path::PathBuf;
use std::sync::Arc;

/// Upper bound on the size of a trial in an exported database (bytes).
const TRIAL_BYTES: u64 = 24_000;

/// The query of an export. Empty parameters, as sent by forms, count as missing.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExportParams {
    /// The format of an archive. Without a format, the response is the steps as one CSV file.
    format: Option<Format>,
    /// Only the trials of this phase.
    #[schemars(extend("enum" = ["", "familiarisation", "practice", "task"]))]
    phase: Option<String>,
    /// Selects trials by their flags.
    quality: Option<Quality>,
    /// Only participants who enrolled under the configuration whose hash begins with these digits.
    configuration: Option<String>,
    /// Whether pilots are exported instead of participants.
    pilots: Option<bool>,
}

impl ExportParams {
    /// The filter that the query describes, given the study's configurations.
    ///
    /// # Errors
    /// [`Invalid`] naming the parameter.
    fn filter(&self, known: &[(String, String)]) -> Result<Filter, Invalid> {
        let given = |text: &Option<String>| text.clone().filter(|text| !text.is_empty());
        let phase = match given(&self.phase) {
            None => None,
            Some(word) => {
                let phase = Phase::ALL.into_iter().find(|phase| phase.word() == word);
                let unknown = || Invalid::new("phase", "familiarisation, practice or task", &word);
                Some(phase.ok_or_else(unknown)?)
            }
        };
        let configuration = match given(&self.configuration) {
            None => None,
            Some(digits) => Some(configuration(&digits, known)?),
        };
        let quality = self.quality.unwrap_or_default();
        Ok(Filter { phase, quality, configuration, pilots: self.pilots.unwrap_or(false) })
    }
}

/// The one configuration whose hash begins with these digits.
fn configuration(digits: &str, known: &[(String, String)]) -> Result<String, Invalid> {
    let wanted = digits.to_lowercase();
    let mut fitting = known.iter().filter(|(hash, _)| hash.starts_with(&wanted));
    match (fitting.next(), fitting.next()) {
        (Some((hash, _)), None) => Ok(hash.clone()),
        _ => {
            let hashes: Vec<&str> = known.iter().map(|(hash, _)| hash.as_str()).collect();
            let expected = format!("the first digits of one of {}", hashes.join(", "));
            Err(Invalid::new("configuration", expected, format!("{digits:?}")))
        }
    }
}

/// `GET /api/v1/admin/studies/{slug}/export?format=…`: an archive. Without a format, the response is
/// the steps as CSV.
pub async fn export(
    Exporter(me): Exporter,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    Params(params): Params<ExportParams>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let study = named(&app.store, &slug).await?;
    let filter = params.filter(&app.store.configurations(study.id).await?)?;
    let Some(format) = params.format else {
        if filter != Filter::default() {
            let expected = "csv, jsonl, parquet, psych-ds or sqlite for a part of the data";
            return Err(Invalid::new("format", expected, "none").into());
        }
        let entry = me.does(Action::Exported, Some(&slug), Some("trials as CSV".to_owned()));
        app.store.note(entry).await?;
        let steps = exports::stream(app.store.clone(), study);
        let steps = steps.inspect_err(|error| tracing::warn!(%error, "an export was interrupted"));
        let steps = Body::from_stream(steps);
        let steps = me.while_valid(app.store.clone(), steps);
        let name = format!("{slug}-trials.csv");
        return Ok((file(&name, "text/csv; charset=utf-8"), steps).into_response());
    };
    let dataset = Dataset::read(&app.store, &study, &filter).await?;
    let tag = format!("\"{}\"", dataset.fingerprint(format));
    let wanted = Wanted::of(&headers, &tag);
    if let Wanted::Known = wanted {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag)]).into_response());
    }
    if let Wanted::Other = wanted {
        let message = "the data have changed since; export them again from the beginning";
        return Err(ApiError::new(StatusCode::PRECONDITION_FAILED, "changed", message));
    }
    let word = format.word();
    let entry = me.does(Action::Exported, Some(&slug), Some(format!("{word} archive")));
    app.store.note(entry).await?;
    let scratch = match format {
        Format::Sqlite => app.store.room(dataset.trials().saturating_mul(TRIAL_BYTES))?,
        _ => PathBuf::new(),
    };
    let outlet = Outlet { store: app.store.clone(), dataset, format, scratch, tag: tag.clone() };
    let mut answer = file(&format!("{slug}-{word}.zip"), "application/zip");
    answer.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    answer.insert(header::ETAG, text(&tag));
    let Wanted::Part(range) = wanted else {
        let lengths = Arc::clone(&app.lengths);
        let archive = body(outlet, 0, u64::MAX, Some(lengths));
        return Ok((answer, me.while_valid(app.store.clone(), archive)).into_response());
    };
    // A partial response states the length of the whole archive.
    let Some(length) = measure(&app.lengths, &outlet).await else {
        let message = "the length of the archive is being measured; ask again in a few seconds";
        let busy = ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "measuring", message);
        let mut busy = busy.into_response();
        busy.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(5));
        return Ok(busy);
    };
    let Some((begin, end)) = range.within(length) else {
        answer.insert(header::CONTENT_RANGE, text(&format!("bytes */{length}")));
        return Ok((StatusCode::RANGE_NOT_SATISFIABLE, answer).into_response());
    };
    answer.insert(header::CONTENT_RANGE, text(&format!("bytes {begin}-{}/{length}", end - 1)));
    answer.insert(header::CONTENT_LENGTH, HeaderValue::from(end - begin));
    let part = me.while_valid(app.store.clone(), body(outlet, begin, end, None));
    Ok((StatusCode::PARTIAL_CONTENT, answer, part).into_response())
}

/// The headers of a download with this file name.
fn file(name: &str, kind: &'static str) -> HeaderMap {
    let mut headers = HeaderMap::new();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    headers.insert(header::CONTENT_DISPOSITION, text(&format!("attachment; filename=\"{name}\"")));
    headers
}

/// A header value of ASCII letters, digits and punctuation.
fn text(value: &str) -> HeaderValue {
    HeaderValue::from_str(value).unwrap_or(HeaderValue::from_static(""))
}
