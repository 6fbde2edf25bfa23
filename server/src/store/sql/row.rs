//! Rows that a statement finds.

use super::{Error, Result};
use crate::store::error::StoreError;
use rusqlite::types::ValueRef;
use tokio_postgres::types::Type;

/// A row.
pub(in crate::store) enum Row<'a> {
    /// Of a file.
    Sqlite(&'a rusqlite::Row<'a>),
    /// Of a server.
    Postgres(&'a tokio_postgres::Row),
}

/// What stands in a column of a row.
pub(in crate::store) enum Cell<'a> {
    /// NULL.
    Null,
    /// A whole number; in SQLite also true (1) or false (0).
    Integer(i64),
    /// A number.
    Real(f64),
    /// A text.
    Text(&'a str),
    /// Bytes.
    Bytes(&'a [u8]),
    /// True or false.
    Truth(bool),
}

/// The number of a column, from 0, or its name.
pub(in crate::store) trait Index: Copy {
    /// The number of the column.
    fn of(self, row: &Row<'_>) -> Result<usize>;
}

impl Index for usize {
    fn of(self, _: &Row<'_>) -> Result<usize> {
        Ok(self)
    }
}

impl Index for &str {
    fn of(self, row: &Row<'_>) -> Result<usize> {
        let unknown = || StoreError::Defect(format!("no column is called {self}"));
        match row {
            Row::Sqlite(row) => Ok(row.as_ref().column_index(self)?),
            Row::Postgres(row) => {
                let place = row.columns().iter().position(|column| column.name() == self);
                Ok(place.ok_or_else(unknown)?)
            }
        }
    }
}

/// A type that a column is read as.
pub(in crate::store) trait FromSql: Sized {
    /// The value; nothing if the cell holds another kind.
    fn from_cell(cell: Cell<'_>) -> Option<Self>;
}

impl Row<'_> {
    /// The value in a column.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if it is of another type.
    pub(in crate::store) fn get<I: Index, T: FromSql>(&self, column: I) -> Result<T> {
        let at = column.of(self)?;
        T::from_cell(self.cell(at)?).ok_or_else(|| {
            Error::Store(StoreError::corrupt(format!("column {at} holds a value of another type")))
        })
    }

    fn cell(&self, at: usize) -> Result<Cell<'_>> {
        match self {
            Row::Sqlite(row) => Ok(match row.get_ref(at)? {
                ValueRef::Null => Cell::Null,
                ValueRef::Integer(number) => Cell::Integer(number),
                ValueRef::Real(number) => Cell::Real(number),
                ValueRef::Text(text) => {
                    Cell::Text(std::str::from_utf8(text).map_err(StoreError::corrupt)?)
                }
                ValueRef::Blob(bytes) => Cell::Bytes(bytes),
            }),
            Row::Postgres(row) => {
                let beyond = || StoreError::Defect(format!("a row has no column {at}"));
                let kind = row.columns().get(at).ok_or_else(beyond)?.type_();
                let cell = match *kind {
                    Type::INT8 => row.try_get::<_, Option<i64>>(at)?.map(Cell::Integer),
                    Type::INT4 => {
                        let number = row.try_get::<_, Option<i32>>(at)?;
                        number.map(|number| Cell::Integer(number.into()))
                    }
                    Type::FLOAT8 => row.try_get::<_, Option<f64>>(at)?.map(Cell::Real),
                    Type::BOOL => row.try_get::<_, Option<bool>>(at)?.map(Cell::Truth),
                    Type::BYTEA => row.try_get::<_, Option<&[u8]>>(at)?.map(Cell::Bytes),
                    Type::TEXT | Type::VARCHAR | Type::NAME => {
                        row.try_get::<_, Option<&str>>(at)?.map(Cell::Text)
                    }
                    ref other => {
                        let defect = format!("column {at} is of PostgreSQL's type {other}");
                        return Err(StoreError::Defect(defect).into());
                    }
                };
                Ok(cell.unwrap_or(Cell::Null))
            }
        }
    }
}

macro_rules! whole_numbers {
    ($($type:ty)*) => {$(
        impl FromSql for $type {
            fn from_cell(cell: Cell<'_>) -> Option<Self> {
                match cell {
                    Cell::Integer(number) => number.try_into().ok(),
                    _ => None,
                }
            }
        }
    )*};
}
whole_numbers!(i64 u64 u32 u8 usize);

impl FromSql for f64 {
    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        match cell {
            Cell::Real(number) => Some(number),
            _ => None,
        }
    }
}

impl FromSql for bool {
    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        match cell {
            Cell::Truth(truth) => Some(truth),
            Cell::Integer(number) => Some(number != 0),
            _ => None,
        }
    }
}

impl FromSql for String {
    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        match cell {
            Cell::Text(text) => Some(text.to_owned()),
            _ => None,
        }
    }
}

impl FromSql for Vec<u8> {
    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        match cell {
            Cell::Bytes(bytes) => Some(bytes.to_vec()),
            _ => None,
        }
    }
}

impl FromSql for [u8; 32] {
    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        match cell {
            Cell::Bytes(bytes) => bytes.try_into().ok(),
            _ => None,
        }
    }
}

impl<T: FromSql> FromSql for Option<T> {
    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        match cell {
            Cell::Null => Some(None),
            cell => T::from_cell(cell).map(Some),
        }
    }
}
