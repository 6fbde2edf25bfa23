//! The files beside the tables in a Psych-DS folder (psych-ds.github.io): the metadata of every column
//! in schema.org terms, and the recommended folders with their texts.

use super::dataset::Dataset;
use super::table::Table;
use super::written::{Plain, Written};
use crate::formats::table::Column;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// The version of the standard that is given in the metadata.
const STANDARD: &str = "Psych-DS 0.4.0";

/// Files that the standard's validator should ignore.
const IGNORED: &str = "manifest.json\n.psychds-ignore\n";

/// The files beside the tables.
pub(super) fn files(dataset: &Dataset, tables: &[Written]) -> Vec<Plain> {
    let title = title(dataset);
    // The most specific table comes first, because its description of a shared column is the most
    // useful one.
    let order = [Table::Participants, Table::Trials, Table::Steps, Table::KeyEvents];
    let in_order =
        order.iter().flat_map(|&wanted| tables.iter().filter(move |t| t.table == wanted));
    let mut known = BTreeSet::new();
    let columns = in_order.flat_map(|written| &written.columns);
    let measured: Vec<Value> =
        columns.filter(|column| known.insert(&column.name)).map(variable).collect();
    let description = metadata(&[
        ("name", json!(title)),
        ("description", json!(about(dataset))),
        ("schemaVersion", json!(STANDARD)),
        ("variableMeasured", json!(measured)),
    ]);
    let directory = metadata(&[("encodingFormat", json!("text/csv"))]);
    let mut files = vec![
        Plain::new("dataset_description.json", measured.len(), description),
        Plain::new("data/file_metadata.json", 0, directory),
    ];
    for written in tables {
        let measured: Vec<Value> = written.columns.iter().map(variable).collect();
        let (name, meaning) = (written.table.name(), written.table.meaning());
        let sidecar = metadata(&[
            ("name", json!(format!("{title}: {name}"))),
            ("description", json!(meaning)),
            ("variableMeasured", json!(measured)),
        ]);
        files.push(Plain::new(written.name.replace(".csv", ".json"), measured.len(), sidecar));
    }
    files.extend([
        Plain::new("README.md", 0, readme(dataset, tables)),
        Plain::new("CHANGES.md", 0, changes(dataset)),
        Plain::new(
            "analysis/load_export.py",
            0,
            include_str!("../../../../examples/load_export.py"),
        ),
        Plain::new("analysis/load_export.R", 0, include_str!("../../../../examples/load_export.R")),
        Plain::new("materials/README.md", 0, MATERIALS),
        Plain::new("results/README.md", 0, "What analyses of these data find goes here.\n"),
        Plain::new(".psychds-ignore", 0, IGNORED),
    ]);
    files
}

const MATERIALS: &str = "What participants were shown follows from the study's configurations in\n\
    documentation/configurations.json. Other materials go here.\n";

fn title(dataset: &Dataset) -> String {
    let title = &dataset.study.config.title;
    match () {
        () if dataset.filter.pilots => format!("{title} (pilots)"),
        () if dataset.is_synthetic() => format!("{title} (synthetic)"),
        () => title.clone(),
    }
}

fn about(dataset: &Dataset) -> String {
    let who = if dataset.is_synthetic() {
        "synthetic participants, which are programs and no evidence about people, steer"
    } else {
        "people steer"
    };
    format!(
        "Data of the study {} ({}): {who} a vehicle past another one that drives to its goal. \
         Steps, trials, key events and participants.",
        dataset.study.config.title, dataset.study.slug
    )
}

/// A schema.org object of type Dataset, as a file.
fn metadata(fields: &[(&str, Value)]) -> String {
    let mut object = json!({ "@context": "https://schema.org/", "@type": "Dataset" });
    for (name, value) in fields {
        object[*name] = value.clone();
    }
    format!("{object:#}\n")
}

/// A column in schema.org terms.
fn variable(column: &Column) -> Value {
    let mut description = column.meaning.to_string();
    for (word, more) in [("frame", column.frame), ("values", column.range.as_deref())] {
        if let Some(more) = more {
            description += &format!("; {word}: {more}");
        }
    }
    let mut object = json!({
        "@type": "PropertyValue",
        "name": column.name,
        "description": description,
    });
    if let Some(unit) = column.unit {
        object["unitText"] = unit.into();
    }
    object
}

fn readme(dataset: &Dataset, tables: &[Written]) -> String {
    let mut text = format!(
        "# {}\n\n{}\n\nThe folder follows the {STANDARD} standard (psych-ds.github.io).\n\n## Tables\n\n",
        title(dataset),
        about(dataset)
    );
    for written in tables {
        let key = written.table.key().join(", ");
        let (name, meaning) = (&written.name, written.table.meaning());
        text += &format!("- `{name}`: {meaning} A row is identified by {key}.\n");
    }
    text += "\nAn empty field has no value; no number is NaN or infinite. A text that begins like a formula \
        has an\napostrophe before it, so that spreadsheets do not compute it. Numbers have enough digits \
        to\nread back the same bits. `documentation/dictionary.json` has the type, unit, frame and \
        range of every\ncolumn, `manifest.json` the rows and SHA-256 of every file, `analysis/` scripts that \
        load the tables.\n\n## Before you publish\n\nThe table of participants contains the recruiting \
        service's ids, completion codes, parameters of links and\nanswers. Remove what identifies people, and \
        what you may not share. Name the authors (`author`), the licence\n(`license`) and how to cite the \
        data (`citation`) in `dataset_description.json`.\n";
    text
}

fn changes(dataset: &Dataset) -> String {
    let mut text = "# Changes\n\nThe configurations under which people took part:\n\n".to_owned();
    for (hash, _) in dataset.configurations.iter() {
        text += &format!("- {hash}\n");
    }
    text
}
