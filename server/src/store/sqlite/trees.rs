//! Rebuilds the b-trees of a damaged SQLite file over the surviving rows:
//! <https://www.sqlite.org/fileformat2.html#b_tree_pages>.
//!
//! SQLite finds rows from the root page of a table downwards, so a lost interior page hides all
//! rows below it. The leaf pages still contain the rowids of their rows, and the types of the
//! values show which table the rows belong to.

mod page;
mod columns;

use self::columns::{Table, tables};
use self::page::{
    HEADER, INNER, LEAF, below, header_in, inner, is_ascending, rows_in, types, varint,
};
use super::connection;
use super::file::{DatabaseFile, MAGIC};
use crate::store::migrations;
use crate::store::sql::{self, Connection};
use std::collections::HashSet;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

/// An upper bound on the number of tables.
const MOST_TABLES: usize = 100;

/// Rebuilds the b-trees of a file that have lost a page. The file must not have a log. In a rebuilt
/// b-tree, the place of missing rows refers to a page that SQLite reports as damaged. If the schema
/// has lost a page, its tables are restored from the database `like`, which has all migrations.
///
/// # Errors
/// If the file cannot be read or written.
pub(super) fn mend(named: &DatabaseFile, page: usize, like: Option<&Connection>) -> io::Result<()> {
    let file = File::options().read(true).write(true).open(named.path())?;
    let mut pages = Pages::of(&file, page)?;
    if pages.count == 0 {
        return Ok(());
    }
    pages.mend_header()?;
    let schema = [Table::of_schema()];
    if pages.mend(&schema)?
        && let Some(like) = like
    {
        // If this fails, SQLite itself reports the damage later.
        let _ = put_back(named, &mut pages, like);
        pages = Pages::of(&file, page)?;
        pages.mend(&schema)?;
    }
    match tables(named) {
        Ok(tables) => pages.mend(&tables).map(drop),
        // SQLite itself reports the damage later.
        Err(_) => Ok(()),
    }
}

/// Restores the lost part of the schema.
fn put_back(named: &DatabaseFile, pages: &mut Pages<'_>, like: &Connection) -> sql::Result<()> {
    let (blank, first) = (vec![0; pages.size], pages.count + 1);
    let appended = (0..MOST_TABLES).try_for_each(|_| pages.append(&blank).map(drop));
    match appended.and_then(|()| pages.write_header()) {
        Ok(()) => {
            let db = connection::mending(named.path())?;
            migrations::put_back(&db, like, first..pages.count + 1)
        }
        Err(_) => Ok(()),
    }
}

/// A range of rows of a b-tree, from the end of the previous part up to the rowid `last`.
struct Part {
    last: i64,
    /// The leaf page of these rows, or `None` if it is lost.
    page: Option<u32>,
}

/// A leaf page that no b-tree refers to.
struct Stray {
    page: u32,
    first: i64,
    last: i64,
    /// The serial types of the values of each row.
    rows: Vec<Vec<u64>>,
}

impl Stray {
    /// Returns `None` if the page is not a leaf page, has no rows, or is invalid.
    fn read(page: u32, content: &[u8]) -> Option<Self> {
        let header = content.get(header_in(page)..)?;
        if header.first() != Some(&LEAF) {
            return None;
        }
        let count = rows_in(header);
        let mut numbers = Vec::new();
        let mut rows = Vec::new();
        for at in header.get(8..8 + 2 * count)?.chunks_exact(2) {
            let mut cell = content.get(usize::from(u16::from_be_bytes([at[0], at[1]]))..)?;
            let length = varint(&mut cell)?;
            numbers.push(varint(&mut cell)? as i64);
            rows.push(types(cell, length)?);
        }
        let (first, last) = (*numbers.first()?, *numbers.last()?);
        numbers.is_sorted_by(|one, next| one < next).then_some(Self { page, first, last, rows })
    }
}

struct Pages<'a> {
    file: &'a File,
    size: usize,
    /// The number of pages.
    count: u32,
    /// The pages that a b-tree refers to.
    reached: HashSet<u32>,
}

impl<'a> Pages<'a> {
    /// An upper bound on the number of levels of a b-tree with 2³² pages.
    const DEPTH: usize = 20;

    fn of(file: &'a File, size: usize) -> io::Result<Self> {
        let count = file.metadata()?.len() / size as u64;
        let count = u32::try_from(count).map_err(io::Error::other)?;
        Ok(Self { file, size, count, reached: HashSet::new() })
    }

    fn offset(&self, page: u32) -> u64 {
        u64::from(page - 1) * self.size as u64
    }

