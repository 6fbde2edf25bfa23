//! The list of a study's participants: filtered, sorted and paged in the database.

use super::{Store, StoreError};
use rusqlite::{Connection, Row, ToSql, named_params};
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::{ParticipantPage, ParticipantSummary, Quality, Stage, StageCount};

/// What a list is sorted by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SortBy {
    /// The participant's number.
    #[default]
    Number,
    /// The last time that something was stored.
    LastSeen,
    /// Stored trials.
    Stored,
    /// Tasks with a late sample.
    LateSample,
    /// Tasks that lost the focus.
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
    /// Answers to the check of understanding.
    ComprehensionAttempts,
    /// Wrong answers to the check of understanding.
    FailedChecks,
    /// Trials that waited in the browser when the server last stored one.
    Waiting,
}

impl SortBy {
    /// Whether this counts something that an experimenter looks for.
    #[must_use]
    pub fn is_count(self) -> bool {
        !matches!(self, Self::Number | Self::LastSeen | Self::Stored)
    }

    /// The expression that is sorted by.
    fn expression(self) -> &'static str {
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

/// Which participants, and in which order.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Pilots instead of participants.
    pub pilots: bool,
    /// Whether external ids and completion codes are shown and searched.
    pub identities: bool,
    /// Only those at this stage.
    pub stage: Option<Stage>,
    /// Only those for whom this is above zero.
    pub having: Option<SortBy>,
    /// Only the participant with this number, external id or completion code.
    pub search: Option<String>,
    /// What the list is sorted by; the number decides between equals.
    pub sort: SortBy,
    /// From the largest down.
    pub descending: bool,
    /// The number of participants before the page.
    pub offset: i64,
    /// The most participants on a page.
    pub limit: i64,
}

/// Whether analyses leave a participant out.
const EXCLUDED: &str = "EXISTS (SELECT 1 FROM exclusion \
     WHERE exclusion.participant_id = participant.id AND ended_at_ms IS NULL)";

/// Whether an experimenter should look at what a participant did, and has not excluded them: no task was
/// steered, each was steered throughout, or keys have the times of an earlier trial.
pub(super) fn doubtful() -> String {
    format!(
        "(coalesce(task > 0 AND (same_timing > 0 OR never_steered = task \
             OR always_steered = task), 0) AND NOT {EXCLUDED})"
    )
}

/// One row for each participant of a study; `:study` and `:pilot` choose them.
const OF_STUDY: &str = "study_id = :study AND pilot = :pilot";

/// One row for each participant for whom a condition holds.
fn people(condition: &str) -> String {
    format!(
        "SELECT *, CASE \
         WHEN withdrawn THEN 'withdrawn' \
         WHEN screened_out THEN 'screened_out' \
         WHEN completion_code IS NOT NULL THEN 'complete' \
         WHEN imported THEN 'imported' \
         WHEN stored = 0 THEN 'joined' \
         ELSE coalesce(next_phase, 'closing') END AS stage \
     FROM (SELECT id, number, pilot, external_id, completion_code, comprehension_attempts, \
         understood_at_ms IS NOT NULL AS understood, \
         max(0, comprehension_attempts - (understood_at_ms IS NOT NULL)) AS failed_checks, \
         coalesce(waiting, 0) AS waiting, enrolled_at_ms, last_seen_at_ms, \
         withdrawn_at_ms IS NOT NULL AS withdrawn, screened_out_at_ms IS NOT NULL AS screened_out, \
         import_hash IS NOT NULL AS imported, \
         next_phase, coalesce(familiarisation + practice + task, 0) AS stored, \
         coalesce(late_sample, 0) AS late_sample, coalesce(focus_lost, 0) AS focus_lost, \
         coalesce(interrupted, 0) AS interrupted, coalesce(never_steered, 0) AS never_steered, \
         coalesce(always_steered, 0) AS always_steered, \
         coalesce(danger_entered, 0) AS danger_entered, coalesce(same_timing, 0) AS same_timing, \
         {} AS doubtful, {EXCLUDED} AS excluded \
         FROM participant LEFT JOIN tally ON tally.participant_id = participant.id \
         WHERE {condition})",
        doubtful()
    )
}

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

