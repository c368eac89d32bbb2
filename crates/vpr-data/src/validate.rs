//! Everything that is wrong with a dataset folder, not only the first thing.

use std::{
    collections::BTreeMap,
    fmt, fs,
    path::{Path, PathBuf},
};

use crate::{
    layout::{
        folder::{images_of, is_hidden},
        numbered::images_in_order,
        seven_scenes,
        utm_names::{UtmFolder, parse_name},
        vpr_bench::{GroundTruthFile, image_number, is_image},
    },
    truth::{self, Source},
};
use vpr_core::{Error, Result};

/// Reads as much of an image as tells its width and height, or says why it cannot.
pub type Probe<'a> = &'a dyn Fn(&Path) -> Result<(u32, u32), String>;

/// Something that is wrong, or at least odd.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// How bad it is.
    pub severity: Severity,
    /// The file or folder.
    pub path: PathBuf,
    /// Where in it; empty if all of it.
    pub place: String,
    /// What is wrong there.
    pub reason: String,
}

/// How bad a [`Problem`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Results can be computed, but may not be what is expected.
    Warning,
    /// The dataset cannot be used like this.
    Error,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        write!(f, "{severity}: {}: ", self.path.display())?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        write!(f, "{}", self.reason)
    }
}

/// All problems of the dataset in `folder`, which has the layout of VPR-Bench (`query/`, `ref/`,
/// `ground_truth_new.npy`) or of positions in names (`queries/`, `database/`).
#[must_use]
pub fn validate(folder: &Path, probe: Probe<'_>) -> Vec<Problem> {
    validate_with(folder, probe, None)
}

/// [`validate`] with a truth from elsewhere: that is checked, and neither a ground truth in the folder
/// nor positions in names are asked for.
#[must_use]
pub fn validate_with(folder: &Path, probe: Probe<'_>, truth: Option<&Source>) -> Vec<Problem> {
    let mut report = Report { problems: Vec::new(), probe };
    let has = |name: &str| folder.join(name).exists();
    if !folder.is_dir() {
        report.error(folder, "", "is not a folder");
    } else if let (Some(truth), Some(sides)) = (truth, sides(folder)) {
        let [queries, references] = sides.map(|name| folder.join(name));
        report.plain_images(&queries);
        report.plain_images(&references);
        report.problems.extend(truth::problems(truth, &queries, &references));
    } else if has("queries") || has("database") {
        report.utm_names(&folder.join("queries"));
        report.utm_names(&folder.join("database"));
    } else if has("query") || has("ref") || has("ground_truth_new.npy") {
        let n_queries = report.numbered_images(&folder.join("query"));
        let n_references = report.numbered_images(&folder.join("ref"));
        report.ground_truth(&folder.join("ground_truth_new.npy"), n_queries, n_references);
    } else if has("seq-01") {
        report.seven_scenes(folder);
    } else {
        let reason = "has neither query/ and ref/, nor queries/ and database/, nor seq-01/";
        report.error(folder, "", reason);
    }
    report.problems
}

/// The folders of queries and references, if there are any that are called so.
fn sides(folder: &Path) -> Option<[&'static str; 2]> {
    let known = [["queries", "database"], ["query", "ref"]];
    known.into_iter().find(|names| names.iter().any(|name| folder.join(name).is_dir()))
}

struct Report<'a> {
    problems: Vec<Problem>,
    probe: Probe<'a>,
}

