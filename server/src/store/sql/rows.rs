//! Statements for many rows of parameters.

use super::row::Row;
use super::value::Value;
use std::collections::HashMap;

/// Maximum number of rows per execution. A statement is prepared for each power of two up to this number.
const MOST_ROWS: usize = 32;

/// A statement for any number of rows of parameters.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::store) struct Rows {
    /// The text before the rows, `… VALUES `.
    pub(in crate::store) before: &'static str,
    /// The text after the rows.
    pub(in crate::store) after: &'static str,
}

impl Rows {
    /// The text for `count` rows of `width` parameters. PostgreSQL requires numbered parameters. In
    /// SQLite, the time to bind numbered parameters grows with the square of their count.
    pub(super) fn text(&self, count: usize, width: usize, is_sqlite: bool) -> String {
        let parameter = |number: usize| match is_sqlite {
            true => "?".to_owned(),
            false => format!("${number}"),
        };
        let row = |row: usize| {
            let parameters = (1..=width).map(|i| parameter(row * width + i));
            format!("({})", parameters.collect::<Vec<_>>().join(", "))
        };
        let rows: Vec<String> = (0..count).map(row).collect();
        format!("{}{}{}", self.before, rows.join(", "), self.after)
    }
}

/// The text of an execution, with its parameters.
type Execution = (String, Vec<Value<'static>>);

impl Rows {
    /// Splits these rows of parameters into executions. The number of rows of each execution is a
    /// power of two.
    pub(super) fn executions(
        &self,
        mut values: Vec<Vec<Value<'static>>>,
        is_sqlite: bool,
    ) -> Vec<Execution> {
        let mut executions = Vec::new();
        while !values.is_empty() {
            let count = (1 << values.len().ilog2()).min(MOST_ROWS);
            let rest = values.split_off(count);
            let width = values.first().map_or(0, Vec::len);
            executions.push((self.text(count, width, is_sqlite), values.concat()));
            values = rest;
        }
        executions
    }
}

/// Prefetched query results by target: the parameters, and the row if one was found.
pub(super) type Asked = HashMap<String, (Vec<Value<'static>>, Option<Row>)>;

/// A question for [`ask_ahead`](super::Connection::ask_ahead): a query, and a row of its parameters.
pub(in crate::store) type Question = (&'static Rows, Vec<Value<'static>>);

/// Deferred rows of a statement.
#[derive(Debug)]
struct Group {
    rows: &'static Rows,
    targets: Vec<String>,
    values: Vec<Vec<Value<'static>>>,
}

/// The deferred rows of a connection, in the order of their first rows.
#[derive(Debug, Default)]
pub(super) struct Waiting(Vec<Group>);

impl Waiting {
    /// Takes the statements for all deferred rows, with their parameters.
    pub(super) fn take(&mut self, is_sqlite: bool) -> Vec<Execution> {
        let groups = std::mem::take(&mut self.0).into_iter();
        groups.flat_map(|group| group.rows.executions(group.values, is_sqlite)).collect()
    }

    /// Discards all deferred rows.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Whether a deferred row has this target.
    pub(super) fn has(&self, target: &str) -> bool {
        self.0.iter().any(|group| group.targets.iter().any(|known| known == target))
    }

    /// Adds a row. Returns `false`, and adds nothing, if the statement already has a row with one of
    /// these targets.
    pub(super) fn add(
        &mut self,
        rows: &'static Rows,
        targets: &[&str],
        values: &[Value<'_>],
    ) -> bool {
        let at = self.0.iter().position(|group| group.rows == rows);
        let at = at.unwrap_or_else(|| {
            self.0.push(Group { rows, targets: Vec::new(), values: Vec::new() });
            self.0.len() - 1
        });
        let Some(group) = self.0.get_mut(at) else { return false };
        if targets.iter().any(|target| group.targets.iter().any(|known| known == target)) {
            return false;
        }
        group.targets.extend(targets.iter().map(|&target| target.to_owned()));
        group.values.push(values.iter().cloned().map(Value::into_owned).collect());
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_numbered_from_row_to_row() {
        let rows = Rows { before: "INSERT INTO t VALUES ", after: " RETURNING a" };
        let text = |count, width, is_sqlite| rows.text(count, width, is_sqlite);
        assert_eq!(text(1, 3, false), "INSERT INTO t VALUES ($1, $2, $3) RETURNING a");
        assert_eq!(text(2, 2, false), "INSERT INTO t VALUES ($1, $2), ($3, $4) RETURNING a");
        assert_eq!(text(2, 2, true), "INSERT INTO t VALUES (?, ?), (?, ?) RETURNING a");
    }

    #[test]
    fn rows_of_a_statement_go_together_and_have_different_targets() {
        static ADD: Rows = Rows { before: "INSERT INTO t VALUES ", after: "" };
        let mut waiting = Waiting::default();
        for row in 0..37 {
            assert!(waiting.add(&ADD, &[&row.to_string()], &[Value::Integer(row)]));
        }
        assert!(!waiting.add(&ADD, &["other", "7"], &[Value::Integer(7)]));
        assert!(waiting.has("7") && !waiting.has("other"));
        let executions = waiting.take(true);
        let counts: Vec<_> = executions.iter().map(|(_, values)| values.len()).collect();
        assert_eq!(counts, [32, 4, 1]);
        let last = executions.iter().flat_map(|(_, values)| values).next_back();
        assert_eq!(last, Some(&Value::Integer(36)));
        assert!(waiting.take(true).is_empty());
        assert!(waiting.add(&ADD, &["7"], &[Value::Integer(7)]));
    }
}
