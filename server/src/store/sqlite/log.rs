//! Reads SQLite's write-ahead log frame by frame: <https://www.sqlite.org/fileformat2.html#walformat>.
//!
//! Each frame contains a page and a cumulative checksum. A power failure can leave incomplete
//! frames at the end, so SQLite reads up to the first frame with a wrong checksum, and silently
//! overwrites the rest.

use std::fs::File;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::time::Duration;

const HEADER: usize = 32;
const FRAME: usize = 24;

/// The first bytes of a log. The last bit of the next byte gives the byte order of the checksums.
const MAGIC: [u8; 3] = [0x37, 0x7f, 0x06];

/// The page size assumed if it is unknown (bytes).
pub(super) const PAGE: usize = 4096;

/// A log that is read from its beginning.
pub(super) struct Frames {
    log: BufReader<File>,
    sum: Checksum,
    /// The salts of this generation of the log. SQLite draws new salts when it restarts the log.
    salts: [u8; 8],
    /// Whether every frame so far is as SQLite wrote it.
    is_sound: bool,
    /// The checksums of the previous frame, if they can be trusted.
    before: Option<[u8; 8]>,
    frame: Vec<u8>,
}

/// A frame of this generation of a log, or a frame left over from an earlier generation.
pub(super) struct Frame<'a> {
    /// The page number, from 1.
    pub(super) page: u32,
    /// If the frame commits a transaction, the size of the database file after the commit, in
    /// pages; otherwise 0.
    pub(super) pages: u32,
    /// Whether this frame and all frames before it are as SQLite wrote them.
    pub(super) is_sound: bool,
    /// Whether the frame belongs to this generation.
    is_own: bool,
    /// Whether the frame belongs to this generation, and its checksums follow from the previous frame's
    /// checksums. If the previous checksums cannot be trusted, only the generation is checked.
    is_intact: bool,
    /// The content of the page.
    pub(super) content: &'a [u8],
}

impl Frames {
    /// Opens a log. Returns `None` if the log is missing, or too short for a header. `page` is the
    /// page size to use if the log's header is damaged.
    pub(super) fn open(path: &Path, page: Option<usize>) -> io::Result<Option<Self>> {
        match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            file => Self::of(file?, page),
        }
    }

    /// Like [`Self::open`], for an open log.
    pub(super) fn of(file: File, page: Option<usize>) -> io::Result<Option<Self>> {
        let mut log = BufReader::with_capacity(1 << 20, file);
        log.rewind()?;
        let mut header = [0; HEADER];
        if !read_whole(&mut log, &mut header)? {
            return Ok(None);
        }
        let sound = Checksum::of_header(&header);
        let (sum, is_sound) = (sound.unwrap_or(Checksum::of(&header)), sound.is_some());
        let length = match is_sound {
            true => number(&header[8..]) as usize,
            false => page.unwrap_or(PAGE),
        };
        let mut found = Self {
            log,
            sum,
            salts: [0; 8],
            is_sound,
            before: None,
            frame: vec![0; FRAME + length],
        };
        found.salts.copy_from_slice(&header[16..24]);
        if !is_sound {
            found.salts = found.repeated_salts()?;
            found.log.seek(SeekFrom::Start(HEADER as u64))?;
        }
        Ok(Some(found))
    }

    /// The first salts that two consecutive frames share and whose bytes are not all equal. Every
    /// frame repeats the salts of the header.
    fn repeated_salts(&mut self) -> io::Result<[u8; 8]> {
        let mut last = [0; 8];
        while read_whole(&mut self.log, &mut self.frame)? {
            let salts = &self.frame[8..16];
            if last == salts && salts.iter().any(|byte| *byte != salts[0]) {
                break;
            }
            last.copy_from_slice(salts);
        }
        Ok(last)
    }

    pub(super) fn salts(&self) -> [u8; 8] {
        self.salts
    }

    /// Reads the next frame. Returns `None` at the end of the log.
    pub(super) fn next(&mut self) -> io::Result<Option<Frame<'_>>> {
        if !read_whole(&mut self.log, &mut self.frame)? {
            return Ok(None);
        }
        let (head, content) = self.frame.split_at(FRAME);
        let is_own = head[8..16] == self.salts;
        self.is_sound &= is_own;
        if self.is_sound {
            self.sum.add(&head[..8]);
            self.sum.add(content);
            self.is_sound = self.sum.is(&head[16..]);
        }
        let follows = |before: [u8; 8]| {
            let mut sum = Checksum { sums: [number(&before), number(&before[4..])], ..self.sum };
            sum.add(&head[..8]);
            sum.add(content);
            sum.is(&head[16..])
        };
        let is_intact = is_own && (self.is_sound || self.before.is_none_or(follows));
        self.before = head[16..].try_into().ok().filter(|_| is_intact);
        let (page, pages) = (number(head), number(&head[4..]));
        Ok(Some(Frame { page, pages, is_sound: self.is_sound, is_own, is_intact, content }))
    }
}

