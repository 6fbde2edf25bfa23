//! Input tables of commands, and messages about their dialects.

use crate::formats::csv_lines::Dialect;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Opens a file; - is stdin.
pub(super) fn open(path: &Path) -> io::Result<Box<dyn Read + Send>> {
    match is_stdin(path) {
        true => Ok(Box::new(io::stdin())),
        false => Ok(Box::new(File::open(path)?)),
    }
}

pub(super) fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// The file's name in messages.
pub(super) fn name(path: &Path) -> String {
    if is_stdin(path) { "stdin".to_owned() } else { path.display().to_string() }
}

/// Reports on stderr if a table is not UTF-8 with commas as delimiters.
pub(super) fn tell(path: &Path, dialect: Dialect) {
    if let Some(remark) = dialect.remark() {
        eprintln!("sidestep: {}: {remark}", name(path));
    }
}
