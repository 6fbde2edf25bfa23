//! Participants: permissions of tokens, comprehension check, answers, completion, withdrawal.

mod visitor;

pub(super) use self::visitor::{COLUMNS, TOKEN};
pub use self::visitor::{Participant, Scope, Visitor};

use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::scenes::{self, PlannedRow};
use super::sql::{Connection, OptionalExtension, Rows, ToSql, params};
use super::{Store, StoreError, analyses};
use sidestep::api::ComprehensionResult;

/// The outcome of a completion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completion {
    /// Every trial is stored. A repeated completion gets the code of the first completion.
    Complete {
        /// The code.
        code: String,
        /// Whether the holder of this token is allowed to see the code.
        visible: bool,
    },
    /// Trials are missing.
    Incomplete {
        /// Number of missing trials.
        missing: usize,
        /// Number of planned trials.
        of: usize,
    },
    /// A required answer is missing.
    Unanswered,
    /// The participant has withdrawn.
    Withdrawn,
}

impl Store {
    /// Records that a participant is present, at most once a minute.
    pub async fn note_presence(
        &self,
        participant: &Participant,
        now_ms: i64,
    ) -> Result<(), StoreError> {
        const MINUTE_MS: i64 = 60_000;
        if now_ms - participant.last_seen_at_ms < MINUTE_MS {
            return Ok(());
        }
        let id = participant.id.clone();
        self.write_behind([Lock::Participant(id.clone())], move |db| seen(db, &id, now_ms)).await
    }

    /// A participant's whole plan, in order.
    pub async fn plan(&self, participant_id: &str) -> Result<Vec<PlannedRow>, StoreError> {
        let id = participant_id.to_owned();
        self.read(move |db| scenes::plan(db, &id)).await
    }

    /// Stores the plan of a participant who has none and has not withdrawn. Returns the
    /// participant's plan afterwards.
    pub async fn put_plan(
        &self,
        participant_id: &str,
        plan: Vec<PlannedRow>,
    ) -> Result<Vec<PlannedRow>, StoreError> {
        let id = participant_id.to_owned();
        self.write_enrolment([Lock::Participant(id.clone())], move |db| {
            let needs_one: bool = db
                .prepare_cached(
                    "SELECT EXISTS (SELECT 1 FROM participant \
                         WHERE id = $1 AND withdrawn_at_ms IS NULL) \
                     AND NOT EXISTS (SELECT 1 FROM scene WHERE participant_id = $1)",
                )?
                .query_row([&id], |row| row.get(0))?;
            if !needs_one {
                return scenes::plan(db, &id);
            }
            for scene in &plan {
                scenes::insert(db, &id, scene)?;
            }
            Ok(plan)
        })
        .await
    }

    /// Stores the result of the comprehension check. After `most` failed attempts (0: unlimited),
    /// the participation ends and its place becomes free. If the participant has passed the check
    /// before, or has driven a scene, nothing is stored. Returns whether the participation is over
    /// for the holder of the token.
    ///
    /// A [`Scope::Continue`] token (`continues` is its hash) has its own number of attempts. Each
    /// call counts as one attempt. These attempts never end the participation. They count for the
    /// participant only if the check is passed.
    pub async fn check_understanding(
        &self,
        participant_id: &str,
        continues: Option<[u8; 32]>,
        result: ComprehensionResult,
        most: usize,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let id = participant_id.to_owned();
        self.write([Lock::Participant(id.clone())], move |db| {
            let (before, is_past, ended): (i64, bool, bool) = db.query_row(
                "SELECT comprehension_attempts, \
                     understood_at_ms IS NOT NULL OR completed_at_ms IS NOT NULL OR EXISTS \
                         (SELECT 1 FROM scene JOIN trial ON trial.trial_id = scene.trial_id \
                          WHERE participant_id = participant.id), \
                     screened_out_at_ms IS NOT NULL FROM participant WHERE id = $1",
                [&id],
                |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
            )?;
            if is_past || ended {
                return Ok(ended);
            }
            let passed = result.passed;
            let [attempts, most] = [result.attempts, most].map(|count| count as i64);
            let has_failed =
                |attempts| most > 0 && (attempts > most || (attempts == most && !passed));
            if let Some(hash) = continues {
                let count = "UPDATE participant_token SET check_attempts = check_attempts + 1 \
                             WHERE hash = $1 RETURNING check_attempts";
                let own: i64 = db.query_row(count, [hash], |row| row.get(0))?;
                if passed && !has_failed(own) {
                    db.execute(
                        "UPDATE participant SET understood_at_ms = $3, last_seen_at_ms = $3, \
                             comprehension_attempts = CASE \
                                 WHEN comprehension_attempts < $2 THEN $2 \
                                 ELSE comprehension_attempts END \
                         WHERE id = $1",
                        params![id, own, now_ms],
                    )?;
                }
                return Ok(has_failed(own));
            }
            // The participant may have made several attempts while the browser was offline.
            let attempts = before.max(attempts);
            let is_over = has_failed(attempts);
            db.execute(
                "UPDATE participant SET comprehension_attempts = $2, last_seen_at_ms = $3, \
                     understood_at_ms = CASE WHEN $4 THEN $3 END, \
                     screened_out_at_ms = CASE WHEN $5 THEN $3 END, \
                     holds_place = (holds_place AND NOT $5) WHERE id = $1",
                params![id, attempts, now_ms, passed && !is_over, is_over],
            )?;
            Ok(is_over)
        })
        .await
    }

