//! The formats of an export, and the names of its files.

use super::table::Table;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The format of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "ExportFormat")]
pub enum Format {
    /// Comma-separated text with a header.
    Csv,
    /// A JSON object for each row.
    Jsonl,
    /// Apache Parquet.
    Parquet,
    /// A folder of the Psych-DS standard with CSV files.
    PsychDs,
    /// One SQLite database.
    Sqlite,
}

impl Format {
    /// The word for the format on the command line and in URLs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Jsonl => "jsonl",
            Self::Parquet => "parquet",
            Self::PsychDs => "psych-ds",
            Self::Sqlite => "sqlite",
        }
    }

    /// How a missing value is written.
    pub(super) fn missing(self) -> &'static str {
        match self {
            Self::Csv | Self::PsychDs => "an empty field",
            Self::Jsonl | Self::Parquet => "null",
            Self::Sqlite => "NULL",
        }
    }

    /// Number of rows per batch. Row groups of a Parquet file should be long. Text batches are short,
    /// so that the text is written while it is still in the processor's cache.
    pub(super) fn batch_rows(self) -> usize {
        match self {
            Self::Csv | Self::Jsonl | Self::PsychDs => 1,
            Self::Sqlite => 1 << 12,
            Self::Parquet => 1 << 15,
        }
    }

    /// The path of a table's file in the export of a study.
    pub(super) fn file(self, study: &str, table: Table) -> String {
        let name = table.name();
        match self {
            Self::Csv => format!("{name}.csv"),
            Self::Jsonl => format!("{name}.jsonl"),
            Self::Parquet => format!("{name}.parquet"),
            Self::PsychDs => {
                // In Psych-DS file names, keywords contain only letters, and values contain only
                // letters and digits.
                let value = |text: &str| -> String {
                    text.chars().filter(char::is_ascii_alphanumeric).collect()
                };
                let (study, name) = (value(study), value(name));
                format!("data/study-{study}_description-{name}_data.csv")
            }
            Self::Sqlite => DATABASE.to_owned(),
        }
    }

    /// The folder for files that are not tables, with a trailing slash.
    pub(super) fn beside(self) -> &'static str {
        match self {
            Self::PsychDs => "documentation/",
            _ => "",
        }
    }
}

/// The name of the file of a SQLite export.
pub(super) const DATABASE: &str = "study.sqlite";
