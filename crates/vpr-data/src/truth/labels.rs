//! Labelled places: images of one class, floor or room are one place.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use vpr_core::{Error, GroundTruth, Result};
use vpr_files::{npy, shorten};

use super::{
    Found,
    names::{self, NameIndex},
    side::{Side, Sides},
    text,
};

/// Where the label of an image stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Labels {
    /// The folder that it lies in, directly below the folder of its side.
    Folders,
    /// A file.
    File {
        /// The labels of all images by name, or of the references if `queries` has the others.
        path: PathBuf,
        /// The labels of the queries.
        queries: Option<PathBuf>,
        /// Title of the column of labels, if it is none of the usual ones.
        column: Option<String>,
    },
}

/// Titles of the column of names, compared as [`text::title`] writes them.
const NAME: [&str; 10] = [
    "name",
    "image",
    "imagename",
    "imagepath",
    "file",
    "filename",
    "filepath",
    "path",
    "key",
    "img",
];
/// Titles of the column of labels.
const LABEL: [&str; 12] = [
    "label",
    "labels",
    "class",
    "classid",
    "place",
    "placeid",
    "placename",
    "floor",
    "room",
    "category",
    "location",
    "cluster",
];

impl Labels {
    /// A reference is correct if its label is that of the query.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Format`] with the line of what is malformed, for an image without a
    /// label or with two, and if no reference has the label of any query.
    pub fn truth(&self, sides: &Sides) -> Result<Found> {
        let (labels, path, mut notes) = match self {
            Self::Folders => {
                let labels = [folder_labels(&sides.queries)?, folder_labels(&sides.references)?];
                let path = sides.references.folder.clone().unwrap_or_default();
                let all: BTreeSet<&String> = labels.iter().flatten().collect();
                if let [only] = all.into_iter().collect::<Vec<_>>()[..] {
                    let reason = format!(
                        "all images lie below `{}`: one folder per place is expected directly below \
                         the folder of a side",
                        shorten(only)
                    );
                    return Err(Error::format(path, "labels", reason));
                }
                (labels, path, Vec::new())
            }
            Self::File { path, queries: None, column } => {
                let rows = read(path, column.as_deref())?;
                let (labels, notes) = of_both(path, &rows, sides)?;
                (labels, path.clone(), notes)
            }
            Self::File { path, queries: Some(queries), column } => {
                let of = |path: &Path, side, what| {
                    of_one(path, &read(path, column.as_deref())?, side, what)
                };
                let query_labels = of(queries, &sides.queries, "queries")?;
                let reference_labels = of(path, &sides.references, "references")?;
                ([query_labels, reference_labels], path.clone(), Vec::new())
            }
        };
        let [queries, references] = labels;
        let truth = GroundTruth::same_label(&queries, &references);
        if truth.n_known() == 0
            && let (Some(query), Some(reference)) = (queries.first(), references.first())
        {
            let reason = format!(
                "no reference has the label of a query: `{}` among queries, `{}` among references",
                shorten(query),
                shorten(reference)
            );
            return Err(Error::format(path, "labels", reason));
        }
        let distinct: BTreeSet<&String> = references.iter().collect();
        if distinct.len() == 1 {
            notes.push(format!("{}: all references have the same label", path.display()));
        }
        Ok(Found { truth, notes })
    }
}

/// The first folder of every name below the folder of its side.
fn folder_labels(side: &Side) -> Result<Vec<String>> {
    let folder = side.folder.clone().unwrap_or_default();
    let Some(names) = &side.names else {
        return Err(Error::format(folder, "labels", "the images have no names, so no folders"));
    };
    let label = |name: &String| {
        let inside = Path::new(name).strip_prefix(&folder).unwrap_or(name.as_ref());
        let mut parts = inside.components();
        let first = parts.next().filter(|_| parts.next().is_some());
        first.map(|first| first.as_os_str().to_string_lossy().into_owned()).ok_or_else(|| {
            Error::format(name, "labels", "lies in no folder of a place: `folders` names places")
        })
    };
    names.iter().map(label).collect()
}

