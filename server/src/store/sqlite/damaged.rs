//! A copy of a damaged file in which SQLite reads all that is left.

use super::file::DatabaseFile;
use super::log::Frames;
use super::mark::{self, Misplaced};
use crate::private;
use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::Path;

/// What every file of SQLite begins with.
pub const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// Copies a file that no server uses, and its log. Pages that are missing at its end are empty in the copy, and the
/// checksums of a damaged log are right: SQLite would otherwise read nothing, or nothing behind the damage.
///
/// # Errors
/// What stands in the way.
pub fn copy_damaged(from: &Path, to: &Path) -> io::Result<()> {
    if !std::fs::metadata(from)?.is_file() {
        return Err(io::Error::other("it is a directory or a pipe"));
    }
    let mut file = File::open(from)?;
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Err(io::Error::other("a server uses it; stop the server first"));
    }
    let (source, copy) = (DatabaseFile::at(from), DatabaseFile::at(to));
    let frames = Frames::open(source.log(), None)?;
    match (frames, mark::misplaced(&source)?) {
        (Some(_), Some(Misplaced::Damaged)) => {
            let page = head(&file).map(|(page, _)| page);
            if let Some(frames) = Frames::open(source.log(), page)? {
                frames.write_mended(private::new_file(copy.log())?)?;
            }
        }
        (Some(_), _) => {
            io::copy(&mut File::open(source.log())?, &mut private::new_file(copy.log())?)?;
        }
        (None, _) => {}
    }
    let mut out = private::new_file(to)?;
    file.rewind()?;
    let length = io::copy(&mut file, &mut out)?;
    out.flush()?;
    file.rewind()?;
    let whole = head(&file).map_or(0, |(page, pages)| page as u64 * u64::from(pages));
    if length > 0 && whole > length {
        out.set_len(whole)?;
    }
    Ok(())
}

/// The length of a page, and how many there are, as a file's first page tells it.
fn head(mut file: &File) -> Option<(usize, u32)> {
    let mut head = [0; 32];
    file.rewind().and_then(|()| file.read_exact(&mut head)).ok()?;
    let page = match u16::from_be_bytes([head[16], head[17]]) {
        1 => 65_536,
        size => usize::from(size),
    };
    let pages = u32::from_be_bytes([head[28], head[29], head[30], head[31]]);
    head.starts_with(MAGIC).then_some((page, pages))
}
