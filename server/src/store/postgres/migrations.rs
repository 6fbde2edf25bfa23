//! Migrations of PostgreSQL: all missing ones in one transaction, or none.

use crate::store::error::StoreError;
use crate::store::misfit::Misfit;
use crate::store::sql::{self, Connection};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// A numbered file of `migrations/postgres`.
struct Migration {
    version: i64,
    name: &'static str,
    sql: &'static str,
}

const MIGRATIONS: [Migration; 3] = [
    Migration {
        version: 1,
        name: "schema",
        sql: include_str!("../../../../migrations/postgres/0001_schema.sql"),
    },
    Migration {
        version: 2,
        name: "throttles",
        sql: include_str!("../../../../migrations/postgres/0002_throttles.sql"),
    },
    Migration {
        version: 3,
        name: "tallies_of_many",
        sql: include_str!("../../../../migrations/postgres/0003_tallies_of_many.sql"),
    },
];

/// What a server writes to: every table but that of the migrations, and the sequence that tells other servers of changes.
pub(super) const TABLES: &str = "study_config study study_version participant participant_token scene trial \
     value_function safety_function api_key session audit note exclusion tally analysis analysis_participant \
     analysis_file analysis_cell analysis_predictor analysis_trial predictor_kind predictor_participant throttle \
     changed";

/// Why a database cannot be migrated.
#[derive(Debug)]
pub(super) enum Failure {
    /// It does not fit this program.
    Misfit(Misfit),
    /// It cannot be read or written.
    Unusable(StoreError),
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        Self::Unusable(error)
    }
}

impl From<sql::Error> for Failure {
    fn from(error: sql::Error) -> Self {
        Self::Unusable(error.into())
    }
}

impl From<Misfit> for Failure {
    fn from(misfit: Misfit) -> Self {
        Self::Misfit(misfit)
    }
}

/// What there is already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Nothing.
    Empty,
    /// The tables of an older version.
    Older {
        /// The number of its last migration.
        found: i64,
        /// The number of the last migration of this version.
        known: i64,
    },
    /// The tables of this version.
    Current,
}

/// Checks that this program can use the database, without changing it. Without rights to the schema, it would look empty.
pub(super) fn check(db: &Connection) -> Result<State, Failure> {
    let known = MIGRATIONS[MIGRATIONS.len() - 1].version;
    if db.query_row("SELECT current_schema() IS NULL", [], |row| row.get(0))? {
        let hidden =
            "this user must not use the schema of the tables; GRANT USAGE ON SCHEMA (public) to it";
        return Err(StoreError::Unavailable(hidden.to_owned()).into());
    }
    Ok(match pending(db)?.first() {
        None => State::Current,
        Some(first) if first.version == 1 => State::Empty,
        Some(first) => State::Older { found: first.version - 1, known },
    })
}

/// Applies the missing migrations. Of several servers that start at once, one does.
pub(super) fn apply(db: &Connection) -> Result<(), Failure> {
    /// A number that no other program's lock is likely to have.
    const LOCK: &str = "SELECT pg_advisory_xact_lock(7310579263541)";
    if pending(db)?.is_empty() {
        return Ok(());
    }
    db.batch(&format!("BEGIN; {LOCK}"))?;
    let applied = apply_all(db);
    db.batch(if applied.is_ok() { "COMMIT" } else { "ROLLBACK" })?;
    applied
}

fn apply_all(db: &Connection) -> Result<(), Failure> {
    let create = "CREATE TABLE IF NOT EXISTS sidestep_migration (version BIGINT PRIMARY KEY, \
                  name TEXT NOT NULL, checksum BYTEA NOT NULL, applied_at TIMESTAMPTZ NOT NULL \
                  DEFAULT now())";
    let failed = |version: i64| {
        move |error: sql::Error| Misfit::Failed {
            version,
            reason: StoreError::from(error).to_string(),
        }
    };
    db.batch(create).map_err(failed(1))?;
    for Migration { version, name, sql } in pending(db)? {
        db.batch(sql).map_err(failed(*version))?;
        db.execute(
            "INSERT INTO sidestep_migration (version, name, checksum) VALUES (?1, ?2, ?3)",
            sql::params![*version, *name, checksum(sql)],
        )?;
    }
    Ok(())
}

/// The missing migrations, in order.
fn pending(db: &Connection) -> Result<Vec<&'static Migration>, Failure> {
    let applied = applied(db)?;
    let known = MIGRATIONS[MIGRATIONS.len() - 1].version;
    if let Some((&found, _)) = applied.last_key_value()
        && found > known
    {
        return Err(Misfit::Newer { found, known }.into());
    }
    let other = MIGRATIONS.iter().find(|migration| {
        let found = applied.get(&migration.version);
        found.is_some_and(|found| *found != checksum(migration.sql))
    });
    if let Some(other) = other {
        return Err(Misfit::Other(other.version).into());
    }
    Ok(MIGRATIONS.iter().filter(|migration| !applied.contains_key(&migration.version)).collect())
}

/// The checksums of the applied migrations, by number.
fn applied(db: &Connection) -> Result<BTreeMap<i64, Vec<u8>>, Failure> {
    let has = |name: &str| {
        let query = "SELECT EXISTS (SELECT 1 FROM pg_tables \
                     WHERE schemaname = current_schema() AND tablename LIKE ?1)";
        db.query_row(query, [name], |row| row.get::<_, bool>(0))
    };
    if !has("sidestep_migration")? {
        return if has("%")? { Err(Misfit::Foreign.into()) } else { Ok(BTreeMap::new()) };
    }
    let mut statement = db.prepare_cached("SELECT version, checksum FROM sidestep_migration")?;
    let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(rows.collect::<sql::Result<_>>()?)
}

fn checksum(sql: &str) -> Vec<u8> {
    Sha256::digest(sql.as_bytes()).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_is_known() {
        let made =
            MIGRATIONS.iter().flat_map(|migration| migration.sql.lines()).filter_map(|line| {
                let kinds = ["CREATE TABLE ", "CREATE UNLOGGED TABLE ", "CREATE SEQUENCE "];
                let rest = kinds.into_iter().find_map(|kind| line.strip_prefix(kind))?;
                Some(rest.trim_end_matches([' ', '(', ';']))
            });
        let (mut made, mut known): (Vec<_>, Vec<_>) =
            (made.collect(), TABLES.split_whitespace().collect());
        made.sort_unstable();
        known.sort_unstable();
        assert_eq!(made, known);
    }
}
