//! Reads the readable part of a damaged SQLite file. The queries are the same as for copying a
//! sound file. If a query fails, its rows are read one by one.
//!
//! An index still contains the keys of rows whose page is damaged, so lost rows can be named. If
//! the index is damaged, the rows of the table are read in the order of their rowids, and
//! unreadable pages are skipped.

mod study;

use super::columns::{ACCESS_TABLES, ANALYSIS_TABLES, PARTICIPANT_TABLES, Table, never_use_again};
use super::rows::{Rows, insert, read, read_where};
use super::{CopyTarget, RowsCopy, StudyCopy, rows_copy};
use crate::store::lanes::Lock;
use crate::store::sql::{Connection, Params, Value, params};
use crate::store::{Store, StoreError};
use serde::Serialize;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt;
use tokio::sync::mpsc;

/// A salvaged item.
#[derive(Debug)]
pub enum Salvaged {
    /// A study, without its participants and analyses.
    Study(Box<StudyCopy>),
    /// A participant, and the id of the study's row.
    Participant(i64, RowsCopy),
    /// An analysis, and the id of the study's row.
    Analysis(i64, RowsCopy),
    /// Keys and audit trail.
    Access(RowsCopy),
    /// A lost row.
    Lost(Lost),
}

/// A row that is lost.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Lost {
    /// The table.
    pub table: String,
    /// The key of the row, as far as it is known.
    pub key: String,
    /// The reason for the loss.
    pub why: String,
}

impl Lost {
    /// A row of this table with this key.
    pub fn new(table: &str, key: impl Into<String>, why: impl Into<String>) -> Self {
        Self { table: table.to_owned(), key: key.into(), why: why.into() }
    }
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}: {}", self.table, self.key, self.why)
    }
}

impl RowsCopy {
    /// The list of losses if a participant and all their rows are lost for this reason. Each trial
    /// is named. The rows of other tables are only counted.
    pub fn rows_lost(&self, why: &str) -> impl Iterator<Item = Lost> {
        PARTICIPANT_TABLES.iter().zip(&self.tables).flat_map(move |(table, rows)| {
            let keys: Vec<String> = match table.name {
                "participant" | "trial" => rows.keys().map(str::to_owned).collect(),
                "tally" => Vec::new(),
                _ => counted(rows.len(), &self.id).into_iter().collect(),
            };
            keys.into_iter().map(move |key| Lost::new(table.name, key, why))
        })
    }
}

/// A key that states the number of a participant's unnamed rows. Returns `None` if there are no rows.
fn counted(rows: usize, participant: &str) -> Option<String> {
    (rows > 0).then(|| format!("({rows} of participant {participant})"))
}

impl Store {
    /// Reads everything that can be read and sends it, each study before its participants.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be read at all, or the receiver is dropped.
    pub async fn salvage(&self, out: mpsc::Sender<Salvaged>) -> Result<(), StoreError> {
        self.read_long(move |db| {
            let (walks, seen, configs) = (HashMap::new(), HashSet::new(), HashMap::new());
            Reader { db, out, walks, seen, configs }.run()
        })
        .await
    }

    /// Stores rows one by one. With a target, these are a participant's rows. Without a target,
    /// these are the keys and the audit trail. Returns the rows that the database refuses.
    ///
    /// # Errors
    /// [`StoreError`] if the transaction fails.
    pub async fn put_rows_apart(
        &self,
        target: Option<CopyTarget>,
        copy: RowsCopy,
    ) -> Result<Vec<Lost>, StoreError> {
        let (tables, study_id, shift) = match target {
            Some(target) => (PARTICIPANT_TABLES, target.study_id, target.shift),
            None => (ACCESS_TABLES, 0, 0),
        };
        let locks = [Lock::Studies, Lock::Keys, Lock::Study(study_id), Lock::Analyses];
        self.write_behind(locks, move |db| {
            let mut lost = Vec::new();
            for (table, rows) in tables.iter().zip(&copy.tables) {
                for row in rows.apart() {
                    db.batch("SAVEPOINT one_row")?;
                    let Err(error) = insert(db, table, &row, study_id, shift) else {
                        db.batch("RELEASE SAVEPOINT one_row")?;
                        continue;
                    };
                    db.batch("ROLLBACK TO SAVEPOINT one_row; RELEASE SAVEPOINT one_row")?;
                    let key = row.keys().next().unwrap_or(&copy.id).to_owned();
                    lost.push(Lost::new(table.name, key, error.to_string()));
                }
                if target.is_none() {
                    never_use_again(db, table.name)?;
                }
            }
            Ok(lost)
        })
        .await
    }

