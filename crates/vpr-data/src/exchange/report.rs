//! The problems of one file, all of them, with the line they are on.

use std::{fs, path::Path};

use vpr_core::{Error, Result};

/// What a reader gives: the content, or every reason why there is none.
pub(super) type Read<T> = Result<T, Vec<Error>>;

/// Collects the problems of one file while it is read.
pub(super) struct Report<'a> {
    path: &'a Path,
    problems: Vec<Error>,
}

impl<'a> Report<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path, problems: Vec::new() }
    }

    /// Notes a problem on a line, counted from 1.
    pub(super) fn line(&mut self, line: usize, reason: impl Into<String>) {
        self.problems.push(Error::format(self.path, format!("line {line}"), reason));
    }

    /// Notes a problem in a place of its own.
    pub(super) fn at(&mut self, place: impl Into<String>, reason: impl Into<String>) {
        self.problems.push(Error::format(self.path, place, reason));
    }

    /// Notes a problem of the whole file.
    pub(super) fn file(&mut self, reason: impl Into<String>) {
        self.problems.push(Error::format(self.path, "file", reason));
    }

    /// Notes a problem that has its own place.
    #[cfg_attr(
        not(feature = "hdf5"),
        expect(dead_code, reason = "for formats whose parts are read apart")
    )]
    pub(super) fn error(&mut self, err: Error) {
        self.problems.push(err);
    }

    /// Notes several problems that have their own places.
    pub(super) fn errors(&mut self, problems: Vec<Error>) {
        self.problems.extend(problems);
    }

    /// Keeps a value, or notes why there is none on this line.
    pub(super) fn keep<T>(&mut self, line: usize, result: Result<T, String>) -> Option<T> {
        result.map_err(|reason| self.line(line, reason)).ok()
    }

    /// Whether there is a problem so far.
    pub(super) fn has_problems(&self) -> bool {
        !self.problems.is_empty()
    }

    /// The content, if there was no problem.
    pub(super) fn finish<T>(self, content: T) -> Read<T> {
        if self.problems.is_empty() { Ok(content) } else { Err(self.problems) }
    }
}

/// The text of a file, without the mark that some editors put before it.
pub(super) fn read_text(path: &Path) -> Read<String> {
    let bytes = fs::read(path).map_err(|source| vec![Error::io(path)(source)])?;
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(vec![Error::format(path, "byte 0", "is UTF-16 text: save it as UTF-8")]);
    }
    let mut text = String::from_utf8(bytes).map_err(|err| {
        let valid = err.utf8_error().valid_up_to();
        let line = err.as_bytes()[..valid].split(|&byte| byte == b'\n').count();
        vec![Error::format(path, format!("line {line}"), "is not UTF-8 text")]
    })?;
    if text.starts_with(BYTE_ORDER_MARK) {
        text.drain(..BYTE_ORDER_MARK.len_utf8());
    }
    Ok(text)
}

/// What some editors put before a text.
pub(super) const BYTE_ORDER_MARK: char = '\u{feff}';

/// The lines of a text that say something, with their numbers: not blank, not after a `#`.
pub(super) fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Exactly `N` finite numbers.
pub(super) fn numbers<'t, const N: usize>(
    fields: impl IntoIterator<Item = &'t str>,
) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    let mut n = 0;
    for field in fields {
        if n < N {
            values[n] = number(field)?;
        }
        n += 1;
    }
    if n == N { Ok(values) } else { Err(format!("has {n} numbers, expected {N}")) }
}

/// One finite number.
pub(super) fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("`{}` is not a finite number", vpr_files::shorten(text.trim()))),
    }
}

/// Numbers as shortest text that reads back as the same bits, with something between them.
pub(super) fn joined(values: &[f64], separator: &str) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(separator)
}

/// The first problem of a list, which says how many more there are.
pub(super) fn first(problems: Vec<Error>) -> Error {
    let more = problems.len().saturating_sub(1);
    match problems.into_iter().next() {
        Some(Error::Format { path, place, reason }) if more > 0 => {
            let problems = if more == 1 { "problem" } else { "problems" };
            Error::Format { path, place, reason: format!("{reason} (and {more} more {problems})") }
        }
        Some(err) => err,
        None => Error::Empty("problems"),
    }
}
