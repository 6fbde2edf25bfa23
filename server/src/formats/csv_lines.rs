//! Reads CSV files. Each record has the line number at which it begins, counted as in an editor.
//! The header determines the delimiter: a comma, a semicolon or a tab. Spreadsheets write a
//! semicolon or a tab if the decimal mark is a comma. Rows without any value are skipped.
//!
//! This module itself splits lines without a quotation mark, which is several times as fast as a
//! full parser. The csv crate reads the rest of the file from the first quotation mark on, or from
//! the first line that ends with a carriage return alone. This module counts the lines, because the
//! csv crate counts from where it starts to read, and counts empty lines and CR LF differently.

mod record;
mod quoted;

use super::text::{Decoder, Encoding, MARK, TextBytes, opened};
use quoted::Quoted;
use record::Decimal;
pub use record::Record;
use sidestep::invalid::Invalid;
use sidestep::recording::Fault;
use std::io::{self, Read};
use std::ops::Range;

/// An error in a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct LineError {
    /// The line number. The header is line 1.
    pub line: u64,
    /// The field, the expected value and the found value.
    pub what: Invalid,
}

impl From<LineError> for Fault {
    fn from(LineError { line, what }: LineError) -> Self {
        Self { line: Some(line), what }
    }
}

/// The dialect of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dialect {
    /// The encoding of the table's characters.
    pub encoding: Encoding,
    /// The delimiter of the columns: a comma, a semicolon or a tab.
    pub separator: u8,
    /// Whether numbers have decimal commas.
    pub decimal_comma: bool,
}

impl Dialect {
    /// A remark for the user if a table is not UTF-8 with commas as delimiters.
    #[must_use]
    pub fn remark(self) -> Option<String> {
        let encoding = self.encoding.remark().map(str::to_owned);
        let columns = match self.separator {
            b';' => Some("columns between semicolons".to_owned()),
            b'\t' => Some("columns between tabs".to_owned()),
            _ => None,
        };
        let decimals = self.decimal_comma.then(|| "decimal commas".to_owned());
        let parts: Vec<_> = [encoding, columns, decimals].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| format!("read as a table with {}", parts.join(", ")))
    }
}

/// The records of a file.
pub struct Records<R> {
    source: Source<TextBytes<R>>,
    record: Record,
    /// The number of fields of the header.
    fields: usize,
    separator: u8,
    decoder: Decoder,
    is_wide: bool,
}

enum Source<R> {
    /// The file has had no quotation mark so far.
    Plain(Lines<R>),
    /// The csv crate reads the rest of the file.
    Quoted(Box<Quoted<R>>),
    /// A placeholder during the switch to the csv crate.
    None,
}

impl<R: Read> Records<R> {
    /// Opens a file. Returns its records and its header.
    ///
    /// # Errors
    /// [`LineError`] for a header that is not text.
    pub fn of(file: R) -> Result<(Self, Record), LineError> {
        let failed = |line, found: String| LineError { line, what: not_text(found) };
        let (bytes, is_wide) = opened(file).map_err(|error| failed(1, error.to_string()))?;
        let mut lines = Lines::new(bytes);
        let separator = lines.separator().map_err(|(line, found)| failed(line, found))?;
        let mut records = Self {
            source: Source::Plain(lines),
            record: Record::separated_by(separator),
            fields: 0,
            separator,
            decoder: Decoder::default(),
            is_wide,
        };
        let header = match records.next()? {
            Some(_) => records.record.clone(),
            None => Record::default(),
        };
        records.fields = header.len();
        Ok((records, header))
    }

    /// The dialect, according to the part of the file that was read so far.
    #[must_use]
    pub fn dialect(&self) -> Dialect {
        Dialect {
            encoding: if self.is_wide { Encoding::Utf16 } else { self.decoder.encoding() },
            separator: self.separator,
            decimal_comma: self.record.decimal() == Some(Decimal::Comma),
        }
    }

