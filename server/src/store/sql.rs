//! The connection that the store's operations use: SQL on two databases, through sqlx.
//!
//! Each statement is written once, in the subset that both databases understand, with numbered
//! parameters (`$1`). Where the dialects differ, [`Connection::choose`] picks the text. In the
//! subset, Booleans are `TRUE` and `FALSE`, and `CAST(… AS BIGINT)` makes them integers. A sum is
//! cast to `BIGINT`. Nullable values are compared with `IS DISTINCT FROM`. A subquery in `FROM (…)`
//! has an alias. A parameter has the type of its Rust value, even for NULL, so PostgreSQL never
//! infers a type.
//!
//! An operation is a plain function that blocks its thread for each query. A cancelled request
//! never leaves a transaction half done, because the thread runs the operation to its end.

mod value;
mod row;
mod rows;

use super::error::StoreError;
use futures_executor::block_on;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgArguments, PgConnection};
use sqlx::sqlite::{SqliteArguments, SqliteConnection};
use sqlx::{AssertSqlSafe, Database, Executor, Postgres, Sqlite, raw_sql};
use std::cell::RefCell;
use std::sync::Arc;
use std::vec::IntoIter;
use tokio::runtime::Handle;

pub(super) use row::Row;
use rows::{Asked, Waiting};
pub(super) use rows::{Question, Rows};
pub(super) use value::{Kind, ToSql, Value};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Error {
    /// A row was expected, but none was found.
    NoRow,
    /// Any other error.
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

impl From<sqlx::Error> for Error {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(error.into())
    }
}

pub(super) type Result<T, E = Error> = core::result::Result<T, E>;

/// Turns a missing row into `None`.
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

/// The parameters of a statement, in the order of their numbers.
pub(super) trait Params {
    fn values(&self) -> Vec<Value<'_>>;
}

impl Params for [&dyn ToSql; 0] {
    fn values(&self) -> Vec<Value<'_>> {
        Vec::new()
    }
}

macro_rules! arrays {
    ($($length:literal)*) => {$(
        impl<T: ToSql> Params for [T; $length] {
            fn values(&self) -> Vec<Value<'_>> {
                self.iter().map(ToSql::value).collect()
            }
        }
    )*};
}
arrays!(1 2 3);

impl Params for &[&dyn ToSql] {
    fn values(&self) -> Vec<Value<'_>> {
        self.iter().map(|value| value.value()).collect()
    }
}

impl Params for &[Value<'_>] {
    fn values(&self) -> Vec<Value<'_>> {
        self.iter().map(ToSql::value).collect()
    }
}

/// Parameters of different types.
macro_rules! params {
    ($($value:expr),* $(,)?) => {
        &[$(&$value as &dyn $crate::store::sql::ToSql),*] as &[&dyn $crate::store::sql::ToSql]
    };
}

pub(super) use params;

/// A SQLite query that finds references to missing rows, and describes each reference in a sentence.
pub(super) const DANGLING: &str = "SELECT \"table\" || ': row ' || coalesce(rowid, -1) || \
     ' refers to nothing in ' || parent FROM pragma_foreign_key_check";

/// A connection to a database. It belongs to one thread at a time.
#[derive(Debug)]
pub(super) struct Connection {
    link: RefCell<Link>,
    /// Rows of parameters whose statement is deferred.
    waiting: RefCell<Waiting>,
    /// Results of queries that [`Connection::ask_ahead`] has prefetched.
    asked: RefCell<Asked>,
}

#[derive(Debug)]
enum Link {
    /// A connection to a file. A thread of sqlx executes the statements.
    Sqlite(SqliteConnection),
    /// A session with a PostgreSQL server. The runtime waits for the answers.
    Postgres(Box<PoolConnection<Postgres>>, Handle),
    Closed,
}

impl Drop for Connection {
    fn drop(&mut self) {
        // sqlx would close the file asynchronously on its own thread. Until then, another process
        // would find the log.
        if let Link::Sqlite(db) = self.link.replace(Link::Closed) {
            let _ = block_on(sqlx::Connection::close(db));
        }
    }
}