impl Report<'_> {
    /// Checks sequences of frames with poses: the first malformed pose, every unreadable image.
    fn seven_scenes(&mut self, folder: &Path) {
        let sides = match seven_scenes::open(folder) {
            Ok((queries, references)) => [queries, references],
            Err(err) => return self.failure(folder, err),
        };
        for image in sides.iter().flat_map(|side| &side.images) {
            if let Err(reason) = (self.probe)(image) {
                self.error(image, "", reason);
            }
        }
    }

    fn add(&mut self, severity: Severity, path: &Path, place: &str, reason: impl Into<String>) {
        let (path, place) = (path.to_owned(), place.to_owned());
        self.problems.push(Problem { severity, path, place, reason: reason.into() });
    }

    fn error(&mut self, path: &Path, place: &str, reason: impl Into<String>) {
        self.add(Severity::Error, path, place, reason);
    }

    fn warning(&mut self, path: &Path, place: &str, reason: impl Into<String>) {
        self.add(Severity::Warning, path, place, reason);
    }

    /// Adds what a reader returned as an error.
    fn failure(&mut self, path: &Path, err: Error) {
        match err {
            Error::Format { path, place, reason } => self.error(&path, &place, reason),
            Error::Io { path, source } => self.error(&path, "", source.to_string()),
            err => self.error(path, "", err.to_string()),
        }
    }

    /// Checks `query/` or `ref/`; returns how many images it has.
    fn numbered_images(&mut self, folder: &Path) -> usize {
        let mut numbered: BTreeMap<u64, Vec<PathBuf>> = BTreeMap::new();
        for path in self.entries(folder) {
            if !is_image(&path) {
                self.warning(&path, "", "is no .jpg, .jpeg or .png image, and not looked at");
                continue;
            }
            match image_number(&path) {
                Ok(number) => numbered.entry(number).or_default().push(path),
                Err(reason) => self.error(&path, "", reason),
            }
        }
        for (number, paths) in &numbered {
            for path in &paths[1..] {
                let reason = format!("`{}` has number {number}, too", paths[0].display());
                self.error(path, "", reason);
            }
        }
        let numbers: Vec<u64> = numbered.keys().copied().collect();
        if let Some(&first) = numbers.first().filter(|&&first| first > 0) {
            let reason = format!("the first number is {first}; it gets index 0");
            self.warning(folder, "", reason);
        }
        for pair in numbered.keys().collect::<Vec<_>>().windows(2) {
            if pair[1] - pair[0] > 1 {
                let reason = "numbers are missing in between; indices are positions, not numbers";
                self.warning(folder, &format!("after {}, before {}", pair[0], pair[1]), reason);
            }
        }
        let images: Vec<PathBuf> = numbered.into_values().flatten().collect();
        self.images(folder, &images);
        images.len()
    }

    /// Checks the images of a folder, whatever they are called.
    fn plain_images(&mut self, folder: &Path) {
        // A folder that cannot be listed is the truth's problem.
        if let Ok(listing) = images_in_order(folder) {
            for note in &listing.notes {
                self.warning(folder, "", note);
            }
            self.images(folder, &listing.images);
        }
    }

    /// Checks `queries/` or `database/`.
    fn utm_names(&mut self, folder: &Path) {
        if !folder.is_dir() {
            return self.error(folder, "", "is missing");
        }
        match UtmFolder::open(folder) {
            Ok(opened) => {
                let mut sorted: Vec<_> = opened.positions.iter().map(|it| (it.x, it.y)).collect();
                sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
                if sorted.len() > 1 && sorted[0] == sorted[sorted.len() - 1] {
                    self.warning(folder, "", "all images have the same position");
                }
                for note in &opened.notes {
                    self.warning(folder, "", note);
                }
                self.images(folder, &opened.images);
            }
            Err(Error::Format { path, .. }) if is_image(&path) => self.names_below(folder),
            Err(err) => self.failure(folder, err),
        }
    }

    /// Names every image whose name has no position.
    fn names_below(&mut self, folder: &Path) {
        let listing = match images_of(folder) {
            Ok(listing) => listing,
            Err(err) => return self.failure(folder, err),
        };
        for image in listing.images {
            match parse_name(&image) {
                Ok(_) => self.images(folder, &[image]),
                Err(reason) => self.error(&image, "file name", reason),
            }
        }
    }

    /// What lies in a folder, sorted, hidden files apart; a missing or empty one is reported.
    fn entries(&mut self, folder: &Path) -> Vec<PathBuf> {
        let listed = fs::read_dir(folder).and_then(|entries| {
            entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>()
        });
        let mut paths = match listed {
            Ok(paths) => paths,
            Err(cause) => {
                self.error(folder, "", cause.to_string());
                return Vec::new();
            }
        };
        paths.retain(|path| !is_hidden(path));
        paths.sort();
        if paths.is_empty() {
            self.error(folder, "", "is empty");
        }
        paths
    }

    /// Probes every image; sizes that differ from the first are odd, not wrong.
    fn images(&mut self, folder: &Path, images: &[PathBuf]) {
        let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for image in images {
            match (self.probe)(image) {
                Ok((0, _) | (_, 0)) => self.error(image, "", "has no pixels"),
                Ok(size) => *sizes.entry(size).or_default() += 1,
                Err(reason) => self.error(image, "", reason),
            }
        }
        if sizes.len() > 1 {
            let sizes = sizes.iter().map(|((width, height), n)| format!("{n} of {width}×{height}"));
            let reason = format!("images differ in size: {}", sizes.collect::<Vec<_>>().join(", "));
            self.warning(folder, "", reason);
        }
    }

    fn ground_truth(&mut self, path: &Path, n_queries: usize, n_references: usize) {
        let file = match GroundTruthFile::read_for(path, n_queries, n_references) {
            Ok((file, notes)) => {
                for note in notes {
                    self.warning(path, "", note);
                }
                file
            }
            Err(err) => return self.failure(path, err),
        };
        if file.len() != n_queries {
            let reason = format!("{}, but query/ has {n_queries} images", file.len());
            self.error(path, "number of rows", reason);
        }
        let n_new = file.lists.iter().filter(|list| list.as_slice() == [-1]).count();
        if n_new > 0 {
            self.warning(path, "", format!("{n_new} queries are new places ([-1])"));
        }
        for (query, list) in file.lists.iter().enumerate() {
            self.list(path, &format!("query {query}"), list, n_references);
        }
    }

    /// Checks the correct references of one query.
    fn list(&mut self, path: &Path, place: &str, list: &[i64], n_references: usize) {
        if list == [-1] {
            return;
        }
        if list.is_empty() {
            self.warning(path, place, "has no reference; a new place is [-1]");
        }
        for &index in list {
            match usize::try_from(index) {
                Err(_) => {
                    self.error(
                        path,
                        place,
                        format!("{index} is not a reference; a new place is [-1]"),
                    );
                }
                Ok(index) if index >= n_references => {
                    let reason =
                        format!("reference {index} does not exist, of {n_references}; dropped");
                    self.warning(path, place, reason);
                }
                Ok(_) => {}
            }
        }
        if let Some(at) = (1..list.len()).find(|&at| list[at - 1] >= list[at]) {
            let (before, after) = (list[at - 1], list[at]);
            let reason = format!("not ascending without repetition: {before} before {after}");
            self.warning(path, place, reason);
        }
    }
}
