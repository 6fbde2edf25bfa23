//! The copied tables and their columns. A test compares the columns with those in the database.

use crate::store::StoreError;
use crate::store::sql::{Connection, Kind, params};

/// A table, or the part of it that belongs to one participant or analysis.
pub(super) struct Table {
    pub(super) name: &'static str,
    /// The columns whose values are copied.
    pub(super) columns: &'static [(&'static str, Kind)],
    /// The column that gets the number of the study, or of the analysis, in the new database.
    pub(super) owner: Option<&'static str>,
    /// Whether the rows are trials. Their numbers are copied with an offset.
    pub(super) is_numbered: bool,
    /// The SQL condition for the rows that belong to the participant or analysis with the id $1.
    pub(super) of: &'static str,
    /// The order of its rows.
    pub(super) order: &'static str,
    /// Whether a trigger creates the row and the copy only updates it. The first column identifies the row.
    pub(super) is_made: bool,
}

impl Table {
    const fn new(name: &'static str, columns: &'static [(&'static str, Kind)]) -> Self {
        Self { name, columns, owner: None, is_numbered: false, of: "", order: "1", is_made: false }
    }

    const fn owned(mut self, column: &'static str) -> Self {
        self.owner = Some(column);
        self
    }

    const fn of(mut self, condition: &'static str, order: &'static str) -> Self {
        (self.of, self.order) = (condition, order);
        self
    }

    const fn numbered(mut self) -> Self {
        self.is_numbered = true;
        self
    }

    const fn made(mut self) -> Self {
        self.is_made = true;
        self
    }

    /// The statement that deletes the rows that belong to the participant or analysis with the id $1.
    pub(super) fn delete(&self) -> String {
        format!("DELETE FROM {} WHERE {}", self.name, self.of)
    }

    /// The comma-separated names of the columns.
    pub(super) fn names(&self) -> String {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| *name).collect();
        names.join(", ")
    }
}

macro_rules! columns {
    ($($kind:ident: $($name:ident)*;)*) => { &[$($((stringify!($name), Kind::$kind)),*),*] };
}

const OF_PARTICIPANT: &str = "participant_id = $1";

/// A participant's tables. A table comes after the tables that its rows refer to.
pub(super) const PARTICIPANT_TABLES: &[Table] = &[
    Table::new(
        "participant",
        columns! {
            Text: id; Truth: pilot; Integer: number place; Truth: holds_place;
            Text: external_id external_key; Bytes: request_hash; Text: config_hash; Integer: seed;
            Text: import_hash locale screen parameters consent_language consent_hash;
            Integer: enrolled_at_ms last_seen_at_ms comprehension_attempts understood_at_ms
                screened_out_at_ms;
            Text: answers; Integer: answered_at_ms completed_at_ms; Text: completion_code;
            Integer: withdrawn_at_ms; Truth: data_deleted;
        },
    )
    .owned("study_id")
    .of("id = $1", "id"),
    Table::new(
        "participant_token",
        columns! {
            Bytes: hash; Text: participant_id; Integer: created_at_ms; Text: scope; Truth: completed;
            Integer: check_attempts;
        },
    )
    .of(OF_PARTICIPANT, "hash"),
    Table::new(
        "scene",
        columns! {
            Text: trial_id participant_id; Integer: ordinal; Text: phase; Integer: idx attempt;
            Real: human_x human_y human_psi robot_x robot_y robot_psi goal_x goal_y;
            Text: policy;
        },
    )
    .of(OF_PARTICIPANT, "ordinal"),
    Table::new(
        "trial",
        columns! {
            Text: trial_id; Integer: content_version; Bytes: content_hash; Integer: received_at_ms;
            Real: started_at_ms; Bytes: inputs states sampled_at_ms; Text: key_events display flags;
            Real: closest_m; Integer: first_step_in_danger avoidance_first avoidance_last;
            Text: page_events; Integer: exposures key_timing;
        },
    )
    .owned("study_id")
    .numbered()
    .of("trial_id IN (SELECT trial_id FROM scene WHERE participant_id = $1)", "sequence"),
    Table::new("note", columns! { Text: participant_id text; Integer: at_ms; Text: who; })
        .of(OF_PARTICIPANT, "id"),
    Table::new(
        "exclusion",
        columns! { Text: participant_id reason; Integer: at_ms; Text: who; Integer: ended_at_ms; },
    )
    .of(OF_PARTICIPANT, "id"),
    Table::new(
        "tally",
        columns! {
            Text: participant_id next_phase;
            Integer: familiarisation practice task late_sample focus_lost interrupted never_steered
                always_steered danger_entered same_timing waiting;
        },
    )
    .of(OF_PARTICIPANT, "participant_id")
    .made(),
];

const OF_ANALYSIS: &str = "analysis = (SELECT sequence FROM analysis WHERE id = $1)";

/// An analysis's tables. A table comes after the tables that its rows refer to.
pub(super) const ANALYSIS_TABLES: &[Table] = &[
    Table::new(
        "analysis",
        columns! {
            Text: id request state; Integer: attempts done total fresh created_at_ms started_at_ms
                ended_at_ms;
            Text: message result;
        },
    )
    .owned("study_id")
    .of("id = $1", "id"),
    Table::new("analysis_participant", columns! { Text: participant_id; })
        .owned("analysis")
        .of(OF_ANALYSIS, "participant_id"),
    Table::new("analysis_file", columns! { Text: name; Integer: part size; Bytes: bytes; })
        .owned("analysis")
        .of(OF_ANALYSIS, "name, part"),
    Table::new(
        "analysis_predictor",
        columns! {
            Text: name; Integer: part participant_number place; Text: model; Integer: experiment;
            Text: feature_set features; Real: cv_accuracy test_accuracy;
        },
    )
    .owned("analysis")
    .of(OF_ANALYSIS, "id"),
    Table::new("analysis_trial", columns! { Text: participant_id trial_id; Truth: trains; })
        .owned("analysis")
        .of(OF_ANALYSIS, "participant_id, trial_id"),
];

/// The experimenters' keys, and the audit trail. Sessions are not copied.
pub(super) const ACCESS_TABLES: &[Table] = &[
    Table::new(
        "api_key",
        columns! {
            Integer: id; Text: name; Bytes: hash; Text: access; Truth: is_first;
            Integer: created_at_ms last_used_at_ms revoked_at_ms;
        },
    )
    .of("", "id"),
    Table::new("audit", columns! { Integer: sequence at_ms; Text: who action study subject; })
        .of("", "sequence"),
];

/// Ensures that new rows of a table get numbers above `last`.
pub(super) fn take_numbers(db: &Connection, table: &str, last: i64) -> Result<(), StoreError> {
    match db.is_sqlite() {
        true => {
            let known = "UPDATE sqlite_sequence SET seq = max(seq, $2) WHERE name = $1";
            if db.execute(known, params![table, last])? == 0 {
                let new = "INSERT INTO sqlite_sequence (name, seq) VALUES ($1, $2)";
                db.execute(new, params![table, last])?;
            }
        }
        false => {
            let column = if table == "api_key" { "id" } else { "sequence" };
            let sequence = format!("pg_get_serial_sequence('{table}', '{column}')");
            let take = format!(
                "SELECT setval({sequence}, greatest($1, (SELECT coalesce(max({column}), 0) FROM {table}), \
                     nextval({sequence})))"
            );
            db.query_row(&take, [last], |_| Ok(()))?;
        }
    }
    Ok(())
}

/// Call this after a table was filled with explicit numbers. It ensures that the table does not
/// assign these numbers again.
pub(super) fn never_use_again(db: &Connection, table: &str) -> Result<(), StoreError> {
    take_numbers(db, table, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::store;
    use std::collections::BTreeSet;

    /// Columns that are not copied: numbers that are reassigned, the worker of an analysis, and
    /// columns that the database computes.
    const LEFT_OUT: &[(&str, &[&str])] = &[
        ("trial", &["sequence"]),
        ("note", &["id"]),
        ("exclusion", &["id"]),
        ("analysis", &["sequence", "worker", "lease_until_ms"]),
        ("analysis_predictor", &["id"]),
        (
            "tally",
            &[
                "study_id",
                "pilot",
                "number",
                "last_seen_at_ms",
                "comprehension_attempts",
                "understood",
                "withdrawn",
                "screened_out",
                "complete",
                "imported",
                "excluded",
                "stored",
                "failed_checks",
                "doubtful",
                "stage",
            ],
        ),
    ];

    #[tokio::test]
    async fn every_column_is_copied_or_left_out_on_purpose() {
        let (_folder, store) = store().await;
        let tables = [PARTICIPANT_TABLES, ANALYSIS_TABLES, ACCESS_TABLES];
        for table in tables.into_iter().flatten() {
            let found: BTreeSet<String> = store
                .read_long(|db| {
                    let query = db.choose(
                        "SELECT name FROM pragma_table_xinfo($1)",
                        "SELECT CAST(column_name AS TEXT) FROM information_schema.columns \
                         WHERE table_schema = current_schema() AND table_name = $1",
                    );
                    let mut statement = db.prepare_cached(query)?;
                    let names = statement.query_map([table.name], |row| row.get(0))?;
                    Ok(names.collect::<Result<_, _>>()?)
                })
                .await
                .unwrap();
            let left = LEFT_OUT.iter().find(|(name, _)| *name == table.name);
            let left = left.map_or(&[][..], |(_, columns)| columns);
            let copied = table.columns.iter().map(|(name, _)| *name).chain(table.owner);
            let known: BTreeSet<String> =
                copied.chain(left.iter().copied()).map(str::to_owned).collect();
            assert_eq!(found, known, "{}", table.name);
        }
    }
}