    /// Deletes a trial in which the check of the copied database found a fault.
    pub async fn drop_unsound(&self, trial_id: &str) -> Result<(), StoreError> {
        let trial_id = trial_id.to_owned();
        self.write_behind([Lock::Studies], move |db| {
            Ok(db.execute("DELETE FROM trial WHERE trial_id = $1", [trial_id]).map(drop)?)
        })
        .await
    }
}

/// The rowids and keys of rows, by owner.
type Walk = HashMap<String, Vec<(i64, String)>>;

struct Reader<'a> {
    db: &'a Connection,
    out: mpsc::Sender<Salvaged>,
    /// The rows found by table scans, by table.
    walks: HashMap<&'static str, Walk>,
    /// Trials that were read or reported as lost.
    seen: HashSet<String>,
    /// The stored hash of each configuration that was read, and the hash of its content.
    configs: HashMap<String, String>,
}

/// The columns that contain a row's key and its owner.
fn key_and_owner(table: &str) -> [&'static str; 2] {
    match table {
        "study" => ["slug", "slug"],
        "study_config" => ["hash", "hash"],
        "participant" | "analysis" => ["id", "id"],
        "trial" => ["trial_id", "trial_id"],
        "scene" => ["ordinal", "participant_id"],
        "participant_token" | "note" | "exclusion" => ["rowid", "participant_id"],
        _ => ["rowid", "''"],
    }
}

