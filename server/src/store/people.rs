//! The list of a study's participants: filtered, sorted and paged in the database.

use super::sql::{Connection, Row, ToSql, params};
use super::{Store, StoreError};
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::{ParticipantPage, ParticipantSummary, Quality, Stage, StageCount};

/// Sort key of a list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SortBy {
    /// The participant's number.
    #[default]
    Number,
    /// When the participant was last seen.
    LastSeen,
    /// Stored trials.
    Stored,
    /// Tasks with a late sample.
    LateSample,
    /// Tasks in which the page lost the focus.
    FocusLost,
    /// Interrupted tasks.
    Interrupted,
    /// Tasks without a turn.
    NeverSteered,
    /// Tasks with a turn in every step.
    AlwaysSteered,
    /// Tasks in which the danger zone was entered.
    DangerEntered,
    /// Tasks with the key times of an earlier trial.
    SameTiming,
    /// Whether analyses leave the participant out.
    Excluded,
    /// Whether the participant is counted as doubtful among a study's participants.
    Doubtful,
    /// Answers to the comprehension check.
    ComprehensionAttempts,
    /// Wrong answers to the comprehension check.
    FailedChecks,
    /// Trials that waited in the browser when the server last stored a trial.
    Waiting,
}

impl SortBy {
    /// Whether this is a count that experimenters filter by.
    #[must_use]
    pub fn is_count(self) -> bool {
        !matches!(self, Self::Number | Self::LastSeen | Self::Stored)
    }

    /// The SQL condition that the value is above zero.
    fn condition(self) -> String {
        match self {
            Self::Excluded | Self::Doubtful => self.column().to_owned(),
            _ => format!("{} > 0", self.column()),
        }
    }

    /// The column of the tally.
    fn column(self) -> &'static str {
        match self {
            Self::Number => "number",
            Self::LastSeen => "last_seen_at_ms",
            Self::Stored => "stored",
            Self::LateSample => "late_sample",
            Self::FocusLost => "focus_lost",
            Self::Interrupted => "interrupted",
            Self::NeverSteered => "never_steered",
            Self::AlwaysSteered => "always_steered",
            Self::DangerEntered => "danger_entered",
            Self::SameTiming => "same_timing",
            Self::Excluded => "excluded",
            Self::Doubtful => "doubtful",
            Self::ComprehensionAttempts => "comprehension_attempts",
            Self::FailedChecks => "failed_checks",
            Self::Waiting => "waiting",
        }
    }
}

/// Filter and order of a list of participants.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Whether the list contains pilots instead of participants.
    pub pilots: bool,
    /// Whether external ids and completion codes are shown and searched.
    pub identities: bool,
    /// Only participants at this stage.
    pub stage: Option<Stage>,
    /// Only participants for whom this value is above zero.
    pub having: Option<SortBy>,
    /// Only the participant with this number, external id or completion code.
    pub search: Option<String>,
    /// The sort key; ties are ordered by number.
    pub sort: SortBy,
    /// Whether the largest values come first.
    pub descending: bool,
    /// Number of participants before the page.
    pub offset: i64,
    /// Maximum number of participants on a page.
    pub limit: i64,
}

/// The query for a summary. Filtering and sorting use only the tally.
const SUMMARY: &str = "SELECT tally.*, id, external_id, completion_code, enrolled_at_ms, \
     (SELECT count(*) FROM scene WHERE scene.participant_id = id) AS planned \
     FROM tally JOIN participant ON participant.id = tally.participant_id";

impl Store {
    /// A page of a study's participants.
    pub async fn people(
        &self,
        study_id: i64,
        selection: Selection,
    ) -> Result<ParticipantPage, StoreError> {
        self.read_long(move |db| page(db, study_id, &selection)).await
    }
}

/// The query for the ids of participants of study $1 whose number, external id or completion code
/// matches the search. $2 states whether pilots are searched instead of participants. The search is
/// bound to three parameters, from the number `first` on.
fn found(first: usize) -> String {
    let [number, text, identities] = [0, 1, 2].map(|i| format!("${}", first + i));
    format!(
        "SELECT id FROM participant WHERE study_id = $1 AND pilot = $2 AND number = {number} \
         UNION ALL SELECT id FROM participant WHERE study_id = $1 AND pilot = $2 AND {identities} \
             AND external_id IS NOT NULL AND lower(external_id) = {text} \
         UNION ALL SELECT id FROM participant WHERE study_id = $1 AND pilot = $2 AND {identities} \
             AND completion_code IS NOT NULL AND lower(completion_code) = {text}"
    )
}