impl From<SqliteConnection> for Connection {
    fn from(db: SqliteConnection) -> Self {
        Self::to(Link::Sqlite(db))
    }
}

impl Connection {
    fn to(link: Link) -> Self {
        let link = RefCell::new(link);
        let (waiting, asked) = (RefCell::default(), RefCell::default());
        Self { link, waiting, asked }
    }

    /// A session with PostgreSQL. It must not be used on a thread that runs the tasks of `runtime`.
    pub(super) fn to_server(session: PoolConnection<Postgres>, runtime: Handle) -> Self {
        Self::to(Link::Postgres(Box::new(session), runtime))
    }

    /// Takes the session out of the connection, so that the caller can close it.
    pub(super) fn into_session(self) -> Option<PoolConnection<Postgres>> {
        match self.link.replace(Link::Closed) {
            Link::Postgres(session, _) => Some(*session),
            _ => None,
        }
    }

    /// Whether this is a connection to a SQLite file.
    pub(super) fn is_sqlite(&self) -> bool {
        matches!(*self.link.borrow(), Link::Sqlite(_))
    }

    /// The text for this database's dialect.
    pub(super) fn choose<'a>(&self, sqlite: &'a str, postgres: &'a str) -> &'a str {
        if self.is_sqlite() { sqlite } else { postgres }
    }

    /// Executes statements without parameters or results.
    pub(super) fn batch(&self, sql: &str) -> Result<()> {
        self.settle()?;
        let sql = raw_sql(AssertSqlSafe(sql));
        match &mut *self.link.borrow_mut() {
            Link::Sqlite(db) => block_on(sql.execute(db)).map(|_| ())?,
            Link::Postgres(db, runtime) => {
                runtime.block_on(sql.execute(connection(db))).map(|_| ())?;
            }
            Link::Closed => return Err(StoreError::closed().into()),
        }
        Ok(())
    }

    /// Executes statements without parameters on PostgreSQL. The first statement returns a row.
    pub(super) fn batch_with_answer<T>(
        &self,
        sql: &'static str,
        read: impl FnOnce(&Row) -> Result<T>,
    ) -> Result<T> {
        self.settle()?;
        let rows = match &mut *self.link.borrow_mut() {
            Link::Postgres(db, runtime) => {
                runtime.block_on(raw_sql(sql).fetch_all(connection(db)))?
            }
            _ => Vec::new(),
        };
        read(&Row::Postgres(rows.into_iter().next().ok_or(Error::NoRow)?))
    }

    /// Defers a statement for one row of parameters. The statement must not return a result.
    /// `targets` identify what the row changes, such as the id of a participant. All deferred rows
    /// of a statement are executed as one batch, before the next statement that is not deferred or
    /// at the end of the transaction. Errors are reported only at this time. The rows of a batch
    /// have different targets, so they do not affect each other. Batches are executed in the order
    /// of their first rows.
    pub(super) fn execute_row_later(
        &self,
        rows: &'static Rows,
        targets: &[&str],
        params: impl Params,
    ) -> Result<()> {
        let values = params.values();
        if !self.waiting.borrow_mut().add(rows, targets, &values) {
            self.settle()?;
            self.waiting.borrow_mut().add(rows, targets, &values);
        }
        Ok(())
    }

    /// Executes [deferred](Self::execute_row_later) statements.
    pub(super) fn settle(&self) -> Result<()> {
        let statements = self.waiting.borrow_mut().take(self.is_sqlite());
        statements.into_iter().try_for_each(|(sql, values)| {
            self.run(&sql.into(), &values)?;
            Ok(())
        })
    }

    /// The rows that a query finds for several rows of parameters.
    pub(super) fn query_rows(
        &self,
        query: &Rows,
        values: Vec<Vec<Value<'static>>>,
    ) -> Result<Vec<Row>> {
        let mut found = Vec::new();
        for (sql, values) in query.executions(values, self.is_sqlite()) {
            found.append(&mut self.rows(&sql.into(), &values)?);
        }
        Ok(found)
    }

