//! How images were when they were described: their length and time of change.

use std::{collections::HashMap, fmt::Write as _, fs, path::Path, time::UNIX_EPOCH};

use vpr_core::Error;

use super::Images;
use crate::Result;

/// The file in the folder of unfinished work.
const FILE: &str = "images.tsv";

/// The first `n` images must be as they were when an earlier run described them.
///
/// # Errors
///
/// [`Error::Format`] with the name of an image that is not, or if it is not known how they were;
/// [`Error::Io`].
pub(super) fn check(work: &Path, images: &Images, n: usize) -> Result<()> {
    if n == 0 {
        return Ok(());
    }
    let again = || format!("delete {} to describe all images anew", work.display());
    let text = match fs::read_to_string(work.join(FILE)) {
        Ok(text) => text,
        Err(err) if err.kind() == std::io::ErrorKind::NotFound => {
            let reason = format!("does not say how its images were; {}", again());
            return Err(crate::Error::format(work, FILE, reason));
        }
        Err(err) => return Err(Error::io(work.join(FILE))(err).into()),
    };
    let lines = text.lines().filter_map(|line| line.split_once('\t'));
    let earlier: HashMap<&str, &str> = lines.map(|(stamp, name)| (name, stamp)).collect();
    for (path, name) in images.paths.iter().zip(&images.names).take(n) {
        let line = escaped(name);
        if earlier.get(line.as_str()) != Some(&stamp(path).as_str()) {
            let reason = format!("has changed since an earlier run described it; {}", again());
            return Err(crate::Error::format(path, "image", reason));
        }
    }
    Ok(())
}

/// Keeps how the images are now.
///
/// # Errors
///
/// [`Error::Io`].
pub(super) fn write(work: &Path, images: &Images) -> Result<()> {
    let mut text = String::new();
    for (path, name) in images.paths.iter().zip(&images.names) {
        let _ = writeln!(text, "{}\t{}", stamp(path), escaped(name));
    }
    Ok(vpr_files::replace(&work.join(FILE), text.as_bytes())?)
}

/// Length and nanoseconds of the last change, or that the file is not there: such an image may be
/// skipped, and be there the next time.
fn stamp(path: &Path) -> String {
    let known = fs::metadata(path).ok().and_then(|it| Some((it.len(), it.modified().ok()?)));
    known.map_or("absent".to_owned(), |(length, changed)| {
        let nanos = changed.duration_since(UNIX_EPOCH).map_or(0, |it| it.as_nanos());
        format!("{length} {nanos}")
    })
}

/// A name on one line.
fn escaped(name: &str) -> String {
    name.escape_debug().collect()
}
