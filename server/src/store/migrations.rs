//! Migrations: all missing ones in one transaction, or none.

use super::connection::dangling;
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
            sql: include_str!(concat!("../../../migrations/sqlite/", $file)),
        }
    };
}

const MIGRATIONS: [Migration; 14] = [
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
];

/// Why a file cannot be migrated. Each message is a sentence about the file.
#[derive(Debug, thiserror::Error)]
pub enum Misfit {
    /// A newer version of the program has migrated it.
    #[error(
        "a newer version of Sidestep made it (it has migration {found}, this version knows 1 to \
         {known}); update Sidestep"
    )]
    Newer {
        /// The highest number in the database.
        found: i64,
        /// The highest number that this program knows.
        known: i64,
    },
    /// A migration of another build, with the same number as one of this build, was applied.
    #[error("its migration {0} is not the one of this version; the file comes from another build")]
    Other(i64),
    /// It contains tables that are not this program's.
    #[error("it is a database of another program")]
    Foreign,
    /// A statement failed.
    #[error("migration {version} failed and nothing was changed: {reason}")]
    Failed {
        /// Its number.
        version: i64,
        /// SQLite's message.
        reason: String,
    },
    /// It cannot be read or written.
    #[error("{0}")]
    Unusable(#[from] rusqlite::Error),
}

/// Checks that this program can use the file, without changing it.
pub(super) fn check(db: &Connection) -> Result<(), Misfit> {
    pending(db).map(drop)
}

/// Applies the missing migrations.
pub(super) fn apply(db: &mut Connection) -> Result<(), Misfit> {
    // Migrations rebuild tables under other names, so references must not be enforced meanwhile. The
    // switch works only outside transactions; all references are checked at the end.
    db.pragma_update(None, "foreign_keys", false)?;
    let applied = apply_all(db);
    db.pragma_update(None, "foreign_keys", true)?;
    applied
}

fn apply_all(db: &mut Connection) -> Result<(), Misfit> {
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
            let reason = super::error::reason(&error);
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
        return Err(Misfit::Failed { version: last, reason });
    }
    Ok(transaction.commit()?)
}

/// The missing migrations, in order.
fn pending(db: &Connection) -> Result<Vec<&'static Migration>, Misfit> {
    let applied = applied(db)?;
    let known = MIGRATIONS[MIGRATIONS.len() - 1].version;
    if let Some((&found, _)) = applied.last_key_value()
        && found > known
    {
        return Err(Misfit::Newer { found, known });
    }
    let other = MIGRATIONS.iter().find(|migration| {
        let found = applied.get(&migration.version);
        found.is_some_and(|found| *found != checksum(migration.sql))
    });
    if let Some(other) = other {
        return Err(Misfit::Other(other.version));
    }
    Ok(MIGRATIONS.iter().filter(|migration| !applied.contains_key(&migration.version)).collect())
}

/// The checksums of the applied migrations, by number.
fn applied(db: &Connection) -> Result<BTreeMap<i64, Vec<u8>>, Misfit> {
    let has = |name: &str| {
        let query = "SELECT 1 FROM sqlite_schema WHERE name LIKE ?1 LIMIT 1";
        db.query_row(query, [name], |_| Ok(())).optional().map(|found| found.is_some())
    };
    if !has("_sqlx_migrations")? {
        return if has("%")? { Err(Misfit::Foreign) } else { Ok(BTreeMap::new()) };
    }
    let mut statement = db.prepare("SELECT version, checksum FROM _sqlx_migrations")?;
    let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(rows.collect::<Result<_, _>>()?)
}

fn checksum(sql: &str) -> Vec<u8> {
    Sha384::digest(sql.as_bytes()).to_vec()
}