/// The index of a log, which all connections share: <https://www.sqlite.org/walformat.html#walidxfmt>.
pub(super) struct Index {
    /// The salts of the log generation that the index describes.
    pub(super) salts: [u8; 8],
    /// Number of committed frames of the log.
    pub(super) frames: u64,
    /// Number of these frames that checkpoints have written to the file.
    pub(super) written_back: u32,
    /// The whole index. Empty if only the header was read.
    bytes: Vec<u8>,
}

impl Index {
    /// The size of a block (bytes). A block contains the page numbers of some frames, and a hash table.
    const PART: usize = 32_768;
    /// The size of the header in the first block (bytes).
    const HEADER: usize = 136;
    /// Number of frames in a block. The first block has fewer because of the header.
    const FRAMES: usize = 4096;
    /// Number of slots of a block's hash table.
    const SLOTS: usize = 8192;

    /// Reads an index. Returns `None` if no connection has initialised it, or if its header was
    /// read during a write.
    pub(super) fn read(file: &File, is_whole: bool) -> Option<Self> {
        let length = if is_whole { usize::try_from(file.metadata().ok()?.len()).ok()? } else { 0 };
        let mut bytes = vec![0; length.max(Self::HEADER)];
        file.read_exact_at(&mut bytes, 0).ok()?;
        // The header is stored twice, so that a torn write is detected. It contains the number of
        // frames, and a flag that is set once the index is initialised.
        let (one, other) = (&bytes[..48], &bytes[48..96]);
        if one != other || one[12] != 1 {
            return None;
        }
        let frames = u32::from_ne_bytes(one[16..20].try_into().ok()?);
        let salts = one[32..40].try_into().ok()?;
        Some(Self {
            salts,
            frames: frames.into(),
            written_back: u32::from_ne_bytes(bytes[96..100].try_into().ok()?),
            bytes: if is_whole { bytes } else { Vec::new() },
        })
    }

    /// Whether the index agrees that the frame with this number (from 1) contains this page. Both
    /// the page list, which checkpoints use, and the hash table, which reads use, must agree.
    /// Returns `true` if the index does not cover the frame.
    pub(super) fn may_have(&self, frame: u64, page: u32) -> bool {
        let first = Self::FRAMES - Self::HEADER / 4;
        let Some(at) = usize::try_from(frame).ok().filter(|at| *at > 0 && frame <= self.frames)
        else {
            return true;
        };
        // The offset of the block, the offset of its page list, and the frame's number in the block, from 1.
        let (block, list, number) = match at.checked_sub(first + 1) {
            None => (0, Self::HEADER, at),
            Some(at) => {
                let block = (1 + at / Self::FRAMES) * Self::PART;
                (block, block, at % Self::FRAMES + 1)
            }
        };
        let Some(block) = self.bytes.get(block..block + Self::PART).map(|of| (of, list - block))
        else {
            return true;
        };
        let (block, list) = block;
        let has = |number: usize| {
            let at = list + 4 * (number - 1);
            block[at..at + 4] == page.to_ne_bytes()
        };
        let slot = |at: usize| {
            let at = Self::PART / 2 + 2 * at;
            usize::from(u16::from_ne_bytes([block[at], block[at + 1]]))
        };
        // As in SQLite, the hash is the page number times a prime. On a collision, the next slots
        // are probed, up to an empty one.
        let begin = page.wrapping_mul(383) as usize;
        let mut slots = (0..Self::SLOTS).map(|step| slot(begin.wrapping_add(step) % Self::SLOTS));
        has(number) && slots.find(|found| *found == number || *found == 0) == Some(number)
    }

