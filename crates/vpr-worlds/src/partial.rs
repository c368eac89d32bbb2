//! Folders under construction: they appear whole under their name, and what killed processes left
//! of them is found and removed.

use std::{
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use tempfile::NamedTempFile;
use vpr_core::{Error, Result};

/// What the names of folders under construction begin with.
const PREFIX: &str = ".partial-";
/// What the name of a folder's lock file has besides.
const LOCK: &str = ".lock";
/// Nothing takes as long as this: the rule where no lock tells who is alive.
const FORGOTTEN: Duration = Duration::from_hours(24);

/// A folder that only its process knows of, until it is published.
///
/// A file beside it, `.partial-….lock`, stays locked as long as the process lives. Dropped without
/// [`Self::publish`], both disappear.
pub(crate) struct Partial {
    folder: PathBuf,
    /// Removed, and by that unlocked, when dropped: after the folder is gone.
    _lock: NamedTempFile,
}

impl Partial {
    /// Makes an empty folder in `parent`, and `parent` if needed.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if `parent` cannot be written.
    pub(crate) fn create(parent: &Path) -> Result<Self> {
        fs::create_dir_all(parent).map_err(Error::io(parent))?;
        loop {
            let lock = tempfile::Builder::new()
                .prefix(PREFIX)
                .suffix(LOCK)
                .tempfile_in(parent)
                .map_err(Error::io(parent))?;
            // Somebody who sweeps may have taken it for abandoned before it was locked: then it is
            // locked by them, or gone. Where nothing can be locked, age decides.
            let is_taken = matches!(lock.as_file().try_lock(), Err(TryLockError::WouldBlock));
            if is_taken || !lock.path().exists() {
                continue;
            }
            let folder = lock.path().with_extension("");
            fs::create_dir(&folder).map_err(Error::io(&folder))?;
            return Ok(Self { folder, _lock: lock });
        }
    }

    /// Where to write.
    pub(crate) fn path(&self) -> &Path {
        &self.folder
    }

    /// Lets the folder appear under this name, by one rename.
    ///
    /// # Errors
    ///
    /// If there is such a folder already, or the file system refuses; the folder is then removed.
    pub(crate) fn publish(self, target: &Path) -> io::Result<()> {
        fs::rename(&self.folder, target)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        // Once published there is nothing under this name; what cannot be removed is swept later.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Removes the folders under construction in `parent` that no living process holds.
///
/// Whatever cannot be read or removed stays: it is never opened.
pub(crate) fn sweep(parent: &Path) {
    let Ok(entries) = fs::read_dir(parent) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        if !name.starts_with(PREFIX) {
            continue;
        }
        if name.ends_with(LOCK) {
            sweep_locked(&path);
        } else if !path.with_file_name(format!("{name}{LOCK}")).exists() && is_forgotten(&path) {
            // Older versions locked nothing.
            let _ = fs::remove_dir_all(&path);
        }
    }
}

/// Removes a lock file and its folder unless somebody holds the lock.
fn sweep_locked(lock: &Path) {
    let Ok(file) = File::open(lock) else { return };
    let is_abandoned = match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => false,
        Err(TryLockError::Error(_)) => is_forgotten(lock),
    };
    if !is_abandoned {
        return;
    }
    let folder = lock.with_extension("");
    // The lock file goes last: as long as the folder is there, it says that nobody holds it.
    if fs::remove_dir_all(&folder).is_ok() || !folder.exists() {
        let _ = fs::remove_file(lock);
    }
}

fn is_forgotten(path: &Path) -> bool {
    let modified = fs::metadata(path).and_then(|data| data.modified());
    modified.is_ok_and(|time| time.elapsed().is_ok_and(|age| age > FORGOTTEN))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(parent: &Path) -> Vec<String> {
        let entries = fs::read_dir(parent).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_held_folder_is_not_swept_and_a_dropped_one_leaves_nothing() {
        let parent = tempfile::tempdir().unwrap();
        let partial = Partial::create(parent.path()).unwrap();
        fs::write(partial.path().join("image"), "half").unwrap();
        sweep(parent.path());
        assert!(partial.path().join("image").exists());
        assert_eq!(names(parent.path()).len(), 2);
        drop(partial);
        assert!(names(parent.path()).is_empty());
    }

    #[test]
    fn a_published_folder_is_all_that_is_left() {
        let parent = tempfile::tempdir().unwrap();
        let partial = Partial::create(parent.path()).unwrap();
        fs::write(partial.path().join("image"), "whole").unwrap();
        partial.publish(&parent.path().join("world")).unwrap();
        assert_eq!(names(parent.path()), ["world"]);
        assert!(parent.path().join("world/image").exists());
    }

    #[test]
    fn a_folder_whose_lock_nobody_holds_is_swept_and_one_without_a_lock_is_not() {
        let parent = tempfile::tempdir().unwrap();
        for folder in [".partial-dead", ".partial-unlocked", "world"] {
            fs::create_dir(parent.path().join(folder)).unwrap();
        }
        for lock in [".partial-dead.lock", ".partial-alone.lock", "world.lock"] {
            fs::write(parent.path().join(lock), "").unwrap();
        }
        sweep(parent.path());
        let mut left = names(parent.path());
        left.sort();
        assert_eq!(left, [".partial-unlocked", "world", "world.lock"]);
    }
}