    fn read(&self, page: u32) -> io::Result<Vec<u8>> {
        let mut content = vec![0; self.size];
        self.file.read_exact_at(&mut content, self.offset(page))?;
        Ok(content)
    }

    fn append(&mut self, content: &[u8]) -> io::Result<u32> {
        self.count += 1;
        self.file.write_all_at(content, self.offset(self.count))?;
        Ok(self.count)
    }

    /// Rebuilds the b-trees of these tables that have lost pages. Returns whether it rebuilt any.
    fn mend(&mut self, tables: &[Table]) -> io::Result<bool> {
        let mut damaged = Vec::new();
        for table in tables {
            let mut parts = Vec::new();
            self.walk(table, table.root, i64::MAX, Self::DEPTH, &mut parts)?;
            if parts.iter().any(|part| part.page.is_none()) {
                damaged.push((table, parts));
            }
        }
        if damaged.is_empty() {
            return self.write_header().map(|()| false);
        }
        let strays = self.strays()?;
        let mut found: Vec<Vec<&Stray>> = damaged.iter().map(|_| Vec::new()).collect();
        for stray in &strays {
            if let Some(at) = owner(&damaged, stray) {
                found[at].push(stray);
            }
        }
        let (first, parts) = &damaged[0];
        if first.root == 1 && found[0].is_empty() && parts.iter().all(|part| part.page.is_none()) {
            // The file may not be a database at all.
            return Ok(false);
        }
        let lost = self.append(&vec![0; self.size])?;
        for ((table, parts), strays) in damaged.iter().zip(&found) {
            let mut pages = filled(parts, strays, lost);
            if table.root == 1 {
                // SQLite reads the schema as a whole, so a damaged page in it would hide all tables.
                pages.retain(|(_, page)| *page != lost);
            }
            self.build(table.root, pages)?;
        }
        self.write_header().map(|()| true)
    }

    /// Appends the parts of the subtree at this page. Its rowids end at `last`.
    fn walk(
        &mut self,
        table: &Table,
        page: u32,
        last: i64,
        depth: usize,
        parts: &mut Vec<Part>,
    ) -> io::Result<()> {
        let before = parts.last().map_or(i64::MIN, |part| part.last);
        let is_new = (1..=self.count).contains(&page) && depth > 0 && self.reached.insert(page);
        let content = if is_new { self.read(page)? } else { Vec::new() };
        let page_of_rows = match content.get(header_in(page)) {
            Some(&INNER) => {
                let below = below(&content[header_in(page)..], &content);
                if let Some((below, right)) =
                    below.filter(|(below, _)| is_ascending(before, below, last))
                {
                    for (last, page) in below {
                        self.walk(table, page, last, depth - 1, parts)?;
                    }
                    return self.walk(table, right, last, depth - 1, parts);
                }
                None
            }
            Some(&LEAF) => Some(page).filter(|_| is_of(table, page, &content, before, last)),
            _ => None,
        };
        parts.push(Part { last, page: page_of_rows });
        Ok(())
    }

    /// The leaf pages that no b-tree refers to, ordered by rowid.
    fn strays(&self) -> io::Result<Vec<Stray>> {
        let mut strays = Vec::new();
        for page in (2..=self.count).filter(|page| !self.reached.contains(page)) {
            strays.extend(Stray::read(page, &self.read(page)?));
        }
        strays.sort_unstable_by_key(|stray| (stray.first, stray.page));
        Ok(strays)
    }

    /// Writes a b-tree over these pages. Each page is given with the rowid of its last row.
    fn build(&mut self, root: u32, mut pages: Vec<(i64, u32)>) -> io::Result<()> {
        // The number of cells that fit on a page even if all rowids have the maximum length.
        let most = (self.size - HEADER - 12) / 15;
        while pages.len() > most {
            let mut above = Vec::new();
            for below in pages.chunks(most) {
                let content = inner(below, &vec![0; self.size], 0);
                above.push((below[below.len() - 1].0, self.append(&content)?));
            }
            pages = above;
        }
        let content = inner(&pages, &self.read(root)?, header_in(root));
        self.file.write_all_at(&content, self.offset(root))
    }

    /// Sets the bytes of a header that are the same in every database of this program.
    fn set_constants(&self, header: &mut [u8; HEADER]) {
        header[..16].copy_from_slice(MAGIC);
        // 1 stands for 65,536.
        let size = u16::try_from(self.size).unwrap_or(1);
        header[16..18].copy_from_slice(&size.to_be_bytes());
        // WAL mode, no reserved bytes, and the fractions of a page that payloads may fill.
        header[18..24].copy_from_slice(&[2, 2, 0, 64, 32, 32]);
        // Schema format 4, no automatic VACUUM, and UTF-8.
        for (at, value) in [(44, 4_u32), (52, 0), (56, 1), (64, 0)] {
            header[at..at + 4].copy_from_slice(&value.to_be_bytes());
        }
    }

