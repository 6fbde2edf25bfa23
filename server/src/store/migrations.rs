//! Migrations of both back ends. All missing migrations are applied in one transaction.

mod repair;

pub(super) use repair::{put_back, renew};

use super::error::StoreError;
use super::misfit::Misfit;
use super::sql::{self, Connection};
use sha2::{Digest, Sha256, Sha384};
use sqlx::migrate::{Migrate, MigrateError, Migration, MigrationType, Migrator};
use sqlx::{
    AssertSqlSafe, ColumnIndex, Connection as _, Database, Decode, Executor, IntoArguments,
    Postgres, Row as _, SqlSafeStr, Sqlite, Type,
};

/// The table of applied migrations, in the format of sqlx. Earlier versions used the same table.
const TABLE: &str = "_sqlx_migrations";

/// The table of applied migrations that earlier versions used in PostgreSQL. It has SHA-256 checksums.
const FORMER_TABLE: &str = "sidestep_migration";

/// The statement that counts a commit in the mark. It is part of the commit's transaction. See
/// `migrations/sqlite/0016_mark.sql`.
pub(super) const COUNTED: &str = "UPDATE mark \
     SET text = printf('sidestep mark %s %020d %s %s', substr(text, 15, 32), \
         CAST(substr(text, 48, 20) AS INTEGER) + 1, substr(text, 86, 16), lower(hex(randomblob(8))))";

/// `include_str!` of numbered files. `sqlx::migrate!` does the same, but would compile SQLite a second time.
macro_rules! migrations {
    ($folder:literal: $($version:literal $name:literal,)*) => {
        &[$(($version, $name, include_str!(concat!(
            "../../../migrations/", $folder, "/", $name, ".sql"
        )))),*]
    };
}

type Files = &'static [(i64, &'static str, &'static str)];

const SQLITE: Files = migrations! { "sqlite":
    1 "0001_studies_participants_trials",
    2 "0002_safety_functions",
    3 "0003_analyses",
    4 "0004_lasting_identities",
    5 "0005_places_and_rights",
    6 "0006_keys_and_audit",
    7 "0007_tallies",
    8 "0008_attempts_of_tokens",
    9 "0009_notes_and_exclusions",
    10 "0010_study_versions",
    11 "0011_upload_backlog",
    12 "0012_predictors",
    13 "0013_lists_from_tallies",
    14 "0014_counted_predictors",
    15 "0015_several_servers",
    16 "0016_mark",
    17 "0017_robot_policies",
};

const POSTGRES: Files = migrations! { "postgres":
    1 "0001_schema",
    2 "0002_throttles",
    3 "0003_tallies_of_many",
    4 "0004_robot_policies",
};

/// The reason why a database cannot be migrated.
#[derive(Debug)]
pub(super) enum Failure {
    /// The database does not fit this program.
    Misfit(Misfit),
    /// The database cannot be read or written.
    Unusable(StoreError),
}

impl<E: Into<StoreError>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Unusable(error.into())
    }
}

impl From<Misfit> for Failure {
    fn from(misfit: Misfit) -> Self {
        Self::Misfit(misfit)
    }
}

/// The state of a database before migration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// No tables.
    Empty,
    /// The tables of an older version.
    Older {
        /// The number of the database's last migration.
        found: i64,
        /// The number of the last migration of this version.
        known: i64,
    },
    /// The tables of this version.
    Current,
}

/// Checks that this program can use the database, without changing it.
pub(super) fn check(db: &Connection) -> Result<State, Failure> {
    let files = files(db);
    let known = files.last().map_or(0, |(version, ..)| *version);
    let applied = applied(db)?;
    let found = applied.iter().map(|(version, _)| *version).max();
    if let Some(found) = found
        && found > known
    {
        return Err(Misfit::Newer { found, known }.into());
    }
    for (version, _, sql) in files {
        let other = |(applied, checksum): &(i64, Vec<u8>)| {
            applied == version && ![sha384(sql), sha256(sql)].contains(checksum)
        };
        if applied.iter().any(other) {
            return Err(Misfit::Other(*version).into());
        }
    }
    Ok(match found {
        None => State::Empty,
        Some(found) if found < known => State::Older { found, known },
        Some(_) => State::Current,
    })
}

/// Checks that no copy into the database was left incomplete.
pub(super) fn check_finished(db: &Connection) -> Result<(), Failure> {
    if is_unfinished(db)? { Err(Misfit::Unfinished.into()) } else { Ok(()) }
}

/// Whether a copy into the database was begun and not finished.
fn is_unfinished(db: &Connection) -> sql::Result<bool> {
    Ok(unfinished(db)? != 0)
}

