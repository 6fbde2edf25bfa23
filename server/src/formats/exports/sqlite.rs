//! The additional tables of a SQLite export: the dictionary and the configurations.

use super::ExportError;
use super::companions::Meaning;
use super::dataset::Dataset;
use super::format::DATABASE;
use super::table_file::Database;
use crate::store::snapshot::{Type, Value};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Adds the tables `dictionary` and `configurations`, and closes the file. Returns its path.
///
/// # Panics
/// If a table is still being written, which is a defect of this program.
pub(super) fn finish(
    database: Database,
    dataset: &Dataset,
    dictionary: &[Meaning],
    folder: &Path,
) -> Result<PathBuf, ExportError> {
    let open = Arc::into_inner(database).map(Mutex::into_inner);
    let Some(Ok(mut open)) = open else { unreachable!("a table is still being written") };
    let names = ["table", "name", "type", "unit", "frame", "range", "meaning"];
    open.table("dictionary", &names.map(|name| (name, Type::Text)), &["table", "name"])?;
    for Meaning { table, column, .. } in dictionary {
        let row = [
            optional(*table),
            Value::Text(&column.name),
            Value::Text(column.kind.word()),
            optional(column.unit),
            optional(column.frame),
            optional(column.range.as_deref()),
            Value::Text(&column.meaning),
        ];
        open.add("dictionary", row.len(), [row.into_iter()].into_iter())?;
    }
    let columns = [("configuration", Type::Text), ("study", Type::Text)];
    open.table("configurations", &columns, &["configuration"])?;
    let rows = dataset.configurations.iter();
    let rows = rows.map(|(hash, json)| [Value::Text(hash), Value::Text(json)].into_iter());
    open.add("configurations", columns.len(), rows)?;
    open.finish()?;
    Ok(folder.join(DATABASE))
}

fn optional(text: Option<&str>) -> Value<'_> {
    text.map_or(Value::Null, Value::Text)
}
