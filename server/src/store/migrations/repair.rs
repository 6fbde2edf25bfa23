//! Repairs the parts of a damaged SQLite file that are the same in every database of this version.

use super::{Failure, SQLITE, State, TABLE, check, record_all};
use crate::store::error::StoreError;
use crate::store::misfit::Misfit;
use crate::store::sql::{self, Connection, params};
use std::ops::Range;

/// The migration that makes the mark.
const MARKED: i64 = 16;

/// Repairs the parts of a damaged SQLite file that are the same in every database of this version:
/// the text of the schema, the mark, and the table of migrations. Migration [`MARKED`] added the
/// mark, so a file without a mark is of an earlier version. `db` must be allowed to write the schema. `like`
/// must have all migrations and no data.
pub(in crate::store) fn renew(db: &Connection, like: &Connection) -> Result<(), Failure> {
    const MARK: &str = "mark";
    let [found, known] = [schema(db)?, schema(like)?];
    if found.iter().all(|it| it.name() != MARK) {
        return Ok(db.batch("PRAGMA writable_schema = RESET")?);
    }
    for (rowid, words) in renewed(&found, &known) {
        let [kind, name, table, sql] = words;
        db.execute(
            "UPDATE sqlite_schema SET type = $2, name = $3, tbl_name = $4, sql = NULLIF($5, '') WHERE rowid = $1",
            params![rowid, kind, name, table, sql],
        )?;
    }
    db.batch("PRAGMA writable_schema = RESET")?;
    for Definition { words: [kind, _, _, text], .. } in missing(&found, &known) {
        if kind == "index" && !text.is_empty() {
            // If the index cannot be created, queries scan the whole table.
            let _ = db.batch(text);
        }
    }
    let is_lost = |table: &str| {
        let mut read = db.prepare_cached(&format!("SELECT * FROM {table}"))?;
        let rows =
            read.query_map([], |_| Ok(())).and_then(Iterator::collect::<sql::Result<Vec<_>>>);
        Ok::<_, sql::Error>(rows.is_err_and(|error| matches!(error.into(), StoreError::Corrupt(_))))
    };
    let marks = "SELECT count(*) FROM mark WHERE text GLOB 'sidestep mark *'";
    let is_marked = db.query_row(marks, [], |row| row.get::<_, i64>(0)).unwrap_or(0) == 1;
    let is_known =
        matches!(check(db), Ok(State::Current) | Err(Failure::Misfit(Misfit::Newer { .. })));
    let lost = [!is_marked || is_lost(MARK)?, !is_known || is_lost(TABLE)?];
    for (table, is_lost) in [MARK, TABLE].into_iter().zip(lost) {
        if is_lost {
            db.batch(&format!(
                "PRAGMA writable_schema = ON; DELETE FROM sqlite_schema WHERE tbl_name = '{table}'; \
                 PRAGMA writable_schema = RESET"
            ))?;
        }
    }
    let made = SQLITE.iter().find(|(version, ..)| *version == MARKED);
    if let ([true, _], Some((.., made))) = (lost, made) {
        db.batch(made)?;
    }
    if lost[1] {
        record_all(db)?;
    }
    Ok(())
}

/// Restores the definitions of a lost schema page, if all other definitions match this version.
///
/// If the file has the same layout as `like`, the lost definitions are copied from `like`. Otherwise
/// the root pages are unknown, and each lost table gets an empty root page from `blank`. The table then
/// counts as a table that has lost all its pages. Its implicit indices are not restored. SQLite reports
/// them as damaged, so that no query mistakes an empty index for an empty table.
pub(in crate::store) fn put_back(
    db: &Connection,
    like: &Connection,
    blank: Range<u32>,
) -> sql::Result<()> {
    let [found, known] = [schema(db)?, schema(like)?];
    let is_ours = |it: &Definition| {
        !it.is_table() || is_older(&it.words) || known.iter().any(|known| known.words == it.words)
    };
    if !found.iter().all(is_ours) {
        return Ok(());
    }
    let is_placed = |it: &Definition| {
        known.iter().any(|known| known.name() == it.name() && known.root == it.root)
    };
    let lost = missing(&found, &known).into_iter();
    let lost: Vec<_> = match found.iter().all(is_placed) {
        true => lost.cloned().collect(),
        false => {
            // SQLite reads the schema in the order of its rows, and a table must come before its indices.
            let tables = lost.filter(|it| it.is_table()).zip(blank).zip(i64::from(i32::MIN)..);
            let placed = |((it, root), rowid): ((&Definition, u32), i64)| Definition {
                rowid,
                root: root.into(),
                words: it.words.clone(),
            };
            tables.map(placed).collect()
        }
    };
    for Definition { rowid, root, words: [kind, name, table, text] } in lost {
        db.execute(
            "INSERT INTO sqlite_schema (rowid, type, name, tbl_name, rootpage, sql) \
             VALUES ($1, $2, $3, $4, $5, NULLIF($6, ''))",
            params![rowid, kind, name, table, root, text],
        )?;
    }
    Ok(())
}

