//! Statements for many rows of parameters, and questions whose answers many operations need.

use super::placeholders::Translated;
use super::session::Session;
use super::value::{Owned, Value};
use super::{Params, Result};

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
    sql: String,
    /// Its parameters.
    values: Vec<Owned>,
}

impl Question {
    /// The question that a statement with this text asks when it is given these parameters.
    pub(in crate::store) fn new(sql: &str, params: impl Params) -> Self {
        let values = params.values().iter().map(|(_, value)| value.owned()).collect();
        Self { sql: sql.to_owned(), values }
    }

    fn is(&self, sql: &str, values: &[Value<'_>]) -> bool {
        self.sql == sql && self.values.iter().map(Owned::value).eq(values.iter().copied())
    }
}

/// Rows that wait for the execution of their statement.
struct Group {
    rows: &'static Rows,
    targets: Vec<String>,
    values: Vec<Vec<Owned>>,
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

    /// Adds a row; false if its statement has one with this target already.
    fn add(&mut self, rows: &'static Rows, target: &str, values: &[Value<'_>]) -> bool {
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

impl Session {
    /// Adds a row to those of its statement.
    pub(super) fn execute_row_later(
        &self,
        rows: &'static Rows,
        target: &str,
        values: &[(Option<&str>, Value<'_>)],
    ) -> Result<()> {
        let values: Vec<Value<'_>> = values.iter().map(|(_, value)| *value).collect();
        if self.ahead.borrow_mut().add(rows, target, &values) {
            return Ok(());
        }
        self.put_off_rows()?;
        self.ahead.borrow_mut().add(rows, target, &values);
        Ok(())
    }

    /// Puts off the statements of all rows.
    pub(super) fn put_off_rows(&self) -> Result<()> {
        let groups = std::mem::take(&mut self.ahead.borrow_mut().groups);
        for Group { rows, mut values, .. } in groups {
            while !values.is_empty() {
                let count = (1 << values.len().ilog2()).min(MOST_ROWS);
                let rest = values.split_off(count);
                let width = values.first().map_or(0, Vec::len);
                let text = self.translated(&rows.text(count, width));
                self.put_off(&text, std::mem::replace(&mut values, rest).concat())?;
            }
        }
        Ok(())
    }

    /// Asks questions, all at once.
    pub(super) fn ask_ahead<'q>(
        &self,
        questions: impl Iterator<Item = &'q Question>,
    ) -> Result<()> {
        let asked: Vec<_> = questions
            .map(|question| {
                let text: std::sync::Arc<Translated> = self.translated(&question.sql);
                let values: Vec<Value<'_>> = question.values.iter().map(Owned::value).collect();
                Ok((question, self.prepared(&text, &values)?, values))
            })
            .collect::<Result<_>>()?;
        let answers =
            self.query_all(asked.iter().map(|(_, statement, values)| (statement, values)))?;
        let questions = asked.into_iter().map(|(question, ..)| question.clone());
        self.ahead.borrow_mut().answers = questions.zip(answers).collect();
        Ok(())
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
}
