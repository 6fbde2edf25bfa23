//! The files of an export besides its tables: the configurations, the meaning of every column, and
//! the manifest.

use super::damage::Damage;
use super::dataset::Dataset;
use super::psych_ds;
use super::written::{Plain, Written};
use super::{ExportError, Filter, Format};
use crate::formats::table::Column;
use serde::Serialize;
use std::io;

/// The name of the manifest.
pub const MANIFEST: &str = "manifest.json";

/// The content of an export. A folder or an archive without a manifest is incomplete.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    /// Name of the study in URLs.
    pub study: String,
    /// Whether the study takes only synthetic participants. In every study, the column `synthetic`
    /// marks each trial.
    pub synthetic: bool,
    /// The time at which the export began (UTC). For an archive, the time of the last change of its
    /// data, so that the same data give the same bytes.
    pub created_at: String,
    /// Version of the program that wrote the export.
    pub version: &'static str,
    /// The format of the tables.
    pub format: Format,
    /// The filter of the export.
    pub filter: Filter,
    /// The damage in all phases, even if the filter selects one phase.
    #[serde(flatten)]
    pub damage: Damage,
    /// The files of the export, except for the manifest.
    pub files: Vec<FileEntry>,
}

impl Manifest {
    pub(super) fn new(
        dataset: &Dataset,
        format: Format,
        created_at: String,
        files: Vec<FileEntry>,
        damage: Damage,
    ) -> Self {
        Self {
            study: dataset.study.slug.clone(),
            synthetic: dataset.is_synthetic(),
            created_at,
            version: env!("CARGO_PKG_VERSION"),
            format,
            filter: dataset.filter.clone(),
            damage,
            files,
        }
    }

    /// The text of the manifest.
    pub(super) fn text(&self) -> io::Result<Vec<u8>> {
        Ok(serde_json::to_vec_pretty(self)?)
    }
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FileEntry {
    /// The path, with slashes.
    pub name: String,
    /// Number of rows of a table, total number of rows of a database, or number of entries of a list. 0
    /// for other files.
    pub rows: u64,
    /// Length (bytes).
    pub bytes: u64,
    /// SHA-256 of the content, as hexadecimal digits.
    pub sha256: String,
}

/// An entry of the dictionary.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Meaning {
    /// The file that has the column.
    pub(super) file: String,
    /// The table, if the file has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) table: Option<&'static str>,
    #[serde(flatten)]
    pub(super) column: Column,
    /// How a missing value is written. No number is NaN or infinite.
    missing: &'static str,
}

/// The meaning of every column.
pub(super) fn dictionary(format: Format, tables: &[Written]) -> Vec<Meaning> {
    let meaning = |written: &Written, column: &Column| Meaning {
        file: written.name.clone(),
        table: (format == Format::Sqlite).then(|| written.table.name()),
        column: column.clone(),
        missing: format.missing(),
    };
    let of = |written| move |column| (written, column);
    let columns = tables.iter().flat_map(|written| written.columns.iter().map(of(written)));
    columns.map(|(written, column)| meaning(written, column)).collect()
}

/// All files that are not tables, in manifest order.
pub(super) fn plain(
    dataset: &Dataset,
    format: Format,
    tables: &[Written],
) -> Result<Vec<Plain>, ExportError> {
    let configurations: Vec<String> = dataset.configurations.iter().map(configuration).collect();
    let dictionary = dictionary(format, tables);
    let beside = format.beside();
    let mut files = vec![
        Plain::new(
            format!("{beside}configurations.json"),
            configurations.len(),
            format!("[\n{}\n]\n", configurations.join(",\n")),
        ),
        Plain::new(
            format!("{beside}dictionary.json"),
            dictionary.len(),
            serde_json::to_vec_pretty(&dictionary).map_err(io::Error::from)?,
        ),
    ];
    if format == Format::PsychDs {
        files.extend(psych_ds::files(dataset, tables));
    }
    Ok(files)
}

/// An entry of configurations.json. It contains the configuration byte for byte, so that readers can
/// recompute its hash.
fn configuration((hash, json): &(String, String)) -> String {
    format!("{{\"configuration\": \"{hash}\", \"study\": {json}}}")
}