    /// A hash of everything except the header, which readers and checkpoints change.
    pub(super) fn fingerprint(&self) -> u64 {
        let mut hash = DefaultHasher::new();
        self.bytes.get(Self::HEADER..).hash(&mut hash);
        hash.finish()
    }
}

/// The result of applying a log to a copy.
#[derive(Debug, Default)]
pub(super) struct Applied {
    /// The size of the copy after the last commit in the log (bytes), if the log contains a commit.
    pub(super) length: Option<u64>,
    /// Number of pages of the log that are damaged or missing.
    pub(super) lost: u64,
}

/// Writes the frames that SQLite would read from the log into `to`, a copy of the file. If the log
/// is damaged, writes every intact frame. `page` is as in [`Frames::open`]. `index` is the log's
/// index, if it can be read. Frames after the first `until` are left out.
pub(super) fn apply(
    log: &Path,
    page: Option<usize>,
    is_damaged: bool,
    index: Option<&Index>,
    until: Option<u64>,
    to: &File,
) -> io::Result<Applied> {
    let is_read = |frame: &Frame<'_>| frame.is_sound || is_damaged && frame.is_intact;
    let Some(mut frames) = Frames::open(log, page)? else { return Ok(Applied::default()) };
    let index = index.filter(|index| index.salts == frames.salts).map_or(0, |index| index.frames);
    let (mut count, mut end, mut pages) = (0_u64, 0, 0);
    while until.is_none_or(|until| count < until)
        && let Some(frame) = frames.next()?
    {
        count += 1;
        if frame.pages > 0 && is_read(&frame) {
            (end, pages) = (count, frame.pages);
        }
    }
    // The frames after the last commit belong to an unfinished transaction.
    let Some(mut frames) = Frames::open(log, page)? else { return Ok(Applied::default()) };
    let length = (frames.frame.len() - FRAME) as u64;
    let mut lost = if is_damaged { index.saturating_sub(end) } else { 0 };
    for _ in 0..end {
        match frames.next()?.filter(&is_read) {
            Some(frame) if frame.page > 0 => {
                to.write_all_at(frame.content, u64::from(frame.page - 1) * length)?;
            }
            _ => lost += 1,
        }
    }
    // Without an index, damaged frames after the last commit may have been committed, too.
    while index == 0
        && is_damaged
        && let Some(frame) = frames.next()?
    {
        lost += u64::from(frame.is_own && !frame.is_intact);
    }
    Ok(Applied { length: (pages > 0).then_some(u64::from(pages) * length), lost })
}

/// If a log has an invalid header, returns whether it begins with a log's first bytes. In this
/// case, only a part of its header was lost. Returns `None` if the header is valid, or consists of
/// zeros. SQLite would delete a log with an invalid header. A power failure can leave zeros, but no
/// other incomplete header, because SQLite writes the header in one piece.
pub(super) fn strange_header(log: &Path) -> io::Result<Option<bool>> {
    let strange = || {
        let mut header = Vec::new();
        match File::open(log) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            file => file?.take(HEADER as u64).read_to_end(&mut header)?,
        };
        let sound =
            header.first_chunk().is_some_and(|header| Checksum::of_header(header).is_some());
        let is_strange = !sound && header.iter().any(|byte| *byte != 0);
        Ok::<_, io::Error>(is_strange.then(|| header.starts_with(&MAGIC)))
    };
    // A server may have been writing the header.
    if strange()?.is_none() {
        return Ok(None);
    }
    std::thread::sleep(Duration::from_millis(20));
    strange()
}

/// Fills the buffer. Returns `false` if there are too few bytes.
pub(super) fn read_whole(from: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match from.read_exact(buffer) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        read => read.map(|()| true),
    }
}

