//! Rows of results.

use super::Result;
use sqlx::decode::Decode;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Column, Postgres, Row as _, Sqlite, Type, TypeInfo};
use std::fmt;

pub(in crate::store) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

impl fmt::Debug for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Hides the values, which may be personal data.
        f.debug_struct("Row").finish_non_exhaustive()
    }
}

/// The number of a column, from 0, or its name.
pub(in crate::store) trait Index:
    sqlx::ColumnIndex<SqliteRow> + sqlx::ColumnIndex<PgRow>
{
}
impl<I: sqlx::ColumnIndex<SqliteRow> + sqlx::ColumnIndex<PgRow>> Index for I {}

/// A type that a column can be read as.
pub(in crate::store) trait FromSql: Sized {
    fn read(row: &Row, column: impl Index) -> sqlx::Result<Self>;
}

/// A type of a single value that may be NULL.
pub(in crate::store) trait Cell: Sized {
    fn read(row: &Row, column: impl Index) -> sqlx::Result<Option<Self>>;
}

impl Row {
    /// The value in a column.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`](crate::store::StoreError::Corrupt) if it has another type.
    pub(in crate::store) fn get<I: Index, T: FromSql>(&self, column: I) -> Result<T> {
        Ok(T::read(self, column)?)
    }

    fn plain<T>(&self, column: impl Index) -> sqlx::Result<Option<T>>
    where
        T: for<'r> Decode<'r, Sqlite>
            + Type<Sqlite>
            + for<'r> Decode<'r, Postgres>
            + Type<Postgres>,
    {
        match self {
            Self::Sqlite(row) => row.try_get(column),
            Self::Postgres(row) => row.try_get(column),
        }
    }
}

impl<T: Cell> FromSql for Option<T> {
    fn read(row: &Row, column: impl Index) -> sqlx::Result<Self> {
        T::read(row, column)
    }
}

fn wrong(what: impl Into<sqlx::error::BoxDynError>) -> sqlx::Error {
    sqlx::Error::Decode(what.into())
}

macro_rules! cells {
    ($($type:ty: |$row:ident, $column:ident| $read:expr;)*) => {$(
        impl Cell for $type {
            fn read($row: &Row, $column: impl Index) -> sqlx::Result<Option<Self>> {
                $read
            }
        }
        impl FromSql for $type {
            fn read(row: &Row, column: impl Index) -> sqlx::Result<Self> {
                let null = || wrong("there is no value in a column that must have one");
                <Self as Cell>::read(row, column)?.ok_or_else(null)
            }
        }
    )*};
}

cells! {
    f64: |row, column| row.plain(column);
    bool: |row, column| row.plain(column);
    String: |row, column| row.plain(column);
    Vec<u8>: |row, column| row.plain(column);
    i64: |row, column| match row {
        // A literal number in the statement has the type INT4.
        Row::Postgres(of) if of.try_column(&column)?.type_info().name() == "INT4" => {
            Ok(of.try_get::<Option<i32>, _>(column)?.map(i64::from))
        }
        _ => row.plain(column),
    };
    [u8; 32]: |row, column| {
        let bytes: Option<Vec<u8>> = row.plain(column)?;
        let sized = |bytes: Vec<u8>| bytes.try_into().map_err(|_| wrong("not 32 bytes"));
        bytes.map(sized).transpose()
    };
    u64: |row, column| number(row, column);
    u32: |row, column| number(row, column);
    u8: |row, column| number(row, column);
    usize: |row, column| number(row, column);
}

/// Reads an integer, which must be in the range of `T`.
fn number<T: TryFrom<i64>>(row: &Row, column: impl Index) -> sqlx::Result<Option<T>> {
    let number = <i64 as Cell>::read(row, column)?;
    let sized =
        |number: i64| T::try_from(number).map_err(|_| wrong(format!("{number} is out of range")));
    number.map(sized).transpose()
}
