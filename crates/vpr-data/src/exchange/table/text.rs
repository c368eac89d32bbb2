//! The header and the rows of a table, whatever separates its columns, and fields that are read back
//! as they were.

use std::borrow::Cow;

use super::columns::{Columns, NotFound, Prefer};

/// What separates columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Byte(u8),
    /// Any number of blanks.
    Blanks,
}

/// The header of a table.
pub(super) struct Header {
    /// Titles as they are written.
    pub(super) titles: Vec<String>,
    pub(super) columns: Columns,
    /// Line of the titles, counted from 1.
    pub(super) line: usize,
    /// How many comments among the rows look like rows.
    pub(super) n_commented_rows: usize,
    separator: Separator,
    /// Where the rows start: byte, and lines before it.
    start: (usize, usize),
}

/// One row.
pub(super) struct Row {
    /// Counted from 1.
    pub(super) line: usize,
    pub(super) fields: Vec<String>,
}

/// A line, and why it is wrong.
type Wrong = (usize, String);

/// Why a text has no header.
#[derive(Debug)]
pub(super) struct NoHeader {
    pub(super) line: usize,
    pub(super) reason: String,
    /// Whether it is a table of poses all the same, with something amiss.
    pub(super) is_table: bool,
}

/// Finds the titles: in the first line that says something, or else in the last comment before it.
pub(super) fn header(text: &str, prefer: Prefer) -> Result<Header, NoHeader> {
    let mut comments: Vec<(usize, &str)> = Vec::new();
    let (mut at, mut first) = (0, None);
    for (index, line) in text.split_inclusive('\n').enumerate() {
        // A tab at the front makes a column without a title.
        let content = line.trim_matches([' ', '\r', '\n']);
        if let Some(comment) = content.strip_prefix('#') {
            comments.push((index + 1, comment.trim_start_matches('#')));
        } else if !content.trim().is_empty() {
            first = Some((index + 1, content, at, line.len()));
            break;
        }
        at += line.len();
    }
    let nothing = (1, "", text.len(), 0);
    let (line, content, at, length) = first.unwrap_or(nothing);
    let reason = match Header::of(content, line, (at + length, line), prefer) {
        Err(NotFound::NoTable(reason)) => reason,
        found => return finished(text, found, line),
    };
    for (comment_line, comment) in comments.into_iter().rev() {
        let found = Header::of(comment, comment_line, (at, line - 1), prefer);
        if matches!(found, Err(NotFound::NoTable(_))) {
            continue;
        }
        // The rows' own separator counts: `# timestamp tx ty tz` may stand over commas.
        let found = found.map(|header| match first {
            Some(_) => Header { separator: separator_of(content), ..header },
            None => header,
        });
        return finished(text, found, comment_line);
    }
    Err(NoHeader { line, reason, is_table: false })
}

fn finished(text: &str, found: Result<Header, NotFound>, line: usize) -> Result<Header, NoHeader> {
    match found {
        Ok(header) => Ok(counted(text, header)),
        Err(NotFound::Broken(reason)) => Err(NoHeader { line, reason, is_table: true }),
        Err(NotFound::NoTable(reason)) => Err(NoHeader { line, reason, is_table: false }),
    }
}

impl Header {
    fn of(
        content: &str,
        line: usize,
        start: (usize, usize),
        prefer: Prefer,
    ) -> Result<Self, NotFound> {
        let separator = separator_of(content);
        let titles = split(content, separator);
        let columns = Columns::find(&titles, prefer)?;
        Ok(Self { titles, columns, line, n_commented_rows: 0, separator, start })
    }
}

/// Counts the comments that look like rows.
fn counted(text: &str, mut header: Header) -> Header {
    let rows = text.get(header.start.0..).unwrap_or_default();
    let comments = rows.lines().filter_map(|line| line.trim().strip_prefix('#'));
    header.n_commented_rows = comments
        .filter(|line| {
            let n = split(line, header.separator).len();
            n > 1 && n == header.titles.len()
        })
        .count();
    header
}

/// The character that occurs most outside of quotes; blanks if none of them does.
fn separator_of(line: &str) -> Separator {
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let mut quoted = false;
    for byte in line.bytes() {
        quoted ^= byte == b'"';
        counts.iter_mut().filter(|(it, _)| !quoted && *it == byte).for_each(|(_, n)| *n += 1);
    }
    // Of equally many the first.
    let most = counts.into_iter().rev().max_by_key(|(_, n)| *n);
    match most {
        Some((byte, 1..)) => Separator::Byte(byte),
        _ => Separator::Blanks,
    }
}

/// The fields of one line.
fn split(line: &str, separator: Separator) -> Vec<String> {
    let record = Records { text: line, separator, line: 1 }.next();
    record.and_then(Result::ok).map(|row| row.fields).unwrap_or_default()
}