    /// Stores answers as JSON. They replace earlier answers, unless the token has [`Scope::Continue`].
    /// Returns `false` and stores nothing if earlier, different answers are kept.
    pub async fn put_answers(
        &self,
        participant_id: &str,
        scope: Scope,
        answers: String,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let (id, replaces) = (participant_id.to_owned(), scope == Scope::Full);
        self.write([Lock::Participant(id.clone())], move |db| {
            let changed = db.execute(
                "UPDATE participant SET answers = $2, answered_at_ms = $3, last_seen_at_ms = $3 \
                 WHERE id = $1 AND completed_at_ms IS NULL AND withdrawn_at_ms IS NULL \
                     AND ($4 OR answered_at_ms IS NULL)",
                params![id, answers, now_ms, replaces],
            )?;
            let mut same =
                db.prepare_cached("SELECT 1 FROM participant WHERE id = $1 AND answers = $2")?;
            Ok(changed > 0 || same.exists(params![id, answers])?)
        })
        .await
    }

    /// Completes a participation if all trials are stored, and also the answers if they are `required`.
    pub async fn complete(
        &self,
        visitor: &Visitor,
        required: bool,
        code: String,
        now_ms: i64,
    ) -> Result<Completion, StoreError> {
        let (id, token_hash, scope) =
            (visitor.participant.id.clone(), visitor.token_hash, visitor.scope);
        self.write([Lock::Participant(id.clone())], move |db| {
            let (of, stored, withdrawn, answered, complete): (i64, i64, bool, bool, bool) = db
                .query_row(
                    "SELECT (SELECT count(*) FROM scene WHERE participant_id = $1), \
                         (SELECT count(*) FROM scene JOIN trial ON trial.trial_id = scene.trial_id \
                          WHERE participant_id = $1), \
                         withdrawn_at_ms IS NOT NULL, answered_at_ms IS NOT NULL, \
                         completed_at_ms IS NOT NULL FROM participant WHERE id = $1",
                    [&id],
                    |row| {
                        let [of, stored] = [row.get(0)?, row.get(1)?];
                        Ok((of, stored, row.get(2)?, row.get(3)?, row.get(4)?))
                    },
                )?;
            if withdrawn {
                return Ok(Completion::Withdrawn);
            }
            // A participant without a plan has not finished enrolling.
            if stored < of || of == 0 {
                let [missing, of] = [of - stored, of].map(|n| n.unsigned_abs() as usize);
                return Ok(Completion::Incomplete { missing, of });
            }
            if required && !answered && !complete {
                return Ok(Completion::Unanswered);
            }
            if !complete {
                db.execute(
                    "UPDATE participant SET completion_code = $2, completed_at_ms = $3, \
                         last_seen_at_ms = $3 WHERE id = $1",
                    params![id, code, now_ms],
                )?;
                db.execute(
                    "UPDATE participant_token SET completed = TRUE WHERE hash = $1",
                    [token_hash],
                )?;
            }
            let (code, completed): (String, bool) = db.query_row(
                "SELECT completion_code, \
                     (SELECT completed FROM participant_token WHERE hash = $2) \
                 FROM participant WHERE id = $1",
                params![id, token_hash],
                |row| Ok((row.get(0)?, row.get(1)?)),
            )?;
            Ok(Completion::Complete { code, visible: completed || scope == Scope::Full })
        })
        .await
    }

    /// Stores a withdrawal. Idempotent. The participant's place becomes free. With `delete`, the
    /// participant's trials and everything that they entered are deleted, together with all results
    /// computed from these data. The participant's number remains, so that counts stay correct.
    /// Deleted rows are overwritten immediately, and are removed from the write-ahead log when no
    /// reader uses the log. `by` is the audit entry if an experimenter withdraws the participant.
    /// It is `None` if the participant withdraws.
    pub async fn withdraw(
        &self,
        participant_id: &str,
        delete: bool,
        now_ms: i64,
        by: Option<NewEntry>,
    ) -> Result<(), StoreError> {
        let id = participant_id.to_owned();
        self.write([Lock::Analyses, Lock::Participant(id.clone())], move |db| {
            if let Some(entry) = &by {
                audit::add(db, entry)?;
            }
            withdraw(db, &id, now_ms)?;
            if delete { delete_data(db, &id) } else { Ok(()) }
        })
        .await?;
        if delete {
            self.forget_deleted();
        }
        Ok(())
    }