/// One label of a file.
struct Row {
    line: usize,
    name: Option<String>,
    label: String,
}

/// The labels of a `.npy` of numbers, of a table with a column of names, or of one column.
fn read(path: &Path, column: Option<&str>) -> Result<Vec<Row>> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    if bytes.starts_with(b"\x93NUMPY") {
        let labels = npy::read_i64(path)?;
        let row = |(line, label): (usize, &i64)| Row { line, name: None, label: label.to_string() };
        return Ok(labels.iter().enumerate().map(row).collect());
    }
    let lines = text::lines(path, &bytes)?;
    let first = lines.first().ok_or_else(|| Error::format(path, "line 1", "there is no label"))?;
    let columns = columns(path, &first.fields, column)?;
    let n_columns = first.fields.len();
    let mut rows = Vec::with_capacity(lines.len());
    for line in &lines[usize::from(columns.has_titles)..] {
        let err = |reason: String| Error::format(path, format!("line {}", line.number), reason);
        if line.fields.len() != n_columns {
            let n = line.fields.len();
            return Err(err(format!("{n} values for {n_columns} columns")));
        }
        let name = columns.name.map(|name| line.fields[name].clone());
        let label = line.fields[columns.label].clone();
        if label.is_empty() || name.as_ref().is_some_and(String::is_empty) {
            let name = name.unwrap_or_default();
            return Err(err(format!("`{}` has no label, or its name is empty", shorten(&name))));
        }
        rows.push(Row { line: line.number, name, label });
    }
    Ok(rows)
}

/// Which columns are which.
struct Columns {
    name: Option<usize>,
    label: usize,
    has_titles: bool,
}

fn columns(path: &Path, fields: &[String], asked: Option<&str>) -> Result<Columns> {
    let titles: Vec<String> = fields.iter().map(|field| text::title(field)).collect();
    let find = |known: &[&str]| titles.iter().position(|it| known.contains(&it.as_str()));
    let err = |reason: String| Error::format(path, "line 1", reason);
    let shown = || shorten(&fields.join(","));
    let name = find(&NAME);
    let label = match asked {
        Some(asked) => {
            let found = fields.iter().position(|field| field == asked);
            Some(found.ok_or_else(|| {
                err(format!("no column `{}`; the titles are `{}`", shorten(asked), shown()))
            })?)
        }
        None => find(&LABEL).filter(|&label| Some(label) != name),
    };
    match (name, label, fields.len()) {
        (Some(name), Some(label), _) => Ok(Columns { name: Some(name), label, has_titles: true }),
        (Some(name), None, 2) => {
            Ok(Columns { name: Some(name), label: 1 - name, has_titles: true })
        }
        (None, Some(label), 2) => Ok(Columns { name: Some(1 - label), label, has_titles: true }),
        (None, Some(label), 1) => Ok(Columns { name: None, label, has_titles: true }),
        (None, None, 1) => Ok(Columns { name: None, label: 0, has_titles: false }),
        (None, None, 2) => Ok(Columns { name: Some(0), label: 1, has_titles: false }),
        _ => Err(err(format!(
            "the titles are `{}`: expected `name` and `label` among them, or `--label-column`",
            shown()
        ))),
    }
}

