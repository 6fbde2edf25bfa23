//! Power cuts. SQLite's writes and syncs are recorded, and the disk's content is reconstructed as a
//! power cut at any point would leave it.
//!
//! Everything that was synced before the cut is on the disk. Of later writes, each sector of 512
//! bytes is on the disk or not, at random, because a disk writes in any order and a cut interrupts
//! the current write. SQLite itself relies on atomic writes of sectors
//! (<https://sqlite.org/psow.html>). The recorder is a VFS layer below the server's own SQLite, so
//! no part of the server is replaced.

pub mod cuts;
mod vfs;

use sidestep::math::SeededRng;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Number of bytes that a disk writes atomically.
const SECTOR: usize = 512;

/// An operation on a file. Files are identified by their names in the folder.
#[derive(Clone, Debug)]
enum Act {
    Wrote {
        offset: usize,
        bytes: Vec<u8>,
    },
    Cut {
        length: usize,
    },
    Deleted,
    /// All operations on the file before index `covered` are on the disk.
    Synced {
        covered: usize,
    },
}

/// Operations on all files of a folder, in order.
type Acts = Arc<Mutex<Vec<(String, Act)>>>;

/// A recording of operations on the files of a folder.
#[derive(Debug)]
pub struct Recording {
    acts: Acts,
}

/// Behaviour of a disk when it is asked to sync.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disk {
    /// The disk answers when everything is written.
    Honest,
    /// For SQLite's write-ahead log, the disk answers immediately without writing. This is the
    /// negative control.
    Lying,
}

impl Recording {
    /// Records the operations of SQLite in this process on the files in a folder.
    ///
    /// # Panics
    /// If SQLite does not accept the VFS layer.
    #[must_use]
    pub fn of(folder: &Path) -> Self {
        let acts = Acts::default();
        vfs::record(folder, &acts);
        Self { acts }
    }

    fn acts(&self) -> MutexGuard<'_, Vec<(String, Act)>> {
        self.acts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The current point, which is the number of operations so far.
    #[must_use]
    pub fn now(&self) -> usize {
        self.acts().len()
    }

    /// Writes the files into a folder as a power cut at point `moment` leaves them.
    ///
    /// # Panics
    /// If they cannot be written.
    pub fn cut(&self, moment: usize, disk: Disk, rng: &mut SeededRng, folder: &Path) {
        for (name, bytes) in files(&self.acts()[..moment], disk, rng) {
            std::fs::write(folder.join(name), bytes).expect("a file");
        }
    }
}

/// The files after these operations and a power cut.
fn files(acts: &[(String, Act)], disk: Disk, rng: &mut SeededRng) -> BTreeMap<String, Vec<u8>> {
    let mut synced: BTreeMap<&str, usize> = BTreeMap::new();
    for (name, act) in acts {
        let is_true = disk == Disk::Honest || !name.ends_with("-wal");
        if let (Act::Synced { covered }, true) = (act, is_true) {
            synced.insert(name, *covered);
        }
    }
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for (moment, (name, act)) in acts.iter().enumerate() {
        let is_safe = synced.get(name.as_str()).is_some_and(|covered| moment < *covered);
        let mut is_kept = || is_safe || rng.below(2) == 0;
        match act {
            Act::Wrote { offset, bytes } => {
                let file = files.entry(name.clone()).or_default();
                for (number, sector) in bytes.chunks(SECTOR).enumerate() {
                    if is_kept() {
                        let begin = offset + number * SECTOR;
                        let end = begin + sector.len();
                        file.resize(file.len().max(end), 0);
                        file[begin..end].copy_from_slice(sector);
                    }
                }
            }
            Act::Cut { length } if is_kept() => {
                files.entry(name.clone()).or_default().resize(*length, 0);
            }
            // SQLite deletes a log or journal only when it is no longer needed, so a deletion is
            // always kept.
            Act::Deleted => drop(files.remove(name)),
            Act::Cut { .. } | Act::Synced { .. } => {}
        }
    }
    files
}

/// The name of a file, if it is directly in the folder.
fn name_in(folder: &Path, file: &Path) -> Option<String> {
    let name = file.strip_prefix(folder).ok()?;
    (name.components().count() == 1).then(|| name.to_string_lossy().into_owned())
}

/// Each recorded folder with its operations.
type Recordings = Mutex<Vec<(PathBuf, Acts)>>;

#[cfg(test)]
mod tests {
    use super::*;

    fn wrote(offset: usize, byte: u8, length: usize) -> (String, Act) {
        ("a-wal".to_owned(), Act::Wrote { offset, bytes: vec![byte; length] })
    }

    #[test]
    fn what_was_synced_is_there_and_the_rest_by_sectors() {
        let synced = ("a-wal".to_owned(), Act::Synced { covered: 1 });
        let acts = [wrote(0, 1, 1024), synced, wrote(0, 2, 1024), wrote(1024, 3, 512)];
        let mut found = std::collections::BTreeSet::new();
        let mut rng = SeededRng::new(1);
        for _ in 0..200 {
            let file = files(&acts, Disk::Honest, &mut rng).remove("a-wal").unwrap();
            let sectors: Vec<u8> = file.chunks(SECTOR).map(|sector| sector[0]).collect();
            assert!(file.chunks(SECTOR).all(|sector| sector.iter().all(|b| *b == sector[0])));
            assert!(sectors[..2].iter().all(|sector| [1, 2].contains(sector)), "{sectors:?}");
            found.insert(sectors);
        }
        // Every combination of the three unsynced sectors occurs.
        assert_eq!(found.len(), 8);
        let lying = (0..50).map(|_| files(&acts[..2], Disk::Lying, &mut rng));
        assert!(lying.into_iter().any(|files| files.get("a-wal").is_none_or(|file| file[0] == 0)));
    }
}
