//! A table as a file that is written batch by batch.

use crate::formats::table::{Batch, Column, ParquetFile, csv_header, csv_rows, json_rows};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

/// The format of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Comma-separated text with a header.
    Csv,
    /// A JSON object for each row.
    Jsonl,
    /// Apache Parquet.
    Parquet,
}

impl Format {
    /// The ending of files in this format.
    #[must_use]
    pub fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Jsonl => "jsonl",
            Self::Parquet => "parquet",
        }
    }

    /// Rows after which a batch is written. A row group of a Parquet file is to be long, and text goes to
    /// the file while it is in the processor's cache.
    pub(super) fn batch_rows(self) -> usize {
        match self {
            Self::Csv | Self::Jsonl => 1,
            Self::Parquet => 1 << 15,
        }
    }
}

/// A table that is being written.
pub(super) struct TableFile {
    pub(super) name: String,
    pub(super) columns: Vec<Column>,
    pub(super) rows: u64,
    content: Content,
}

enum Content {
    /// Text on its way to the file, and how rows become text.
    Text {
        out: Hashed,
        text: Vec<u8>,
        print: fn(&[Column], &Batch, &mut Vec<u8>),
    },
    Parquet(ParquetFile<Hashed>),
}

impl TableFile {
    /// Begins a file in `folder`.
    pub(super) fn begin(
        folder: &Path,
        table: &str,
        columns: Vec<Column>,
        format: Format,
    ) -> io::Result<Self> {
        let name = format!("{table}.{}", format.ending());
        let mut out = Hashed::create(&folder.join(&name))?;
        let text = Vec::new();
        let content = match format {
            Format::Csv => {
                out.write_all(&csv_header(&columns))?;
                Content::Text { out, text, print: csv_rows }
            }
            Format::Jsonl => Content::Text { out, text, print: json_rows },
            Format::Parquet => Content::Parquet(ParquetFile::begin(out, &columns)?),
        };
        Ok(Self { name, columns, rows: 0, content })
    }

    /// Adds the rows of a batch.
    pub(super) fn write(&mut self, batch: &Batch) -> io::Result<()> {
        self.rows += batch.rows() as u64;
        match &mut self.content {
            Content::Text { out, text, print } => {
                text.clear();
                print(&self.columns, batch, text);
                out.write_all(text)
            }
            Content::Parquet(file) => file.write(batch),
        }
    }

    /// Ends the file. Returns its length, bytes, and its SHA-256 as hexadecimal digits.
    pub(super) fn finish(self) -> io::Result<(u64, String)> {
        match self.content {
            Content::Text { out, .. } => Ok(out.finish()),
            Content::Parquet(file) => Ok(file.finish()?.finish()),
        }
    }
}

/// A file with the hash of what was written to it.
pub(super) struct Hashed {
    file: File,
    hash: Sha256,
    bytes: u64,
}

impl Hashed {
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        Ok(Self { file: File::create(path)?, hash: Sha256::new(), bytes: 0 })
    }

    /// The number of bytes, and their SHA-256 as hexadecimal digits.
    pub(super) fn finish(self) -> (u64, String) {
        (self.bytes, hex::encode(self.hash.finalize()))
    }
}

impl Write for Hashed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hash.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
