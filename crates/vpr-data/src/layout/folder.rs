//! The images in a folder, as deep as they lie.

use std::{
    collections::{BTreeSet, VecDeque},
    fs, io,
    path::{Path, PathBuf},
};

use super::vpr_bench::is_image;
use vpr_core::{Error, Result};

/// The images of a folder, and what was left out of it that may be missed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listing {
    /// The images, as paths that start with the folder, sorted.
    pub images: Vec<PathBuf>,
    /// One line each: links to nothing, folders that are linked to twice.
    pub notes: Vec<String>,
}

/// The images of a folder: those that `<folder>_images_paths.txt` beside it lists, one path a line,
/// if that exists, else all below it.
///
/// Paths in the list are taken as they are, or else relative to the folder, or to what it is in.
///
/// # Errors
///
/// Those of [`images_below`]; [`Error::Format`] if the list names a missing file, with its line, or
/// there is no image.
pub fn images_of(folder: &Path) -> Result<Listing> {
    let list = list_path(folder);
    let listing = if list.is_file() && folder.is_dir() {
        Listing { images: listed(folder, &list)?, notes: Vec::new() }
    } else {
        images_below(folder)?
    };
    if listing.images.is_empty() {
        return Err(Error::format(folder, "folder", "has no image"));
    }
    Ok(listing)
}

/// All images below a folder.
///
/// Hidden files and folders, and files that are no images, are not looked at. Links are followed; a
/// folder that is reached twice, or that a link makes part of itself, is listed once, where it lies
/// if it lies below `folder`.
///
/// # Errors
///
/// [`Error::Io`] if a folder cannot be read.
pub fn images_below(folder: &Path) -> Result<Listing> {
    let mut walk = Walk::default();
    walk.waiting.push_back(folder.to_owned());
    // What lies here comes before what is only linked to, however it is called.
    while let Some(folder) = walk.waiting.pop_front().or_else(|| walk.linked.pop_front()) {
        walk.folder(&folder)?;
    }
    walk.listing.images.sort();
    Ok(walk.listing)
}

#[derive(Default)]
struct Walk {
    waiting: VecDeque<PathBuf>,
    linked: VecDeque<PathBuf>,
    /// Where the folders that were listed really are.
    seen: BTreeSet<PathBuf>,
    listing: Listing,
}

impl Walk {
    fn folder(&mut self, folder: &Path) -> Result<()> {
        let real = folder.canonicalize().map_err(Error::io(folder))?;
        if !self.seen.insert(real.clone()) {
            let (folder, real) = (folder.display(), real.display());
            self.listing.notes.push(format!("{folder}: leads to {real}, which is listed already"));
            return Ok(());
        }
        let entries = fs::read_dir(folder).map_err(Error::io(folder))?;
        let mut paths = entries
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<Vec<_>, io::Error>>()
            .map_err(Error::io(folder))?;
        paths.sort();
        paths.into_iter().filter(|path| !is_hidden(path)).try_for_each(|path| self.entry(path))
    }

    fn entry(&mut self, path: PathBuf) -> Result<()> {
        let is_link = path.symlink_metadata().map_err(Error::io(&path))?.is_symlink();
        let metadata = match path.metadata() {
            Ok(metadata) => metadata,
            // Nothing there, or links in a circle: the link is at fault, not the folder.
            Err(_) if is_link => {
                if is_image(&path) || path.extension().is_none() {
                    let note = format!("{}: is a link to nothing, left out", path.display());
                    self.listing.notes.push(note);
                }
                return Ok(());
            }
            Err(source) => return Err(Error::Io { path, source }),
        };
        match (metadata.is_dir(), is_link) {
            (true, true) => self.linked.push_back(path),
            (true, false) => self.waiting.push_back(path),
            (false, _) if is_image(&path) => self.listing.images.push(path),
            (false, _) => {}
        }
        Ok(())
    }
}