fn page(db: &Connection, study_id: i64, asked: &Selection) -> Result<ParticipantPage, StoreError> {
    let people = people(OF_STUDY);
    let stages = stages(db, study_id, asked.pilots)?;
    let stage = asked.stage.map(Stage::word);
    // Names of columns come from this program alone; what was asked for is bound.
    let having = asked.having.map_or("1", SortBy::expression);
    let filter = format!(
        "WHERE (:stage IS NULL OR stage = :stage) AND {having} > 0 AND (:search IS NULL OR \
         :search = CAST(number AS TEXT) OR \
         (:identities AND :search IN (lower(external_id), lower(completion_code))))"
    );
    let search = asked.search.as_ref().map(|text| text.trim().to_lowercase());
    let chosen: [(&str, &dyn ToSql); 5] = [
        (":study", &study_id),
        (":pilot", &asked.pilots),
        (":stage", &stage),
        (":search", &search),
        (":identities", &asked.identities),
    ];
    let is_everybody = stage.is_none() && asked.having.is_none() && search.is_none();
    let total = if is_everybody {
        stages.iter().map(|count| count.participants).sum()
    } else {
        let query = format!("SELECT count(*) FROM ({people}) {filter}");
        db.prepare_cached(&query)?
            .query_row(&chosen[..], |row| row.get::<_, i64>(0))?
            .unsigned_abs()
    };
    let (by, order) = (asked.sort.expression(), if asked.descending { "DESC" } else { "ASC" });
    // The rows of the page are found first, by the narrow columns that decide.
    let mut statement = db.prepare_cached(&format!(
        "WITH people AS NOT MATERIALIZED ({people}) \
         SELECT *, (SELECT count(*) FROM scene WHERE participant_id = id) AS planned FROM people \
         WHERE id IN (SELECT id FROM people {filter} ORDER BY {by} {order}, number \
             LIMIT :limit OFFSET :offset) \
         ORDER BY {by} {order}, number"
    ))?;
    let mut bound = chosen.to_vec();
    bound.extend([(":limit", &asked.limit as &dyn ToSql), (":offset", &asked.offset)]);
    let mut participants: Vec<ParticipantSummary> =
        statement.query_and_then(&bound[..], summary_of)?.collect::<Result<_, _>>()?;
    if !asked.identities {
        for person in &mut participants {
            (person.external_id, person.completion_code) = (None, None);
        }
    }
    Ok(ParticipantPage { participants, total, stages })
}

fn stages(db: &Connection, study_id: i64, pilots: bool) -> Result<Vec<StageCount>, StoreError> {
    let people = people(OF_STUDY);
    let mut statement =
        db.prepare_cached(&format!("SELECT stage, count(*) FROM ({people}) GROUP BY stage"))?;
    let count = |row: &Row<'_>| {
        let participants = row.get::<_, i64>(1)?.unsigned_abs();
        Ok(StageCount { stage: stage_of(row.get(0)?)?, participants })
    };
    let chosen = named_params! { ":study": study_id, ":pilot": pilots };
    let mut counts: Vec<StageCount> =
        statement.query_and_then(chosen, count)?.collect::<Result<_, StoreError>>()?;
    counts.sort_by_key(|count| Stage::ALL.iter().position(|stage| *stage == count.stage));
    Ok(counts)
}

/// The participant with this id, as in the list.
pub(super) fn person(db: &Connection, id: &str) -> Result<Option<ParticipantSummary>, StoreError> {
    let people = people("participant.id = :id");
    let mut statement = db.prepare_cached(&format!(
        "SELECT *, (SELECT count(*) FROM scene WHERE participant_id = id) AS planned FROM ({people})"
    ))?;
    statement.query_and_then(named_params! { ":id": id }, summary_of)?.next().transpose()
}

fn summary_of(row: &Row<'_>) -> Result<ParticipantSummary, StoreError> {
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
