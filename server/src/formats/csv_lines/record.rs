//! The fields of a row.

use sidestep::invalid::Invalid;
use std::cell::Cell;
use std::ops::Index;

/// The decimal mark of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decimal {
    Point,
    Comma,
}

/// The fields of a row.
#[derive(Clone, Debug, Default)]
pub struct Record {
    text: String,
    /// The end of each field in the text, and the start of the next field.
    fields: Vec<(usize, usize)>,
    /// Whether the delimiter is a comma. If so, only quoted fields contain commas, and these commas
    /// can separate thousands.
    by_commas: bool,
    /// The decimal mark of the file's numbers so far.
    decimal: Cell<Option<Decimal>>,
}

impl Record {
    /// A row of a file with this delimiter.
    pub(super) fn separated_by(separator: u8) -> Self {
        Self { by_commas: separator == b',', ..Self::default() }
    }

    /// The number of fields.
    #[must_use]
    pub fn len(&self) -> usize {
        self.fields.len()
    }

    /// Whether there is no field.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.fields.is_empty()
    }

    /// The field at a place, if any.
    #[must_use]
    pub fn get(&self, place: usize) -> Option<&str> {
        let (end, _) = *self.fields.get(place)?;
        let begin = if place == 0 { 0 } else { self.fields[place - 1].1 };
        Some(&self.text[begin..end])
    }

    /// The fields in order.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.len()).map(|place| &self[place])
    }

    /// The number at a place in the column `name`. The first number with a comma or a point sets the
    /// file's decimal mark. A later number with the other mark is an error.
    ///
    /// # Errors
    /// [`Invalid`] naming the column.
    pub fn number(&self, place: usize, name: &str) -> Result<f64, Invalid> {
        let text = self.get(place).unwrap_or("").trim();
        let refused = |expected: &str| {
            let found: String = text.chars().take(60).collect();
            Err(Invalid::new(name, expected, format!("{found:?}")))
        };
        let parsed = |text: &str| match text.parse() {
            Ok(number) => Ok(number),
            Err(_) => refused("a number"),
        };
        let found = match (text.contains(','), text.contains('.')) {
            (false, false) => return parsed(text),
            (true, true) => return refused("a number without marks between thousands"),
            (true, false)
                if self.by_commas && self.decimal.get().is_none() && may_be_thousands(text) =>
            {
                return refused(
                    "a number without marks between thousands, or with a decimal comma in a table with columns between \
                     semicolons",
                );
            }
            (true, false) => Decimal::Comma,
            (false, true) => Decimal::Point,
        };
        let number = match found {
            Decimal::Point => parsed(text)?,
            Decimal::Comma => match text.replacen(',', ".", 1).parse() {
                Ok(number) => number,
                Err(_) => return refused("a number"),
            },
        };
        match self.decimal.replace(Some(found)) {
            Some(before) if before != found => {
                self.decimal.set(Some(before));
                refused(match before {
                    Decimal::Point => "a decimal point, as the numbers before have",
                    Decimal::Comma => "a decimal comma, as the numbers before have",
                })
            }
            _ => Ok(number),
        }
    }

    /// The decimal mark of the file's numbers so far.
    pub(super) fn decimal(&self) -> Option<Decimal> {
        self.decimal.get()
    }

    pub(super) fn clear(&mut self) {
        self.text.clear();
        self.fields.clear();
    }

    /// Splits a line without quotation marks.
    pub(super) fn split(&mut self, line: &str, separator: u8) {
        self.clear();
        self.text.push_str(line);
        self.fields.extend(memchr::memchr_iter(separator, line.as_bytes()).map(|at| (at, at + 1)));
        self.fields.push((line.len(), line.len()));
    }

    /// Adds a field.
    pub(super) fn push(&mut self, field: &str) {
        self.text.push_str(field);
        self.fields.push((self.text.len(), self.text.len()));
    }
}

/// Whether each comma is followed by three digits, as in 1,000.
fn may_be_thousands(text: &str) -> bool {
    let (whole, rest) = text.split_once(',').unwrap_or((text, ""));
    let whole = whole.trim_start_matches(['-', '+']);
    let is_whole = (1..=3).contains(&whole.len()) && !whole.starts_with('0');
    is_whole && rest.split(',').all(|part| part.len() == 3)
}

impl Index<usize> for Record {
    type Output = str;

    fn index(&self, place: usize) -> &str {
        self.get(place).unwrap_or_else(|| panic!("field {place} of {}", self.len()))
    }
}
