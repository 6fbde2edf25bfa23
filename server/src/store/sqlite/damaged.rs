//! Copies a damaged file, so that SQLite can read the data that survive.

use super::connection;
use super::file::DatabaseFile;
use super::log::{self, Index, PAGE};
use super::mark;
use super::trees;
use crate::store::migrations;
use crate::store::opening::Misplaced;
use crate::support::private;
use std::fs::{File, TryLockError};
use std::io::{self, Seek};
use std::path::Path;

/// Copies a file that no server uses, including the content of its log, even if the log continues a
/// later state of the database. In the copy, b-trees with lost pages are rebuilt over the surviving
/// rows. The indices of readable tables are rebuilt, too, because damaged indices may miss rows. If
/// the log does not belong to the file, it is copied beside the copy, and opening the copy fails.
/// Returns each loss with its kind, its name and the reason.
///
/// # Errors
/// If the file cannot be copied. The error contains the reason.
pub fn copy_damaged(
    from: &Path,
    to: &Path,
) -> io::Result<Vec<(&'static str, String, &'static str)>> {
    if !std::fs::metadata(from)?.is_file() {
        return Err(io::Error::other("it is a directory or a pipe"));
    }
    let mut file = File::open(from)?;
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Err(io::Error::other("a server uses it; stop the server first"));
    }
    let (source, copy) = (DatabaseFile::at(from), DatabaseFile::at(to));
    if let Some(reason) = source.misleading() {
        return Err(io::Error::other(reason));
    }
    let mut out = private::new_file(to)?;
    io::copy(&mut file, &mut out)?;
    let page = mark::page_length(&file).unwrap_or(PAGE);
    const LOG: &str = "write-ahead log";
    let mut lost = Vec::new();
    if source.has_log() {
        if mark::of_file(&copy).is_err() {
            // The mark must be readable, because it identifies the file's own log.
            trees::mend(&copy, page, None)?;
        }
        io::copy(&mut File::open(source.log())?, &mut private::new_file(copy.log())?)?;
        let index = || Index::read(&File::open(source.index()).ok()?, false);
        let is_damaged = match mark::misplaced(&copy, index)? {
            None | Some(Misplaced::Replaced) => false,
            Some(Misplaced::Damaged) => true,
            Some(Misplaced::Later) => {
                let why = "it continues a later state than the file has; the data in between are missing and cannot be named";
                lost.push((LOG, "(before its beginning)".to_owned(), why));
                false
            }
            Some(_) => return Ok(lost),
        };
        let of = mark::of_file(&copy).ok().flatten();
        let log = mark::Log::read(copy.log(), of.as_ref(), None)?;
        let mut apply = |until| {
            out.set_len(0)?;
            file.rewind()?;
            out.rewind()?;
            io::copy(&mut file, &mut out)?;
            let index = index();
            let applied =
                log::apply(copy.log(), Some(page), is_damaged, index.as_ref(), until, &out)?;
            if let Some(length) = applied.length {
                out.set_len(length)?;
            }
            Ok::<_, io::Error>(applied)
        };
        let mut applied = apply(None)?;
        // The number of frames up to the log's last mark, this mark, and the mark that is now in
        // the copy.
        let ends = log.as_ref().and_then(|log| Some((log.marked, log.marks.as_ref()?[1].clone())));
        let found = mark::by_sqlite(&copy);
        if let (false, Some((marked, last)), Ok(found)) = (is_damaged, ends, found)
            && !found.is_some_and(|(found, _)| last.is_before(&found))
        {
            applied = apply(Some(marked))?;
            let why = "another program wrote another database over this one; what was stored after that is left out";
            lost.push((LOG, "(its end)".to_owned(), why));
        }
        if applied.lost > 0 {
            let why = "damaged; the latest data may be missing, and cannot be named";
            lost.push((LOG, format!("({} pages)", applied.lost), why));
        }
        std::fs::remove_file(copy.log())?;
    }
    // The last page may be incomplete.
    out.set_len(out.metadata()?.len().next_multiple_of(page as u64))?;
    let like = to.with_extension("like");
    private::new_file(&like)?;
    let like = connection::migrating(&like).ok();
    let like = like.filter(|like| migrations::apply(like).is_ok());
    trees::mend(&copy, page, like.as_ref())?;
    // Errors are ignored here. The code that reads the copy reports the remaining damage.
    if !copy.is_empty()
        && let Ok(db) = connection::mending(to)
    {
        if let Some(like) = like {
            let _ = migrations::renew(&db, &like);
        }
        if migrations::forget_copy(&db).unwrap_or(false) {
            let why =
                "an interrupted copy or restore was in it; what it did not copy is in its source";
            lost.push(("database", "(the rest)".to_owned(), why));
        }
        let _ = connection::renew_indices(&db);
    }
    Ok(lost)
}