/// The text that marks an unfinished copy in PostgreSQL, as a comment on a table.
const UNFINISHED: &str = "A copy into this database was not finished.";

/// The number of the unfinished copy into the database. Returns 0 if there is no unfinished copy, and 1
/// if its source is unknown.
fn unfinished(db: &Connection) -> sql::Result<i64> {
    let is_ours = |number: &i64| *number == 1 || number & !COPY_BITS == COPY;
    if db.is_sqlite() {
        let query = "SELECT user_version FROM pragma_user_version";
        let found = db.query_row(query, [], |row| row.get(0))?;
        return Ok(Some(found).filter(is_ours).unwrap_or(0));
    }
    // Other programs may comment on the table, too.
    let query = "SELECT coalesce(obj_description('study'::regclass, 'pg_class'), '')";
    let comment = db.query_row(query, [], |row| row.get::<_, String>(0))?;
    let number = comment.strip_prefix(UNFINISHED).map(|number| number.trim().parse().unwrap_or(1));
    Ok(number.filter(is_ours).unwrap_or(0))
}

/// The number of a copy begins with these bits, and ends with bits of a hash of its source. The
/// first bits are necessary because other programs can set the version of a SQLite file, too.
const COPY: i64 = 0x5d00_0000;
const COPY_BITS: i64 = 0x00ff_ffff;

/// If a copy without a recorded source was begun, records the hash of its source. Returns whether
/// an unfinished copy has another source.
pub(super) fn claim_copy(db: &Connection, hash: u32) -> Result<bool, StoreError> {
    let (found, number) = (unfinished(db)?, COPY | i64::from(hash) & COPY_BITS);
    if found == 1 {
        db.batch(&match db.is_sqlite() {
            true => format!("PRAGMA user_version = {number}; UPDATE mark SET text = text"),
            false => format!("COMMENT ON TABLE study IS '{UNFINISHED} {number}'"),
        })?;
    }
    Ok(![0, 1, number].contains(&found))
}

/// Records that a copy into an empty database begins.
pub(super) fn begin_copy(db: &Connection) -> Result<(), StoreError> {
    Ok(db.batch(&match db.is_sqlite() {
        true => "PRAGMA user_version = 1".to_owned(),
        false => format!("COMMENT ON TABLE study IS '{UNFINISHED}'"),
    })?)
}

/// If a copy was begun, records that it is complete. Otherwise changes nothing, because a user who
/// copies into an existing database might not own its tables.
pub(super) fn end_copy(db: &Connection) -> Result<(), StoreError> {
    if !is_unfinished(db)? {
        return Ok(());
    }
    // A change of `user_version` does not count as a changed row, and only a commit with changed
    // rows gets a new mark.
    Ok(db.batch(db.choose(
        "PRAGMA user_version = 0; UPDATE mark SET text = text",
        "COMMENT ON TABLE study IS NULL",
    ))?)
}

/// Makes an unfinished copy in a SQLite file count as finished. Returns whether there was one.
pub(super) fn forget_copy(db: &Connection) -> Result<bool, StoreError> {
    let is_unfinished = is_unfinished(db)?;
    db.batch("PRAGMA user_version = 0")?;
    Ok(is_unfinished)
}

/// Applies the missing migrations. If several servers start at the same time, only one server applies
/// them.
pub(super) fn apply(db: &Connection) -> Result<(), Failure> {
    let is_former = has(db, FORMER_TABLE)?;
    if check(db)? == State::Current && !is_former {
        return Ok(());
    }
    let adopted = if is_former { applied(db)? } else { Vec::new() };
    let missing = Missing {
        known: Migrator::with_migrations(files(db).iter().copied().map(migration).collect()),
        adopted: adopted.into_iter().map(|(version, _)| version).collect(),
    };
    db.with_link(
        async |db| {
            missing.apply::<Sqlite>(db, "BEGIN IMMEDIATE", Some(sql::DANGLING), Some(COUNTED)).await
        },
        async |db| missing.apply::<Postgres>(db, "BEGIN", None, None).await,
    )?
}

/// Creates the table of applied migrations in a SQLite file that has all migrations.
fn record_all(db: &Connection) -> Result<(), Failure> {
    let known = Migrator::with_migrations(SQLITE.iter().copied().map(migration).collect());
    let adopted = SQLITE.iter().map(|(version, ..)| *version).collect();
    let missing = Missing { known, adopted };
    db.with_link(
        async |db| missing.apply::<Sqlite>(db, "BEGIN IMMEDIATE", None, None).await,
        async |_| Ok(()),
    )?
}