    /// Deletes the pilots of a study with all their trials. Returns the number of pilots. The audit
    /// entry contains this number, too.
    pub async fn delete_pilots(
        &self,
        study_id: i64,
        mut entry: NewEntry,
    ) -> Result<usize, StoreError> {
        let deleted = self
            .write([Lock::Study(study_id)], move |db| {
                const PILOTS: &str =
                    "SELECT id FROM participant WHERE study_id = $1 AND pilot = TRUE";
                for statement in [
                    format!(
                        "DELETE FROM trial WHERE trial_id IN \
                             (SELECT trial_id FROM scene WHERE participant_id IN ({PILOTS}))"
                    ),
                    format!("DELETE FROM scene WHERE participant_id IN ({PILOTS})"),
                    format!("DELETE FROM participant_token WHERE participant_id IN ({PILOTS})"),
                ] {
                    db.execute(&statement, [study_id])?;
                }
                let delete = "DELETE FROM participant WHERE study_id = $1 AND pilot = TRUE";
                let deleted = db.execute(delete, [study_id])?;
                entry.subject = Some(deleted.to_string());
                audit::add(db, &entry)?;
                Ok(deleted)
            })
            .await?;
        self.forget_deleted();
        Ok(deleted)
    }

    /// The ids of a study's participants, ordered by number. With `pilots`, the ids of its pilots follow.
    pub async fn participant_ids(
        &self,
        study_id: i64,
        pilots: bool,
    ) -> Result<Vec<String>, StoreError> {
        self.read_long(move |db| {
            let query = "SELECT id FROM participant WHERE study_id = $1 AND ($2 OR pilot = FALSE) \
                         ORDER BY pilot, number";
            let mut statement = db.prepare_cached(query)?;
            let ids = statement.query_map(params![study_id, pilots], |row| row.get(0))?;
            Ok(ids.collect::<Result<_, _>>()?)
        })
        .await
    }
}

/// Ends a participation and frees its place.
pub(super) fn withdraw(db: &Connection, id: &str, now_ms: i64) -> Result<(), StoreError> {
    db.execute(
        "UPDATE participant SET withdrawn_at_ms = coalesce(withdrawn_at_ms, $2), \
             holds_place = FALSE WHERE id = $1",
        params![id, now_ms],
    )?;
    Ok(())
}

/// Deletes all data of a participant who has withdrawn, and every result that was computed from these data.
pub(super) fn delete_data(db: &Connection, id: &str) -> Result<(), StoreError> {
    analyses::withdraw(db, id)?;
    for statement in [
        "DELETE FROM trial WHERE trial_id IN \
             (SELECT trial_id FROM scene WHERE participant_id = $1)",
        "DELETE FROM scene WHERE participant_id = $1",
        "UPDATE tally SET next_phase = NULL, familiarisation = 0, practice = 0, task = 0, \
             late_sample = 0, focus_lost = 0, interrupted = 0, never_steered = 0, \
             always_steered = 0, danger_entered = 0, same_timing = 0, waiting = 0 \
             WHERE participant_id = $1",
        "DELETE FROM note WHERE participant_id = $1",
        "DELETE FROM exclusion WHERE participant_id = $1",
        "UPDATE participant SET data_deleted = TRUE, external_id = NULL, external_key = NULL, \
             request_hash = NULL, locale = NULL, screen = NULL, parameters = NULL, \
             consent_language = NULL, consent_hash = NULL, place = NULL, seed = NULL, \
             comprehension_attempts = 0, understood_at_ms = NULL, answers = NULL, \
             answered_at_ms = NULL, completion_code = NULL, completed_at_ms = NULL, \
             screened_out_at_ms = NULL, last_seen_at_ms = withdrawn_at_ms WHERE id = $1",
        // The hashes of tokens stay, so that the deletion can be repeated, and every browser of the
        // participant learns of it.
        "UPDATE participant_token SET completed = FALSE, check_attempts = 0, created_at_ms = \
             (SELECT enrolled_at_ms FROM participant WHERE id = $1) \
             WHERE participant_id = $1",
    ] {
        db.execute(statement, [id])?;
    }
    Ok(())
}

/// Records that a participant is active now.
pub(super) fn seen(db: &Connection, participant_id: &str, now_ms: i64) -> Result<(), StoreError> {
    let row = params![participant_id, now_ms];
    Ok(db.execute_row_later(&SEEN, &[participant_id], row)?)
}

const SEEN: Rows = Rows {
    before: "UPDATE participant SET last_seen_at_ms = given.column2 FROM (VALUES ",
    after: ") AS given WHERE id = given.column1",
};

/// The participant of a study with this value in this column.
pub(super) fn find(
    db: &Connection,
    study_id: i64,
    column: &'static str,
    value: &dyn ToSql,
) -> Result<Option<Participant>, StoreError> {
    let query = format!("SELECT {COLUMNS} FROM participant WHERE study_id = $1 AND {column} = $2");
    let mut statement = db.prepare_cached(&query)?;
    Ok(statement.query_row(params![study_id, value], Participant::of).optional()?)
}
