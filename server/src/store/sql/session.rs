//! A session of PostgreSQL with the statements that it has prepared.

use super::placeholders::Translated;
use super::value::{Kind, Value};
use super::{Error, Result};
use crate::store::error::StoreError;
use postgres::types::{ToSql, Type};
use postgres::{Client, Row, Statement};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

/// Most statements that stay prepared; the store has fewer, but for lists that are filtered in many ways.
const MOST_PREPARED: usize = 256;

/// A session.
pub(in crate::store) struct Session {
    client: RefCell<Client>,
    known: RefCell<HashMap<String, Known>>,
}

/// A statement, prepared for each combination of types that it was used with.
struct Known {
    translated: Arc<Translated>,
    prepared: Vec<(Vec<Kind>, Statement)>,
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session").finish_non_exhaustive()
    }
}

impl Session {
    pub(super) fn new(client: Client) -> Self {
        Self { client: RefCell::new(client), known: RefCell::default() }
    }

    /// Whether it can be used no more.
    pub(super) fn is_closed(&self) -> bool {
        self.client.borrow().is_closed()
    }

    /// Statements without parameters and rows, in one message.
    pub(super) fn batch(&self, sql: &str) -> Result<()> {
        Ok(self.client.borrow_mut().batch_execute(sql)?)
    }

    /// The statement as PostgreSQL writes it.
    pub(super) fn translated(&self, sql: &str) -> Arc<Translated> {
        let mut known = self.known.borrow_mut();
        if let Some(known) = known.get(sql) {
            return Arc::clone(&known.translated);
        }
        if known.len() >= MOST_PREPARED {
            known.clear();
        }
        let translated = Arc::new(Translated::of(sql));
        let new = Known { translated: Arc::clone(&translated), prepared: Vec::new() };
        known.insert(sql.to_owned(), new);
        translated
    }

    /// The number of rows that a statement changes.
    pub(super) fn execute(
        &self,
        text: &Translated,
        values: &[(Option<&str>, Value<'_>)],
    ) -> Result<usize> {
        let values = in_order(text, values)?;
        let statement = self.prepared(text, &values)?;
        let changed = self.client.borrow_mut().execute(&statement, &references(&values))?;
        Ok(usize::try_from(changed).unwrap_or(usize::MAX))
    }

    /// The rows that a statement finds.
    pub(super) fn query(
        &self,
        text: &Translated,
        values: &[(Option<&str>, Value<'_>)],
    ) -> Result<Vec<Row>> {
        let values = in_order(text, values)?;
        let statement = self.prepared(text, &values)?;
        Ok(self.client.borrow_mut().query(&statement, &references(&values))?)
    }

    fn prepared(&self, text: &Translated, values: &[Value<'_>]) -> Result<Statement> {
        let kinds: Vec<Kind> = values.iter().map(Value::kind).collect();
        if let Some(known) = self.known.borrow().get(&text.source)
            && let Some((_, statement)) = known.prepared.iter().find(|(known, _)| *known == kinds)
        {
            return Ok(statement.clone());
        }
        let types: Vec<Type> = kinds.iter().map(|kind| kind.postgres()).collect();
        let statement = self.client.borrow_mut().prepare_typed(&text.text, &types)?;
        if let Some(known) = self.known.borrow_mut().get_mut(&text.source) {
            known.prepared.push((kinds, statement.clone()));
        }
        Ok(statement)
    }
}

/// The values by their numbers.
fn in_order<'a>(text: &Translated, values: &[(Option<&str>, Value<'a>)]) -> Result<Vec<Value<'a>>> {
    if text.names.is_empty() {
        return Ok(values.iter().map(|(_, value)| *value).collect());
    }
    let find = |name: &String| {
        let found = values.iter().find(|(known, _)| *known == Some(name.as_str()));
        let missing = || StoreError::Defect(format!("the parameter {name} has no value"));
        found.map(|(_, value)| *value).ok_or_else(|| Error::Store(missing()))
    };
    text.names.iter().map(find).collect()
}

fn references<'a>(values: &'a [Value<'_>]) -> Vec<&'a (dyn ToSql + Sync)> {
    values.iter().map(|value| value as &(dyn ToSql + Sync)).collect()
}
