//! Rows of any table.

use super::columns::Table;
use crate::store::StoreError;
use crate::store::sql::{Connection, Kind, Row, ToSql, Value};
use sha2::{Digest, Sha256};

/// Rows of a table, in order.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    rows: Vec<Vec<Value<'static>>>,
    /// The numbers of the rows, if they are trials.
    numbers: Vec<i64>,
}

impl Rows {
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Adds other rows of the same table.
    pub(super) fn append(&mut self, mut more: Self) {
        self.rows.append(&mut more.rows);
        self.numbers.append(&mut more.numbers);
    }

    /// Each row as its own [`Rows`].
    pub(super) fn apart(&self) -> impl Iterator<Item = Self> {
        self.rows.iter().enumerate().map(|(at, row)| Self {
            rows: vec![row.clone()],
            numbers: self.numbers.get(at).copied().into_iter().collect(),
        })
    }

    /// The texts in the first column.
    pub(super) fn keys(&self) -> impl Iterator<Item = &str> {
        self.rows.iter().filter_map(|row| match row.first() {
            Some(Value::Text(text)) => Some(&**text),
            _ => None,
        })
    }

    /// A value in the first row, for tables with one row per participant.
    pub(super) fn value_mut(&mut self, table: &Table, column: &str) -> Option<&mut Value<'static>> {
        let place = table.columns.iter().position(|(name, _)| *name == column)?;
        self.rows.first_mut()?.get_mut(place)
    }

    /// An integer, or a Boolean as 1 or 0, in the first row, for tables with one row per participant.
    pub(super) fn number(&self, table: &Table, column: &str) -> Option<i64> {
        let place = table.columns.iter().position(|(name, _)| *name == column)?;
        match self.rows.first()?.get(place)? {
            Value::Integer(number) => Some(*number),
            Value::Truth(truth) => Some(i64::from(*truth)),
            _ => None,
        }
    }

    /// Hashes the number of rows, and each value with its kind and length.
    pub(super) fn hash(&self, hasher: &mut Sha256) {
        hasher.update((self.rows.len() as u64).to_le_bytes());
        for value in self.rows.iter().flatten() {
            let mut sized = |kind: u8, bytes: &[u8]| {
                hasher.update([kind]);
                hasher.update((bytes.len() as u64).to_le_bytes());
                hasher.update(bytes);
            };
            match value {
                Value::Null(_) => sized(0, &[]),
                Value::Integer(number) => sized(1, &number.to_le_bytes()),
                Value::Real(number) => sized(2, &number.to_bits().to_le_bytes()),
                Value::Text(text) => sized(3, text.as_bytes()),
                Value::Bytes(bytes) => sized(4, bytes),
                Value::Truth(truth) => sized(5, &[(*truth).into()]),
            }
        }
    }
}

/// A table's rows that belong to the participant or analysis with this id. Without an id, returns all
/// rows.
pub(super) fn read(db: &Connection, table: &Table, id: Option<&str>) -> Result<Rows, StoreError> {
    match id {
        Some(id) => read_where(db, table, table.of, Some(&id)),
        None => read_where(db, table, "TRUE", None),
    }
}

/// The rows of a table that satisfy a condition on $1.
pub(super) fn read_where(
    db: &Connection,
    table: &Table,
    condition: &str,
    of: Option<&dyn ToSql>,
) -> Result<Rows, StoreError> {
    let number = if table.is_numbered { ", sequence" } else { "" };
    let query = format!(
        "SELECT {}{number} FROM {} WHERE {condition} ORDER BY {}",
        table.names(),
        table.name,
        table.order
    );
    let mut rows = Rows::default();
    let row = |row: &Row| {
        for at in 0..usize::from(table.is_numbered) {
            rows.numbers.push(row.get(table.columns.len() + at)?);
        }
        let kinds = table.columns.iter().enumerate();
        kinds.map(|(at, (_, kind))| value(row, at, *kind)).collect::<Result<Vec<_>, StoreError>>()
    };
    let mut statement = db.prepare_cached(&query)?;
    let found = match of {
        Some(of) => statement.query_and_then(&[of][..], row)?,
        None => statement.query_and_then([], row)?,
    };
    rows.rows = found.collect::<Result<_, _>>()?;
    Ok(rows)
}

fn value(row: &Row, at: usize, kind: Kind) -> Result<Value<'static>, StoreError> {
    let found = match kind {
        Kind::Integer => row.get::<_, Option<i64>>(at)?.map(Value::Integer),
        Kind::Real => row.get::<_, Option<f64>>(at)?.map(Value::Real),
        Kind::Text => row.get::<_, Option<String>>(at)?.map(|text| Value::Text(text.into())),
        Kind::Bytes => row.get::<_, Option<Vec<u8>>>(at)?.map(|bytes| Value::Bytes(bytes.into())),
        Kind::Truth => row.get::<_, Option<bool>>(at)?.map(Value::Truth),
    };
    Ok(found.unwrap_or(Value::Null(kind)))
}

/// Stores rows. `owner` is the number of the study or analysis that the rows belong to. `shift` is
/// added to the numbers of trials.
pub(super) fn insert(
    db: &Connection,
    table: &Table,
    rows: &Rows,
    owner: i64,
    shift: i64,
) -> Result<(), StoreError> {
    let mut names: Vec<&str> = table.columns.iter().map(|(name, _)| *name).collect();
    if table.is_made {
        let set = |(i, name): (usize, &&str)| format!("{name} = ${}", i + 1);
        let sets: Vec<String> = names.iter().enumerate().skip(1).map(set).collect();
        let query = format!("UPDATE {} SET {} WHERE {}", table.name, sets.join(", "), table.of);
        for row in &rows.rows {
            db.execute(&query, &row[..])?;
        }
        return Ok(());
    }
    names.extend(table.owner);
    names.extend(table.is_numbered.then_some("sequence"));
    let places: Vec<String> = (1..=names.len()).map(|place| format!("${place}")).collect();
    let query =
        format!("INSERT INTO {} ({}) VALUES ({})", table.name, names.join(", "), places.join(", "));
    let mut statement = db.prepare_cached(&query)?;
    for (i, row) in rows.rows.iter().enumerate() {
        let number = rows.numbers.get(i).map(|number| number + shift);
        let mut values: Vec<&dyn ToSql> = row.iter().map(|value| value as _).collect();
        if table.owner.is_some() {
            values.push(&owner);
        }
        if let Some(number) = &number {
            values.push(number);
        }
        statement.execute(&values[..])?;
    }
    Ok(())
}
