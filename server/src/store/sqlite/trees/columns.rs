//! Constraints on the rows of a table.

use super::super::connection;
use super::super::file::DatabaseFile;
use crate::store::sql;

/// The type of the values that a column accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Integer,
    Real,
    Text,
    Blob,
    Any,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    kind: Kind,
    /// Whether the column is NOT NULL.
    is_required: bool,
    /// Whether the column has a default value for rows that are older than the column.
    has_default: bool,
}

impl Column {
    /// Whether the column accepts a value of this serial type.
    fn takes(self, serial_type: u64) -> bool {
        match serial_type {
            0 => !self.is_required,
            1..=6 | 8 | 9 => matches!(self.kind, Kind::Integer | Kind::Real | Kind::Any),
            7 => matches!(self.kind, Kind::Real | Kind::Any),
            10 | 11 => false,
            even if even % 2 == 0 => matches!(self.kind, Kind::Blob | Kind::Any),
            _ => matches!(self.kind, Kind::Text | Kind::Any),
        }
    }
}

pub(super) struct Table {
    /// The root page of its b-tree.
    pub(super) root: u32,
    pub(super) columns: Vec<Column>,
}

impl Table {
    /// The schema table.
    pub(super) fn of_schema() -> Self {
        let kinds = [Kind::Text, Kind::Text, Kind::Text, Kind::Integer, Kind::Text];
        let column = |kind| Column { kind, is_required: kind == Kind::Integer, has_default: false };
        Self { root: 1, columns: kinds.map(column).to_vec() }
    }

    /// Whether a row with values of these serial types can belong to this table. A row that is
    /// older than a column has no value for it.
    pub(super) fn takes(&self, row: &[u64]) -> bool {
        // The first value of a schema row is "view", "table", "index" or "trigger". The numbers are
        // the serial types of these texts.
        if self.root == 1 && (row.len() < self.columns.len() || !matches!(row[0], 21 | 23 | 27)) {
            return false;
        }
        let later = self.columns.get(row.len()..);
        later.is_some_and(|later| {
            later.iter().all(|column| !column.is_required || column.has_default)
        }) && row.iter().zip(&self.columns).all(|(value, column)| column.takes(*value))
    }
}

/// The tables with rowids.
pub(super) fn tables(file: &DatabaseFile) -> sql::Result<Vec<Table>> {
    let query = "SELECT rootpage, info.type, info.\"notnull\" AND NOT info.pk, info.dflt_value IS NOT NULL \
                 FROM sqlite_schema AS own, pragma_table_list(own.name) AS list, pragma_table_xinfo(own.name) AS info \
                 WHERE own.type = 'table' AND own.name NOT LIKE 'sqlite%' AND list.schema = 'main' AND NOT list.wr \
                     AND info.hidden <> 2 \
                 ORDER BY rootpage, info.cid";
    let db = connection::without_log(file)?;
    let mut statement = db.prepare_cached(query)?;
    let columns = statement.query_map([], |row| {
        let kind = match &*row.get::<_, String>(1)? {
            "INTEGER" | "INT" => Kind::Integer,
            "REAL" => Kind::Real,
            "TEXT" => Kind::Text,
            "BLOB" => Kind::Blob,
            _ => Kind::Any,
        };
        let column = Column { kind, is_required: row.get(2)?, has_default: row.get(3)? };
        Ok((row.get::<_, i64>(0)?, column))
    })?;
    let mut tables: Vec<Table> = Vec::new();
    for column in columns {
        let (root, column) = column?;
        let Ok(root) = u32::try_from(root) else { continue };
        match tables.last_mut() {
            Some(table) if table.root == root => table.columns.push(column),
            _ => tables.push(Table { root, columns: vec![column] }),
        }
    }
    Ok(tables)
}
