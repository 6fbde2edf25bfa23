//! The mark of a database identifies which file and which write-ahead log belong together.
//!
//! SQLite applies any log with the right name to any file, and deletes the log of a missing file.
//! The result of a mismatch looks sound, but is a state that the database never had. Therefore the
//! marks are compared before a file is opened.

use super::connection;
use super::file::{DatabaseFile, Identity, MAGIC};
use super::log::{self, Frames, Index, PAGE, number, read_whole};
use crate::store::migrations::COUNTED;
use crate::store::opening::Misplaced;
use crate::store::sql::{Connection, Error, OptionalExtension, Result, Row};
use memchr::memmem;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The prefix of every mark.
const PREFIX: &[u8] = b"sidestep mark ";
/// Length of an identity (hexadecimal digits).
const IDENTITY: usize = 32;
/// Length of the number of commits (digits).
const COUNT: usize = 20;
/// Length of the random number of a commit (hexadecimal digits).
const DRAWN: usize = 16;

/// The mark of a database after a commit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// The identity of the database.
    pub(super) identity: String,
    /// Number of commits so far.
    pub(super) commits: u64,
    /// The random number of the previous commit.
    before: String,
    /// The random number of the last commit. It differs between copies of a database that have diverged.
    drawn: String,
}

impl Mark {
    /// The first mark in these bytes.
    pub(super) fn find(bytes: &[u8]) -> Option<Self> {
        let at = memmem::find(bytes, PREFIX)? + PREFIX.len();
        let length = IDENTITY + COUNT + 2 * DRAWN + 3;
        let text = std::str::from_utf8(bytes.get(at..at + length)?).ok()?;
        let mut parts = text.split(' ').map(str::to_owned);
        let (identity, commits) = (parts.next()?, parts.next()?.parse().ok()?);
        Some(Self { identity, commits, before: parts.next()?, drawn: parts.next()? })
    }

    /// Whether a database with this mark can get the mark `later`. Returns `true` if the marks are
    /// equal.
    pub(super) fn is_before(&self, later: &Self) -> bool {
        self == later || self.commits < later.commits && self.identity == later.identity
    }

    /// Whether the next transaction can write the mark `next`. Returns `true` if the marks are equal.
    fn is_just_before(&self, next: &Self) -> bool {
        let is_next = next.commits == self.commits + 1 && next.before == self.drawn;
        self == next || is_next && self.identity == next.identity
    }

    /// Whether a log with the mark `log` can continue a file with this mark. Returns `true` if the two
    /// marks are too many commits apart to decide.
    fn is_followed_by(&self, log: &Self) -> bool {
        match log.commits {
            commits if commits == self.commits => log.drawn == self.drawn,
            commits if commits == self.commits + 1 => log.before == self.drawn,
            _ => true,
        }
    }
}

/// The page of a file that contains the file's mark.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Offset of the page (bytes).
    pub(super) offset: u64,
    /// Size of the page (bytes).
    pub(super) length: usize,
    /// The version of the schema, which VACUUM raises, and the number of pages in the file, if SQLite
    /// can read them.
    header: Option<[u32; 2]>,
}

/// The mark in a file, without its log, and the place of the mark. Returns `None` for a file of a
/// version without marks.
pub(super) fn of_file(file: &DatabaseFile) -> Result<Option<(Mark, Place)>> {
    match by_sqlite(file) {
        // During a checkpoint, and after a crash during a checkpoint, SQLite can read the file only
        // together with its log.
        Err(error) => Ok(Some(by_bytes(file).ok().flatten().ok_or(error)?)),
        found => found,
    }
}

/// Searches the file for pages that contain a mark and nothing else. Returns the mark if there is
/// exactly one such page.
pub(super) fn by_bytes(file: &DatabaseFile) -> io::Result<Option<(Mark, Place)>> {
    // Closing any handle of a file releases SQLite's locks on it, so this handle stays open.
    static OPEN: Mutex<Vec<(Identity, File)>> = Mutex::new(Vec::new());
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    let identity = file.identity().map_err(io::Error::other)?;
    let place = match open.iter().position(|(known, _)| *known == identity) {
        Some(place) => place,
        None => {
            open.push((identity, File::open(file.path())?));
            open.len() - 1
        }
    };
    let handle = &open[place].1;
    let length = page_length(handle).unwrap_or(PAGE);
    let mut bytes = BufReader::with_capacity(1 << 20, handle);
    bytes.rewind()?;
    let (mut page, mut offset, mut found) = (vec![0; length], 0, None);
    while read_whole(&mut bytes, &mut page)? {
        if let Some(mark) = alone_on(&page)
            && found.replace((mark, Place { offset, length, header: None })).is_some()
        {
            return Ok(None);
        }
        offset += length as u64;
    }
    Ok(found)
}

