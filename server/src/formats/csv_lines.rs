//! CSV files, with the line on which each record begins as an editor counts them.
//!
//! The csv crate counts from where it began to read, which differs after empty lines and after CR LF.

use csv::StringRecord;
use sidestep::invalid::Invalid;
use sidestep::recording::Fault;
use std::collections::VecDeque;
use std::io::{self, Read};

/// An error in a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct LineError {
    /// The line, from 1 for the header.
    pub line: u64,
    /// Field, expected and found.
    pub what: Invalid,
}

impl From<LineError> for Fault {
    fn from(LineError { line, what }: LineError) -> Self {
        Self { line: Some(line), what }
    }
}

/// The records of a file.
pub struct Records<R> {
    reader: csv::Reader<Watched<R>>,
    record: StringRecord,
}

impl<R: Read> Records<R> {
    /// The records, and the header.
    ///
    /// # Errors
    /// [`LineError`] for a header that is not text.
    pub fn of(file: R) -> Result<(Self, StringRecord), LineError> {
        let reader = csv::Reader::from_reader(Watched::new(file));
        let mut records = Self { reader, record: StringRecord::new() };
        let header = records.reader.headers().cloned().map_err(|error| records.broken(&error))?;
        Ok((records, header))
    }

    /// The next record and its line; none at the end.
    ///
    /// # Errors
    /// [`LineError`] for text that is not UTF-8, or a row with another number of fields than the
    /// header has.
    pub fn read(&mut self) -> Result<Option<(u64, &StringRecord)>, LineError> {
        match self.reader.read_record(&mut self.record) {
            Ok(false) => Ok(None),
            Ok(true) => {
                let begin = self.record.position().map_or(0, csv::Position::byte);
                Ok(Some((self.reader.get_mut().line_of(begin), &self.record)))
            }
            Err(error) => Err(self.broken(&error)),
        }
    }

    fn broken(&mut self, error: &csv::Error) -> LineError {
        let begin = error.position().map_or(0, csv::Position::byte);
        let line = self.reader.get_mut().line_of(begin);
        let what = match error.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                let expected = format!("{expected_len} fields, as in the header");
                Invalid::new("row", expected, len)
            }
            csv::ErrorKind::Utf8 { .. } => not_text("bytes that are not UTF-8".to_owned()),
            csv::ErrorKind::Io(error) => not_text(error.to_string()),
            other => not_text(format!("{other:?}")),
        };
        LineError { line, what }
    }
}

fn not_text(found: String) -> Invalid {
    Invalid::new("row", "comma-separated UTF-8 text", found)
}

/// Records where the lines that are not empty begin, while they are read.
struct Watched<R> {
    file: R,
    /// Number of bytes read, and the line after them.
    read: u64,
    line: u64,
    /// Whether that line is empty so far.
    empty: bool,
    /// The first byte and the number of each line that is not empty, from the last requested line on.
    begins: VecDeque<(u64, u64)>,
}

impl<R> Watched<R> {
    fn new(file: R) -> Self {
        Self { file, read: 0, line: 1, empty: true, begins: VecDeque::new() }
    }

    /// The first line from this byte on that is not empty. Requests are in rising order.
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
                b'\n' => (self.line, self.empty) = (self.line + 1, true),
                b'\r' => {}
                _ if self.empty => {
                    self.begins.push_back((self.read, self.line));
                    self.empty = false;
                }
                _ => {}
            }
            self.read += 1;
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::math::SeededRng;

    fn lines(text: &str) -> Result<Vec<(u64, String)>, LineError> {
        let (mut records, _) = Records::of(text.as_bytes())?;
        let mut found = Vec::new();
        while let Some((line, record)) = records.read()? {
            found.push((line, record[0].to_owned()));
        }
        Ok(found)
    }

    #[test]
    fn a_quoted_line_end_is_a_line_too() {
        let text = "a,b\r\n\"1\r\n\r\n2\",3\r\n\r\n4,5";
        let expected = [(2, "1\r\n\r\n2".to_owned()), (6, "4".to_owned())];
        assert_eq!(lines(text).unwrap(), expected);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let short = lines("a,b\r\n1,2\r\n\r\n3\r\n").unwrap_err();
        let said = "line 4: row: expected 2 fields, as in the header, found 1";
        assert_eq!(short.to_string(), said);
        let (mut records, _) = Records::of(&b"a\r\n1\r\n\xff\r\n"[..]).unwrap();
        records.read().unwrap();
        assert_eq!(records.read().unwrap_err().line, 3);
        let (_, header) = Records::of(&b""[..]).unwrap();
        assert!(header.is_empty());
    }

    /// Each row holds its own line number, among empty lines, whatever ends the lines and whether
    /// the last one has an end.
    #[test]
    fn records_are_on_their_lines() {
        let mut rng = SeededRng::new(1);
        for case in 0..200 {
            let ends = if case % 2 == 0 { "\n" } else { "\r\n" };
            let mut text = "number".to_owned();
            let mut expected = Vec::new();
            // More than the reader takes in at once.
            for line in 2..2 + 30 * rng.below(100) as u64 {
                text += ends;
                if rng.below(3) > 0 {
                    text += &line.to_string();
                    expected.push((line, line.to_string()));
                }
            }
            if rng.below(2) == 0 {
                text += ends;
            }
            assert_eq!(lines(&text).unwrap(), expected);
        }
    }
}