    /// Repairs damaged bytes of the file header. SQLite does not read a file in which these bytes
    /// are wrong.
    fn mend_header(&self) -> io::Result<()> {
        let mut header = [0; HEADER];
        self.file.read_exact_at(&mut header, 0)?;
        let found = header;
        self.set_constants(&mut header);
        // If the first bytes of the header are damaged, too, the whole page counts as lost and is
        // repaired later.
        if found == header || !found.starts_with(MAGIC) {
            return Ok(());
        }
        self.file.write_all_at(&header, 0)
    }

    /// Writes the number of pages. The free list is emptied, because it may be damaged, too.
    fn write_header(&self) -> io::Result<()> {
        let mut header = [0; HEADER];
        self.file.read_exact_at(&mut header, 0)?;
        if !header.starts_with(MAGIC) {
            header = [0; HEADER];
        }
        self.set_constants(&mut header);
        header[28..32].copy_from_slice(&self.count.to_be_bytes());
        header[32..40].fill(0);
        let changes: [u8; 4] = std::array::from_fn(|at| header[24 + at]);
        header[92..96].copy_from_slice(&changes);
        self.file.write_all_at(&header, 0)
    }
}

/// Whether a leaf page of a table's b-tree contains rows of the table between these rowids, and was
/// not overwritten with another page. SQLite skips damaged rows of a page, but reads the schema only
/// as a whole.
fn is_of(table: &Table, page: u32, content: &[u8], before: i64, last: i64) -> bool {
    let is_schema = table.root == 1;
    if rows_in(&content[header_in(page)..]) == 0 {
        return true;
    }
    let Some(found) = Stray::read(page, content) else { return !is_schema };
    let mut fit = found.rows.iter().map(|row| table.takes(row));
    let fits = if is_schema { fit.all(|fits| fits) } else { fit.any(|fits| fits) };
    fits && before < found.first && found.last <= last
}

/// The index of the only table that lacks these rows and could have contained them. Returns `None` if
/// there are several such tables, because rows must not appear in a table that never contained them.
fn owner(damaged: &[(&Table, Vec<Part>)], stray: &Stray) -> Option<usize> {
    let is_missing = |parts: &[Part]| {
        let mut before = i64::MIN;
        parts.iter().any(|part| {
            let is_in = part.page.is_none() && before < stray.first && stray.last <= part.last;
            before = part.last;
            is_in
        })
    };
    let only = |is_whole: bool| {
        let mut owners = damaged.iter().enumerate().filter(|(_, (table, parts))| {
            let takes = |row: &Vec<u64>| {
                (!is_whole || row.len() == table.columns.len()) && table.takes(row)
            };
            stray.rows.iter().all(takes) && is_missing(parts)
        });
        owners.next().map(|(at, _)| at).filter(|_| owners.next().is_none())
    };
    only(true).or_else(|| only(false))
}

/// All leaf pages of a table, each with the rowid of its last row. `lost` is the page for lost rows.
fn filled(parts: &[Part], strays: &[&Stray], lost: u32) -> Vec<(i64, u32)> {
    let (mut pages, mut strays) = (Vec::new(), strays.iter().peekable());
    let mut before = 0;
    for part in parts {
        if let Some(page) = part.page {
            pages.push((part.last, page));
            before = part.last;
            continue;
        }
        while let Some(stray) = strays.next_if(|stray| stray.last <= part.last) {
            if stray.first <= before {
                continue;
            }
            if stray.first > before + 1 {
                pages.push((stray.first - 1, lost));
            }
            pages.push((stray.last, stray.page));
            before = stray.last;
        }
        if before < part.last {
            pages.push((part.last, lost));
            before = part.last;
        }
    }
    pages
}

#[cfg(test)]
mod tests {
    use super::super::log::PAGE;
    use super::*;
    use std::collections::BTreeSet;
    use std::path::Path;