/// The mark on a leaf page of a table's b-tree, if the page has a single row with a single value.
/// User input is never found, because it is stored in rows with more values.
fn alone_on(page: &[u8]) -> Option<Mark> {
    // A leaf page with one row, and the row's offset.
    let &[13, _, _, 0, 1, _, _, _, high, low, ..] = page else { return None };
    let row = page.get(usize::from(u16::from_be_bytes([high, low]))..)?;
    // The row's length, its rowid 1, the length of the record header, and the serial type of a text
    // of 101 bytes.
    let &[104, 1, 3, 0x81, 0x57, ref text @ ..] = row else { return None };
    Mark::find(text.get(..101)?)
}

/// The mark in a file and its place, as SQLite reads them without the log.
pub(super) fn by_sqlite(file: &DatabaseFile) -> Result<Option<(Mark, Place)>> {
    let db = connection::without_log(file)?;
    let page = "SELECT rootpage, (SELECT page_size FROM pragma_page_size), \
                    (SELECT schema_version FROM pragma_schema_version), \
                    (SELECT page_count FROM pragma_page_count) \
                FROM sqlite_schema WHERE name = 'mark'";
    let read = |row: &Row| {
        let header: [i64; 2] = [row.get(2)?, row.get(3)?];
        Ok((row.get(0)?, row.get(1)?, header.map(|number| u32::try_from(number).unwrap_or(0))))
    };
    let page = db.query_row(page, [], read).optional()?;
    let Some((page, size, header)): Option<(u64, u64, _)> = page else { return Ok(None) };
    let header = Some(header);
    let text =
        db.query_row("SELECT text FROM mark", [], |row| row.get::<_, String>(0)).optional()?;
    let mark = text.and_then(|text| Mark::find(text.as_bytes()));
    let place = Place { offset: (page - 1) * size, length: size as usize, header };
    Ok(mark.map(|mark| (mark, place)))
}

/// The page size, from the header in a file's first page.
pub(super) fn page_length(mut file: &File) -> Option<usize> {
    let mut head = [0; 32];
    file.rewind().and_then(|()| file.read_exact(&mut head)).ok()?;
    let length = match u16::from_be_bytes([head[16], head[17]]) {
        1 => 65_536,
        length => usize::from(length),
    };
    // If the file's length fits the number of pages only with the default page size, the stored
    // page size is damaged.
    let (pages, all) = (u64::from(number(&head[28..])), file.metadata().ok()?.len());
    if pages * length as u64 != all && pages * PAGE as u64 == all {
        return Some(PAGE);
    }
    (head.starts_with(MAGIC) && length >= 512 && length.is_power_of_two()).then_some(length)
}

/// Content of a write-ahead log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Log {
    /// The salts of this generation of the log. SQLite draws new salts when it restarts the log.
    pub(super) salts: [u8; 8],
    /// The first and the last mark of the transactions that SQLite would apply.
    pub(super) marks: Option<[Mark; 2]>,
    /// Whether all marks of the log can follow the file's mark.
    follows: bool,
    /// Number of frames up to the last transaction with a mark.
    pub(super) marked: u64,
    /// Whether a mark does not follow the mark before it, because another program wrote another
    /// database into this one.
    is_broken: bool,
    /// The first mark on a page other than the page of the file's mark. Such a log belongs to
    /// another database or to a copy of this one, or contains a VACUUM, which rearranges the pages.
    elsewhere: Option<Mark>,
    /// Whether the schema has a later version in the log than in the file, as after VACUUM.
    is_rearranged: bool,
    /// Number of transactions that SQLite would apply.
    commits: usize,
    /// If SQLite would lose frames at the end of the log, the number of frames that it would read.
    /// It loses frames if transactions follow a damaged frame, or if the log's index has more or
    /// different frames.
    cut: Option<u64>,
}

