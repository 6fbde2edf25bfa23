//! Migrations: all missing ones in one transaction, or none.

use super::connection::dangling;
use crate::store::error::reason;
use crate::store::misfit::Misfit;
use rusqlite::{Connection, OptionalExtension, TransactionBehavior, params};
use sha2::{Digest, Sha384};
use std::collections::BTreeMap;

/// A numbered file of `migrations/sqlite`.
struct Migration {
    version: i64,
    name: &'static str,
    sql: &'static str,
}

macro_rules! migration {
    ($version:literal, $file:literal, $name:literal) => {
        Migration {
            version: $version,
            name: $name,
            sql: include_str!(concat!("../../../../migrations/sqlite/", $file)),
        }
    };
}

const MIGRATIONS: [Migration; 15] = [
    migration!(1, "0001_studies_participants_trials.sql", "studies participants trials"),
    migration!(2, "0002_safety_functions.sql", "safety functions"),
    migration!(3, "0003_analyses.sql", "analyses"),
    migration!(4, "0004_lasting_identities.sql", "lasting identities"),
    migration!(5, "0005_places_and_rights.sql", "places and rights"),
    migration!(6, "0006_keys_and_audit.sql", "keys and audit"),
    migration!(7, "0007_tallies.sql", "tallies"),
    migration!(8, "0008_attempts_of_tokens.sql", "attempts of tokens"),
    migration!(9, "0009_notes_and_exclusions.sql", "notes and exclusions"),
    migration!(10, "0010_study_versions.sql", "versions of studies"),
    migration!(11, "0011_upload_backlog.sql", "upload backlog"),
    migration!(12, "0012_predictors.sql", "predictors"),
    migration!(13, "0013_lists_from_tallies.sql", "lists from tallies"),
    migration!(14, "0014_counted_predictors.sql", "counted predictors"),
    migration!(15, "0015_several_servers.sql", "several servers"),
];

/// Why a file cannot be migrated.
#[derive(Debug)]
pub(super) enum Failure {
    /// It does not fit this program.
    Misfit(Misfit),
    /// It cannot be read or written.
    Unusable(rusqlite::Error),
}

impl From<Misfit> for Failure {
    fn from(misfit: Misfit) -> Self {
        Self::Misfit(misfit)
    }
}

impl From<rusqlite::Error> for Failure {
    fn from(error: rusqlite::Error) -> Self {
        Self::Unusable(error)
    }
}

/// Checks that this program can use the file, without changing it. Returns whether no migration is missing.
pub(super) fn check(db: &Connection) -> Result<bool, Failure> {
    Ok(pending(db)?.is_empty())
}

/// Applies the missing migrations.
pub(super) fn apply(db: &mut Connection) -> Result<(), Failure> {
    // Migrations rebuild tables under other names, so references must not be enforced meanwhile. The
    // switch works only outside transactions; all references are checked at the end.
    db.pragma_update(None, "foreign_keys", false)?;
    let applied = apply_all(db);
    db.pragma_update(None, "foreign_keys", true)?;
    applied
}

fn apply_all(db: &mut Connection) -> Result<(), Failure> {
    if pending(db)?.is_empty() {
        return Ok(());
    }
    let transaction = db.transaction_with_behavior(TransactionBehavior::Immediate)?;
    // This table comes from the library that earlier versions used; it identifies their databases.
    transaction.execute_batch(
        "CREATE TABLE IF NOT EXISTS _sqlx_migrations (version BIGINT PRIMARY KEY, \
             description TEXT NOT NULL, installed_on TIMESTAMP NOT NULL DEFAULT CURRENT_TIMESTAMP, \
             success BOOLEAN NOT NULL, checksum BLOB NOT NULL, execution_time BIGINT NOT NULL)",
    )?;
    let mut last = 0;
    for Migration { version, name, sql } in pending(&transaction)? {
        let failed = |error: rusqlite::Error| {
            let reason = reason(&error);
            Misfit::Failed { version: *version, reason }
        };
        transaction.execute_batch(sql).map_err(failed)?;
        transaction.execute(
            "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) \
             VALUES (?1, ?2, 1, ?3, 0)",
            params![version, name, checksum(sql)],
        )?;
        last = *version;
    }
    if let Some(reason) = dangling(&transaction)?.into_iter().next() {
        return Err(Misfit::Failed { version: last, reason }.into());
    }
    Ok(transaction.commit()?)
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
        let query = "SELECT 1 FROM sqlite_schema WHERE name LIKE ?1 LIMIT 1";
        db.query_row(query, [name], |_| Ok(())).optional().map(|found| found.is_some())
    };
    if !has("_sqlx_migrations")? {
        return if has("%")? { Err(Misfit::Foreign.into()) } else { Ok(BTreeMap::new()) };
    }
    let mut statement = db.prepare("SELECT version, checksum FROM _sqlx_migrations")?;
    let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(rows.collect::<Result<_, _>>()?)
}

fn checksum(sql: &str) -> Vec<u8> {
    Sha384::digest(sql.as_bytes()).to_vec()
}