/// The labels of one side: by name where both have names, in order otherwise.
fn of_one(path: &Path, rows: &[Row], side: &Side, what: &str) -> Result<Vec<String>> {
    let are_named = rows.iter().all(|row| row.name.is_some());
    let (true, Some(names)) = (are_named, &side.names) else {
        if rows.len() != side.len {
            let reason = format!("{} labels, but there are {} {what}", rows.len(), side.len);
            return Err(Error::format(path, "number of labels", reason));
        }
        return Ok(rows.iter().map(|row| row.label.clone()).collect());
    };
    let index = NameIndex::new(names);
    let mut labels = vec![None; side.len];
    for row in rows {
        let name = row.name.as_deref().unwrap_or_default();
        match index.find(name) {
            names::Found::Whole(image) | names::Found::End(image) => {
                give(path, &mut labels, image, row, side)?;
            }
            names::Found::Several => return Err(several(path, row)),
            names::Found::None => {}
        }
    }
    complete(path, labels, side, what)
}

/// The labels of both sides, which one file has by name.
fn of_both(path: &Path, rows: &[Row], sides: &Sides) -> Result<([Vec<String>; 2], Vec<String>)> {
    let sides = [&sides.queries, &sides.references];
    let [Some(query_names), Some(reference_names)] = sides.map(|side| side.names.as_deref()) else {
        let reason = "the images have no names: give the labels of the references here, in order, \
                      and those of the queries by `--queries-labels`";
        return Err(Error::format(path, "labels", reason));
    };
    let indices = [query_names, reference_names].map(NameIndex::new);
    let mut labels = sides.map(|side| vec![None; side.len]);
    let mut n_unused = 0;
    for row in rows {
        let name = row.name.as_deref().ok_or_else(|| {
            let reason = "has no name: one file for both sides needs a column of names";
            Error::format(path, format!("line {}", row.line), reason)
        })?;
        let found = [0, 1].map(|side: usize| indices[side].find(name));
        // A folder that is written tells the sides apart; only where it is not that of an image, the
        // rest of the name has to do.
        let is_whole = found.iter().any(|it| matches!(it, names::Found::Whole(_)));
        let mut is_used = false;
        for (side, found) in found.into_iter().enumerate() {
            match found {
                names::Found::Whole(image) => {
                    give(path, &mut labels[side], image, row, sides[side])?;
                }
                names::Found::End(image) if !is_whole => {
                    give(path, &mut labels[side], image, row, sides[side])?;
                }
                names::Found::Several if !is_whole => return Err(several(path, row)),
                _ => continue,
            }
            is_used = true;
        }
        n_unused += usize::from(!is_used);
    }
    let [queries, references] = labels;
    let queries = complete(path, queries, sides[0], "queries")?;
    let references = complete(path, references, sides[1], "references")?;
    let notes = match n_unused {
        0 => Vec::new(),
        n => vec![format!("{}: {n} labels are of none of the images", path.display())],
    };
    Ok(([queries, references], notes))
}

/// Labels an image; two different labels are an error.
fn give(
    path: &Path,
    labels: &mut [Option<String>],
    image: usize,
    row: &Row,
    side: &Side,
) -> Result<()> {
    match &labels[image] {
        Some(known) if *known != row.label => {
            let (name, known) = (side.name(image), shorten(known));
            let reason = format!("`{name}` has the label `{known}` already");
            Err(Error::format(path, format!("line {}", row.line), reason))
        }
        _ => {
            labels[image] = Some(row.label.clone());
            Ok(())
        }
    }
}

fn several(path: &Path, row: &Row) -> Error {
    let name = shorten(row.name.as_deref().unwrap_or_default());
    let reason = format!("`{name}`: several images are called so");
    Error::format(path, format!("line {}", row.line), reason)
}

/// All labels, or which image has none.
fn complete(
    path: &Path,
    labels: Vec<Option<String>>,
    side: &Side,
    what: &str,
) -> Result<Vec<String>> {
    let n_missing = labels.iter().filter(|label| label.is_none()).count();
    match labels.iter().position(Option::is_none) {
        None => Ok(labels.into_iter().flatten().collect()),
        Some(first) => {
            let name = shorten(&side.name(first));
            let reason =
                format!("{n_missing} of {} {what} have no label, such as `{name}`", side.len);
            Err(Error::format(path, "labels", reason))
        }
    }
}