impl Log {
    /// Whether the log can belong to a file with its mark at this place. Returns `false` if the log
    /// has marks only on other pages.
    pub(super) fn is_of_place(&self) -> bool {
        self.marks.is_some() || self.elsewhere.is_none()
    }

    /// Reads the log of a file with this mark. Returns `None` if SQLite would neither apply nor
    /// lose any transaction of the log. Only marks on the page of the file's mark count, because
    /// user input may look like a mark.
    pub(super) fn read(
        path: &Path,
        of: Option<&(Mark, Place)>,
        index: Option<&Index>,
    ) -> io::Result<Option<Self>> {
        match Frames::open(path, of.map(|(_, place)| place.length))? {
            Some(frames) => Self::of(frames, of, index),
            None => Ok(None),
        }
    }

    /// Like [`Self::read`], for an open log.
    pub(super) fn of(
        mut frames: Frames,
        of: Option<&(Mark, Place)>,
        index: Option<&Index>,
    ) -> io::Result<Option<Self>> {
        let page = of.map(|(_, place)| place.offset / place.length as u64 + 1);
        let mut found = Self { salts: frames.salts(), follows: true, ..Self::default() };
        // The last mark since the last commit, the number of sound frames, and the highest commit
        // number in this database's marks after the sound frames.
        let (mut pending, mut sound, mut behind) = (None, 0, 0);
        // The last version of the schema, and the number of pages after the last commit.
        let (mut schema, mut pages) = (None, None);
        let index = index.filter(|index| index.salts == found.salts);
        let mut is_indexed = true;
        while let Some(frame) = frames.next()? {
            let mark = match page {
                Some(page) if page != u64::from(frame.page) => {
                    if found.elsewhere.is_none() && frame.is_sound {
                        found.elsewhere = alone_on(frame.content);
                    }
                    None
                }
                _ => Mark::find(frame.content),
            };
            if !frame.is_sound {
                let commits =
                    mark.filter(|mark| of.is_some_and(|(of, _)| of.identity == mark.identity));
                behind = behind.max(commits.map_or(0, |mark| mark.commits));
                continue;
            }
            sound += 1;
            if frame.page == 1 {
                schema = frame.content.get(40..44).map(number);
            }
            is_indexed &= index.is_none_or(|index| index.may_have(sound, frame.page));
            pending = mark.or(pending);
            if frame.pages == 0 {
                continue;
            }
            found.commits += 1;
            pages = Some(frame.pages);
            if let Some(mark) = pending.take() {
                let is_next = |[_, last]: &[Mark; 2]| last.is_just_before(&mark);
                found.is_broken |= !found.marks.as_ref().is_none_or(is_next);
                if found.is_broken {
                    continue;
                }
                found.marked = sound;
                found.follows &= of.is_none_or(|(file, _)| file.is_followed_by(&mark));
                let first = found.marks.take().map_or_else(|| mark.clone(), |[first, _]| first);
                found.marks = Some([first, mark]);
            }
        }
        // VACUUM INTO makes a copy with the same mark. Its pages have another arrangement, and its
        // schema has a later version than any log of the original. A log without the first page
        // changes neither the schema nor the number of pages.
        if let Some([version, count]) = of.and_then(|(_, place)| place.header) {
            found.follows &=
                schema.map_or(pages.is_none_or(|pages| pages == count), |log| version <= log);
            found.is_rearranged = schema.is_some_and(|log| version < log);
        }
        // A power failure damages at most the last transaction, because SQLite syncs the disk
        // before it begins the next one.
        let last = found.marks.as_ref().map_or(0, |[_, last]| last.commits);
        let last = of.map_or(last, |(file, _)| last.max(file.commits));
        let is_told = is_indexed && index.is_none_or(|index| index.frames <= sound);
        found.cut = (behind > last + 1 || !is_told).then_some(sound);
        Ok((found.commits > 0 || found.cut.is_some()).then_some(found))
    }
}

/// Number of attempts to read a log while a server writes to it.
const ATTEMPTS: usize = 20;

/// Number of reads of the mark while a server waits for the disk, and the pause between them.
const PATIENCE: usize = 100;
const PAUSE: Duration = Duration::from_millis(100);

