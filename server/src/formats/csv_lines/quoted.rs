//! Reads a table with quotation marks. Each record has the line number at which it begins.

use super::{Decoder, LineError, Record, not_text};
use std::collections::VecDeque;
use std::io::{self, Chain, Cursor, Read};

/// The rest of a file, read by the csv crate.
pub(super) struct Quoted<R> {
    reader: csv::Reader<Watched<Chain<Cursor<Vec<u8>>, R>>>,
    record: csv::ByteRecord,
}

impl<R: Read> Quoted<R> {
    /// Reads from this line on. `read` has the bytes that were already read, and `file` has the
    /// rest.
    pub(super) fn of(read: Vec<u8>, file: R, line: u64, separator: u8) -> Self {
        let file = Watched::new(Cursor::new(read).chain(file), line);
        let mut reader = csv::ReaderBuilder::new();
        let reader = reader.has_headers(false).flexible(true).delimiter(separator);
        Self { reader: reader.from_reader(file), record: csv::ByteRecord::new() }
    }

    /// Reads the next record and returns its line, or `None` at the end.
    pub(super) fn next(
        &mut self,
        record: &mut Record,
        decoder: &mut Decoder,
    ) -> Result<Option<u64>, LineError> {
        let (byte, found) = match self.reader.read_byte_record(&mut self.record) {
            Ok(false) => return Ok(None),
            Ok(true) => {
                record.clear();
                let copied = self.record.iter().try_for_each(|field| {
                    record.push(&decoder.text(field)?);
                    Ok::<(), String>(())
                });
                let begin = self.record.position().map_or(0, csv::Position::byte);
                match copied {
                    Ok(()) => return Ok(Some(self.reader.get_mut().line_of(begin))),
                    Err(found) => (begin, found),
                }
            }
            Err(error) => {
                let found = match error.kind() {
                    csv::ErrorKind::Io(error) => error.to_string(),
                    other => format!("{other:?}"),
                };
                (error.position().map_or(0, csv::Position::byte), found)
            }
        };
        Err(LineError { line: self.reader.get_mut().line_of(byte), what: not_text(found) })
    }
}

/// A reader that records where non-empty lines begin.
struct Watched<R> {
    file: R,
    /// Number of bytes read, and the current line number.
    read: u64,
    line: u64,
    /// Whether the current line is empty so far.
    empty: bool,
    /// Whether the last byte was a carriage return. A carriage return ends a line, either alone or
    /// together with a line feed.
    after_return: bool,
    /// For each non-empty line from the last requested line on: the offset of its first byte, and its
    /// line number.
    begins: VecDeque<(u64, u64)>,
}

impl<R> Watched<R> {
    /// Watches the file from this line on.
    fn new(file: R, line: u64) -> Self {
        Self { file, read: 0, line, empty: true, after_return: false, begins: VecDeque::new() }
    }

    /// The number of the first non-empty line that begins at this byte or later. Requests must be
    /// in ascending order.
    fn line_of(&mut self, byte: u64) -> u64 {
        while self.begins.len() > 1 && self.begins[0].0 < byte {
            self.begins.pop_front();
        }
        self.begins.front().map_or(1, |(_, line)| *line)
    }
}

impl<R: Read> Read for Watched<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        for byte in &buffer[..count] {
            match byte {
                b'\n' if self.after_return => {}
                b'\n' | b'\r' => (self.line, self.empty) = (self.line + 1, true),
                _ if self.empty => {
                    self.begins.push_back((self.read, self.line));
                    self.empty = false;
                }
                _ => {}
            }
            self.after_return = *byte == b'\r';
            self.read += 1;
        }
        Ok(count)
    }
}