impl Reader<'_> {
    /// How many rowids are tried after the last readable row.
    const MOST_TRIED: i64 = 100_000;

    fn run(mut self) -> Result<(), StoreError> {
        for slug in self.ids("study")? {
            if let Some(study) = self.study(&slug)? {
                self.send(Salvaged::Study(Box::new(study)))?;
            }
        }
        for id in self.ids("participant")? {
            if let Some(mut rows) = self.participant(&id)? {
                let lost = match rows.config_hash() {
                    Some(Value::Text(hash)) => match self.configs.get(&**hash) {
                        Some(saved) => {
                            *hash = saved.clone().into();
                            None
                        }
                        None => Some(hash.to_string()),
                    },
                    _ => Some(String::new()),
                };
                if let Some(hash) = lost {
                    let why = format!("the configuration {hash} is lost");
                    rows.rows_lost(&why).try_for_each(|lost| self.send(Salvaged::Lost(lost)))?;
                    continue;
                }
                let study = "SELECT study_id FROM participant WHERE rowid = $1";
                let rowid = self.rowids("participant", &id)?.first().map_or(0, |(rowid, _)| *rowid);
                let study_id = self.db.query_row(study, [rowid], |row| row.get(0))?;
                self.send(Salvaged::Participant(study_id, rows))?;
            }
        }
        for id in self.ids("trial")? {
            if !self.seen.contains(&id) {
                self.lose("trial", id, "no scene that can be read has it")?;
            }
        }
        self.analyses()?;
        self.lose_dangling()?;
        let mut tables = Vec::new();
        for table in ACCESS_TABLES {
            tables.push(match read(self.db, table, None) {
                Err(StoreError::Corrupt(_)) => {
                    let mut rowids: Vec<_> =
                        self.walk(table.name)?.values().flatten().cloned().collect();
                    rowids.sort_unstable();
                    self.rows(table, &rowids)?
                }
                read => read?,
            });
        }
        self.send(Salvaged::Access(RowsCopy { id: String::new(), tables }))
    }

    fn send(&self, found: Salvaged) -> Result<(), StoreError> {
        let gone = |_| StoreError::Unavailable("stopped".to_owned());
        self.out.blocking_send(found).map_err(gone)
    }

    fn lose(&self, table: &str, key: impl Into<String>, why: &str) -> Result<(), StoreError> {
        self.send(Salvaged::Lost(Lost::new(table, key, why)))
    }

    /// Returns the result. If the row cannot be read, reports it as lost and returns `None`.
    fn unless_lost<T>(
        &self,
        table: &str,
        key: &str,
        read: Result<T, StoreError>,
    ) -> Result<Option<T>, StoreError> {
        match read {
            Err(StoreError::Corrupt(why)) => self.lose(table, key, &why).map(|()| None),
            read => read.map(Some),
        }
    }

    /// The keys of all rows of a table.
    fn ids(&mut self, table: &'static str) -> Result<Vec<String>, StoreError> {
        let [_, owner] = key_and_owner(table);
        // Without ORDER BY, the index alone answers this query.
        match texts(self.db, &format!("SELECT {owner} FROM {table}")) {
            Err(StoreError::Corrupt(_)) => {}
            found => return found,
        }
        let mut found: Vec<_> =
            self.walk(table)?.iter().map(|(id, rows)| (rows[0].0, id.clone())).collect();
        found.sort_unstable();
        Ok(found.into_iter().map(|(_, id)| id).collect())
    }

    /// The rowids and keys of the rows that belong to this owner.
    fn rowids(
        &mut self,
        table: &'static str,
        owner: &str,
    ) -> Result<Vec<(i64, String)>, StoreError> {
        let [key, column] = key_and_owner(table);
        let query = format!("SELECT rowid, CAST({key} AS TEXT) FROM {table} WHERE {column} = $1");
        match numbered(self.db, &query, [owner]) {
            Err(StoreError::Corrupt(_)) => {}
            found => return found,
        }
        Ok(self.walk(table)?.get(owner).cloned().unwrap_or_default())
    }

    /// All readable rows of a table, without using an index.
    fn walk(&mut self, table: &'static str) -> Result<&Walk, StoreError> {
        if !self.walks.contains_key(table) {
            let walk = self.walk_once(table)?;
            self.walks.insert(table, walk);
        }
        Ok(&self.walks[table])
    }

    fn walk_once(&self, table: &'static str) -> Result<Walk, StoreError> {
        const MANY: i64 = 512;
        let [key, owner] = key_and_owner(table);
        let query = format!(
            "SELECT rowid, CAST({key} AS TEXT), {owner} FROM {table} NOT INDEXED WHERE rowid > $1 \
             ORDER BY rowid LIMIT $2"
        );
        let mut walk = Walk::new();
        let (mut last, mut many) = (0, MANY);
        let end = self.last(table);
        // The first unreadable row after the last row that was read, and why it cannot be read.
        let mut damaged: Option<(i64, String)> = None;
        while last < end && damaged.as_ref().is_none_or(|(from, _)| last - from < Self::MOST_TRIED)
        {
            let mut statement = self.db.prepare_cached(&query)?;
            let rows = statement.query_map(params![last, many], |row| {
                Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?, row.get::<_, String>(2)?))
            });
            match rows.and_then(Iterator::collect::<Result<Vec<_>, _>>).map_err(StoreError::from) {
                Err(StoreError::Corrupt(_)) if many > 1 => many = 1,
                Err(StoreError::Corrupt(why)) => {
                    last += 1;
                    damaged.get_or_insert((last, why));
                }
                Err(error) => return Err(error),
                Ok(rows) => {
                    let next = rows.first().map_or(end, |(rowid, ..)| rowid - 1);
                    if let Some((from, why)) = damaged.take() {
                        self.lose(table, format!("rows {from} to {next}"), &why)?;
                    }
                    let Some((rowid, ..)) = rows.last() else { break };
                    last = *rowid;
                    many = MANY.min(2 * many);
                    for (rowid, key, owner) in rows {
                        walk.entry(owner).or_default().push((rowid, key));
                    }
                }
            }
        }
        if let Some((from, why)) = damaged {
            self.lose(table, format!("rows from {from}"), &why)?;
        }
        Ok(walk)
    }

    /// The highest rowid of a table. If it cannot be read, returns the highest rowid ever assigned. If
    /// this cannot be read either, returns `i64::MAX`.
    fn last(&self, table: &str) -> i64 {
        let highest = format!("SELECT max(rowid) FROM {table} NOT INDEXED");
        let highest = self.db.query_row(&highest, [], |row| row.get::<_, Option<i64>>(0));
        let given = || {
            let query = "SELECT seq FROM sqlite_sequence WHERE name = $1";
            self.db.query_row(query, [table], |row| row.get(0)).ok()
        };
        highest.ok().map(|highest| highest.unwrap_or(0)).or_else(given).unwrap_or(i64::MAX)
    }

    /// Reads these rows, and reports unreadable ones as lost.
    fn rows(&self, table: &Table, rowids: &[(i64, String)]) -> Result<Rows, StoreError> {
        let mut rows = Rows::default();
        for (rowid, key) in rowids {
            let row = read_where(self.db, table, "rowid = $1", Some(rowid));
            let row = row.and_then(|row| match row.len() {
                1 => Ok(row),
                _ => Err(StoreError::corrupt("only an index has it")),
            });
            if let Some(row) = self.unless_lost(table.name, key, row)? {
                rows.append(row);
            }
        }
        Ok(rows)
    }

    /// `there` is the number of trials that were read. If the tally counts more trials, reports the
    /// difference as lost.
    fn lose_uncounted(&self, id: &str, there: usize) -> Result<(), StoreError> {
        let query = "SELECT stored FROM tally WHERE participant_id = $1";
        let stored = self.db.query_row(query, [id], |row| row.get::<_, i64>(0));
        let gone = stored.ok().and_then(|stored| usize::try_from(stored).ok());
        match gone.unwrap_or(0).saturating_sub(there) {
            0 => Ok(()),
            gone => self.lose(
                "trial",
                format!("({gone} of participant {id})"),
                "counted when it was stored, and no longer there",
            ),
        }
    }

    /// A participant with all readable rows. Returns `None` if the participant's own row is lost.
    fn participant(&mut self, id: &str) -> Result<Option<RowsCopy>, StoreError> {
        match rows_copy(self.db, PARTICIPANT_TABLES, id) {
            Err(StoreError::Corrupt(_)) | Ok(None) => {}
            Ok(Some(copy)) => {
                self.seen.extend(copy.keys("trial").map(str::to_owned));
                self.lose_uncounted(id, copy.keys("trial").count())?;
                return Ok(Some(copy));
            }
            Err(error) => return Err(error),
        }
        let mut tables: Vec<Rows> = Vec::new();
        let mut scenes: Vec<String> = Vec::new();
        for table in PARTICIPANT_TABLES {
            let mut rowids = Vec::new();
            match table.name {
                // The tally is derived from the other rows.
                "tally" => {}
                "trial" => {
                    for trial_id in &scenes {
                        rowids.extend(self.rowids(table.name, trial_id)?);
                    }
                    rowids.sort_unstable();
                }
                _ => rowids = self.rowids(table.name, id)?,
            }
            if table.name == "scene" {
                for (_, key) in &mut rowids {
                    *key = format!("{key} of participant {id}");
                }
            }
            let is_lost = tables.first().is_some_and(|own| own.len() == 0);
            let rows = match is_lost && table.name != "scene" {
                true => Rows::default(),
                false => self.rows(table, &rowids)?,
            };
            tables.push(rows);
            if is_lost {
                let why = format!("participant {id} is lost");
                let keys: Vec<String> = match table.name {
                    "trial" => rowids.iter().map(|(_, trial_id)| trial_id.clone()).collect(),
                    _ => counted(rowids.len(), id).into_iter().collect(),
                };
                for key in keys {
                    self.lose(table.name, key, &why)?;
                }
            }
            match table.name {
                "scene" => scenes = tables[tables.len() - 1].keys().map(str::to_owned).collect(),
                "trial" => self.seen.extend(rowids.into_iter().map(|(_, trial_id)| trial_id)),
                _ => {}
            }
        }
        let exists = tables.first().is_some_and(|own| own.len() > 0);
        Ok(exists.then(|| RowsCopy { id: id.to_owned(), tables }))
    }

    /// Reports rows whose owner is missing, except trials. [`Self::run`] reports trials without an
    /// owner.
    fn lose_dangling(&self) -> Result<(), StoreError> {
        let mut missing = BTreeSet::new();
        for table in ["participant_token", "scene", "note", "exclusion", "tally"] {
            let query = format!(
                "SELECT count(*), participant_id FROM {table} \
                 WHERE participant_id NOT IN (SELECT id FROM participant) GROUP BY participant_id"
            );
            // Damaged pages are reported where their rows are read.
            for (rows, id) in numbered(self.db, &query, []).unwrap_or_default() {
                let key = counted(usize::try_from(rows).unwrap_or(0), &id);
                if let Some(key) = key.filter(|_| table != "tally") {
                    self.lose(table, key, &format!("participant {id} is lost"))?;
                }
                missing.insert(id);
            }
        }
        for id in missing {
            self.lose("participant", id, "only rows that refer to it are left")?;
        }
        let query = "SELECT \"table\", coalesce(rowid, -1), parent FROM pragma_foreign_key_check \
                     WHERE parent <> 'participant' AND \"table\" NOT IN ('participant', 'trial')";
        let mut statement = self.db.prepare_cached(query)?;
        let rows = statement.query_map([], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, i64>(1)?, row.get::<_, String>(2)?))
        });
        let Ok(rows) = rows.and_then(Iterator::collect::<Result<Vec<_>, _>>) else { return Ok(()) };
        for (table, row, parent) in rows {
            let why = format!("it refers to nothing in {parent}");
            self.lose(&table, format!("row {row}"), &why)?;
        }
        Ok(())
    }

    /// Sends the analyses that can be read completely. Other analyses can be computed again.
    fn analyses(&mut self) -> Result<(), StoreError> {
        let ids = match texts(self.db, "SELECT id FROM analysis ORDER BY sequence") {
            Err(StoreError::Corrupt(_)) => self.ids("analysis")?,
            ids => ids?,
        };
        for id in ids {
            let study =
                self.db.query_row("SELECT study_id FROM analysis WHERE id = $1", [&id], |row| {
                    row.get::<_, i64>(0)
                });
            let copy = study.map_err(StoreError::from).and_then(|study_id| {
                Ok(rows_copy(self.db, ANALYSIS_TABLES, &id)?.map(|copy| (study_id, copy)))
            });
            if let Some((study_id, copy)) = self.unless_lost("analysis", &id, copy)?.flatten() {
                self.send(Salvaged::Analysis(study_id, copy))?;
            }
        }
        Ok(())
    }
}

fn texts(db: &Connection, query: &str) -> Result<Vec<String>, StoreError> {
    Ok(db.prepare_cached(query)?.query_map([], |row| row.get(0))?.collect::<Result<_, _>>()?)
}

fn numbered(
    db: &Connection,
    query: &str,
    of: impl Params,
) -> Result<Vec<(i64, String)>, StoreError> {
    let mut statement = db.prepare_cached(query)?;
    let rows = statement.query_map(of, |row| Ok((row.get(0)?, row.get(1)?)))?;
    Ok(rows.collect::<Result<_, _>>()?)
}
