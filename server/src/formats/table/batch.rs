//! Some rows of a table, column by column.

use super::{Column, Kind};

/// The values of a column, one for each row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Values of [`Kind::Whole`].
    Whole(Vec<Option<i64>>),
    /// Values of [`Kind::Number`] and [`Kind::Time`].
    Number(Vec<Option<f64>>),
    /// Values of all other kinds.
    Text(Texts),
}

/// The texts of a column. Most texts equal the text in the previous row, so repeated texts are
/// stored only once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texts {
    /// The texts without adjacent repetitions.
    pub distinct: Vec<String>,
    /// The index of each row's text.
    pub rows: Vec<Option<u32>>,
}

impl Texts {
    fn push(&mut self, text: Option<&str>, rows: usize) {
        let place = text.map(|text| {
            if self.distinct.last().is_none_or(|last| last != text) {
                self.distinct.push(text.to_owned());
            }
            self.distinct.len() as u32 - 1
        });
        self.rows.resize(self.rows.len() + rows, place);
    }

    /// The text of a row.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<&str> {
        self.rows[row].map(|place| self.distinct[place as usize].as_str())
    }
}

/// Some rows of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    columns: Vec<Cells>,
    rows: usize,
}

impl Batch {
    /// An empty batch for a table with these columns.
    #[must_use]
    pub fn new(columns: &[Column]) -> Self {
        let cells = |column: &Column| match column.kind {
            Kind::Whole => Cells::Whole(Vec::new()),
            Kind::Number | Kind::Time => Cells::Number(Vec::new()),
            Kind::Text | Kind::Word | Kind::Hash | Kind::Json => Cells::Text(Texts::default()),
        };
        Self { columns: columns.iter().map(cells).collect(), rows: 0 }
    }

    /// The number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The columns, in order.
    #[must_use]
    pub fn columns(&self) -> &[Cells] {
        &self.columns
    }

    /// Drops the rows and keeps the allocated memory.
    pub fn clear(&mut self) {
        self.rows = 0;
        for column in &mut self.columns {
            match column {
                Cells::Whole(cells) => cells.clear(),
                Cells::Number(cells) => cells.clear(),
                Cells::Text(Texts { distinct, rows }) => {
                    distinct.clear();
                    rows.clear();
                }
            }
        }
    }

    /// Adds rows. Their values must then be set column by column, in order.
    pub fn add(&mut self, rows: usize) -> NewRows<'_> {
        self.rows += rows;
        NewRows { columns: self.columns.iter_mut(), rows }
    }
}

/// New rows of a batch, to be filled column by column.
#[derive(Debug)]
pub struct NewRows<'a> {
    columns: std::slice::IterMut<'a, Cells>,
    rows: usize,
}

impl NewRows<'_> {
    /// Sets the values of the next column, which contains whole numbers.
    ///
    /// # Panics
    /// If the next column has another type, which is a bug.
    pub fn whole(&mut self, value: impl Fn(usize) -> Option<i64>) {
        match self.columns.next() {
            Some(Cells::Whole(cells)) => cells.extend((0..self.rows).map(value)),
            other => unreachable!("expected a column of whole numbers, found {other:?}"),
        }
    }

    /// Sets the values of the next column, which contains numbers. Numbers that are not finite
    /// become missing values.
    ///
    /// # Panics
    /// If the next column has another type, which is a bug.
    pub fn number(&mut self, value: impl Fn(usize) -> Option<f64>) {
        let finite = |row: usize| value(row).filter(|value| value.is_finite());
        match self.columns.next() {
            Some(Cells::Number(cells)) => cells.extend((0..self.rows).map(finite)),
            other => unreachable!("expected a column of numbers, found {other:?}"),
        }
    }

    /// Sets the value of the next column, which contains texts, in all new rows.
    ///
    /// # Panics
    /// If the next column has another type, which is a bug.
    pub fn text<'t>(&mut self, text: impl Into<Option<&'t str>>) {
        match self.columns.next() {
            Some(Cells::Text(cells)) => cells.push(text.into(), self.rows),
            other => unreachable!("expected a column of texts, found {other:?}"),
        }
    }
}