/// Whether a name starts with a dot: `.git`, `.DS_Store`, `._IMG_1.jpg` of macOS.
pub(crate) fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

/// `<folder>_images_paths.txt`.
fn list_path(folder: &Path) -> PathBuf {
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push("_images_paths.txt");
    folder.with_file_name(name)
}

/// The images a list names, sorted.
fn listed(folder: &Path, list: &Path) -> Result<Vec<PathBuf>> {
    let text = fs::read_to_string(list).map_err(Error::io(list))?;
    let mut images = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let line = line.trim();
        let parent = folder.parent().unwrap_or(Path::new(""));
        let candidates = [PathBuf::from(line), folder.join(line), parent.join(line)];
        let image = candidates.into_iter().find(|path| path.is_file()).ok_or_else(|| {
            let reason = format!("`{line}` does not exist");
            Error::format(list, format!("line {}", index + 1), reason)
        })?;
        images.push(image);
    }
    images.sort();
    Ok(images)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(path: &Path) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }

    /// The images relative to the folder.
    fn names(folder: &Path, listing: &Listing) -> Vec<String> {
        let name = |path: &PathBuf| path.strip_prefix(folder).unwrap().display().to_string();
        listing.images.iter().map(name).collect()
    }

    #[test]
    fn what_lies_beside_images_is_not_looked_at() {
        let folder = tempfile::tempdir().unwrap();
        for name in
            ["b.jpg", "a.PNG", "Thumbs.db", ".DS_Store", "._b.jpg", ".git/x.jpg", "notes.txt"]
        {
            touch(&folder.path().join(name));
        }
        let listing = images_of(folder.path()).unwrap();
        assert_eq!(names(folder.path(), &listing), ["a.PNG", "b.jpg"]);
        assert!(listing.notes.is_empty(), "{:?}", listing.notes);
        let empty = tempfile::tempdir().unwrap();
        touch(&empty.path().join("desktop.ini"));
        assert!(images_of(empty.path()).unwrap_err().to_string().contains("has no image"));
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_circles_end() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let (inside, outside) = (folder.path().join("in"), folder.path().join("out"));
        touch(&inside.join("imgs/a.jpg"));
        touch(&outside.join("b.jpg"));
        touch(&outside.join("more/c.jpg"));
        symlink(&outside, inside.join("other")).unwrap();
        symlink(outside.join("b.jpg"), inside.join("z.jpg")).unwrap();
        symlink("imgs", inside.join("alias")).unwrap();
        symlink("..", inside.join("imgs/up")).unwrap();
        symlink("nowhere.jpg", inside.join("gone.jpg")).unwrap();
        symlink("self", inside.join("self")).unwrap();
        let listing = images_below(&inside).unwrap();
        assert_eq!(
            names(&inside, &listing),
            ["imgs/a.jpg", "other/b.jpg", "other/more/c.jpg", "z.jpg"]
        );
        let mut notes = listing.notes;
        notes.sort();
        let ends = ["alias", "gone.jpg", "imgs/up", "self"];
        assert_eq!(notes.len(), ends.len(), "{notes:?}");
        for (note, end) in notes.iter().zip(ends) {
            assert!(note.starts_with(&format!("{}: ", inside.join(end).display())), "{note}");
        }
    }

    #[test]
    fn the_list_beside_a_folder_is_used() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("queries");
        for name in ["3.jpg", "1.jpg", "5.jpg"] {
            touch(&folder.join(name));
        }
        let list = parent.path().join("queries_images_paths.txt");
        fs::write(&list, "5.jpg\nqueries/1.jpg\n").unwrap();
        assert_eq!(names(&folder, &images_of(&folder).unwrap()), ["1.jpg", "5.jpg"]);
        fs::write(&list, "5.jpg\n\n7.jpg\n").unwrap();
        let err = images_of(&folder).unwrap_err().to_string();
        assert!(err.ends_with("line 3: `7.jpg` does not exist"), "{err}");
    }
}
