//! Cells kept in a folder, by what they were computed from.

use crate::formats::atomic_file;
use sha2::{Digest, Sha256};
use sidestep::comparison::Cache;
use sidestep::comparison::cell::Cell;
use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tokio_util::sync::CancellationToken;

/// One file a key: the cells, and in a last line their SHA-256. What cannot be read or was changed
/// counts as not there: it is computed anew.
pub struct FolderCache {
    folder: PathBuf,
    used: Mutex<HashSet<String>>,
}

impl FolderCache {
    /// A cache in `folder`, which is made where there is none.
    ///
    /// # Errors
    /// What the disk says.
    pub fn open(folder: &Path) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned(), used: Mutex::default() })
    }

    fn path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.json"))
    }

    fn note(&self, key: &str) {
        // A thread that panicked has left the set as good as it was.
        self.used.lock().unwrap_or_else(|broken| broken.into_inner()).insert(key.to_owned());
    }

    /// Forgets what was neither asked for nor kept since it was opened.
    ///
    /// # Errors
    /// What the disk says.
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

fn sha256(text: &str) -> String {
    hex::encode(Sha256::digest(text))
}

impl Cache for FolderCache {
    fn get(&self, key: &str) -> Option<Vec<Cell>> {
        let text = fs::read_to_string(self.path(key)).ok()?;
        let (cells, hash) = text.rsplit_once('\n')?;
        let cells = (hash == sha256(cells)).then(|| serde_json::from_str(cells).ok())??;
        self.note(key);
        Some(cells)
    }

    fn put(&self, key: &str, cells: &[Cell]) {
        self.note(key);
        let written = atomic_file::write(&self.path(key), &CancellationToken::new(), |out| {
            let cells = serde_json::to_string(cells)?;
            write!(out, "{cells}\n{}", sha256(&cells))
        });
        if let Err(error) = written {
            // Nothing is lost but time.
            tracing::warn!("the cache cannot be written: {error}");
        }
    }
}