    /// A file with two tables whose b-trees have three levels, and some small tables.
    fn written(path: &Path) -> Vec<u8> {
        let file = DatabaseFile::at(path);
        file.create().unwrap();
        let db = connection::writing(path).unwrap();
        db.batch(
            "CREATE TABLE study (id INTEGER PRIMARY KEY, name TEXT NOT NULL, bytes BLOB NOT NULL) STRICT; \
             CREATE TABLE trial (name TEXT NOT NULL, weight REAL NOT NULL) STRICT; \
             ALTER TABLE trial ADD COLUMN later INTEGER NOT NULL DEFAULT 7; \
             CREATE TABLE scene (at INTEGER NOT NULL) STRICT; INSERT INTO scene VALUES (3); \
             CREATE TABLE participant (at INTEGER NOT NULL, few REAL NOT NULL) STRICT; \
             CREATE TABLE study_config (hash TEXT NOT NULL) STRICT",
        )
        .unwrap();
        // As in a file of this program, the schema table has several pages.
        for view in 0..8 {
            let text = "x".repeat(900);
            db.batch(&format!("CREATE VIEW view{view} AS SELECT '{text}'")).unwrap();
        }
        // The rowids have various lengths. Two tables grow together, so that their pages alternate.
        let rows =
            "WITH RECURSIVE n (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM n WHERE n < 400) ";
        for part in 0..3 {
            db.batch(&format!(
                "{rows} INSERT INTO study SELECT n * (n + {part}) + {part} * 5000000000, \
                     printf('one%08d.', {part} * 400 + n), zeroblob(n % 3 * 1900) FROM n; \
                 {rows} INSERT INTO trial (name, weight) SELECT \
                     printf('other%07d%01500d', {part} * 400 + n, 0), n / 2.0 FROM n;"
            ))
            .unwrap();
        }
        assert!(connection::empty_log(&db).unwrap());
        drop(db);
        std::fs::read(path).unwrap()
    }

    /// The names of the rows that SQLite finds by their rowids, or as the next row after a rowid.
    fn names(file: &DatabaseFile) -> BTreeSet<String> {
        let db = connection::without_log(file).unwrap();
        let mut found = BTreeSet::new();
        for table in ["study", "trial"] {
            let next =
                format!("SELECT rowid, substr(name, 1, 12) FROM {table} WHERE rowid > $1 LIMIT 1");
            let last = format!("SELECT rowid, substr(name, 1, 12) FROM {table} WHERE rowid = $1");
            let mut numbers: Vec<i64> = vec![0];
            numbers
                .extend((0..3).flat_map(|part| {
                    (1..=400).map(move |n| n * (n + part) + part * 5_000_000_000)
                }));
            for number in numbers.into_iter().chain(0..1201) {
                for query in [&next, &last] {
                    let row = db.query_row(query, [number], |row| row.get::<_, String>(1));
                    found.extend(row.ok());
                }
            }
        }
        found
    }

    /// The names of the rows that survived. They are found in the leaf pages without following b-trees.
    fn left(content: &[u8]) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        for page in content.chunks_exact(PAGE).filter(|page| page[0] == LEAF) {
            for word in ["one", "other"] {
                for at in memchr::memmem::find_iter(page, word) {
                    let name = String::from_utf8_lossy(&page[at..at + 12]).into_owned();
                    if name[word.len()..].starts_with('0') {
                        found.insert(name);
                    }
                }
            }
        }
        found
    }

    /// Rebuilds a file with this content, and compares the readable rows with the surviving rows.
    fn compare(path: &Path, content: &[u8], what: &str) -> usize {
        std::fs::write(path, content).unwrap();
        let file = DatabaseFile::at(path);
        mend(&file, PAGE, None).unwrap();
        let (read, left) = (names(&file), left(content));
        assert!(read == left, "{what}: {} of {}", read.len(), left.len());
        left.len()
    }

    #[test]
    fn rows_are_read_wherever_pages_are_lost() {
        let folder = tempfile::tempdir().unwrap();
        let whole = written(&folder.path().join("whole.db"));
        let damaged = folder.path().join("damaged.db");
        let all = compare(&damaged, &whole, "sound");
        assert_eq!(all, 2400);
        assert!(std::fs::read(&damaged).unwrap() == whole, "a sound file is as it was");
        let inner: Vec<_> =
            (0..whole.len() / PAGE).filter(|page| whole[page * PAGE] == INNER).collect();
        assert!(inner.len() > 4, "{inner:?}");
        // The first page contains the schema, and the next pages are the root pages of the tables.
        for lost in inner.iter().copied().chain([0, 1, 2, 3, 40]) {
            let mut content = whole.clone();
            content[lost * PAGE..][..PAGE].fill(0);
            let left = compare(&damaged, &content, &format!("without page {lost}"));
            assert!(all - left < 20, "{left}");
        }
        for parts in 1..10 {
            let content = &whole[..whole.len() / PAGE * parts / 10 * PAGE];
            let left = compare(&damaged, content, &format!("{parts} tenths"));
            assert!(left * 20 > all * parts, "{left}");
        }
        let mut content = whole.clone();
        inner.iter().for_each(|lost| content[lost * PAGE..][..PAGE].fill(0xd5));
        assert_eq!(compare(&damaged, &content, "without any inner page"), all);
    }
}
