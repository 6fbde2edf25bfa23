//! Writes the same rows in every format and reads them back.

use super::*;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::record::Field;
use proptest::prelude::*;
use std::fs::File;

/// A value of a cell.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    None,
    Whole(i64),
    Number(u64),
    Text(String),
}

const KINDS: [Kind; 5] = [Kind::Whole, Kind::Number, Kind::Time, Kind::Text, Kind::Json];

fn columns() -> Vec<Column> {
    let name = |i: usize| if i == 3 { "a \"name\", odd".to_owned() } else { format!("c{i}") };
    KINDS.iter().enumerate().map(|(i, &kind)| Column::new(name(i), kind, "")).collect()
}

type Row = (Option<i64>, Option<f64>, Option<f64>, Option<String>, Option<String>);

fn batch(rows: &[Row]) -> Batch {
    let mut batch = Batch::new(&columns());
    for (whole, number, time, text, json) in rows {
        let mut row = batch.add(1);
        row.whole(|_| *whole);
        row.number(|_| *number);
        row.number(|_| *time);
        row.text(text.as_deref());
        row.text(json.as_deref());
    }
    batch
}

fn values(batch: &Batch) -> Vec<Vec<Value>> {
    let value = |cells: &Cells, row: usize| match cells {
        Cells::Whole(cells) => cells[row].map_or(Value::None, Value::Whole),
        Cells::Number(cells) => cells[row].map_or(Value::None, |x| Value::Number(x.to_bits())),
        Cells::Text(cells) => cells.get(row).map_or(Value::None, |text| Value::Text(text.into())),
    };
    let row = |row| batch.columns().iter().map(|cells| value(cells, row)).collect();
    (0..batch.rows()).map(row).collect()
}

fn from_csv(bytes: &[u8]) -> Vec<Vec<Value>> {
    let mut reader = ::csv::Reader::from_reader(bytes);
    let names: Vec<_> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    assert_eq!(names, columns().iter().map(|c| c.name.to_string()).collect::<Vec<_>>());
    let value = |(kind, text): (&Kind, &str)| match kind {
        _ if text.is_empty() => Value::None,
        Kind::Whole => Value::Whole(text.parse().unwrap()),
        Kind::Number | Kind::Time => Value::Number(text.parse::<f64>().unwrap().to_bits()),
        _ => Value::Text(text.to_owned()),
    };
    let row = |row: ::csv::Result<::csv::StringRecord>| {
        KINDS.iter().zip(&row.unwrap()).map(value).collect()
    };
    reader.records().map(row).collect()
}

fn from_json(bytes: &[u8]) -> Vec<Vec<Value>> {
    let value = |(kind, column, row): (&Kind, &Column, &serde_json::Value)| {
        let value = row.get(&*column.name).unwrap();
        match kind {
            _ if value.is_null() => Value::None,
            Kind::Whole => Value::Whole(value.as_i64().unwrap()),
            Kind::Number | Kind::Time => Value::Number(value.as_f64().unwrap().to_bits()),
            _ => Value::Text(value.as_str().unwrap().to_owned()),
        }
    };
    let lines = std::str::from_utf8(bytes).unwrap().split_terminator('\n');
    let row = |line: &str| {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        KINDS.iter().zip(&columns()).map(|(kind, column)| value((kind, column, &row))).collect()
    };
    lines.map(row).collect()
}

fn from_parquet(file: File) -> Vec<Vec<Value>> {
    let reader = SerializedFileReader::new(file).unwrap();
    let value = |field: &Field| match field {
        Field::Null => Value::None,
        Field::Long(number) => Value::Whole(*number),
        Field::Double(number) => Value::Number(number.to_bits()),
        Field::Str(text) => Value::Text(text.clone()),
        other => panic!("{other:?}"),
    };
    let rows = reader.get_row_iter(None).unwrap();
    rows.map(|row| row.unwrap().get_column_iter().map(|(_, field)| value(field)).collect())
        .collect()
}

fn through(batches: &[Batch]) -> [Vec<Vec<Value>>; 3] {
    let columns = columns();
    let (mut csv, mut json) = (csv_header(&columns), Vec::new());
    let mut parquet = ParquetFile::begin(tempfile::tempfile().unwrap(), &columns).unwrap();
    for batch in batches {
        csv_rows(&columns, batch, &mut csv);
        json_rows(&columns, batch, &mut json);
        parquet.write(batch).unwrap();
    }
    [from_csv(&csv), from_json(&json), from_parquet(parquet.finish().unwrap())]
}

/// Texts with special characters at any position, and finite numbers with any bits.
fn rows() -> impl Strategy<Value = Vec<Row>> {
    let odd = [0.0, -0.0, 5e-324, 1e16, 1e-5, 123_456.0, f64::MAX, 0.1 + 0.2].to_vec();
    let number = || {
        let finite = prop::num::f64::ANY.prop_filter("finite", |x| x.is_finite());
        prop::option::of(prop_oneof![finite, prop::sample::select(odd.clone())])
    };
    let text = || prop::option::of("[a-c=＝+@'\\-\",;\t\r\n \u{e4}\u{1f600}]{0,6}");
    let row = (prop::option::of(any::<i64>()), number(), number(), text(), text());
    prop::collection::vec(row, 0..20)
}

/// A value after a round trip through CSV. An empty text becomes a missing value, and a formula
/// gets an apostrophe.
fn in_csv(value: Value) -> Value {
    match value {
        Value::Text(text) if text.is_empty() => Value::None,
        Value::Text(text) if text.starts_with(['=', '+', '-', '@', '\t', '\r', '\n', '＝']) => {
            Value::Text(format!("'{text}"))
        }
        other => other,
    }
}

proptest! {
    #[test]
    fn every_format_gives_the_same_rows_back(first in rows(), second in rows()) {
        let batches = [batch(&first), batch(&second)];
        let expected: Vec<_> = batches.iter().flat_map(values).collect();
        let [csv, json, parquet] = through(&batches);
        prop_assert_eq!(&json, &expected);
        prop_assert_eq!(&parquet, &expected);
        let expected: Vec<Vec<_>> =
            expected.into_iter().map(|row| row.into_iter().map(in_csv).collect()).collect();
        prop_assert_eq!(csv, expected);
    }
}

#[test]
fn formulas_are_disarmed_and_numbers_left_alone() {
    let texts = ["=HYPERLINK(1)", "-cmd", "+1", "@a", "＝1", "\ta", "\ra", "\na", "default", "a=b"];
    let rows: Vec<Row> = texts
        .iter()
        .map(|text| (Some(-1), Some(-1.5), None, Some((*text).to_owned()), None))
        .collect();
    let mut csv = Vec::new();
    csv_rows(&columns(), &batch(&rows), &mut csv);
    let lines = "-1,-1.5,,'=HYPERLINK(1),\n-1,-1.5,,'-cmd,\n-1,-1.5,,'+1,\n-1,-1.5,,'@a,\n\
                 -1,-1.5,,'＝1,\n-1,-1.5,,'\ta,\n-1,-1.5,,\"'\ra\",\n-1,-1.5,,\"'\na\",\n-1,-1.5,,default,\n-1,-1.5,,a=b,\n";
    assert_eq!(String::from_utf8(csv).unwrap(), lines);
}

#[test]
fn rows_are_added_after_others_are_cleared() {
    let row = (Some(1), Some(2.0), Some(3.0), Some("a".to_owned()), None);
    let mut again = batch(&[row.clone(), row.clone()]);
    again.clear();
    assert_eq!(again, batch(&[]));
    assert!(through(&[again]).iter().all(Vec::is_empty));
}
