//! A cache of cells in a folder, keyed by a hash of their inputs.

use crate::formats::atomic_file;
use crate::support::private;
use sha2::{Digest, Sha256};
use sidestep::comparison::Cache;
use sidestep::comparison::cell::Cell;
use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tokio_util::sync::CancellationToken;

/// A cache with one file per key. The file has the cells and, in its last line, the SHA-256 of key and
/// cells. If the file cannot be read, was changed or belongs to another key, the cells are computed again.
pub struct FolderCache {
    folder: PathBuf,
    used: Mutex<HashSet<String>>,
}

impl FolderCache {
    /// A cache in `folder`. If the folder does not exist, it is created and only this user can access it.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub fn open(folder: &Path) -> io::Result<Self> {
        private::make_folder(folder)?;
        Ok(Self { folder: folder.to_owned(), used: Mutex::default() })
    }

    fn path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.json"))
    }

    fn note(&self, key: &str) {
        // A panic of another thread leaves the set valid.
        self.used.lock().unwrap_or_else(|broken| broken.into_inner()).insert(key.to_owned());
    }

    /// Deletes the files that were neither read nor written since the cache was opened.
    ///
    /// # Errors
    /// If the folder cannot be read or a file cannot be deleted.
    pub fn forget_unused(&self) -> io::Result<()> {
        let used = self.used.lock().unwrap_or_else(|broken| broken.into_inner());
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            let key = path.file_stem().and_then(|stem| stem.to_str());
            if path.extension().is_some_and(|end| end == "json")
                && !key.is_some_and(|key| used.contains(key))
            {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

fn sha256(key: &str, cells: &str) -> String {
    hex::encode(Sha256::digest(format!("{key}\n{cells}")))
}

impl Cache for FolderCache {
    fn get(&self, key: &str) -> Option<Vec<Cell>> {
        let text = fs::read_to_string(self.path(key)).ok()?;
        let (cells, hash) = text.rsplit_once('\n')?;
        let cells = (hash == sha256(key, cells)).then(|| serde_json::from_str(cells).ok())??;
        self.note(key);
        Some(cells)
    }

    fn put(&self, key: &str, cells: &[Cell]) {
        self.note(key);
        let written = atomic_file::write(&self.path(key), &CancellationToken::new(), |out| {
            let cells = serde_json::to_string(cells)?;
            write!(out, "{cells}\n{}", sha256(key, &cells))
        });
        if let Err(error) = written {
            // Without the cached file, the cells are only computed again.
            tracing::warn!("the cache cannot be written: {error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_under_another_key_is_not_believed() {
        let folder = tempfile::tempdir().unwrap();
        let cache = FolderCache::open(folder.path()).unwrap();
        cache.put("first", &[]);
        fs::copy(cache.path("first"), cache.path("second")).unwrap();
        assert_eq!(cache.get("first").map(|cells| cells.len()), Some(0));
        assert!(cache.get("second").is_none());
    }
}