    /// Returns the next record and its line, or `None` at the end.
    ///
    /// # Errors
    /// [`LineError`] for bytes that are not text, or a row whose number of fields differs from the header.
    pub fn read(&mut self) -> Result<Option<(u64, &Record)>, LineError> {
        let line = loop {
            let Some(line) = self.next()? else { return Ok(None) };
            // Skip the empty rows that spreadsheets append.
            if self.record.len() == 1 || self.record.iter().any(|field| !field.is_empty()) {
                break line;
            }
        };
        if self.record.len() != self.fields {
            let expected = format!("{} fields, as in the header", self.fields);
            return Err(LineError { line, what: Invalid::new("row", expected, self.record.len()) });
        }
        Ok(Some((line, &self.record)))
    }

    /// Reads the next record and returns its line, or `None` at the end.
    fn next(&mut self) -> Result<Option<u64>, LineError> {
        if let Source::Plain(lines) = &mut self.source {
            loop {
                let begins_at = lines.line;
                let failed = |found: String| LineError { line: begins_at, what: not_text(found) };
                let next = lines.next().map_err(|error| failed(error.to_string()))?;
                let Some(range) = next else { return Ok(None) };
                let text = without_ends(&lines.buffer[range.clone()], begins_at);
                if text.is_empty() {
                    continue;
                }
                if memchr::memchr2(b'"', b'\r', text).is_some() {
                    lines.begin = range.start;
                    lines.line = begins_at;
                    break;
                }
                let line = self.decoder.text(text).map_err(failed)?;
                self.record.split(&line, self.separator);
                return Ok(Some(begins_at));
            }
        }
        self.source = match std::mem::replace(&mut self.source, Source::None) {
            Source::Plain(lines) => Source::Quoted(Box::new(lines.quoted(self.separator))),
            other => other,
        };
        match &mut self.source {
            Source::Quoted(quoted) => quoted.next(&mut self.record, &mut self.decoder),
            Source::Plain(_) | Source::None => Ok(None),
        }
    }
}

fn not_text(found: String) -> Invalid {
    Invalid::new("row", "UTF-8 text", found)
}

/// A line without its final carriage return. The byte-order mark of the first line is also removed.
fn without_ends(line: &[u8], number: u64) -> &[u8] {
    let text = line.strip_suffix(b"\r").unwrap_or(line);
    match number {
        1 => text.strip_prefix(MARK).unwrap_or(text),
        _ => text,
    }
}

/// The lines of a file.
struct Lines<R> {
    file: R,
    /// Bytes from `begin` on were read, but not returned yet.
    buffer: Vec<u8>,
    begin: usize,
    /// The number of the next line.
    line: u64,
}

/// Maximum number of bytes per read.
const PIECE: usize = 1 << 18;

impl<R: Read> Lines<R> {
    fn new(file: R) -> Self {
        Self { file, buffer: Vec::new(), begin: 0, line: 1 }
    }

    /// The range of the next line in the buffer, without its line feed. Returns `None` at the end.
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

    /// The delimiter of the header, which is the next line. Some spreadsheets declare the delimiter in
    /// a line such as `sep=;` before the header. That line is skipped.
    fn separator(&mut self) -> Result<u8, (u64, String)> {
        loop {
            let begins_at = self.line;
            let next = self.next().map_err(|error| (begins_at, error.to_string()))?;
            let Some(range) = next else { return Ok(b',') };
            // On old Macintoshes, a carriage return alone ends a line. In such a file, the range
            // can be the whole file.
            let end = memchr::memchr(b'\r', &self.buffer[range.clone()]);
            let end = end.map_or(range.end, |length| range.start + length);
            if end + 1 < range.end {
                (self.begin, self.line) = (end + 1, begins_at + 1);
            }
            let line = without_ends(&self.buffer[range.start..end], begins_at);
            match line {
                [] => continue,
                [b's', b'e', b'p', b'=', separator @ (b',' | b';' | b'\t')] => {
                    return Ok(*separator);
                }
                _ if line.contains(&0) => {
                    let found = "NUL, as UTF-16 without a mark has; save the file as UTF-8";
                    return Err((begins_at, found.to_owned()));
                }
                _ => {}
            }
            let separator = separator_of(line);
            (self.begin, self.line) = (range.start, begins_at);
            return Ok(separator);
        }
    }

    /// A reader that supports quotation marks, for the rest of the file from the next line on.
    fn quoted(self, separator: u8) -> Quoted<R> {
        Quoted::of(self.buffer[self.begin..].to_vec(), self.file, self.line, separator)
    }
}

