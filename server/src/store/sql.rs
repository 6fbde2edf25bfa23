//! SQL on two databases: the part of rusqlite's interface that the store uses, over SQLite and PostgreSQL.
//!
//! A statement is written once, in the subset that both databases understand, with SQLite's numbered
//! (`?1`) or named (`:name`) parameters. Where they differ, [`Connection::choose`] picks the words.
//! The subset: truth values are `TRUE` and `FALSE`, and `CAST(… AS INTEGER)` makes them numbers; a sum
//! of numbers is cast to `BIGINT`; `IS DISTINCT FROM` compares what may be NULL; a table in `FROM (…)`
//! has a name. The type of a parameter is that of the Rust value, also for NULL, so PostgreSQL guesses
//! none.

mod value;
mod row;
mod placeholders;
mod rows;
mod session;

use super::error::StoreError;
use placeholders::Translated;
use std::sync::Arc;
use std::vec::IntoIter;

pub(super) use row::Row;
pub(super) use rows::{Question, Rows};
use session::Session;
use tokio_postgres_rustls::MakeRustlsConnect;
pub(super) use value::{Kind, ToSql, Value};

/// The error of a statement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Error {
    /// A row was expected and there is none.
    NoRow,
    /// Anything else.
    Store(StoreError),
}

impl From<StoreError> for Error {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

impl From<Error> for StoreError {
    fn from(error: Error) -> Self {
        match error {
            Error::NoRow => Self::Defect("a query returned no row".to_owned()),
            Error::Store(error) => error,
        }
    }
}

impl From<rusqlite::Error> for Error {
    fn from(error: rusqlite::Error) -> Self {
        Self::Store(error.into())
    }
}

impl From<tokio_postgres::Error> for Error {
    fn from(error: tokio_postgres::Error) -> Self {
        Self::Store(error.into())
    }
}

/// The result of a statement.
pub(super) type Result<T, E = Error> = core::result::Result<T, E>;

/// Turns "there is no row" into `None`.
pub(super) trait OptionalExtension<T> {
    /// The row, if there is one.
    fn optional(self) -> Result<Option<T>>;
}

impl<T> OptionalExtension<T> for Result<T> {
    fn optional(self) -> Result<Option<T>> {
        match self {
            Ok(value) => Ok(Some(value)),
            Err(Error::NoRow) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// The parameters of a statement.
pub(super) trait Params {
    /// Their values, with their names if they have some.
    fn values(&self) -> Vec<(Option<&str>, Value<'_>)>;
}

/// No parameters.
impl Params for [&dyn ToSql; 0] {
    fn values(&self) -> Vec<(Option<&str>, Value<'_>)> {
        Vec::new()
    }
}

macro_rules! arrays {
    ($($length:literal)*) => {$(
        impl<T: ToSql> Params for [T; $length] {
            fn values(&self) -> Vec<(Option<&str>, Value<'_>)> {
                self.iter().map(|value| (None, value.value())).collect()
            }
        }
    )*};
}
arrays!(1 2 3);

impl Params for &[&dyn ToSql] {
    fn values(&self) -> Vec<(Option<&str>, Value<'_>)> {
        self.iter().map(|value| (None, value.value())).collect()
    }
}

impl Params for &[(&str, &dyn ToSql)] {
    fn values(&self) -> Vec<(Option<&str>, Value<'_>)> {
        self.iter().map(|(name, value)| (Some(*name), value.value())).collect()
    }
}

/// Numbered parameters of different types.
macro_rules! params {
    ($($value:expr),* $(,)?) => {
        &[$(&$value as &dyn $crate::store::sql::ToSql),*] as &[&dyn $crate::store::sql::ToSql]
    };
}

/// Named parameters.
macro_rules! named_params {
    ($($name:literal: $value:expr),* $(,)?) => {
        &[$(($name, &$value as &dyn $crate::store::sql::ToSql)),*]
            as &[(&str, &dyn $crate::store::sql::ToSql)]
    };
}

pub(super) use {named_params, params};

/// A connection to a database.
#[derive(Debug)]
pub(super) enum Connection {
    /// To a file.
    Sqlite(rusqlite::Connection),
    /// To a server.
    Postgres(Box<Session>),
}

impl Connection {
    /// A connection to PostgreSQL.
    pub(super) fn to_server(
        config: &tokio_postgres::Config,
        tls: MakeRustlsConnect,
    ) -> Result<Self> {
        Ok(Self::Postgres(Box::new(Session::begin(config, tls)?)))
    }

    /// Whether it can be used no more.
    pub(super) fn is_closed(&self) -> bool {
        match self {
            Self::Sqlite(_) => false,
            Self::Postgres(session) => session.is_closed(),
        }
    }

    /// Statements without parameters and rows.
    pub(super) fn batch(&self, sql: &str) -> Result<()> {
        match self {
            Self::Sqlite(db) => Ok(db.execute_batch(sql)?),
            Self::Postgres(session) => session.batch(sql),
        }
    }

    /// Waits for what was [put off](Self::execute_row_later), and returns the first error of it.
    pub(super) fn settle(&self) -> Result<()> {
        match self {
            Self::Sqlite(_) => Ok(()),
            Self::Postgres(session) => session.settle(),
        }
    }

    /// Executes a statement for one row of parameters, without a result. PostgreSQL does so for many rows at once,
    /// together with the next statement that is not like that, or when the transaction ends; an error comes then. The
    /// rows of one statement have different targets: what it changes for one target does not depend on what it changes for
    /// another. Statements for rows are executed in the order of their first rows.
    pub(super) fn execute_row_later(
        &self,
        rows: &'static Rows,
        target: &str,
        params: impl Params,
    ) -> Result<()> {
        match self {
            Self::Sqlite(_) => {
                let values = params.values();
                self.prepare_cached(&rows.text(1, values.len()))?.execute(params).map(drop)
            }
            Self::Postgres(session) => session.execute_row_later(rows, target, &params.values()),
        }
    }

    /// Has PostgreSQL answer questions, all at once. A query that asks one of them finds its answer here, if it is
    /// asked before the transaction ends; until then nobody may change the answer.
    pub(super) fn ask_ahead(&self, questions: &[&Question]) -> Result<()> {
        match self {
            Self::Sqlite(_) => Ok(()),
            Self::Postgres(session) => session.ask_ahead(questions),
        }
    }

    /// Forgets answers to questions that were [asked ahead](Self::ask_ahead).
    pub(super) fn forget_answers(&self) {
        if let Self::Postgres(session) = self {
            session.forget_later();
        }
    }

    /// Undoes a transaction of PostgreSQL, with what was put off in it.
    pub(super) fn roll_back(&self) -> Result<()> {
        if let Self::Postgres(session) = self {
            session.forget_later();
        }
        self.batch("ROLLBACK")
    }

    /// What this database says differently.
    pub(super) fn choose<'a>(&self, sqlite: &'a str, postgres: &'a str) -> &'a str {
        match self {
            Self::Sqlite(_) => sqlite,
            Self::Postgres(_) => postgres,
        }
    }

    /// A statement that will be used again.
    pub(super) fn prepare_cached(&self, sql: &str) -> Result<Statement<'_>> {
        Ok(match self {
            Self::Sqlite(db) => Statement::Sqlite(db.prepare_cached(sql)?),
            Self::Postgres(session) => Statement::Postgres(session, session.translated(sql)),
        })
    }

    /// The number of rows that a statement changes.
    pub(super) fn execute(&self, sql: &str, params: impl Params) -> Result<usize> {
        self.prepare_cached(sql)?.execute(params)
    }

    /// The first row that a statement finds.
    pub(super) fn query_row<T>(
        &self,
        sql: &str,
        params: impl Params,
        read: impl FnOnce(&Row<'_>) -> Result<T>,
    ) -> Result<T> {
        self.prepare_cached(sql)?.query_row(params, read)
    }
}

/// A statement of a connection.
pub(super) enum Statement<'c> {
    /// Prepared.
    Sqlite(rusqlite::CachedStatement<'c>),
    /// Prepared when the types of its parameters are known.
    Postgres(&'c Session, Arc<Translated>),
}

impl Statement<'_> {
    /// The number of rows that it changes.
    pub(super) fn execute(&mut self, params: impl Params) -> Result<usize> {
        match self {
            Self::Sqlite(statement) => {
                bind(statement, &params)?;
                Ok(statement.raw_execute()?)
            }
            Self::Postgres(session, text) => session.execute(text, &params.values()),
        }
    }

    /// Whether it finds a row.
    pub(super) fn exists(&mut self, params: impl Params) -> Result<bool> {
        Ok(self.query_row(params, |_| Ok(())).optional()?.is_some())
    }

    /// The first row that it finds.
    pub(super) fn query_row<T>(
        &mut self,
        params: impl Params,
        read: impl FnOnce(&Row<'_>) -> Result<T>,
    ) -> Result<T> {
        match self {
            Self::Sqlite(statement) => {
                bind(statement, &params)?;
                let mut rows = statement.raw_query();
                read(&Row::Sqlite(rows.next()?.ok_or(Error::NoRow)?))
            }
            Self::Postgres(session, text) => {
                let rows = session.query(text, &params.values())?;
                read(&Row::Postgres(rows.first().ok_or(Error::NoRow)?))
            }
        }
    }

    /// What `read` makes of each row.
    pub(super) fn query_map<T>(
        &mut self,
        params: impl Params,
        read: impl FnMut(&Row<'_>) -> Result<T>,
    ) -> Result<IntoIter<Result<T>>> {
        self.query_and_then(params, read)
    }

    /// The same with an error of any kind.
    pub(super) fn query_and_then<T, E: From<Error>>(
        &mut self,
        params: impl Params,
        mut read: impl FnMut(&Row<'_>) -> Result<T, E>,
    ) -> Result<IntoIter<Result<T, E>>> {
        let mut found = Vec::new();
        match self {
            Self::Sqlite(statement) => {
                bind(statement, &params)?;
                let mut rows = statement.raw_query();
                while let Some(row) = rows.next()? {
                    found.push(read(&Row::Sqlite(row)));
                }
            }
            Self::Postgres(session, text) => {
                let rows = session.query(text, &params.values())?;
                found.extend(rows.iter().map(|row| read(&Row::Postgres(row))));
            }
        }
        Ok(found.into_iter())
    }
}

/// Binds parameters by their numbers or names.
fn bind(statement: &mut rusqlite::Statement<'_>, params: &impl Params) -> Result<()> {
    let values = params.values();
    let expected = statement.parameter_count();
    if values.len() != expected {
        let found = values.len();
        let defect = format!("a statement has {expected} parameters, and {found} were given");
        return Err(StoreError::Defect(defect).into());
    }
    for (i, (name, value)) in values.iter().enumerate() {
        let at = match name {
            None => i + 1,
            Some(name) => {
                let unknown = || StoreError::Defect(format!("no parameter is called {name}"));
                statement.parameter_index(name)?.ok_or_else(unknown)?
            }
        };
        statement.raw_bind_parameter(at, value)?;
    }
    Ok(())
}