/// The mismatch between a file and its log, if any. Changes nothing. `index` reads the log's index,
/// if it can be trusted.
pub(super) fn misplaced(
    file: &DatabaseFile,
    index: impl Fn() -> Option<Index>,
) -> io::Result<Option<Misplaced>> {
    let found = unlike(file, index)?;
    if found.is_some() {
        return Ok(found);
    }
    Ok(log::strange_header(file.log())?.map(|is_cut| match is_cut {
        true => Misplaced::Damaged,
        false => Misplaced::Unmarked,
    }))
}

/// The mismatch between a file and the transactions in its log, if any.
fn unlike(file: &DatabaseFile, index: impl Fn() -> Option<Index>) -> io::Result<Option<Misplaced>> {
    let mut before = None;
    for _ in 0..ATTEMPTS {
        // The index is read before the log, so that it never has frames that were written after the
        // log was read.
        let index = index();
        let Some(frames) = Frames::open(file.log(), None)? else { return Ok(None) };
        // The caller opens the file and reports the damage.
        let Ok(found) = of_file(file) else { return Ok(None) };
        let Some(log) = Log::read(file.log(), found.as_ref(), index.as_ref())? else {
            return Ok(None);
        };
        if frames.salts() != log.salts {
            continue;
        }
        // A server may be writing a frame during the read. Therefore a cut counts only if two reads
        // find it at the same frame. A server never writes the same frame twice.
        if log.cut.is_none() || before == Some((log.salts, log.cut)) {
            return Ok(compare(found.map(|(mark, _)| mark).as_ref(), &log));
        }
        before = Some((log.salts, log.cut));
    }
    Ok(None)
}

/// The mark that SQLite finds when it applies the log. Returns `None` if there is no mark.
pub(super) fn with_log(db: &Connection) -> Result<Option<Mark>> {
    let text = db.query_row("SELECT text FROM mark", [], |row| row.get::<_, String>(0)).optional();
    let has = "SELECT 1 FROM sqlite_schema WHERE name = 'mark'";
    match text {
        Err(_) if !db.prepare_cached(has)?.exists([])? => Ok(None),
        text => Ok(text?.and_then(|text| Mark::find(text.as_bytes()))),
    }
}

/// Like [`with_log`], with the number of rows that the connection's statements have changed so far,
/// including changes that were rolled back.
pub(super) fn with_changes(db: &Connection) -> Result<(Option<Mark>, i64)> {
    let read = |row: &Row| Ok((Mark::find(row.get::<_, String>(0)?.as_bytes()), row.get(1)?));
    match db.query_row("SELECT text, total_changes() FROM mark", [], read) {
        Err(_) => {
            let changes = db.query_row("SELECT total_changes()", [], |row| row.get(0))?;
            Ok((with_log(db)?, changes))
        }
        found => found,
    }
}

/// Counts a commit in the mark, if the connection has changed more than `changes` rows. Returns the
/// new mark in this case.
pub(super) fn count(db: &Connection, changes: i64) -> Result<Option<Mark>> {
    let counted = format!("{COUNTED} WHERE total_changes() > $1 RETURNING text");
    let text = db.query_row(&counted, [changes], |row| row.get::<_, String>(0)).optional()?;
    let has_changed = "SELECT total_changes() > $1";
    match text.and_then(|text| Mark::find(text.as_bytes())) {
        // The commit cannot be counted, because the mark is missing.
        None if db.query_row(has_changed, [changes], |row| row.get(0))? => Err(Error::NoRow),
        mark => Ok(mark),
    }
}

/// Whether another program wrote a different database into this one, with a mark on a different
/// page or without a mark. In this case, the mark that SQLite finds when it applies the log cannot
/// follow the log's last mark.
pub(super) fn is_replaced(file: &DatabaseFile, db: &Connection) -> Result<bool> {
    let of = of_file(file).ok().flatten();
    let log = Log::read(file.log(), of.as_ref(), None).ok().flatten();
    let Some([_, last]) = log.and_then(|log| log.marks) else { return Ok(false) };
    for _ in 0..PATIENCE {
        if with_log(db)?.is_some_and(|found| last.is_before(&found)) {
            return Ok(false);
        }
        if matches!(file.lock(), Ok(Some(_))) {
            break;
        }
        // While a server waits for the disk, the log has a commit that SQLite does not show yet.
        std::thread::sleep(PAUSE);
    }
    Ok(true)
}

