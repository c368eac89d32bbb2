//! Who is writing to a map: a lock that says whose it is.

use std::{
    fs::{self, File, TryLockError},
    io::{self, Read as _, Seek as _, Write as _},
    path::Path,
    time::Duration,
};

use crate::{Error, Result};

/// The longest that is read of what a lock says.
const LONGEST: u64 = 1 << 10;

/// Takes the lock at `path` and writes into it who has it; it is free again when the file is dropped.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be written, or another process has the lock: which one, on which
/// machine, for how long, as far as it says so.
pub(super) fn take(path: &Path) -> Result<File> {
    // Not cut to nothing: it may say whose it is.
    let options = File::options().read(true).write(true).create(true).truncate(false).open(path);
    let mut file = options.map_err(Error::io(path))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let source = io::Error::new(io::ErrorKind::WouldBlock, holder(&mut file));
            return Err(Error::Io { path: path.to_owned(), source });
        }
        Err(TryLockError::Error(source)) => {
            return Err(Error::Io { path: path.to_owned(), source });
        }
    }
    let text = format!("process {} on {}\n", std::process::id(), host());
    let written = file.set_len(0).and_then(|()| file.write_all(text.as_bytes()));
    written.and_then(|()| file.flush()).map_err(Error::io(path))?;
    Ok(file)
}

/// What is said of a lock that another process has.
fn holder(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.rewind().and_then(|()| file.take(LONGEST).read_to_string(&mut text));
    let who = match (read, text.lines().next()) {
        (Ok(_), Some(line)) if !line.is_empty() => vpr_files::shorten(line),
        _ => "another process".to_owned(),
    };
    let age = file.metadata().and_then(|metadata| metadata.modified());
    let age = age.ok().and_then(|time| time.elapsed().ok()).map(in_words);
    format!("the map is being written to by {who}{}", age.unwrap_or_default())
}

/// ` for 3 minutes`; nothing for less than a second.
fn in_words(age: Duration) -> String {
    let seconds = age.as_secs();
    let (n, unit) = match seconds {
        0 => return String::new(),
        1..120 => (seconds, "second"),
        120..7200 => (seconds / 60, "minute"),
        _ => (seconds / 3600, "hour"),
    };
    format!(" for {n} {unit}{}", if n == 1 { "" } else { "s" })
}

/// The name of this machine, as far as it is known.
fn host() -> String {
    let kernel = fs::read_to_string("/proc/sys/kernel/hostname");
    let named = kernel.ok().or_else(|| std::env::var("HOSTNAME").ok());
    let named = named.or_else(|| std::env::var("COMPUTERNAME").ok());
    let name = named.as_deref().map(str::trim).filter(|name| !name.is_empty());
    name.map_or_else(|| "a machine without a name".to_owned(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_comes_second_is_told_who_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        fs::write(&path, "left by somebody long ago, with a longer text than the next has")
            .unwrap();
        let first = take(&path).unwrap();
        let Err(Error::Io { source, .. }) = take(&path) else { panic!("two have the lock") };
        let expected =
            format!("the map is being written to by process {} on {}", std::process::id(), host());
        assert!(source.to_string().starts_with(&expected), "{source}");
        drop(first);
        take(&path).unwrap();
    }

    #[test]
    fn a_lock_that_says_nothing_is_anothers() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = File::create_new(folder.path().join("lock")).unwrap();
        assert_eq!(holder(&mut file), "the map is being written to by another process");
    }

    #[test]
    fn ages_are_said_in_whole_units() {
        let words = |seconds| in_words(Duration::from_secs(seconds));
        assert_eq!(
            [0, 1, 90, 150, 7300].map(words).join(";"),
            "; for 1 second; for 90 seconds; for 2 minutes; for 2 hours"
        );
    }
}
