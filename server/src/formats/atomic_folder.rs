//! Folders whose new content appears whole or not at all.

use crate::support::private::Unfinished;
use std::fs::{self, DirBuilder, File};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use tokio_util::sync::CancellationToken;

/// New content for a folder, kept separate from the old content until it is complete.
pub struct Draft {
    folder: PathBuf,
    draft: Unfinished,
    /// Folders that were created for the draft, innermost first. If they are still empty, they are
    /// removed with the draft.
    made: Vec<PathBuf>,
}

impl Draft {
    /// Begins a draft. Creates the folder if it does not exist. The draft removes this folder again
    /// if it stays empty.
    ///
    /// # Errors
    /// The error of the disk.
    pub fn begin(folder: &Path) -> io::Result<Self> {
        Self::with_mode(folder, 0o777)
    }

    /// Like [`Self::begin`], but only this user can access a folder that is created.
    ///
    /// # Errors
    /// The error of the disk.
    pub fn begin_private(folder: &Path) -> io::Result<Self> {
        Self::with_mode(folder, 0o700)
    }

    fn with_mode(folder: &Path, mode: u32) -> io::Result<Self> {
        let missing =
            folder.ancestors().take_while(|path| !path.exists() && *path != Path::new(""));
        let made = missing.map(Path::to_owned).collect();
        DirBuilder::new().recursive(true).mode(mode).create(folder)?;
        let draft = Unfinished::within(".sidestep-draft-", folder)?;
        Ok(Self { folder: folder.to_owned(), draft, made })
    }

    /// The folder for the new content.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.draft.path()
    }

    /// Moves every file and folder of the draft into the folder. Replaces entries with the same names,
    /// deletes old entries named in `obsolete`, and keeps all others. The moves cannot be cancelled.
    ///
    /// # Errors
    /// The error of the disk; a new file with the name of an old folder, or the reverse; or a
    /// cancellation before the moves. After a cancellation, nothing has changed.
    pub fn keep(self, obsolete: &[&str], cancel: &CancellationToken) -> io::Result<()> {
        synced(self.path())?;
        for entry in fs::read_dir(self.path())? {
            let entry = entry?;
            let found = self.folder.join(entry.file_name()).symlink_metadata();
            if found.is_ok_and(|found| found.is_dir() != entry.path().is_dir()) {
                let name = entry.file_name().display().to_string();
                let [there, new] = match entry.path().is_dir() {
                    true => ["file", "folder"],
                    false => ["folder", "file"],
                };
                let said = format!("there is a {there} {name} where a {new} is to be");
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, said));
            }
        }
        if cancel.is_cancelled() {
            return Err(io::Error::other("stopped"));
        }
        let old = Unfinished::within(".sidestep-old-", &self.folder)?;
        for name in obsolete {
            let place = self.folder.join(name);
            if place.symlink_metadata().is_ok() && !self.path().join(name).exists() {
                fs::rename(&place, old.path().join(name))?;
            }
        }
        for entry in fs::read_dir(self.path())? {
            let entry = entry?;
            let place = self.folder.join(entry.file_name());
            if place.symlink_metadata().is_ok() {
                fs::rename(&place, old.path().join(entry.file_name()))?;
            }
            fs::rename(entry.path(), &place)?;
        }
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // Delete the rest of the draft. Ignore entries that cannot be deleted.
        let _ = fs::remove_dir_all(self.path());
        self.made.iter().all(|folder| fs::remove_dir(folder).is_ok());
    }
}

fn synced(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            synced(&entry.path())?;
        } else {
            File::open(entry.path())?.sync_all()?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn new_content_takes_the_place_of_old_and_leaves_the_rest() {
        let root = TempDir::new().unwrap();
        let folder = root.path().join("out");
        for text in ["first", "second"] {
            let draft = Draft::begin(&folder).unwrap();
            fs::write(draft.path().join("table.csv"), text).unwrap();
            fs::create_dir(draft.path().join("models")).unwrap();
            fs::write(draft.path().join("models").join(text), text).unwrap();
            draft.keep(&[], &CancellationToken::new()).unwrap();
            fs::write(folder.join("notes.txt"), "mine").unwrap();
        }
        assert_eq!(names(&folder), ["models", "notes.txt", "table.csv"]);
        assert_eq!(names(&folder.join("models")), ["second"]);
        assert_eq!(fs::read_to_string(folder.join("table.csv")).unwrap(), "second");
    }

    #[test]
    fn what_is_obsolete_goes_and_what_is_of_another_kind_stays() {
        let root = TempDir::new().unwrap();
        fs::write(root.path().join("former.csv"), "old").unwrap();
        fs::write(root.path().join("table.csv"), "old").unwrap();
        let draft = |name: &str| {
            let draft = Draft::begin(root.path()).unwrap();
            fs::write(draft.path().join(name), "new").unwrap();
            draft.keep(&["former.csv", "table.csv", "none.csv"], &CancellationToken::new())
        };
        draft("table.csv").unwrap();
        assert_eq!(names(root.path()), ["table.csv"]);
        assert_eq!(fs::read_to_string(root.path().join("table.csv")).unwrap(), "new");

        fs::create_dir(root.path().join("report.html")).unwrap();
        let refused = draft("report.html").unwrap_err().to_string();
        assert_eq!(refused, "there is a folder report.html where a file is to be");
        assert_eq!(names(root.path()), ["report.html", "table.csv"]);
    }

    #[test]
    fn folders_that_stay_empty_are_removed() {
        let root = TempDir::new().unwrap();
        let folder = root.path().join("a").join("b");
        drop(Draft::begin(&folder).unwrap());
        assert_eq!(names(root.path()), Vec::<String>::new());
        let draft = Draft::begin(&folder).unwrap();
        fs::write(root.path().join("a").join("mine"), "").unwrap();
        drop(draft);
        assert_eq!(names(&root.path().join("a")), ["mine"]);
    }

    #[test]
    fn a_stop_leaves_what_was_there() {
        let root = TempDir::new().unwrap();
        fs::write(root.path().join("table.csv"), "old").unwrap();
        let stop = CancellationToken::new();
        let draft = Draft::begin(root.path()).unwrap();
        fs::write(draft.path().join("table.csv"), "new").unwrap();
        stop.cancel();
        assert!(draft.keep(&["table.csv"], &stop).is_err());
        assert_eq!(names(root.path()), ["table.csv"]);
        assert_eq!(fs::read_to_string(root.path().join("table.csv")).unwrap(), "old");
    }
}
