//! The participants of a study, as a list on pages and as a table in a file.

use crate::formats::exports;
use crate::formats::table::{csv_header, csv_rows};
use crate::formats::tables::participants::Participants;
use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::Reader;
use crate::http::params::{Params, PathText};
use crate::http::studies::named;
use crate::store::people::{Selection, SortBy};
use axum::Json;
use axum::extract::{MatchedPath, State};
use axum::http::{Method, header};
use axum::response::{IntoResponse, Response};
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::{Access, Action, Stage};
use sidestep::invalid::Invalid;
use std::sync::Arc;

/// The query of a list of participants.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListParams {
    /// `csv` gives the whole table as a file, and needs export access.
    #[schemars(extend("enum" = ["csv"]))]
    format: Option<String>,
    /// Sort key. The default is the participant's number.
    #[serde(default)]
    sort: SortBy,
    /// Direction of the sorting. The default is ascending.
    #[serde(default)]
    order: Order,
    /// Only participants at this stage.
    stage: Option<Stage>,
    /// Only participants for whom this count, such as `late_sample`, is not 0.
    having: Option<SortBy>,
    /// Only participants whose number, external id or code equals this text.
    search: Option<String>,
    /// Whether pilots are listed instead of participants.
    #[serde(default)]
    pilot: bool,
    /// Maximum number of entries on the page, from 1 to 500. The default is 50.
    #[schemars(range(min = 1, max = 500))]
    limit: Option<i64>,
    /// Number of entries before the page, from 0.
    #[schemars(range(min = 0))]
    offset: Option<i64>,
}

/// The direction of a sorted list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Order {
    /// Lowest first.
    #[default]
    Asc,
    /// Highest first.
    Desc,
}

impl ListParams {
    /// The selection of participants. With `identities`, external ids and codes are shown and searched.
    ///
    /// # Errors
    /// [`Invalid`] for a limit outside 1 to 500, a negative offset, or a `having` that is not a count.
    fn selection(self, identities: bool) -> Result<Selection, Invalid> {
        let (limit, offset) = (self.limit.unwrap_or(50), self.offset.unwrap_or(0));
        if !(1..=500).contains(&limit) {
            return Err(Invalid::new("limit", "a whole number from 1 to 500", limit));
        }
        if offset < 0 {
            return Err(Invalid::new("offset", "a whole number ≥ 0", offset));
        }
        if self.having.is_some_and(|having| !having.is_count()) {
            let expected = "a count to look at, such as late_sample or never_steered";
            return Err(Invalid::new("having", expected, "a name to sort by only"));
        }
        Ok(Selection {
            pilots: self.pilot,
            identities,
            stage: self.stage,
            having: self.having,
            search: self.search.filter(|text| !text.trim().is_empty()),
            sort: self.sort,
            descending: self.order == Order::Desc,
            offset,
            limit,
        })
    }
}

/// `GET /api/v1/admin/studies/{slug}/participants`: a page of participants, with external ids and
/// codes if the key has export access. With `?format=csv`, the response is the whole table.
pub async fn list(
    Reader(me): Reader,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    method: Method,
    route: MatchedPath,
    Params(params): Params<ListParams>,
) -> Result<Response, ApiError> {
    let Some(format) = params.format else {
        let selection = params.selection(me.access >= Access::Export)?;
        let study = named(&app.store, &slug).await?;
        return Ok(Json(app.store.people(study.id, selection).await?).into_response());
    };
    me.must(&app, Access::Export, &method, Some(&route)).await?;
    exports::check_format(&format)?;
    let study = named(&app.store, &slug).await?;
    if params.stage.is_some() || params.having.is_some() || params.search.is_some() {
        let expected = "no format with stage, having or search, since the file has everybody";
        return Err(Invalid::new("format", expected, format).into());
    }
    let people = app.store.roster(study.id, params.pilot).await?;
    let table = Participants::new(&study.config, &people);
    let mut file = csv_header(&table.columns());
    csv_rows(&table.columns(), &table.rows(), &mut file);
    let entry = me.does(Action::Exported, Some(&slug), Some("participants as CSV".to_owned()));
    app.store.note(entry).await?;
    let name = format!("attachment; filename=\"{slug}-participants.csv\"");
    let headers = [
        (header::CONTENT_TYPE, "text/csv; charset=utf-8".to_owned()),
        (header::CONTENT_DISPOSITION, name),
    ];
    Ok((headers, file).into_response())
}
