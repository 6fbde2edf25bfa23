//! Batches as CSV: comma-separated UTF-8 text with LF line endings.

use super::batch::{Batch, Cells, Texts};
use super::{Column, Kind, decimal};

/// The header.
#[must_use]
pub fn csv_header(columns: &[Column]) -> Vec<u8> {
    let mut line = Vec::new();
    for column in columns {
        quoted(&mut line, &column.name);
        line.push(b',');
    }
    end_line(&mut line);
    line
}

/// Appends a line for each row. Text that a spreadsheet could take for a formula gets a leading
/// apostrophe. Numbers are unchanged. A missing value is an empty field.
pub fn csv_rows(columns: &[Column], batch: &Batch, out: &mut Vec<u8>) {
    let mut printers: Vec<Printer<'_>> = columns
        .iter()
        .zip(batch.columns())
        .map(|(column, cells)| Printer::new(column, cells))
        .collect();
    for row in 0..batch.rows() {
        for printer in &mut printers {
            printer.print(row, out);
            out.push(b',');
        }
        end_line(out);
    }
}

/// Replaces the last comma by the end of the line.
fn end_line(out: &mut [u8]) {
    if let Some(last) = out.last_mut() {
        *last = b'\n';
    }
}

/// Prints the values of a column, row after row.
enum Printer<'a> {
    Whole(&'a [Option<i64>]),
    Number {
        cells: &'a [Option<f64>],
        print: fn(&mut Vec<u8>, f64),
        /// The bits of the last number, and the range of its text in the output. Numbers often repeat,
        /// so the text can be reused.
        last: Option<(u64, std::ops::Range<usize>)>,
    },
    Text {
        rows: &'a [Option<u32>],
        /// All printed texts, and the end of each text.
        printed: Vec<u8>,
        ends: Vec<usize>,
    },
}

impl<'a> Printer<'a> {
    fn new(column: &Column, cells: &'a Cells) -> Self {
        match cells {
            Cells::Whole(cells) => Self::Whole(cells),
            Cells::Number(cells) => {
                let print = match column.kind {
                    Kind::Time => decimal::time,
                    _ => decimal::number,
                };
                Self::Number { cells, print, last: None }
            }
            Cells::Text(Texts { distinct, rows }) => {
                let (mut printed, mut ends) = (Vec::new(), Vec::new());
                for text in distinct {
                    quoted(&mut printed, &disarmed(text));
                    ends.push(printed.len());
                }
                Self::Text { rows, printed, ends }
            }
        }
    }

    fn print(&mut self, row: usize, out: &mut Vec<u8>) {
        match self {
            Self::Whole(cells) => cells[row].into_iter().for_each(|cell| decimal::whole(out, cell)),
            Self::Number { cells, print, last } => {
                let Some(number) = cells[row] else { return };
                match last {
                    Some((bits, printed)) if *bits == number.to_bits() => {
                        out.extend_from_within(printed.clone());
                    }
                    _ => {
                        let begin = out.len();
                        print(out, number);
                        *last = Some((number.to_bits(), begin..out.len()));
                    }
                }
            }
            Self::Text { rows, printed, ends } => {
                let Some(place) = rows[row].map(|place| place as usize) else { return };
                let begin = if place == 0 { 0 } else { ends[place - 1] };
                out.extend_from_slice(&printed[begin..ends[place]]);
            }
        }
    }
}

/// The text, with a leading apostrophe if a spreadsheet could take it for a formula.
fn disarmed(text: &str) -> std::borrow::Cow<'_, str> {
    // Includes full-width forms, because some spreadsheets treat them like the ASCII characters.
    match text.starts_with(['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠']) {
        true => format!("'{text}").into(),
        false => text.into(),
    }
}

/// Appends a field, quoted if necessary.
fn quoted(out: &mut Vec<u8>, text: &str) {
    if !text.contains([',', '"', '\n', '\r']) {
        out.extend_from_slice(text.as_bytes());
        return;
    }
    out.push(b'"');
    out.extend_from_slice(text.replace('"', "\"\"").as_bytes());
    out.push(b'"');
}