fn compare(file: Option<&Mark>, log: &Log) -> Option<Misplaced> {
    let replaced = log.is_broken.then_some(Misplaced::Replaced);
    replaced.or_else(|| strange(file, log)).or_else(|| log.cut.map(|_| Misplaced::Damaged))
}

/// The mismatch between the marks of a file and of a log, if the log does not belong to the file.
fn strange(file: Option<&Mark>, log: &Log) -> Option<Misplaced> {
    let Some([first, last]) = &log.marks else {
        if file.zip(log.elsewhere.as_ref()).is_some_and(|(file, mark)| {
            log.is_rearranged && file.is_before(mark) && file.is_followed_by(mark)
        }) {
            return None;
        }
        return file.filter(|_| log.commits > 0).map(|file| match &log.elsewhere {
            Some(mark) if mark.identity == file.identity => Misplaced::Fork,
            Some(_) => Misplaced::Other,
            None => Misplaced::Unmarked,
        });
    };
    match file {
        None => Some(Misplaced::Later).filter(|_| first.commits > 1).or(None),
        Some(file) if file.identity != first.identity => Some(Misplaced::Other),
        Some(file) if first.commits > file.commits + 1 => Some(Misplaced::Later),
        Some(file) if last.commits < file.commits => Some(Misplaced::Earlier),
        Some(_) if !log.follows => Some(Misplaced::Fork),
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(identity: char, commits: u64) -> Mark {
        let (before, drawn) = (format!("{:016}", commits - 1), format!("{commits:016}"));
        Mark { identity: identity.to_string().repeat(IDENTITY), commits, before, drawn }
    }

    #[test]
    fn a_mark_is_found_in_bytes() {
        let text =
            format!("..sidestep mark {} {:020} {:016} {:016}..", "a".repeat(IDENTITY), 7, 6, 7);
        assert_eq!(Mark::find(text.as_bytes()), Some(mark('a', 7)));
        assert_eq!(Mark::find(&text.as_bytes()[..40]), None);
        assert_eq!(Mark::find(b"sidestep mark"), None);
    }

    #[test]
    fn a_log_belongs_to_its_file_alone() {
        let log = |first, last| Log {
            marks: Some([mark('a', first), mark('a', last)]),
            follows: true,
            commits: 2,
            ..Log::default()
        };
        let of = |file: Option<Mark>, log: Log| compare(file.as_ref(), &log);
        let fork = Log { follows: false, ..log(5, 9) };
        assert_eq!(of(Some(mark('a', 4)), fork), Some(Misplaced::Fork));
        let other = Mark { drawn: "0".repeat(DRAWN), ..mark('a', 4) };
        assert!(mark('a', 4).is_followed_by(&mark('a', 5)) && !other.is_followed_by(&mark('a', 5)));
        assert!(mark('a', 4).is_followed_by(&mark('a', 4)) && !other.is_followed_by(&mark('a', 4)));
        assert_eq!(of(Some(mark('a', 4)), log(5, 9)), None);
        // A checkpoint has written the log back, partially or completely.
        assert_eq!(of(Some(mark('a', 7)), log(5, 9)), None);
        assert_eq!(of(Some(mark('a', 9)), log(5, 9)), None);
        assert_eq!(of(Some(mark('a', 3)), log(5, 9)), Some(Misplaced::Later));
        assert_eq!(of(Some(mark('a', 10)), log(5, 9)), Some(Misplaced::Earlier));
        assert_eq!(of(Some(mark('b', 4)), log(5, 9)), Some(Misplaced::Other));
        let unmarked = || Log { follows: true, commits: 1, ..Log::default() };
        assert_eq!(of(Some(mark('a', 4)), unmarked()), Some(Misplaced::Unmarked));
        // The file is of an earlier version whose log has no marks either, or this log contains the
        // migration.
        assert_eq!(of(None, unmarked()), None);
        assert_eq!(of(None, log(1, 3)), None);
        assert_eq!(of(None, log(5, 9)), Some(Misplaced::Later));
    }
}