/// A row of the schema table.
#[derive(Clone)]
struct Definition {
    rowid: i64,
    /// The root page; 0 for a view or a trigger.
    root: i64,
    /// The type, name, table and SQL text of the object.
    words: [String; 4],
}

impl Definition {
    fn name(&self) -> &str {
        &self.words[1]
    }

    /// Whether this is a table that the migrations create.
    fn is_table(&self) -> bool {
        self.words[0] == "table" && !self.name().starts_with("sqlite_")
    }
}

fn schema(db: &Connection) -> sql::Result<Vec<Definition>> {
    let text = |column: &str| format!("CAST(coalesce({column}, '') AS TEXT)");
    let columns = ["type", "name", "tbl_name", "sql"].map(text).join(", ");
    let query = format!("SELECT rowid, CAST(rootpage AS INTEGER), {columns} FROM sqlite_schema");
    let mut statement = db.prepare_cached(&query)?;
    let row = |row: &sql::Row| {
        let words = [row.get(2)?, row.get(3)?, row.get(4)?, row.get(5)?];
        Ok(Definition {
            rowid: row.get(0)?,
            root: row.get::<_, Option<i64>>(1)?.unwrap_or(0),
            words,
        })
    };
    statement.query_map([], row)?.collect()
}

/// The definitions in `known` whose names are not in `found`.
fn missing<'a>(found: &[Definition], known: &'a [Definition]) -> Vec<&'a Definition> {
    known.iter().filter(|it| found.iter().all(|found| found.name() != it.name())).collect()
}

/// Whether this is the table of migrations as earlier versions created it, with other SQL text.
fn is_older([_, name, _, text]: &[String; 4]) -> bool {
    let columns =
        ["version", "description", "installed_on", "success", "checksum", "execution_time"];
    name == TABLE && columns.iter().all(|column| text.contains(column))
}

/// Whether this is a definition in `known` as it was before migration 17, which added one column. The
/// migration of such a file still has to add it.
fn is_former([_, name, _, text]: &[String; 4], known: &[Definition]) -> bool {
    let before = |text: &str| text.replace(", policy TEXT", "").replace(", scene.policy", "");
    known.iter().any(|it| it.words[1] == *name && before(&it.words[3]) == *text)
}

/// The rows of a schema that differ from `known`, each with its replacement. The replacement is the
/// missing row with the same name or the same SQL text. If only one row differs, the replacement
/// can also be a missing row of the same type, or the only missing row.
fn renewed(found: &[Definition], known: &[Definition]) -> Vec<(i64, [String; 4])> {
    let is_known = |words: &[String; 4]| known.iter().any(|known| known.words == *words);
    let is_missing = |known: &[String; 4]| found.iter().all(|found| found.words != *known);
    let missing: Vec<_> = known.iter().map(|it| &it.words).filter(|it| is_missing(it)).collect();
    let odd = found
        .iter()
        .filter(|it| !is_known(&it.words) && !is_older(&it.words) && !is_former(&it.words, known));
    let odd: Vec<_> = odd.collect();
    let was = |[kind, name, _, text]: &[String; 4]| {
        let same_name = missing.iter().find(|it| it[1] == *name);
        let same_text = || missing.iter().find(|it| !text.is_empty() && it[3] == *text);
        let only = || missing.iter().find(|it| it[0] == *kind).filter(|_| odd.len() == 1);
        let any = || missing.first().filter(|_| odd.len() == 1 && missing.len() == 1);
        same_name.or_else(same_text).or_else(only).or_else(any).map(|it| (*it).clone())
    };
    odd.iter().filter_map(|it| Some((it.rowid, was(&it.words)?))).collect()
}
