//! A database behind the server's back, of whichever kind.

use postgres::types::Type;
use rusqlite::types::ValueRef;
use std::thread;
use std::time::Duration;

/// The database at `url`.
#[must_use]
pub fn behind(url: &str) -> Behind {
    Behind { url: url.to_owned() }
}

/// What a row has in a column.
#[derive(Clone, Debug)]
enum Cell {
    Null,
    Integer(i64),
    Real(f64),
    Text(String),
    Bytes(Vec<u8>),
}

/// A row of a database.
#[derive(Debug)]
pub struct BehindRow(Vec<Cell>);

/// What a column can be read as.
pub trait FromBehind: Sized {
    /// The value, if it is one.
    fn from_cell(cell: &BehindCell<'_>) -> Option<Self>;
}

/// A column of a row.
#[derive(Debug)]
pub struct BehindCell<'a>(&'a Cell);

impl BehindRow {
    /// The value in a column, from 0.
    ///
    /// # Errors
    /// If it is of another type.
    pub fn get<T: FromBehind>(&self, at: usize) -> Result<T, String> {
        let cell = self.0.get(at).ok_or("no such column")?;
        T::from_cell(&BehindCell(cell)).ok_or_else(|| format!("{cell:?} is of another type"))
    }
}

macro_rules! from_behind {
    ($($type:ty: $pattern:pat => $value:expr;)*) => {$(
        impl FromBehind for $type {
            fn from_cell(cell: &BehindCell<'_>) -> Option<Self> {
                match cell.0 {
                    $pattern => Some($value),
                    _ => None,
                }
            }
        }
    )*};
}
from_behind! {
    i64: Cell::Integer(number) => *number;
    f64: Cell::Real(number) => *number;
    bool: Cell::Integer(number) => *number != 0;
    String: Cell::Text(text) => text.clone();
    Vec<u8>: Cell::Bytes(bytes) => bytes.clone();
}

impl<T: FromBehind> FromBehind for Option<T> {
    fn from_cell(cell: &BehindCell<'_>) -> Option<Self> {
        match cell.0 {
            Cell::Null => Some(None),
            _ => T::from_cell(cell).map(Some),
        }
    }
}

/// A database behind the server's back. Truth values are the words `TRUE` and `FALSE` on both kinds.
#[derive(Debug)]
pub struct Behind {
    url: String,
}

impl Behind {
    /// Runs a statement.
    ///
    /// # Errors
    /// If it fails.
    pub fn execute(&self, statement: &str, _: [(); 0]) -> Result<(), String> {
        self.execute_batch(statement)
    }

    /// Runs statements.
    ///
    /// # Errors
    /// If one fails.
    pub fn execute_batch(&self, statements: &str) -> Result<(), String> {
        match self.file() {
            Some(db) => db.execute_batch(statements).map_err(|error| error.to_string()),
            None => on_server(&self.url, |client| client.batch_execute(statements)),
        }
    }

    /// What `read` makes of each row that a query finds.
    ///
    /// # Errors
    /// If the query fails, or `read`.
    pub fn rows<T>(
        &self,
        query: &str,
        read: impl FnMut(&BehindRow) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        let rows = match self.file() {
            Some(db) => rows_of_file(&db, query).map_err(|error| error.to_string())?,
            None => on_server(&self.url, |client| client.query(query, &[]))?
                .iter()
                .map(row_of_server)
                .collect::<Result<_, _>>()?,
        };
        rows.iter().map(read).collect()
    }

    /// What `read` makes of the first row that a query finds.
    ///
    /// # Errors
    /// If there is none, the query fails, or `read`.
    pub fn query_row<T>(
        &self,
        query: &str,
        _: [(); 0],
        read: impl FnMut(&BehindRow) -> Result<T, String>,
    ) -> Result<T, String> {
        self.rows(query, read)?.into_iter().next().ok_or_else(|| "no row".to_owned())
    }