fn files(db: &Connection) -> Files {
    if db.is_sqlite() { SQLITE } else { POSTGRES }
}

/// The applied migrations: their numbers and checksums.
fn applied(db: &Connection) -> Result<Vec<(i64, Vec<u8>)>, Failure> {
    let table = match (has(db, FORMER_TABLE)?, has(db, TABLE)?) {
        (true, _) => FORMER_TABLE,
        (false, true) => TABLE,
        (false, false) if has(db, "%")? => return Err(Misfit::Foreign.into()),
        (false, false) => return Ok(Vec::new()),
    };
    let mut statement = db.prepare_cached(&format!("SELECT version, checksum FROM {table}"))?;
    let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(rows.collect::<sql::Result<_>>()?)
}

/// Whether a table's name matches this LIKE pattern.
fn has(db: &Connection, name: &str) -> sql::Result<bool> {
    let query = db.choose(
        "SELECT name FROM sqlite_schema WHERE name LIKE $1 LIMIT 1",
        "SELECT CAST(tablename AS TEXT) FROM pg_tables WHERE schemaname = current_schema() \
         AND tablename LIKE $1 LIMIT 1",
    );
    db.prepare_cached(query)?.exists([name])
}

fn migration((version, name, sql): (i64, &'static str, &'static str)) -> Migration {
    // The description that sqlx derives from a file's name.
    let words = name.split_once('_').map_or(name, |(_, words)| words).replace('_', " ");
    Migration::new(version, words.into(), MigrationType::Simple, sql.into_sql_str(), false)
}

/// The checksum that sqlx stores.
fn sha384(sql: &str) -> Vec<u8> {
    Sha384::digest(sql.as_bytes()).to_vec()
}

/// The checksum in the former table.
fn sha256(sql: &str) -> Vec<u8> {
    Sha256::digest(sql.as_bytes()).to_vec()
}

/// The migrations to apply.
struct Missing {
    known: Migrator,
    /// The numbers of migrations that are already applied, and only have to be recorded.
    adopted: Vec<i64>,
}

impl Missing {
    /// Applies the missing migrations in one transaction. Before the commit, the query `wrong` must
    /// find no row. Then the statement `last` is executed.
    async fn apply<DB: Database>(
        &self,
        db: &mut DB::Connection,
        begin: &'static str,
        wrong: Option<&'static str>,
        last: Option<&'static str>,
    ) -> Result<(), Failure>
    where
        DB::Connection: Migrate,
        for<'c> &'c mut DB::Connection: Executor<'c, Database = DB>,
        DB::Arguments: IntoArguments<DB>,
        for<'r> String: Decode<'r, DB> + Type<DB>,
        usize: ColumnIndex<DB::Row>,
    {
        db.lock().await.map_err(failed(0))?;
        let mut transaction = db.begin_with(begin).await?;
        let to = &mut *transaction;
        to.ensure_migrations_table(TABLE).await.map_err(failed(0))?;
        let applied = to.list_applied_migrations(TABLE).await.map_err(failed(0))?;
        let mut version = 0;
        for migration in self.known.iter() {
            if applied.iter().any(|applied| applied.version == migration.version) {
                continue;
            }
            version = migration.version;
            if self.adopted.contains(&version) {
                to.skip(TABLE, migration).await.map_err(failed(version))?;
            } else {
                to.apply(TABLE, migration).await.map_err(failed(version))?;
            }
        }
        if !self.adopted.is_empty() {
            let drop = format!("DROP TABLE IF EXISTS {FORMER_TABLE}");
            to.execute(AssertSqlSafe(drop)).await?;
        }
        if let Some(wrong) = wrong
            && let Some(row) = to.fetch_optional(wrong).await?
        {
            return Err(Misfit::Failed { version, reason: row.try_get(0)? }.into());
        }
        if let Some(last) = last {
            to.execute(last).await?;
        }
        transaction.commit().await?;
        db.unlock().await.map_err(failed(0))
    }
}

/// The failure of a migration or of its connection.
fn failed(version: i64) -> impl Fn(MigrateError) -> Failure {
    move |error| match error {
        MigrateError::Execute(error) => StoreError::from(error).into(),
        MigrateError::ExecuteMigration(error, version) => {
            Misfit::Failed { version, reason: StoreError::from(error).to_string() }.into()
        }
        other => Misfit::Failed { version, reason: other.to_string() }.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::postgres::TABLES;

    #[test]
    fn every_table_is_known() {
        let made = POSTGRES.iter().flat_map(|(.., sql)| sql.lines()).filter_map(|line| {
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
