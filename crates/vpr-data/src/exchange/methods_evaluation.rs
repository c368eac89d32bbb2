//! What VPR-methods-evaluation saves: descriptors of both sides, and predictions per query.

use std::{
    collections::HashMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use super::{
    held, npy,
    parts::{PairList, Pairs, Parts},
    report::{Read, Report, read_text},
};
use vpr_core::{Error, Result};
use vpr_files::replace;

/// The references' descriptors in a log folder.
pub(super) const DATABASE: &str = "database_descriptors.npy";
/// The queries' descriptors in a log folder.
pub(super) const QUERIES: &str = "queries_descriptors.npy";
const PREDICTIONS: &str = "preds";

pub(super) fn read(folder: &Path, file: &str) -> Read<Parts> {
    npy::read_descriptors(&folder.join(file)).map_err(|err| vec![err])
}

pub(super) fn write(folder: &Path, file: &str, parts: &Parts) -> Result<()> {
    fs::create_dir_all(folder).map_err(Error::io(folder))?;
    Ok(vpr_files::npy::write_f32(&folder.join(file), parts.descriptors()?.view())?)
}

/// Reads `preds/*.txt` of a log folder, in the order of their numbers.
pub(super) fn read_pairs(folder: &Path) -> Read<Pairs> {
    let folder = folder.join(PREDICTIONS);
    let wrong = |source| vec![Error::io(&folder)(source)];
    let entries = fs::read_dir(&folder).map_err(wrong)?;
    let files = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut files: Vec<PathBuf> = files.collect::<Result<_, _>>().map_err(wrong)?;
    files.retain(|file| file.extension().is_some_and(|it| it == "txt"));
    files.sort_by_key(|file| file.file_stem().map(|stem| (stem.len(), stem.to_owned())));
    let mut report = Report::new(&folder);
    let mut pairs = Pairs::default();
    let mut file_of: HashMap<String, String> = HashMap::new();
    for file in files {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match read_list(&file) {
            Ok(list) => {
                if let Some(first) = file_of.insert(list.query.clone(), name.clone()) {
                    let query = vpr_files::shorten(&list.query);
                    report.at(name, format!("`{query}` is the query of {first}, too"));
                }
                pairs.lists.push(list);
            }
            Err(problems) => report.errors(problems),
        }
    }
    report.finish(pairs)
}

/// One file: `Query path:`, the query, `Predictions paths:`, the references, then the positives.
fn read_list(path: &Path) -> Read<PairList> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let (mut query, mut references, mut section) = (None, Vec::new(), "");
    for (line, content) in text.lines().enumerate().map(|(index, line)| (index + 1, line.trim())) {
        match content {
            "" => {}
            "Query path:" | "Predictions paths:" | "Positives paths:" => section = content,
            _ if section == "Query path:" && query.is_some() => report.line(line, "a second query"),
            name if section == "Query path:" => query = Some(name.to_owned()),
            name if section == "Predictions paths:" => references.push(name.to_owned()),
            _ if section.is_empty() => report.line(line, "expected `Query path:`"),
            _ => {}
        }
    }
    if query.is_none() {
        report.file("names no query");
    }
    report.finish(PairList { query: query.unwrap_or_default(), references })
}

pub(super) fn write_pairs(folder: &Path, pairs: &Pairs) -> Result<()> {
    let folder = folder.join(PREDICTIONS);
    fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    for (index, PairList { query, references }) in pairs.lists.iter().enumerate() {
        let path = folder.join(format!("{index:03}.txt"));
        held::Names::Line.check(&path, query)?;
        references.iter().try_for_each(|name| held::Names::Line.check(&path, name))?;
        let mut text = format!("Query path:\n{query}\n\nPredictions paths:\n");
        for reference in references {
            let _ = writeln!(text, "{reference}");
        }
        replace(&path, text.as_bytes())?;
    }
    Ok(())
}
