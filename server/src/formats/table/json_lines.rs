//! Batches as JSON Lines. Each line is an object with the names of the columns as keys.

use super::batch::{Batch, Cells};
use super::{Column, decimal};

/// Appends a line for each row. A missing value is null. JSON inside a column is a string.
pub fn json_rows(columns: &[Column], batch: &Batch, out: &mut Vec<u8>) {
    let keys: Vec<Vec<u8>> = columns
        .iter()
        .enumerate()
        .map(|(i, column)| {
            let begin = if i == 0 { "{" } else { "," };
            format!("{begin}{}:", json_text(&column.name)).into_bytes()
        })
        .collect();
    let printed = |cells: &Cells| match cells {
        Cells::Text(texts) => texts.distinct.iter().map(|text| json_text(text)).collect(),
        Cells::Whole(_) | Cells::Number(_) => Vec::new(),
    };
    let texts: Vec<Vec<String>> = batch.columns().iter().map(printed).collect();
    for row in 0..batch.rows() {
        for ((key, cells), texts) in keys.iter().zip(batch.columns()).zip(&texts) {
            out.extend_from_slice(key);
            match cells {
                Cells::Whole(cells) => match cells[row] {
                    Some(number) => decimal::whole(out, number),
                    None => out.extend_from_slice(b"null"),
                },
                Cells::Number(cells) => match cells[row] {
                    Some(number) => decimal::number(out, number),
                    None => out.extend_from_slice(b"null"),
                },
                Cells::Text(cells) => match cells.rows[row] {
                    Some(place) => out.extend_from_slice(texts[place as usize].as_bytes()),
                    None => out.extend_from_slice(b"null"),
                },
            }
        }
        out.extend_from_slice(b"}\n");
    }
}

fn json_text(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