    /// Prefetches the results of one query for several rows of parameters. The query's first parameter
    /// and first column are the target. [`Self::query_ahead`] returns the results. If several questions
    /// have the same target, only the first question is prefetched, because the first operation may
    /// change the answers to the other questions.
    pub(super) fn ask_ahead(&self, questions: Vec<Question>) -> Result<()> {
        let Some((query, _)) = questions.first() else { return Ok(()) };
        let query: &Rows = query;
        let (mut asked, mut all) = (Asked::new(), Vec::new());
        for (_, values) in questions {
            if let Some(Value::Text(target)) = values.first()
                && !asked.contains_key(&**target)
            {
                asked.insert(target.to_string(), (values.clone(), None));
                all.push(values);
            }
        }
        for row in self.query_rows(query, all)? {
            if let Some((_, found)) = asked.get_mut(&row.get::<_, String>(0)?) {
                *found = Some(row);
            }
        }
        self.asked.replace(asked);
        Ok(())
    }

    /// Discards the prefetched results, because they are out of date.
    pub(super) fn forget_asked(&self) {
        self.asked.borrow_mut().clear();
    }

    /// The row that a query finds, or the prefetched row. The first parameter is the target.
    /// [Deferred](Self::execute_row_later) statements are executed first only if they have this
    /// target.
    pub(super) fn query_ahead<T, E: From<Error>>(
        &self,
        (query, values): Question,
        read: impl FnOnce(&Row) -> Result<T, E>,
    ) -> Result<Option<T>, E> {
        let mut known = None;
        if let Some(Value::Text(target)) = values.first() {
            known = self.asked.borrow_mut().remove(&**target);
            let waits = self.waiting.borrow().has(target);
            if waits {
                self.settle()?;
                known = None;
            }
        }
        let found = match known {
            Some((asked, found)) if asked == values => found,
            _ => self
                .rows(&query.text(1, values.len(), self.is_sqlite()).into(), &values)?
                .into_iter()
                .next(),
        };
        found.as_ref().map(read).transpose()
    }

    /// Rolls back a transaction or a savepoint, and discards deferred statements.
    pub(super) fn roll_back(&self, undo: &str) -> Result<()> {
        self.waiting.borrow_mut().clear();
        self.forget_asked();
        self.batch(undo)
    }

    /// Calls `sqlite` or `postgres` with sqlx's connection.
    pub(super) fn with_link<T>(
        &self,
        sqlite: impl AsyncFnOnce(&mut SqliteConnection) -> T,
        postgres: impl AsyncFnOnce(&mut PgConnection) -> T,
    ) -> Result<T> {
        match &mut *self.link.borrow_mut() {
            Link::Sqlite(db) => Ok(block_on(sqlite(db))),
            Link::Postgres(db, runtime) => Ok(runtime.block_on(postgres(connection(db)))),
            Link::Closed => Err(StoreError::closed().into()),
        }
    }

