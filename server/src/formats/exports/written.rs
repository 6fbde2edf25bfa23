//! The content of an export, as needed for its dictionary and its other descriptions.

use super::table::Table;
use crate::formats::table::Column;

/// A table that was written.
#[derive(Clone, Debug)]
pub(super) struct Written {
    pub(super) name: String,
    pub(super) table: Table,
    pub(super) columns: Vec<Column>,
}

/// A file that is not a table.
#[derive(Clone, Debug)]
pub(super) struct Plain {
    pub(super) name: String,
    pub(super) rows: u64,
    pub(super) content: Vec<u8>,
}

impl Plain {
    pub(super) fn new(name: impl Into<String>, rows: usize, content: impl Into<Vec<u8>>) -> Self {
        Self { name: name.into(), rows: rows as u64, content: content.into() }
    }
}
