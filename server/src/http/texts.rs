//! The texts for participants, in the language that they choose or that their browser prefers.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::{Params, PathText};
use crate::http::studies::{Asked, asked_for, named};
use crate::languages::page::drawn;
use crate::store::participants::Visitor;
use crate::support::secrets;
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::Texts;
use sidestep::invalid::Invalid;
use sidestep::study::{AfterWrong, is_language};
use std::sync::Arc;

/// The query of the texts.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct TextParams {
    /// Tag of the language, such as `en` or `zh-CN`.
    #[schemars(regex(pattern = r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{1,8})*$"))]
    language: Option<String>,
}

/// `GET /api/v1/studies/{slug}/texts?language=`: the texts in this language. Without this parameter, or
/// if the study does not offer the language, the server uses the language that the browser prefers.
/// With a participant's token, the texts belong to the configuration under which they enrolled.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    Params(params): Params<TextParams>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    if let Some(tag) = params.language.as_deref().filter(|tag| !is_language(tag)) {
        let found = format!("{tag:?}");
        return Err(Invalid::new("language", "a language tag such as en or zh-CN", found).into());
    }
    let study = named(&app.store, &slug).await?;
    let accepted = headers.get(header::ACCEPT_LANGUAGE).and_then(|value| value.to_str().ok());
    let accepted = preferred(accepted.unwrap_or_default());
    let wanted = params.language.as_deref().into_iter().chain(accepted);
    let Asked { config, config_hash, visitor } = asked_for(&app, &study, &headers).await?;
    let begun = match &visitor {
        Some(visitor) => app.store.agreed_language(&visitor.participant.id).await?,
        None => None,
    };
    let page = app.library.page(&config, &config_hash, wanted, begun.as_deref());
    let vary = [(header::VARY, "Accept-Language, Authorization")];
    let check = &config.comprehension;
    if !check.is_drawn() {
        return Ok((vary, Json(&page.texts)).into_response());
    }
    let seed = visitor.as_ref().map(|visitor| drawing_seed(visitor, check.after_wrong));
    let check = drawn(&page.texts.check, check, seed);
    Ok((vary, Json(Texts { check, ..page.texts.clone() })).into_response())
}

/// The seed with which a participant's questions are drawn. The seed also depends on the attempt,
/// unless participants keep their questions after a wrong answer.
fn drawing_seed(visitor: &Visitor, after_wrong: AfterWrong) -> u64 {
    let attempt = match after_wrong {
        AfterWrong::Mark => 0,
        AfterWrong::Renew | AfterWrong::Reread => visitor.attempts(),
    };
    let hash = secrets::hash(&format!("check {} {attempt}", visitor.participant.id));
    hash.iter().take(8).fold(0, |seed, byte| (seed << 8) | u64::from(*byte))
}

/// The languages of an Accept-Language header, in descending order of preference.
fn preferred(header: &str) -> Vec<&str> {
    let quality = |parameters: &str| {
        let value = parameters.split(';').find_map(|p| p.trim().strip_prefix("q="));
        value.map_or(1.0, |value| value.trim().parse::<f64>().unwrap_or(0.0))
    };
    let mut found: Vec<_> = header
        .split(',')
        .map(|part| part.split_once(';').unwrap_or((part, "")))
        .map(|(tag, parameters)| (tag.trim(), quality(parameters)))
        .filter(|(tag, quality)| is_language(tag) && *quality > 0.0)
        .collect();
    // The sort is stable, so languages of equal preference keep their order.
    found.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    found.into_iter().map(|(tag, _)| tag).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn languages_by_quality() {
        let cases: [(&str, &[&str]); 5] = [
            ("de-AT,de;q=0.9,en;q=0.8", &["de-AT", "de", "en"]),
            ("en;q=0.2, es ; q=0.7,fr;q=0", &["es", "en"]),
            ("*", &[]),
            ("", &[]),
            ("de;q=x, ../x, zh-CN;q=0.5", &["zh-CN"]),
        ];
        for (header, expected) in cases {
            assert_eq!(preferred(header), expected, "{header}");
        }
    }
}