/// The rows below a header, comments and lines that say nothing apart.
pub(super) fn rows<'t>(
    text: &'t str,
    header: &Header,
) -> impl Iterator<Item = Result<Row, Wrong>> + use<'t> {
    let (start, lines_before) = header.start;
    let text = text.get(start..).unwrap_or_default();
    Records { text, separator: header.separator, line: lines_before + 1 }
}

/// Takes rows off the front of a text, comments and lines that say nothing apart.
struct Records<'t> {
    text: &'t str,
    separator: Separator,
    /// Line that the text starts in.
    line: usize,
}

impl Iterator for Records<'_> {
    type Item = Result<Row, Wrong>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            self.skip_comments();
            if self.text.is_empty() {
                return None;
            }
            let line = self.line;
            let fields = match self.separator {
                Separator::Blanks => {
                    let (content, rest) = self.text.split_once('\n').unwrap_or((self.text, ""));
                    (self.text, self.line) = (rest, line + 1);
                    Ok(content.split_whitespace().map(str::to_owned).collect())
                }
                Separator::Byte(byte) => self.record(byte),
            };
            match fields {
                Ok(fields) if fields.iter().all(String::is_empty) => {}
                Ok(fields) => return Some(Ok(Row { line, fields })),
                Err(reason) => return Some(Err((line, reason))),
            }
        }
    }
}

impl Records<'_> {
    fn skip_comments(&mut self) {
        while self.text.trim_start_matches(' ').starts_with('#') {
            self.skip_line();
        }
    }

    /// The fields of one row: in quotes as they are, a quote in them written twice; else without the
    /// blanks around them.
    fn record(&mut self, separator: u8) -> Result<Vec<String>, String> {
        let separator = char::from(separator);
        let mut fields = Vec::new();
        loop {
            let blanks = |char: char| char.is_whitespace() && char != '\n' && char != separator;
            self.text = self.text.trim_start_matches(blanks);
            let field = if let Some(rest) = self.text.strip_prefix('"') {
                self.text = rest;
                let field = self.quoted()?;
                self.text = self.text.trim_start_matches(blanks);
                if !self.text.is_empty() && !self.text.starts_with([separator, '\n']) {
                    self.skip_line();
                    return Err("something follows a closing quote".to_owned());
                }
                field
            } else {
                let end = self.text.find([separator, '\n']).unwrap_or(self.text.len());
                let field = self.text[..end].trim_end().to_owned();
                self.text = &self.text[end..];
                field
            };
            fields.push(field);
            let Some(rest) = self.text.strip_prefix(separator) else {
                self.skip_line();
                return Ok(fields);
            };
            self.text = rest;
        }
    }

    /// What stands in quotes, of which the first is taken.
    fn quoted(&mut self) -> Result<String, String> {
        let mut field = String::new();
        loop {
            let Some((content, rest)) = self.text.split_once('"') else {
                self.text = "";
                return Err("a quote is opened and not closed".to_owned());
            };
            self.line += content.matches('\n').count();
            field.push_str(content);
            self.text = rest;
            match self.text.strip_prefix('"') {
                Some(rest) => self.text = rest,
                None => return Ok(field),
            }
            field.push('"');
        }
    }

    fn skip_line(&mut self) {
        self.text = self.text.split_once('\n').map_or("", |(_, rest)| rest);
        self.line += 1;
    }
}

/// A field of a line of CSV, in quotes if it would not be read back as it is without them.
#[must_use]
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let is_plain = !text.contains([',', ';', '\t', '"', '\n', '\r'])
        && !text.starts_with('#')
        && text.trim() == text;
    if is_plain { text.into() } else { format!("\"{}\"", text.replace('"', "\"\"")).into() }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn fields_are_read_back_as_they_were(names in prop::collection::vec("[a#,;\" \t\n\r.é]{1,6}", 1..5)) {
            let fields: Vec<_> = names.iter().map(|name| csv_field(name)).collect();
            let text = format!("name,x,y\n{},1,2\nz,3,4\n", fields.join(",1,2\n"));
            let header = header(&text, Prefer::Metres).unwrap();
            let rows: Vec<Row> = rows(&text, &header).map(Result::unwrap).collect();
            let read: Vec<&String> = rows.iter().map(|row| &row.fields[0]).collect();
            prop_assert_eq!(read[..names.len()].to_vec(), names.iter().collect::<Vec<_>>());
            let n_lines: usize = names.iter().map(|name| 1 + name.matches('\n').count()).sum();
            prop_assert_eq!(rows[names.len()].line, 2 + n_lines);
        }
    }

    #[test]
    fn quotes_must_end() {
        let reason = |text: &str| {
            let header = header(text, Prefer::Metres).unwrap();
            let wrong = rows(text, &header).find_map(Result::err).unwrap();
            format!("line {}: {}", wrong.0, wrong.1)
        };
        assert_eq!(
            reason("name,x,y\na,1,2\n\"b,1,2\n"),
            "line 3: a quote is opened and not closed"
        );
        assert_eq!(reason("name,x,y\n\"a\"b,1,2\n"), "line 2: something follows a closing quote");
    }
}