/// The big-endian number in the first four bytes.
pub(super) fn number(bytes: &[u8]) -> u32 {
    u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// The checksum of a log, over words in the byte order given by its header.
#[derive(Clone, Copy)]
struct Checksum {
    sums: [u32; 2],
    is_big_endian: bool,
}

impl Checksum {
    fn of(header: &[u8; HEADER]) -> Self {
        Self { sums: [0; 2], is_big_endian: header[3] == 0x83 }
    }

    /// The checksum of a header that SQLite wrote.
    fn of_header(header: &[u8; HEADER]) -> Option<Self> {
        let mut sum = Self::of(header);
        sum.add(&header[..24]);
        let is_sound = header.starts_with(&MAGIC)
            && matches!(header[3], 0x82 | 0x83)
            && (512..=65_536).contains(&number(&header[8..]))
            && sum.is(&header[24..]);
        is_sound.then_some(sum)
    }

    fn add(&mut self, bytes: &[u8]) {
        let [mut first, mut second] = self.sums;
        let read = if self.is_big_endian { u32::from_be_bytes } else { u32::from_le_bytes };
        let (pairs, _) = bytes.as_chunks::<8>();
        for &[a, b, c, d, e, f, g, h] in pairs {
            first = first.wrapping_add(read([a, b, c, d])).wrapping_add(second);
            second = second.wrapping_add(read([e, f, g, h])).wrapping_add(first);
        }
        self.sums = [first, second];
    }

    fn is(&self, bytes: &[u8]) -> bool {
        bytes[..8] == self.bytes()
    }

    fn bytes(&self) -> [u8; 8] {
        let [[a, b, c, d], [e, f, g, h]] = self.sums.map(u32::to_be_bytes);
        [a, b, c, d, e, f, g, h]
    }
}

#[cfg(test)]
mod tests {
    use super::super::connection;
    use super::super::file::DatabaseFile;
    use super::*;

    /// Number of frames in a log, and number of frames that SQLite reads.
    fn frames(path: &Path) -> [usize; 2] {
        let mut frames = Frames::open(path, Some(PAGE)).unwrap().unwrap();
        let mut found = [0; 2];
        while let Some(frame) = frames.next().unwrap() {
            found[0] += 1;
            found[1] += usize::from(frame.is_sound);
        }
        found
    }

    #[test]
    fn a_log_is_read_as_sqlite_reads_it_and_mended() {
        const ROWS: i64 = 40;
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| DatabaseFile::at(&folder.path().join(name));
        let file = of("written.db");
        file.create().unwrap();
        let db = connection::writing(file.path()).unwrap();
        db.batch("CREATE TABLE page (bytes BLOB NOT NULL) STRICT").unwrap();
        connection::write_back(&db).unwrap();
        for _ in 0..ROWS {
            db.execute("INSERT INTO page VALUES (randomblob(3000))", []).unwrap();
        }
        let [all, sound] = frames(file.log());
        assert!(all == sound && all as i64 >= ROWS, "{sound} of {all}");
        assert_eq!(all as i64, connection::log_pages(&db).unwrap());

        let rows = |file: &DatabaseFile| {
            let db = connection::reading(file, false).unwrap();
            db.query_row("SELECT count(*) FROM page", [], |row| row.get::<_, i64>(0)).unwrap()
        };
        // Damages the header, the salts of a frame, and the unused middle of a page.
        let middle = 32 + (all as u64 / 2) * (24 + PAGE as u64);
        for (name, at) in [("header.db", 0), ("salts.db", middle + 8), ("page.db", middle + 64)] {
            let (damaged, mended) = (of(name), of(&format!("mended-{name}")));
            for copy in [&damaged, &mended] {
                std::fs::copy(file.path(), copy.path()).unwrap();
            }
            std::fs::copy(file.log(), damaged.log()).unwrap();
            let log = std::fs::OpenOptions::new().write(true).open(damaged.log()).unwrap();
            log.write_all_at(&[1, 2, 3, 4], at).unwrap();
            let [found, sound] = frames(damaged.log());
            let read = if name == "header.db" { 0 } else { all / 2 };
            assert_eq!([found, sound], [all, read], "{name}");
            let copy = File::options().write(true).open(mended.path()).unwrap();
            let applied = apply(damaged.log(), Some(PAGE), true, None, None, &copy).unwrap();
            assert_eq!(applied.lost, u64::from(name != "header.db"), "{name}");
            assert!(rows(&damaged) < ROWS, "{name}");
            // The rows of the damaged page may survive in a later version of the same page.
            let lost = rows(&mended) < ROWS;
            assert!(name != "header.db" || !lost, "{name}");
        }
    }
}
