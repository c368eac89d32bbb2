//! hloc's pairs: one line `query reference` per pair, nearest first.

use std::{collections::HashMap, fmt::Write as _, path::Path};

use super::{
    held,
    parts::{PairList, Pairs},
    report::{Read, Report, content_lines, read_text},
};
use vpr_core::Result;
use vpr_files::replace;

pub(super) fn read(path: &Path) -> Read<Pairs> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let mut pairs = Pairs::default();
    let mut list_of: HashMap<&str, usize> = HashMap::new();
    for (line, content) in content_lines(&text) {
        let mut fields = content.split_whitespace();
        let (Some(query), Some(reference), None) = (fields.next(), fields.next(), fields.next())
        else {
            let reason =
                "is no pair: expected the names of a query and a reference, without blanks";
            report.line(line, reason);
            continue;
        };
        let list = *list_of.entry(query).or_insert_with(|| {
            pairs.lists.push(PairList { query: query.to_owned(), references: Vec::new() });
            pairs.lists.len() - 1
        });
        pairs.lists[list].references.push(reference.to_owned());
    }
    report.finish(pairs)
}

pub(super) fn write(path: &Path, pairs: &Pairs) -> Result<()> {
    let mut text = String::new();
    for PairList { query, references } in &pairs.lists {
        held::Names::Words.check(path, query)?;
        for reference in references {
            held::Names::Words.check(path, reference)?;
            let _ = writeln!(text, "{query} {reference}");
        }
    }
    Ok(replace(path, text.as_bytes())?)
}