    fn file(&self) -> Option<rusqlite::Connection> {
        self.url.starts_with("sqlite:").then(|| behind_file(&self.url))
    }
}

/// The file of SQLite at `url`, for tests of what only a file has.
///
/// # Panics
/// If it cannot be opened.
#[must_use]
pub fn behind_file(url: &str) -> rusqlite::Connection {
    let file = url.strip_prefix("sqlite:").expect("the address of a file");
    let db = rusqlite::Connection::open(file).expect("a database");
    db.busy_timeout(Duration::from_secs(10)).expect("a timeout");
    db
}

fn rows_of_file(db: &rusqlite::Connection, query: &str) -> rusqlite::Result<Vec<BehindRow>> {
    let mut statement = db.prepare(query)?;
    let columns = statement.column_count();
    let row = |row: &rusqlite::Row<'_>| {
        let cell = |at: usize| {
            Ok(match row.get_ref(at)? {
                ValueRef::Null => Cell::Null,
                ValueRef::Integer(number) => Cell::Integer(number),
                ValueRef::Real(number) => Cell::Real(number),
                ValueRef::Text(text) => Cell::Text(String::from_utf8_lossy(text).into_owned()),
                ValueRef::Blob(bytes) => Cell::Bytes(bytes.to_vec()),
            })
        };
        (0..columns).map(cell).collect::<rusqlite::Result<_>>().map(BehindRow)
    };
    statement.query_map([], row)?.collect()
}

fn row_of_server(row: &postgres::Row) -> Result<BehindRow, String> {
    fn of<'a, T: postgres::types::FromSql<'a>>(
        row: &'a postgres::Row,
        at: usize,
        cell: fn(T) -> Cell,
    ) -> Result<Cell, String> {
        let found = row.try_get::<_, Option<T>>(at).map_err(|error| error.to_string())?;
        Ok(found.map_or(Cell::Null, cell))
    }
    let cell = |(at, column): (usize, &postgres::Column)| match *column.type_() {
        Type::INT8 => of(row, at, Cell::Integer),
        Type::INT4 => of(row, at, |number: i32| Cell::Integer(number.into())),
        Type::FLOAT8 => of(row, at, Cell::Real),
        Type::BOOL => of(row, at, |truth: bool| Cell::Integer(truth.into())),
        Type::BYTEA => of(row, at, Cell::Bytes),
        _ => of(row, at, Cell::Text),
    };
    row.columns().iter().enumerate().map(cell).collect::<Result<_, _>>().map(BehindRow)
}

/// A conversation with PostgreSQL, on a thread of its own: it waits, which a test's thread must not.
fn on_server<T: Send>(
    url: &str,
    talk: impl FnOnce(&mut postgres::Client) -> Result<T, postgres::Error> + Send,
) -> Result<T, String> {
    let conversation = || {
        let mut client = postgres::Client::connect(url, postgres::NoTls)?;
        talk(&mut client)
    };
    let found = thread::scope(|scope| scope.spawn(conversation).join().expect("no panic"));
    found.map_err(|error| error.as_db_error().map_or(error.to_string(), ToString::to_string))
}

/// The address of a new database: in the cluster of PostgreSQL that `SIDESTEP_TEST_POSTGRES` names (an
/// address with DATABASE in the place of its name), if there is one.
///
/// # Panics
/// If the cluster does not make a database.
#[must_use]
pub fn new_postgres_database() -> Option<String> {
    let cluster = std::env::var("SIDESTEP_TEST_POSTGRES").ok()?;
    let mut random = [0; 8];
    getrandom::fill(&mut random).expect("random bytes");
    let name = format!("test_{}", hex::encode(random));
    behind(&cluster.replace("DATABASE", "postgres"))
        .execute_batch(&format!("CREATE DATABASE {name}"))
        .expect("a new database");
    Some(cluster.replace("DATABASE", &name))
}
