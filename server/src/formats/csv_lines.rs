//! CSV files, with the line on which each record begins as an editor counts them.
//!
//! Lines without a quotation mark are split at commas, which is several times as fast as a whole parser.
//! From the first quotation mark on (or a carriage return within a line), the csv crate reads the file. It
//! counts lines from where it began to read, which differs after empty lines and after CR LF; so they are
//! counted here.

use sidestep::invalid::Invalid;
use sidestep::recording::Fault;
use std::collections::VecDeque;
use std::io::{self, Chain, Cursor, Read};
use std::ops::{Index, Range};

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

/// The fields of a row.
#[derive(Clone, Debug, Default)]
pub struct Record {
    text: String,
    /// The end of each field in the text, and the beginning of the next one.
    fields: Vec<(usize, usize)>,
}

impl Record {
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

    /// The field at a place, if there is one.
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

    fn clear(&mut self) {
        self.text.clear();
        self.fields.clear();
    }

    /// Takes a line without quotation marks.
    fn split(&mut self, line: &str) {
        self.clear();
        self.text.push_str(line);
        self.fields.extend(memchr::memchr_iter(b',', line.as_bytes()).map(|at| (at, at + 1)));
        self.fields.push((line.len(), line.len()));
    }

    fn copy(&mut self, record: &csv::StringRecord) {
        self.clear();
        for field in record {
            self.text.push_str(field);
            self.fields.push((self.text.len(), self.text.len()));
        }
    }
}

impl Index<usize> for Record {
    type Output = str;

    fn index(&self, place: usize) -> &str {
        self.get(place).unwrap_or_else(|| panic!("field {place} of {}", self.len()))
    }
}

/// The records of a file.
pub struct Records<R> {
    source: Source<R>,
    record: Record,
    /// The number of fields of the header.
    fields: usize,
}

enum Source<R> {
    /// No quotation mark so far.
    Plain(Lines<R>),
    /// The rest is read by the csv crate.
    Quoted(Box<Quoted<R>>),
    /// In between.
    None,
}

impl<R: Read> Records<R> {
    /// The records, and the header.
    ///
    /// # Errors
    /// [`LineError`] for a header that is not text.
    pub fn of(file: R) -> Result<(Self, Record), LineError> {
        let mut records =
            Self { source: Source::Plain(Lines::new(file)), record: Record::default(), fields: 0 };
        let header = match records.next()? {
            Some(_) => records.record.clone(),
            None => Record::default(),
        };
        records.fields = header.len();
        Ok((records, header))
    }

    /// The next record and its line; none at the end.
    ///
    /// # Errors
    /// [`LineError`] for text that is not UTF-8, or a row with another number of fields than the
    /// header has.
    pub fn read(&mut self) -> Result<Option<(u64, &Record)>, LineError> {
        let Some(line) = self.next()? else { return Ok(None) };
        if self.record.len() != self.fields {
            let expected = format!("{} fields, as in the header", self.fields);
            return Err(LineError { line, what: Invalid::new("row", expected, self.record.len()) });
        }
        Ok(Some((line, &self.record)))
    }

    /// Reads the next record and returns its line; none at the end.
    fn next(&mut self) -> Result<Option<u64>, LineError> {
        if let Source::Plain(lines) = &mut self.source {
            loop {
                let begins_at = lines.line;
                let failed = |what| LineError { line: begins_at, what };
                let next = lines.next().map_err(|error| failed(not_text(error.to_string())))?;
                let Some(range) = next else { return Ok(None) };
                let bytes = &lines.buffer[range.clone()];
                let text = bytes.strip_suffix(b"\r").unwrap_or(bytes);
                let text = match begins_at {
                    1 => text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text),
                    _ => text,
                };
                if text.is_empty() {
                    continue;
                }
                if memchr::memchr2(b'"', b'\r', text).is_some() {
                    lines.begin = range.start;
                    lines.line = begins_at;
                    break;
                }
                let broken = |_| failed(not_text("bytes that are not UTF-8".to_owned()));
                self.record.split(std::str::from_utf8(text).map_err(broken)?);
                return Ok(Some(begins_at));
            }
        }
        self.source = match std::mem::replace(&mut self.source, Source::None) {
            Source::Plain(lines) => Source::Quoted(Box::new(lines.quoted())),
            other => other,
        };
        match &mut self.source {
            Source::Quoted(quoted) => quoted.next(&mut self.record),
            Source::Plain(_) | Source::None => Ok(None),
        }
    }
}

fn not_text(found: String) -> Invalid {
    Invalid::new("row", "comma-separated UTF-8 text", found)
}

