//! Statements for many rows of parameters, and questions whose answers many operations need.

use super::Params;
use super::value::{Owned, Value};

/// Most rows of one execution. A statement is prepared for each power of two up to this.
const MOST_ROWS: usize = 32;

/// A statement for any number of rows of parameters.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::store) struct Rows {
    /// Its text up to the rows, `… VALUES `.
    pub(in crate::store) before: &'static str,
    /// Its text after them.
    pub(in crate::store) after: &'static str,
}

impl Rows {
    /// Its text for `count` rows of `width` parameters.
    pub(super) fn text(&self, count: usize, width: usize) -> String {
        let row = |row: usize| {
            let numbers = (1..=width).map(|i| format!("?{}", row * width + i));
            format!("({})", numbers.collect::<Vec<_>>().join(", "))
        };
        let rows: Vec<String> = (0..count).map(row).collect();
        format!("{}{}{}", self.before, rows.join(", "), self.after)
    }
}

/// A query with its parameters.
#[derive(Clone, Debug)]
pub(in crate::store) struct Question {
    /// The query.
    pub(super) sql: String,
    values: Vec<Owned>,
}

impl Question {
    /// The question that a statement with this text asks when it is given these parameters.
    pub(in crate::store) fn new(sql: &str, params: impl Params) -> Self {
        let values = params.values().iter().map(|(_, value)| value.owned()).collect();
        Self { sql: sql.to_owned(), values }
    }

    /// Its parameters.
    pub(super) fn values(&self) -> Vec<Value<'_>> {
        self.values.iter().map(Owned::value).collect()
    }

    fn is(&self, sql: &str, values: &[Value<'_>]) -> bool {
        self.sql == sql && self.values() == values
    }
}

/// Rows that wait for the execution of their statement.
struct Group {
    rows: &'static Rows,
    targets: Vec<String>,
    values: Vec<Vec<Owned>>,
}

impl Group {
    /// The texts of as few executions as there may be, each with its parameters.
    fn executions(self) -> Vec<(String, Vec<Owned>)> {
        let (mut values, mut executions) = (self.values, Vec::new());
        while !values.is_empty() {
            let count = (1 << values.len().ilog2()).min(MOST_ROWS);
            let rest = values.split_off(count);
            let width = values.first().map_or(0, Vec::len);
            executions.push((self.rows.text(count, width), values.concat()));
            values = rest;
        }
        executions
    }
}

/// What a session has yet to do for rows, and what it was told ahead.
#[derive(Default)]
pub(super) struct Ahead {
    /// In the order of their first rows.
    groups: Vec<Group>,
    answers: Vec<(Question, Vec<tokio_postgres::Row>)>,
}

impl Ahead {
    /// Forgets rows and answers.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The answer to a question that was asked ahead.
    pub(super) fn answer(
        &mut self,
        sql: &str,
        values: &[Value<'_>],
    ) -> Option<Vec<tokio_postgres::Row>> {
        let at = self.answers.iter().position(|(question, _)| question.is(sql, values))?;
        Some(self.answers.swap_remove(at).1)
    }

    /// Remembers answers to questions.
    pub(super) fn remember(
        &mut self,
        questions: &[&Question],
        answers: Vec<Vec<tokio_postgres::Row>>,
    ) {
        self.answers = questions.iter().copied().cloned().zip(answers).collect();
    }

    /// The statements of all rows, which wait no longer, with their parameters.
    pub(super) fn take_rows(&mut self) -> Vec<(String, Vec<Owned>)> {
        std::mem::take(&mut self.groups).into_iter().flat_map(Group::executions).collect()
    }

    /// Adds a row; false if its statement has one with this target already.
    pub(super) fn add(&mut self, rows: &'static Rows, target: &str, values: &[Value<'_>]) -> bool {
        let at = self.groups.iter().position(|group| group.rows == rows);
        let at = at.unwrap_or_else(|| {
            self.groups.push(Group { rows, targets: Vec::new(), values: Vec::new() });
            self.groups.len() - 1
        });
        let Some(group) = self.groups.get_mut(at) else { return false };
        if group.targets.iter().any(|known| known == target) {
            return false;
        }
        group.targets.push(target.to_owned());
        group.values.push(values.iter().map(Value::owned).collect());
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_numbered_from_row_to_row() {
        let rows = Rows { before: "INSERT INTO t VALUES ", after: " RETURNING a" };
        assert_eq!(rows.text(1, 3), "INSERT INTO t VALUES (?1, ?2, ?3) RETURNING a");
        assert_eq!(rows.text(2, 2), "INSERT INTO t VALUES (?1, ?2), (?3, ?4) RETURNING a");
    }

    #[test]
    fn rows_of_a_statement_go_together_and_have_different_targets() {
        static ADD: Rows = Rows { before: "INSERT INTO t VALUES ", after: "" };
        let mut ahead = Ahead::default();
        for row in 0..37 {
            assert!(ahead.add(&ADD, &row.to_string(), &[Value::Integer(row)]));
        }
        assert!(!ahead.add(&ADD, "7", &[Value::Integer(7)]));
        let executions = ahead.take_rows();
        let counts: Vec<_> = executions.iter().map(|(_, values)| values.len()).collect();
        assert_eq!(counts, [32, 4, 1]);
        let last = executions.iter().flat_map(|(_, values)| values).map(Owned::value).next_back();
        assert_eq!(last, Some(Value::Integer(36)));
        assert!(ahead.take_rows().is_empty());
        assert!(ahead.add(&ADD, "7", &[Value::Integer(7)]));
    }
}
