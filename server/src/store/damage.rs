//! Damage that the database finds in its own file.

use super::studies::key_of;
use super::{Database, Store, StoreError};
use std::collections::BTreeMap;

impl Store {
    /// Damage that SQLite finds in the file: damaged pages, with their tables or indices, and
    /// dangling references. The list is empty for a sound database, and for PostgreSQL, which has
    /// its own tools for this.
    ///
    /// # Errors
    /// If the check cannot be run.
    pub async fn damage(&self) -> Result<Vec<String>, StoreError> {
        let Database::Sqlite(database) = &self.open.database else { return Ok(Vec::new()) };
        let found = database.damage().await?;
        if found.is_empty() {
            return Ok(found);
        }
        let names = self.trees().await.unwrap_or_default();
        Ok(found
            .iter()
            .flat_map(|found| found.lines())
            .filter_map(|line| told(line, &names))
            .collect())
    }

    /// Configurations and value functions whose key is no longer the SHA-256 of their content,
    /// because the content was altered.
    ///
    /// # Errors
    /// If they cannot be read.
    pub async fn altered(&self) -> Result<Vec<String>, StoreError> {
        self.read_long(|db| {
            let mut altered = Vec::new();
            let mut compare = |what: &str, key: String, content: &[u8]| {
                if key_of(content) != key {
                    altered.push(format!("{what} {key}: its content was altered"));
                }
            };
            let mut statement = db.prepare_cached("SELECT hash, json FROM study_config")?;
            let rows =
                statement.query_map([], |row| Ok((row.get(0)?, row.get::<_, String>(1)?)))?;
            for row in rows {
                let (key, json) = row?;
                compare("configuration", key, json.as_bytes());
            }
            let mut statement = db.prepare_cached("SELECT id FROM value_function")?;
            let ids = statement.query_map([], |row| row.get::<_, String>(0))?;
            for id in ids.collect::<Result<Vec<_>, _>>()? {
                let query = "SELECT octets FROM value_function WHERE id = $1";
                let bytes = db.query_row(query, [&id], |row| row.get::<_, Vec<u8>>(0))?;
                compare("value function", id, &bytes);
            }
            Ok(altered)
        })
        .await
    }

    /// Names of tables and indices by the root pages of their b-trees.
    async fn trees(&self) -> Result<BTreeMap<i64, String>, StoreError> {
        self.read_long(|db| {
            let query = "SELECT rootpage, name FROM sqlite_schema WHERE rootpage > 0";
            let mut statement = db.prepare_cached(query)?;
            let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
            Ok(rows.collect::<Result<_, _>>()?)
        })
        .await
    }
}

/// A line of SQLite's integrity check, with the root page of a b-tree replaced by the name of its
/// table or index. Returns `None` for a title line.
fn told(line: &str, names: &BTreeMap<i64, String>) -> Option<String> {
    if line.starts_with("***") {
        return None;
    }
    let named = line.strip_prefix("Tree ").and_then(|rest| {
        let (number, rest) = rest.split_once(' ')?;
        Some(format!("{}, {rest}", names.get(&number.parse().ok()?)?))
    });
    Some(named.unwrap_or_else(|| line.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_is_called_by_its_name() {
        let names = BTreeMap::from([(12, "trial".to_owned())]);
        let told = |line: &str| told(line, &names);
        assert_eq!(told("*** in database main ***"), None);
        let line = "page 345: btreeInitPage() returns error code 11";
        assert_eq!(told(&format!("Tree 12 {line}")).unwrap(), format!("trial, {line}"));
        for other in ["Tree 13 page 1: x", "Tree", "row 1 missing from index people"] {
            assert_eq!(told(other).unwrap(), other);
        }
    }
}
