//! A table that is written to a file batch by batch.

use super::Format;
use super::format::DATABASE;
use super::hashed::Hashed;
use super::table::Table;
use crate::formats::table::{Batch, Cells, Column, Kind, ParquetFile};
use crate::formats::table::{csv_header, csv_rows, json_rows};
use crate::store::StoreError;
use crate::store::snapshot::{Snapshot, Type, Value};
use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// A table that is being written.
pub(super) struct TableFile<W: Write + Send> {
    pub(super) name: String,
    pub(super) table: Table,
    pub(super) columns: Vec<Column>,
    pub(super) rows: u64,
    content: Content<W>,
}

enum Content<W: Write + Send> {
    /// A text file being written, a buffer, and the conversion of rows to text.
    Text {
        out: Hashed<W>,
        text: Vec<u8>,
        print: fn(&[Column], &Batch, &mut Vec<u8>),
    },
    Parquet(ParquetFile<Hashed<W>>),
    /// A table of a shared database.
    Rows(Database),
}

/// The database of an export. Several tables write to it.
pub(super) type Database = Arc<Mutex<Snapshot>>;

/// Begins the database of an export in a folder.
pub(super) fn database(folder: &Path) -> Result<Database, StoreError> {
    Ok(Arc::new(Mutex::new(Snapshot::create(&folder.join(DATABASE))?)))
}

/// The destination of a table.
pub(super) enum Place<W> {
    /// A separate file with this name.
    File(String, W),
    /// A shared database.
    Database(Database),
}

impl<W: Write + Send> TableFile<W> {
    /// Begins a table.
    pub(super) fn begin(
        format: Format,
        table: Table,
        mut columns: Vec<Column>,
        place: Place<W>,
    ) -> io::Result<Self> {
        let text = Vec::new();
        let (name, content) = match place {
            Place::File(name, out) => {
                let mut out = Hashed::new(out);
                let content = match format {
                    Format::Jsonl => Content::Text { out, text, print: json_rows },
                    Format::Parquet => Content::Parquet(ParquetFile::begin(out, &columns)?),
                    Format::Csv | Format::PsychDs | Format::Sqlite => {
                        out.write_all(&csv_header(&columns))?;
                        Content::Text { out, text, print: csv_rows }
                    }
                };
                (name, content)
            }
            Place::Database(database) => {
                make_distinct(&mut columns);
                let types: Vec<_> =
                    columns.iter().map(|column| (&*column.name, type_of(column.kind))).collect();
                let mut open = database.lock().unwrap_or_else(PoisonError::into_inner);
                open.table(table.name(), &types, table.key()).map_err(io::Error::other)?;
                drop(open);
                (DATABASE.to_owned(), Content::Rows(database))
            }
        };
        Ok(Self { name, table, columns, rows: 0, content })
    }

    /// Adds the rows of a batch.
    pub(super) fn write(&mut self, batch: &Batch) -> io::Result<()> {
        self.rows += batch.rows() as u64;
        match &mut self.content {
            Content::Text { out, text, print } => {
                text.clear();
                print(&self.columns, batch, text);
                out.write_all(text)
            }
            Content::Parquet(file) => file.write(batch),
            Content::Rows(database) => {
                let mut open = database.lock().unwrap_or_else(PoisonError::into_inner);
                let rows = (0..batch.rows()).map(|row| batch.columns().iter().map(cell(row)));
                open.add(self.table.name(), batch.columns().len(), rows).map_err(io::Error::other)
            }
        }
    }

    /// Closes the file, if the table has a separate file.
    pub(super) fn finish(self) -> io::Result<Option<Hashed<W>>> {
        match self.content {
            Content::Text { out, .. } => Ok(Some(out)),
            Content::Parquet(file) => file.finish().map(Some),
            Content::Rows(_) => Ok(None),
        }
    }
}

/// The SQLite type of a column.
pub(super) fn type_of(kind: Kind) -> Type {
    match kind {
        Kind::Whole => Type::Whole,
        Kind::Number | Kind::Time => Type::Number,
        Kind::Text | Kind::Word | Kind::Hash | Kind::Json => Type::Text,
    }
}

/// The value of a column in this row.
fn cell(row: usize) -> impl for<'a> Fn(&'a Cells) -> Value<'a> {
    move |cells| {
        let value = match cells {
            Cells::Whole(cells) => cells[row].map(Value::Whole),
            Cells::Number(cells) => cells[row].map(Value::Number),
            Cells::Text(cells) => cells.get(row).map(Value::Text),
        };
        value.unwrap_or(Value::Null)
    }
}

/// Appends a number to the names of columns that differ only in case, because SQLite treats them as equal.
fn make_distinct(columns: &mut [Column]) {
    let mut known = BTreeSet::new();
    for column in columns {
        let name = column.name.clone();
        let mut number = 1;
        while !known.insert(column.name.to_lowercase()) {
            number += 1;
            column.name = format!("{name}_{number}").into();
        }
    }
}
