//! Direct access to a SQLite or PostgreSQL database, bypassing the server.

use crate::sqlite::{self, Cell, cells};
use sqlx::postgres::{PgColumn, PgConnectOptions, PgConnection, PgRow, PgSslMode, Postgres};
use sqlx::{AssertSqlSafe, Column, ConnectOptions, Connection, Decode, Row, Type, TypeInfo};
use std::path::Path;
use std::str::FromStr;

/// Access to the database at `url`.
#[must_use]
pub fn behind(url: &str) -> Behind {
    Behind { url: url.to_owned() }
}

/// A row of a database.
#[derive(Debug)]
pub struct BehindRow(Vec<Cell>);

/// Types that a column can be read as.
pub trait FromBehind: Sized {
    /// Returns the value, if it has this type.
    fn from_cell(cell: &BehindCell<'_>) -> Option<Self>;
}

/// A column of a row.
#[derive(Debug)]
pub struct BehindCell<'a>(&'a Cell);

impl BehindRow {
    /// The value in column `at`, counted from 0.
    ///
    /// # Errors
    /// If there is no such column, or its value has another type.
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

/// Direct access to a database, bypassing the server. Statements can use `TRUE` and `FALSE` with
/// both kinds of database.
#[derive(Debug)]
pub struct Behind {
    url: String,
}

impl Behind {
    /// Runs statements.
    ///
    /// # Errors
    /// If a statement fails.
    pub async fn execute(&self, statements: &str) -> Result<(), String> {
        let statements = sqlx::raw_sql(AssertSqlSafe(statements));
        let done = match self.file() {
            Some(file) => {
                sqlite::with(file, async |db| statements.execute(db).await).await.map(drop)
            }
            None => on_server(&self.url, async |db| statements.execute(db).await).await.map(drop),
        };
        done.map_err(|error| error.to_string())
    }

    /// Applies `read` to each row of a query.
    ///
    /// # Errors
    /// If the query or `read` fails.
    pub async fn rows<T>(
        &self,
        query: &str,
        read: impl FnMut(&BehindRow) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        let query = AssertSqlSafe(query);
        let rows: sqlx::Result<Vec<BehindRow>> = match self.file() {
            Some(file) => {
                let rows = async |db: &mut _| sqlx::query(query).fetch_all(db).await;
                let rows = sqlite::with(file, rows).await;
                rows.and_then(|rows| rows.iter().map(|row| cells(row).map(BehindRow)).collect())
            }
            None => {
                let rows = async |db: &mut _| sqlx::query(query).fetch_all(db).await;
                let rows = on_server(&self.url, rows).await;
                rows.and_then(|rows| rows.iter().map(row_of_server).collect())
            }
        };
        rows.map_err(|error| error.to_string())?.iter().map(read).collect()
    }

    /// Applies `read` to the first row of a query.
    ///
    /// # Errors
    /// If there is no row, or if the query or `read` fails.
    pub async fn row<T>(
        &self,
        query: &str,
        read: impl FnMut(&BehindRow) -> Result<T, String>,
    ) -> Result<T, String> {
        self.rows(query, read).await?.into_iter().next().ok_or_else(|| "no row".to_owned())
    }

    fn file(&self) -> Option<&Path> {
        self.url.strip_prefix("sqlite:").map(Path::new)
    }
}

fn row_of_server(row: &PgRow) -> sqlx::Result<BehindRow> {
    fn of<'a, T: Decode<'a, Postgres> + Type<Postgres>>(
        row: &'a PgRow,
        at: usize,
        cell: fn(T) -> Cell,
    ) -> sqlx::Result<Cell> {
        Ok(row.try_get::<Option<T>, _>(at)?.map_or(Cell::Null, cell))
    }
    let cell = |(at, column): (usize, &PgColumn)| match column.type_info().name() {
        "INT8" => of(row, at, Cell::Integer),
        "INT4" => of(row, at, |number: i32| Cell::Integer(number.into())),
        "FLOAT8" => of(row, at, Cell::Real),
        "BOOL" => of(row, at, |truth: bool| Cell::Integer(truth.into())),
        "BYTEA" => of(row, at, Cell::Bytes),
        _ => of(row, at, Cell::Text),
    };
    row.columns().iter().enumerate().map(cell).collect::<Result<_, _>>().map(BehindRow)
}

/// Applies `talk` to a connection to PostgreSQL, and then closes the connection.
async fn on_server<T>(
    url: &str,
    talk: impl AsyncFnOnce(&mut PgConnection) -> sqlx::Result<T>,
) -> sqlx::Result<T> {
    let options = PgConnectOptions::from_str(url)?.ssl_mode(PgSslMode::Disable);
    let mut db = options.connect().await?;
    let found = talk(&mut db).await;
    db.close().await?;
    found
}

/// Creates a database in the PostgreSQL cluster that `SIDESTEP_TEST_POSTGRES` names, and returns
/// its address. The variable contains an address with DATABASE instead of the database name.
/// Returns `None` if it is not set.
///
/// # Panics
/// If the database cannot be created.
#[must_use]
pub async fn new_postgres_database() -> Option<String> {
    let cluster = std::env::var("SIDESTEP_TEST_POSTGRES").ok()?;
    let mut random = [0; 8];
    getrandom::fill(&mut random).expect("random bytes");
    let name = format!("test_{}", hex::encode(random));
    behind(&cluster.replace("DATABASE", "postgres"))
        .execute(&format!("CREATE DATABASE {name}"))
        .await
        .expect("a new database");
    Some(cluster.replace("DATABASE", &name))
}