/// The delimiter of a header. It is a comma if the header has a comma outside quotation marks.
/// Otherwise it is the more frequent one of semicolon and tab.
fn separator_of(header: &[u8]) -> u8 {
    let mut quoted = false;
    let [mut commas, mut semicolons, mut tabs] = [0; 3];
    for byte in header {
        match byte {
            b'"' => quoted = !quoted,
            b',' if !quoted => commas += 1,
            b';' if !quoted => semicolons += 1,
            b'\t' if !quoted => tabs += 1,
            _ => {}
        }
    }
    match (commas, semicolons, tabs) {
        (0, 0, 0) | (1.., ..) => b',',
        (_, semicolons, tabs) if semicolons >= tabs => b';',
        _ => b'\t',
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::math::SeededRng;
    use std::io::Cursor;

    fn lines(text: &str) -> Result<Vec<(u64, String)>, LineError> {
        let (mut records, _) = Records::of(text.as_bytes())?;
        let mut found = Vec::new();
        while let Some((line, record)) = records.read()? {
            found.push((line, record[0].to_owned()));
        }
        Ok(found)
    }

    /// Returns all numbers of a file or its error, and the remark on its dialect.
    fn numbers(bytes: &[u8]) -> (Result<Vec<f64>, String>, Option<String>) {
        let (mut records, header) = Records::of(bytes).unwrap();
        let names: Vec<String> = header.iter().map(str::to_owned).collect();
        let mut read = || {
            let mut found = Vec::new();
            while let Some((line, record)) = records.read()? {
                let at = |what| LineError { line, what };
                for (place, name) in names.iter().enumerate() {
                    found.push(record.number(place, name).map_err(at)?);
                }
            }
            Ok(found)
        };
        let found = read().map_err(|error: LineError| error.to_string());
        (found, records.dialect().remark())
    }

    fn wide(text: &str) -> Vec<u8> {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
    }

    #[test]
    fn tables_are_read_as_spreadsheets_write_them() {
        let check = |bytes: &[u8], expected: &[f64], remark: &str| {
            let (found, said) = numbers(bytes);
            assert_eq!(found.as_deref(), Ok(expected), "{}", String::from_utf8_lossy(bytes));
            assert_eq!(said.unwrap_or_default(), remark);
        };
        let values = [1.5, -2.0, 1234.25, 1e-7];
        let semicolons = "read as a table with columns between semicolons";
        let commas = format!("{semicolons}, decimal commas");
        let tabs = "read as a table with columns between tabs, decimal commas";
        check(b"a,b\n1.5,-2\n1234.25,1e-7\n", &values, "");
        check(b"\xef\xbb\xbfa,b\r\n1.5,-2\r\n1234.25,1E-07", &values, "");
        check(b"a;b\r\n1,5;-2\r\n1234,25;1E-07\r\n", &values, &commas);
        check(b"a;b\n1.5;-2\n1234.25;1e-7\n", &values, semicolons);
        check(b"sep=;\r\na;b\r\n1,5;-2,0\r\n\"1234,25\";\"1e-7\"\r\n", &values, &commas);
        check(b"\"a\"\t\"b;,c\"\n1,5\t-2\n1234,25\t1e-7", &values, tabs);
        let utf_16 = "read as a table with UTF-16, columns between tabs, decimal commas";
        check(&wide("a\tb\r\n1,5\t-2\r\n1234,25\t1e-7\r\n"), &values, utf_16);
        check(b"\ra;b\r1,5;-2\r\r1234,25;1E-07\r", &values, &commas);
        check(b"sep=;\ra;b\r1,5;-2\r1234,25;1E-07", &values, &commas);
        check(b"a,b\r1.5,-2\r1234.25,1e-7", &values, "");
        check(&wide("a\tb\r1,5\t-2\r1234,25\t1e-7\r"), &values, utf_16);
        let quoted = "\"a\";\"b,c\"\n\"1,5\";\"-2,0\"\n\"1234,25\";\"1E-07\"\n";
        for end in ["\n", "\r\n", "\r"] {
            check(quoted.replace('\n', end).as_bytes(), &values, &commas);
        }
        check(b"a;b\n1,5;-2\n;\n1234,25;1E-07\n;\n;\n", &values, &commas);
        check(b"a,b\r\n\"1.5\",-2\r\n1234.25,1e-7\r\n,,,\r\n\"\",\r\n", &values, "");
        let between_commas = quoted.replace(';', ",").replace("b,c", "b");
        check(between_commas.as_bytes(), &values, "read as a table with decimal commas");
        let latin = "read as a table with Windows-1252 (Latin-1), columns between semicolons";
        check(b"\xe4;b\n1;2\n", &[1.0, 2.0], latin);
        check(b"\xe4;b\n\"1\";2\n", &[1.0, 2.0], latin);
    }

    #[test]
    fn what_can_be_read_in_two_ways_is_refused_with_line_and_column() {
        let check = |text: &str, words: &str| {
            assert_eq!(numbers(text.as_bytes()).0.unwrap_err(), words, "{text}");
        };
        check(
            "a;b\r\n1,5;2\r\n\r\n3;4.5\r\n",
            "line 4: b: expected a decimal comma, as the numbers before have, found \"4.5\"",
        );
        check(
            "a;b\n1.5;2,5\n",
            "line 2: b: expected a decimal point, as the numbers before have, found \"2,5\"",
        );
        check(
            "a;b\n1.234,5;2\n",
            "line 2: a: expected a number without marks between thousands, found \"1.234,5\"",
        );
        check("a;b\n1,234,567;2\n", "line 2: a: expected a number, found \"1,234,567\"");
        check(
            "a;b\r\r1,5;2\r;\r3;4.5\r",
            "line 5: b: expected a decimal comma, as the numbers before have, found \"4.5\"",
        );
        check("a,b\n1,\n", "line 2: b: expected a number, found \"\"");
        check("a,b\n1,5,2\n", "line 2: row: expected 2 fields, as in the header, found 3");
        check(
            "a,b\n\"1,500\",2\n",
            "line 2: a: expected a number without marks between thousands, or with a decimal comma in a table with \
             columns between semicolons, found \"1,500\"",
        );
        let bare: Vec<u8> = "a;b\n1;2".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let said = Records::of(&bare[..]).err().unwrap().to_string();
        let expected = "line 1: row: expected UTF-8 text, found NUL, as UTF-16 without a mark has; save \
                        the file as UTF-8";
        assert_eq!(said, expected);
        let mixed = ["a;ä\n1;2\n".as_bytes(), b"\xe4;1\n"].concat();
        let (mut records, _) = Records::of(Cursor::new(mixed)).unwrap();
        records.read().unwrap();
        let said = records.read().unwrap_err().to_string();
        assert!(
            said.starts_with("line 3: row: expected UTF-8 text, found UTF-8 and another"),
            "{said}"
        );
    }

    #[test]
    fn a_quoted_line_end_is_a_line_too() {
        let text = "a,b\r\n\"1\r\n\r\n2\",3\r\n\r\n4,5";
        let expected = [(2, "1\r\n\r\n2".to_owned()), (6, "4".to_owned())];
        assert_eq!(lines(text).unwrap(), expected);
    }

    /// The plain reader splits rows like the csv crate.
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
            let (bytes, is_wide) = opened(text.as_bytes()).unwrap();
            let mut records = Records {
                source: Source::Plain(Lines::new(bytes)),
                record: Record::default(),
                fields: 0,
                separator: b',',
                decoder: Decoder::default(),
                is_wide,
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
        let (mut records, _) = Records::of(&b"a\r\n1\r\n\x81\r\n"[..]).unwrap();
        records.read().unwrap();
        assert_eq!(records.read().unwrap_err().line, 3);
        let (_, header) = Records::of(&b""[..]).unwrap();
        assert!(header.is_empty());
    }

    /// Each row contains its own line number. The files have empty lines between rows, and all
    /// kinds of line endings. In some files, the last line has no line ending.
    #[test]
    fn records_are_on_their_lines() {
        let mut rng = SeededRng::new(1);
        for case in 0..200 {
            let ends = ["\n", "\r\n", "\r"][case % 3];
            // The csv crate reads from the first quotation mark on.
            let quotes = rng.below(4) as u64;
            let mut text = "number".to_owned();
            let mut expected = Vec::new();
            // The file is long enough for several reads.
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