fn page(db: &Connection, study_id: i64, asked: &Selection) -> Result<ParticipantPage, StoreError> {
    let stage = asked.stage.map(Stage::word);
    let search = asked.search.as_ref().map(|text| text.trim().to_lowercase());
    let search_number = search.as_ref().and_then(|text| text.parse::<i64>().ok());
    let mut filter = "study_id = $1 AND pilot = $2".to_owned();
    let mut chosen: Vec<&dyn ToSql> = vec![&study_id, &asked.pilots];
    if stage.is_some() {
        chosen.push(&stage);
        filter += &format!(" AND stage = ${}", chosen.len());
    }
    if let Some(having) = asked.having {
        // Column names come only from this program. User input is bound as parameters.
        filter += &format!(" AND {}", having.condition());
    }
    if search.is_some() {
        filter += &format!(" AND participant_id IN ({})", found(chosen.len() + 1));
        chosen.extend([&search_number as &dyn ToSql, &search, &asked.identities]);
    }
    let stages = stages(db, study_id, asked.pilots)?;
    let total = if asked.having.is_none() && search.is_none() {
        let is_chosen = |count: &&StageCount| asked.stage.is_none_or(|stage| stage == count.stage);
        stages.iter().filter(is_chosen).map(|count| count.participants).sum()
    } else {
        db.prepare_cached(&format!("SELECT count(*) FROM tally WHERE {filter}"))?
            .query_row(&chosen[..], |row| row.get::<_, i64>(0))?
            .unsigned_abs()
    };
    let (by, order) = (asked.sort.column(), if asked.descending { "DESC" } else { "ASC" });
    let [limit, offset] = [1, 2].map(|i| format!("${}", chosen.len() + i));
    // The subquery finds the rows of the page, so that only these rows are joined.
    let mut statement = db.prepare_cached(&format!(
        "{SUMMARY} WHERE tally.participant_id IN (SELECT participant_id FROM tally WHERE {filter} \
             ORDER BY {by} {order}, number LIMIT {limit} OFFSET {offset}) \
         ORDER BY tally.{by} {order}, tally.number"
    ))?;
    chosen.extend([&asked.limit as &dyn ToSql, &asked.offset]);
    let mut participants: Vec<ParticipantSummary> =
        statement.query_and_then(&chosen[..], summary_of)?.collect::<Result<_, StoreError>>()?;
    if !asked.identities {
        for person in &mut participants {
            (person.external_id, person.completion_code) = (None, None);
        }
    }
    Ok(ParticipantPage { participants, total, stages })
}

fn stages(db: &Connection, study_id: i64, pilots: bool) -> Result<Vec<StageCount>, StoreError> {
    let mut statement = db.prepare_cached(
        "SELECT stage, count(*) FROM tally WHERE study_id = $1 AND pilot = $2 GROUP BY stage",
    )?;
    let count = |row: &Row| {
        let participants = row.get::<_, i64>(1)?.unsigned_abs();
        Ok(StageCount { stage: stage_of(row.get(0)?)?, participants })
    };
    let mut counts: Vec<StageCount> = statement
        .query_and_then(params![study_id, pilots], count)?
        .collect::<Result<_, StoreError>>()?;
    counts.sort_by_key(|count| Stage::ALL.iter().position(|stage| *stage == count.stage));
    Ok(counts)
}

/// The participant with this id, as in the list.
pub(super) fn person(db: &Connection, id: &str) -> Result<Option<ParticipantSummary>, StoreError> {
    let mut statement = db.prepare_cached(&format!("{SUMMARY} WHERE tally.participant_id = $1"))?;
    statement.query_and_then([id], summary_of)?.next().transpose()
}

fn summary_of(row: &Row) -> Result<ParticipantSummary, StoreError> {
    Ok(ParticipantSummary {
        participant_id: row.get("id")?,
        number: row.get("number")?,
        pilot: row.get("pilot")?,
        external_id: row.get("external_id")?,
        stage: stage_of(row.get("stage")?)?,
        completion_code: row.get("completion_code")?,
        comprehension_attempts: row.get("comprehension_attempts")?,
        understood: row.get("understood")?,
        stored: row.get("stored")?,
        planned: row.get("planned")?,
        waiting: row.get("waiting")?,
        enrolled_at_ms: row.get("enrolled_at_ms")?,
        last_seen_at_ms: row.get("last_seen_at_ms")?,
        quality: Quality {
            late_sample: row.get("late_sample")?,
            focus_lost: row.get("focus_lost")?,
            interrupted: row.get("interrupted")?,
            never_steered: row.get("never_steered")?,
            always_steered: row.get("always_steered")?,
            danger_entered: row.get("danger_entered")?,
            same_timing: row.get("same_timing")?,
            failed_checks: row.get("failed_checks")?,
        },
        excluded: row.get("excluded")?,
    })
}

fn stage_of(word: String) -> Result<Stage, StoreError> {
    let known = Stage::ALL.into_iter().find(|stage| stage.word() == word);
    known.ok_or_else(|| StoreError::unknown_word(&word))
}
