//! Tables: columns with their meaning, and their rows in batches.
//!
//! One definition of a table ([`Column`]s, in `formats/tables`) determines the header of its CSV file, the
//! keys of its JSON Lines, the schema of its Parquet file and its part of the data dictionary.

mod decimal;
mod batch;
mod csv;
mod json_lines;
mod parquet;
#[cfg(test)]
mod tests;

pub use batch::{Batch, Cells, Texts};
pub use csv::{csv_header, csv_rows};
pub use json_lines::json_rows;
pub use parquet::ParquetFile;

use serde::{Serialize, Serializer};
use std::borrow::Cow;

/// The type of a column's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number.
    Whole,
    /// A number. In text it is the shortest decimal that parses to the same bits, such as `4.0` for
    /// a whole number.
    Number,
    /// A number of milliseconds. In text it is written like [`Kind::Number`], but a whole number as `4`.
    Time,
    /// Any text.
    Text,
    /// One of a few words, or an id.
    Word,
    /// A SHA-256, as hexadecimal digits.
    Hash,
    /// A value as JSON.
    Json,
}

impl Kind {
    /// The word for the kind in the dictionary.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Whole => "whole number",
            Self::Number | Self::Time => "number",
            Self::Text => "text",
            Self::Word => "word",
            Self::Hash => "hash",
            Self::Json => "JSON",
        }
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Column {
    /// The name.
    pub name: Cow<'static, str>,
    /// The type of the column's values.
    #[serde(rename = "type")]
    pub kind: Kind,
    /// The unit, if the column has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// The frame of a coordinate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<&'static str>,
    /// The possible values, if they are few or bounded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<Cow<'static, str>>,
    /// The meaning of a value.
    pub meaning: Cow<'static, str>,
}

impl Column {
    /// A column without unit, frame and range.
    pub fn new(
        name: impl Into<Cow<'static, str>>,
        kind: Kind,
        meaning: impl Into<Cow<'static, str>>,
    ) -> Self {
        let (name, meaning) = (name.into(), meaning.into());
        Self { name, kind, unit: None, frame: None, range: None, meaning }
    }

    /// Sets the unit.
    #[must_use]
    pub fn unit(self, unit: &'static str) -> Self {
        Self { unit: Some(unit), ..self }
    }

    /// Sets the frame.
    #[must_use]
    pub fn frame(self, frame: &'static str) -> Self {
        Self { frame: Some(frame), ..self }
    }

    /// Sets the range.
    #[must_use]
    pub fn range(self, range: impl Into<Cow<'static, str>>) -> Self {
        Self { range: Some(range.into()), ..self }
    }
}
