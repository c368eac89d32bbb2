//! Files that appear whole or not at all.

use std::{
    ffi::OsString,
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
    process,
    sync::atomic::{AtomicU64, Ordering},
};

use crate::{Error, Result};

/// A file under construction, next to the one it will replace.
///
/// Written under a temporary name, synced to the disk, renamed over the target, and the folder
/// synced: whoever opens the target sees the old file or the new one, also after a crash. Dropped
/// without [`Self::commit`] it disappears; what a killed writer left is removed by the next one.
#[derive(Debug)]
pub struct NewFile {
    file: File,
    temporary: PathBuf,
    target: PathBuf,
}

const SUFFIX: &str = ".partial";

impl NewFile {
    /// Starts a file that will replace `target`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder cannot be written, or `target` is a folder.
    pub fn create(target: &Path) -> Result<Self> {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        if target.is_dir() {
            let source = io::Error::new(io::ErrorKind::IsADirectory, "a folder, not a file");
            return Err(Error::Io { path: target.to_owned(), source });
        }
        let name = target.file_name().ok_or_else(|| Error::Io {
            path: target.to_owned(),
            source: io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file"),
        })?;
        remove_abandoned(target);
        let mut temporary = OsString::from(".");
        temporary.push(name);
        let count = COUNTER.fetch_add(1, Ordering::Relaxed);
        temporary.push(format!(".{}-{count}{SUFFIX}", process::id()));
        let temporary = target.with_file_name(temporary);
        let file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(true)
            .open(&temporary)
            .map_err(Error::io(target))?;
        // Best effort: the lock only protects from being taken for abandoned.
        let _ = file.try_lock();
        Ok(Self { file, temporary, target: target.to_owned() })
    }

    /// The file to write to.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// An [`Error::Io`] that names the target; for use in `map_err`.
    pub fn io_error(&self) -> impl FnOnce(io::Error) -> Error + use<> {
        Error::io(self.target.clone())
    }

    /// Makes the file appear under its name.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if syncing or renaming fails; the old file is then still there.
    pub fn commit(self) -> Result<()> {
        let io_error = || Error::io(&self.target);
        self.file.sync_all().map_err(io_error())?;
        fs::rename(&self.temporary, &self.target).map_err(io_error())?;
        sync_folder(&self.target).map_err(io_error())
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        // After a commit there is nothing under this name and the removal fails: as intended.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Replaces a small file by these bytes, atomically.
///
/// # Errors
///
/// [`Error::Io`]; the old file is then still there.
pub fn replace(target: &Path, bytes: &[u8]) -> Result<()> {
    let mut new = NewFile::create(target)?;
    new.file.write_all(bytes).map_err(new.io_error())?;
    new.commit()
}

/// Makes a rename durable.
#[cfg(unix)]
fn sync_folder(target: &Path) -> io::Result<()> {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

/// Folders cannot be synced here; a rename is durable once the file system writes its journal.
#[cfg(not(unix))]
fn sync_folder(_: &Path) -> io::Result<()> {
    Ok(())
}

/// Removes what killed writers of `target` left: partial files that nobody holds a lock on.
fn remove_abandoned(target: &Path) {
    let Some(name) = target.file_name().and_then(|name| name.to_str()) else { return };
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
    let Ok(entries) = fs::read_dir(folder.unwrap_or(Path::new("."))) else { return };
    let prefix = format!(".{name}.");
    for entry in entries.flatten() {
        let is_partial = entry
            .file_name()
            .to_str()
            .is_some_and(|entry| entry.starts_with(&prefix) && entry.ends_with(SUFFIX));
        if is_partial && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_unfinished_file_leaves_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("map");
        replace(&target, b"old").unwrap();
        let mut new = NewFile::create(&target).unwrap();
        new.file().write_all(b"ne").unwrap();
        drop(new);
        assert_eq!(fs::read(&target).unwrap(), b"old");
        assert_eq!(entries(folder.path()), ["map"]);
    }

    #[test]
    fn abandoned_files_go_and_those_in_use_stay() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("map");
        fs::write(folder.path().join(".map.1-0.partial"), b"left behind").unwrap();
        let in_use = NewFile::create(&target).unwrap();
        replace(&target, b"new").unwrap();
        assert_eq!(entries(folder.path()).len(), 2);
        in_use.commit().unwrap();
        assert_eq!(entries(folder.path()), ["map"]);
    }
}
