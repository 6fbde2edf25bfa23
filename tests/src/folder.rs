//! Temporary folders, and CSV tables.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A temporary folder. Dropping it removes the folder.
pub struct Folder(TempDir);

impl Default for Folder {
    fn default() -> Self {
        Self(TempDir::new().expect("a folder"))
    }
}

impl Folder {
    /// Creates a temporary folder in `parent`.
    ///
    /// # Panics
    /// If it cannot be created.
    #[must_use]
    pub fn within(parent: &str) -> Self {
        Self(TempDir::new_in(parent).expect("a folder"))
    }

    /// The path of the folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        self.0.path()
    }

    /// The path of a file in the folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.root().join(name)
    }

    /// The path of a file in the folder as text, for command lines.
    #[must_use]
    pub fn name(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// The address of a SQLite database in the folder.
    #[must_use]
    pub fn database(&self, name: &str) -> String {
        format!("sqlite:{}", self.name(name))
    }

    /// Writes a file and returns its path.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        fs::write(self.path(name), content).expect("a file");
        self.name(name)
    }

    /// The text of a file.
    ///
    /// # Panics
    /// If the file cannot be read.
    #[must_use]
    pub fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect("a text")
    }

    /// Names of all entries, including hidden ones, in ascending order.
    ///
    /// # Panics
    /// If the folder does not exist.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.root()).expect("the folder");
        let name = |entry: fs::DirEntry| entry.file_name().into_string().expect("UTF-8");
        let mut names: Vec<_> = entries.map(|entry| name(entry.expect("an entry"))).collect();
        names.sort();
        names
    }
}

/// The path of a file in the library's test data.
#[must_use]
pub fn data(name: &str) -> String {
    format!("{}/../shared/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// A row of a table: each column's name and the field in that column.
pub type Row = HashMap<String, String>;

/// The rows of a CSV file.
///
/// # Panics
/// If it is not a table.
pub fn rows(path: impl AsRef<Path>) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).expect("a file");
    reader.deserialize().map(|row| row.expect("a row")).collect()
}

/// A field as a number.
///
/// # Panics
/// If it is not a number.
#[must_use]
pub fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().expect("a number")
}
