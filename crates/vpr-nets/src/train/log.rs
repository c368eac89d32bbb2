//! The log of a run: a table that goes on where a resumed run goes on.

use std::{
    fs::{self, File, OpenOptions},
    io::Write,
    path::{Path, PathBuf},
};

use vpr_core::{Error, Result};
use vpr_files::replace;

/// A CSV file with the column `step` and some more: a line every so many steps.
///
/// Lines are written whole and synced one by one. A resumed run takes back the lines that it will
/// write again, so that its log is that of a run which was never killed.
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
    columns: Vec<String>,
    every: usize,
    file: Option<File>,
}

impl Log {
    /// A log with a line of `columns` every `every` steps. Nothing is read or written yet.
    #[must_use]
    pub fn new(path: &Path, columns: &[&str], every: usize) -> Self {
        let columns = columns.iter().map(|&name| name.to_owned()).collect();
        Self { path: path.to_owned(), columns, every: every.max(1), file: None }
    }

    /// Steps between two lines.
    #[must_use]
    pub fn every(&self) -> usize {
        self.every
    }

    /// Opens the file after `done` steps: keeps the lines up to that step, takes back all others
    /// and what is no line of a step. Without steps it begins anew.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Format`] if lines would be kept under other columns.
    pub(super) fn resume(&mut self, done: usize) -> Result<()> {
        if let Some(folder) = self.path.parent() {
            fs::create_dir_all(folder).map_err(Error::io(folder))?;
        }
        let found = match fs::read(&self.path) {
            // A cut line may end inside a character.
            Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
            Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(cause) => return Err(Error::io(&self.path)(cause)),
        };
        let head = format!("step,{}\n", self.columns.join(","));
        let lines = kept(&found, done);
        if !lines.is_empty() && !found.starts_with(&head) {
            let first = found.lines().next().unwrap_or_default();
            let reason = format!("`{first}`, but this run writes `{}`", head.trim_end());
            return Err(Error::format(&self.path, "line 1", reason));
        }
        replace(&self.path, (head + &lines).as_bytes())?;
        let file = OpenOptions::new().append(true).open(&self.path);
        self.file = Some(file.map_err(Error::io(&self.path))?);
        Ok(())
    }

    /// Appends a line; `label` is the step, or what the line is about.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if there is not a cell for every column; [`Error::Io`].
    pub(super) fn append(&mut self, label: &str, cells: &[String]) -> Result<()> {
        if cells.len() != self.columns.len() {
            let (expected, actual) = (self.columns.len(), cells.len());
            return Err(Error::Mismatch { what: "cells of a line of a log", expected, actual });
        }
        let line = format!("{label},{}\n", cells.join(","));
        let file = self.file.as_mut().ok_or(Error::Empty("open log"))?;
        let written = file.write_all(line.as_bytes()).and_then(|()| file.sync_data());
        written.map_err(Error::io(&self.path))
    }
}

/// The whole lines of steps up to `done`, each later than the one before.
fn kept(log: &str, done: usize) -> String {
    let mut last = 0;
    let is_kept = |line: &&str| {
        let label = line.split(',').next().and_then(|it| it.parse::<usize>().ok());
        let step = label.filter(|&step| line.ends_with('\n') && step > last && step <= done);
        last = step.unwrap_or(last);
        step.is_some()
    };
    log.split_inclusive('\n').filter(is_kept).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = "step,loss\n1,0.5\n2,0.4\n3,0.3\n";

    /// What is in a file with `before` once it was opened after `done` steps.
    fn resumed(before: &[u8], done: usize) -> Result<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("logs/run.csv");
        fs::create_dir(folder.path().join("logs")).unwrap();
        fs::write(&path, before).unwrap();
        Log::new(&path, &["loss"], 1).resume(done)?;
        Ok(fs::read_to_string(path).unwrap())
    }

    #[test]
    fn lines_after_the_resumed_step_are_taken_back() {
        assert_eq!(resumed(WHOLE.as_bytes(), 2).unwrap(), "step,loss\n1,0.5\n2,0.4\n");
        assert_eq!(resumed(WHOLE.as_bytes(), 3).unwrap(), WHOLE);
        assert_eq!(resumed(WHOLE.as_bytes(), 0).unwrap(), "step,loss\n");
        assert_eq!(resumed(b"", 0).unwrap(), "step,loss\n");
        let ended = format!("{WHOLE}whitened,0.1\n");
        assert_eq!(resumed(ended.as_bytes(), 3).unwrap(), WHOLE);
    }

    #[test]
    fn a_cut_line_and_one_that_stands_twice_go() {
        for cut in ["3", "3,", "3,0.", "3,0.3", "3,\u{e9}"] {
            let bytes = ["step,loss\n1,0.5\n2,0.4\n", cut].concat().into_bytes();
            let cut = &bytes[..bytes.len() - usize::from(!bytes.is_ascii())];
            assert_eq!(resumed(cut, 9).unwrap(), "step,loss\n1,0.5\n2,0.4\n");
        }
        let twice = "step,loss\n1,0.5\n2,0.4\n2,0.4\n1,0.5\n3,0.3\n";
        assert_eq!(resumed(twice.as_bytes(), 3).unwrap(), WHOLE);
    }

    #[test]
    fn lines_of_other_columns_are_not_mixed_with_ours() {
        let other = b"step,loss,rate\n1,0.5,0.1\n";
        let err = resumed(other, 1).unwrap_err().to_string();
        assert!(err.contains("run.csv") && err.contains("`step,loss,rate`"), "{err}");
        assert_eq!(resumed(other, 0).unwrap(), "step,loss\n");
    }

    #[test]
    fn a_line_has_a_cell_for_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = Log::new(&folder.path().join("run.csv"), &["loss", "rate"], 1);
        log.resume(0).unwrap();
        assert!(log.append("1", &["0.5".to_owned()]).is_err());
        log.append("1", &["0.5".to_owned(), "0.1".to_owned()]).unwrap();
        let text = fs::read_to_string(folder.path().join("run.csv")).unwrap();
        assert_eq!(text, "step,loss,rate\n1,0.5,0.1\n");
    }
}