    /// A statement that the connection prepares and caches for reuse.
    pub(super) fn prepare_cached(&self, sql: &str) -> Result<Statement<'_>> {
        Ok(Statement { db: self, sql: sql.into() })
    }

    /// Executes a statement and returns the number of rows that it changed.
    pub(super) fn execute(&self, sql: &str, params: impl Params) -> Result<usize> {
        self.prepare_cached(sql)?.execute(params)
    }

    /// The first row that a statement finds.
    pub(super) fn query_row<T>(
        &self,
        sql: &str,
        params: impl Params,
        read: impl FnOnce(&Row) -> Result<T>,
    ) -> Result<T> {
        self.prepare_cached(sql)?.query_row(params, read)
    }

    /// Executes a statement and returns the number of rows that it changed.
    fn run(&self, sql: &Arc<str>, values: &[Value<'_>]) -> Result<u64> {
        let changed = match &mut *self.link.borrow_mut() {
            Link::Sqlite(db) => block_on(db.execute(query(sql, sqlite(values)?)))?.rows_affected(),
            Link::Postgres(db, runtime) => {
                let query = query(sql, postgres(values)?);
                runtime.block_on(connection(db).execute(query))?.rows_affected()
            }
            Link::Closed => return Err(StoreError::closed().into()),
        };
        Ok(changed)
    }

    /// Executes a statement that begins or ends a transaction or a savepoint. It returns no count,
    /// because SQLite would report the number of rows that the previous statement changed.
    pub(super) fn control(&self, sql: &'static str) -> Result<()> {
        self.run(&sql.into(), &[]).map(drop)
    }

    fn rows(&self, sql: &Arc<str>, values: &[Value<'_>]) -> Result<Vec<Row>> {
        Ok(match &mut *self.link.borrow_mut() {
            Link::Sqlite(db) => {
                let rows = block_on(db.fetch_all(query(sql, sqlite(values)?)))?;
                rows.into_iter().map(Row::Sqlite).collect()
            }
            Link::Postgres(db, runtime) => {
                let query = query(sql, postgres(values)?);
                let rows = runtime.block_on(connection(db).fetch_all(query))?;
                rows.into_iter().map(Row::Postgres).collect()
            }
            Link::Closed => return Err(StoreError::closed().into()),
        })
    }

    /// The first row that a statement finds.
    fn row(&self, sql: &Arc<str>, values: &[Value<'_>]) -> Result<Option<Row>> {
        self.settle()?;
        Ok(match &mut *self.link.borrow_mut() {
            Link::Sqlite(db) => {
                block_on(db.fetch_optional(query(sql, sqlite(values)?)))?.map(Row::Sqlite)
            }
            Link::Postgres(db, runtime) => {
                let query = query(sql, postgres(values)?);
                runtime.block_on(connection(db).fetch_optional(query))?.map(Row::Postgres)
            }
            Link::Closed => return Err(StoreError::closed().into()),
        })
    }
}

fn connection(session: &mut PoolConnection<Postgres>) -> &mut PgConnection {
    session
}

fn query<DB: Database>(
    sql: &Arc<str>,
    arguments: DB::Arguments,
) -> sqlx::query::Query<'static, DB, DB::Arguments>
where
    DB::Arguments: sqlx::IntoArguments<DB>,
{
    // The text of a statement comes only from the store. User input is always bound as parameters.
    sqlx::query_with(AssertSqlSafe(Arc::clone(sql)), arguments)
}

fn sqlite(values: &[Value<'_>]) -> Result<SqliteArguments> {
    Ok(value::arguments::<Sqlite>(values)?)
}

fn postgres(values: &[Value<'_>]) -> Result<PgArguments> {
    let values: Vec<Value<'_>> = values.iter().map(Value::without_nul).collect();
    Ok(value::arguments::<Postgres>(&values)?)
}

/// A statement of a connection.
pub(super) struct Statement<'c> {
    db: &'c Connection,
    sql: Arc<str>,
}

impl Statement<'_> {
    /// Executes the statement and returns the number of rows that it changed.
    pub(super) fn execute(&mut self, params: impl Params) -> Result<usize> {
        self.db.settle()?;
        let changed = self.db.run(&self.sql, &params.values())?;
        Ok(usize::try_from(changed).unwrap_or(usize::MAX))
    }

    /// Whether the statement finds a row.
    pub(super) fn exists(&mut self, params: impl Params) -> Result<bool> {
        Ok(self.db.row(&self.sql, &params.values())?.is_some())
    }

    pub(super) fn query_row<T>(
        &mut self,
        params: impl Params,
        read: impl FnOnce(&Row) -> Result<T>,
    ) -> Result<T> {
        read(&self.db.row(&self.sql, &params.values())?.ok_or(Error::NoRow)?)
    }

    /// The result of `read` for each row.
    pub(super) fn query_map<T>(
        &mut self,
        params: impl Params,
        read: impl FnMut(&Row) -> Result<T>,
    ) -> Result<IntoIter<Result<T>>> {
        self.query_and_then(params, read)
    }

    /// Like [`Self::query_map`], for a `read` with any type of error.
    pub(super) fn query_and_then<T, E: From<Error>>(
        &mut self,
        params: impl Params,
        read: impl FnMut(&Row) -> Result<T, E>,
    ) -> Result<IntoIter<Result<T, E>>> {
        self.db.settle()?;
        let rows = self.db.rows(&self.sql, &params.values())?;
        let found: Vec<_> = rows.iter().map(read).collect();
        Ok(found.into_iter())
    }
}