/// The lines of a file.
struct Lines<R> {
    file: R,
    /// What was read and not returned yet is from `begin` on.
    buffer: Vec<u8>,
    begin: usize,
    /// The number of the next line.
    line: u64,
}

/// Bytes that are read at once.
const PIECE: usize = 1 << 18;

impl<R: Read> Lines<R> {
    fn new(file: R) -> Self {
        Self { file, buffer: Vec::new(), begin: 0, line: 1 }
    }

    /// The place of the next line in the buffer, without LF; none at the end.
    fn next(&mut self) -> io::Result<Option<Range<usize>>> {
        let mut searched = self.begin;
        loop {
            if let Some(length) = memchr::memchr(b'\n', &self.buffer[searched..]) {
                let line = self.begin..searched + length;
                self.begin = line.end + 1;
                self.line += 1;
                return Ok(Some(line));
            }
            self.buffer.drain(..self.begin);
            self.begin = 0;
            searched = self.buffer.len();
            let piece = self.file.by_ref().take(PIECE as u64).read_to_end(&mut self.buffer)?;
            if piece == 0 {
                let line = 0..self.buffer.len();
                self.begin = line.end;
                self.line += 1;
                return Ok(Some(line).filter(|line| !line.is_empty()));
            }
        }
    }

    /// The same file from the next line on, with quotation marks.
    fn quoted(self) -> Quoted<R> {
        let rest = self.buffer[self.begin..].to_vec();
        let file = Watched::new(Cursor::new(rest).chain(self.file), self.line);
        let reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(file);
        Quoted { reader, record: csv::StringRecord::new() }
    }
}

/// The rest of a file as the csv crate reads it.
struct Quoted<R> {
    reader: csv::Reader<Watched<Chain<Cursor<Vec<u8>>, R>>>,
    record: csv::StringRecord,
}

impl<R: Read> Quoted<R> {
    fn next(&mut self, record: &mut Record) -> Result<Option<u64>, LineError> {
        let (byte, what) = match self.reader.read_record(&mut self.record) {
            Ok(false) => return Ok(None),
            Ok(true) => {
                record.copy(&self.record);
                let begin = self.record.position().map_or(0, csv::Position::byte);
                return Ok(Some(self.reader.get_mut().line_of(begin)));
            }
            Err(error) => {
                let found = match error.kind() {
                    csv::ErrorKind::Utf8 { .. } => "bytes that are not UTF-8".to_owned(),
                    csv::ErrorKind::Io(error) => error.to_string(),
                    other => format!("{other:?}"),
                };
                (error.position().map_or(0, csv::Position::byte), not_text(found))
            }
        };
        Err(LineError { line: self.reader.get_mut().line_of(byte), what })
    }
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
    /// The file from this line on.
    fn new(file: R, line: u64) -> Self {
        Self { file, read: 0, line, empty: true, begins: VecDeque::new() }
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

    /// The plain reader is the csv crate with another way to split.
    #[test]
    fn both_readers_read_the_same() {
        let mut rng = SeededRng::new(2);
        let pieces = ["", "a", "1.5", " ", "ü", ",", ",", ",", "\n", "\r\n", "\n\n", "\u{feff}"];
        for _ in 0..2000 {
            let text: String =
                (0..rng.below(40)).map(|_| pieces[rng.below(pieces.len())]).collect();
            let mut reader = csv::ReaderBuilder::new();
            let mut reader = reader.has_headers(false).flexible(true).from_reader(text.as_bytes());
            let expected: Vec<Vec<String>> = reader
                .records()
                .map(|record| record.unwrap().iter().map(str::to_owned).collect())
                .collect();
            let mut records = Records {
                source: Source::Plain(Lines::new(text.as_bytes())),
                record: Record::default(),
                fields: 0,
            };
            let mut found = Vec::new();
            while records.next().unwrap().is_some() {
                found.push(records.record.iter().map(str::to_owned).collect::<Vec<_>>());
            }
            assert_eq!(found, expected, "{text:?}");
        }
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
            // From the first quotation mark on another reader reads.
            let quotes = rng.below(4) as u64;
            let mut text = "number".to_owned();
            let mut expected = Vec::new();
            // More than the reader takes in at once.
            for line in 2..2 + 30 * rng.below(100) as u64 {
                text += ends;
                if rng.below(3) > 0 {
                    let is_quoted = quotes > 0 && line % (100 * quotes) == 7;
                    text += &if is_quoted { format!("\"{line}\"") } else { line.to_string() };
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
