//! A report to look at: one HTML file that needs nothing but a browser.
//!
//! It reads without JavaScript; with it, filters drive map, curves and gallery together. Pictures
//! are thumbnails within a budget of bytes. Everything is written as it is made, so that a large
//! report needs little memory.

mod chart;
mod curves;
mod data;
mod facts;
mod gallery;
mod json;
mod map;
mod matrix;
mod outcome;
mod pairs;
mod png;
mod scores;
mod summary;
mod thumbnails;

#[cfg(test)]
mod tests;

use std::io::{self, Write};

use vpr_core::{GroundTruth, Poses, Similarities};

use crate::figure::{COLOURS, DARK_COLOURS, escape};
use outcome::Judged;

/// Bytes that a report takes at most where nothing else is asked for.
pub const BUDGET: usize = 10_000_000;

/// One of the two sides of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// What is asked.
    Query,
    /// What is in the map.
    Reference,
}

/// Thumbnails of images, in order: a JPEG or PNG file no larger than the given side in pixels, or
/// why there is none. Called with a few dozen images at a time, so that it can work in parallel.
pub type Thumbnails<'a> = dyn Fn(&[(Side, usize)], u32) -> Vec<Result<Vec<u8>, String>> + 'a;

/// A dataset as runs see it.
pub struct Dataset<'a> {
    /// Its name.
    pub name: String,
    /// Names of the queries.
    pub queries: Vec<String>,
    /// Names of the references.
    pub references: Vec<String>,
    /// Poses of queries and of references, if known.
    pub poses: Option<(&'a Poses, &'a Poses)>,
    /// Which references are correct, if known.
    pub truth: Option<&'a GroundTruth>,
    /// Where pictures come from, if there are any.
    pub thumbnails: Option<&'a Thumbnails<'a>>,
    /// Similarities of all queries with all references, for a picture of the matrix.
    pub similarities: Option<&'a Similarities>,
}

/// A retrieved reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index of the reference.
    pub reference: usize,
    /// Distance of the descriptors, lower is nearer; a negative similarity for techniques without
    /// one. NaN is shown as such.
    pub distance: f64,
    /// Inliers of geometric verification, if it was done.
    pub inliers: Option<usize>,
}

/// What one method found on one dataset.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// The method, as tables call it.
    pub name: String,
    /// Index into the datasets of the report.
    pub dataset: usize,
    /// Retrieved references of every query, nearest first.
    pub matches: Vec<Vec<Match>>,
    /// How uncertain the best match of each query is; the distance of the best match if left out.
    pub uncertainty: Option<Vec<f64>>,
    /// What the uncertainty is called.
    pub estimator: Option<String>,
    /// Matches of at most this uncertainty are accepted; those of the more certain half if left
    /// out.
    pub threshold: Option<f64>,
}

/// A report.
pub struct Report<'a> {
    /// Its title.
    pub title: String,
    /// What a reader must know, by name: origin, protocol, command line, version.
    pub facts: Vec<(String, String)>,
    /// The datasets.
    pub datasets: Vec<Dataset<'a>>,
    /// The runs, side by side.
    pub runs: Vec<Run>,
    /// Bytes that the file takes at most, as far as thumbnails decide it; `None` keeps all.
    pub budget: Option<usize>,
}

impl Report<'_> {
    /// Writes the report as one HTML file.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::InvalidInput`] for runs that do not fit their dataset, with what does not;
    /// otherwise what the writer reports.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        self.check().map_err(|reason| io::Error::new(io::ErrorKind::InvalidInput, reason))?;
        let judged: Vec<Judged> = self.runs.iter().map(|run| Judged::new(self, run)).collect();
        let mut out = Counted { out, n: 0 };
        head(&mut out, &self.title)?;
        facts::write(&mut out, self)?;
        summary::write(&mut out, self, &judged)?;
        pairs::write(&mut out, self, &judged)?;
        out.write_all(FILTERS.as_bytes())?;
        curves::write(&mut out, self, &judged)?;
        scores::write(&mut out, self, &judged)?;
        matrix::write(&mut out, self, &judged)?;
        // What is high and narrow leaves room for the gallery at its side.
        let is_high = self.datasets.iter().flat_map(map::views).any(|it| it.is_high());
        writeln!(out, "<div class=\"places{}\">", if is_high { " beside" } else { "" })?;
        map::write(&mut out, self, &judged)?;
        data::write(&mut out, self, &judged)?;
        let reserved = out.n + SCRIPT.len() + gallery::RESERVED;
        let left = self.budget.map(|budget| budget.saturating_sub(reserved));
        let pictures = thumbnails::write(&mut out, self, &judged, left)?;
        gallery::write(&mut out, self, &judged, &pictures)?;
        writeln!(out, "</div>\n</main>\n<script>{SCRIPT}</script>\n</body>\n</html>")
    }

    fn check(&self) -> Result<(), String> {
        for run in &self.runs {
            let name = &run.name;
            let Some(dataset) = self.datasets.get(run.dataset) else {
                return Err(format!("{name}: there is no dataset {}", run.dataset));
            };
            let n = dataset.queries.len();
            let expect = |what: &str, actual: usize, expected: usize| {
                if actual == expected {
                    return Ok(());
                }
                Err(format!("{name} on {}: {actual} {what} for {expected}", dataset.name))
            };
            expect("lists of matches", run.matches.len(), n)?;
            if let Some(uncertainty) = &run.uncertainty {
                expect("uncertainties", uncertainty.len(), n)?;
            }
            if let Some(truth) = dataset.truth {
                expect("queries of the truth", truth.len(), n)?;
                expect("references of the truth", truth.n_references(), dataset.references.len())?;
            }
            if let Some((queries, references)) = dataset.poses {
                expect("poses of queries", queries.len(), n)?;
                expect("poses of references", references.len(), dataset.references.len())?;
            }
            let all = run.matches.iter().flatten();
            if let Some(it) = all.into_iter().find(|it| it.reference >= dataset.references.len()) {
                let n = dataset.references.len();
                return Err(format!("{name}: a match with reference {} of {n}", it.reference));
            }
        }
        Ok(())
    }
}

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");
const FILTERS: &str = include_str!("filters.html");

/// Everything before the content; colours in light and dark.
fn head(out: &mut dyn Write, title: &str) -> io::Result<()> {
    let variables = |colours: [&str; 8]| -> String {
        let all = colours.iter().enumerate();
        all.map(|(index, colour)| format!("--c{index}:{colour};")).collect::<Vec<_>>().concat()
    };
    let classes = (0..8).map(|it| format!(".c{it}{{color:var(--c{it})}}"));
    let classes = classes.collect::<Vec<_>>().concat();
    write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
         script-src 'unsafe-inline'; img-src data:\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n\
         <style>:root{{{light}}}@media (prefers-color-scheme:dark){{:root{{{dark}}}}}\
         @media print{{:root{{{light}}}}}{classes}\n{STYLE}</style>\n</head>\n<body>\n\
         <header><h1>{title}</h1></header>\n<main>\n",
        title = escape(title),
        light = variables(COLOURS),
        dark = variables(DARK_COLOURS),
    )
}

/// A writer that knows how many bytes went through.
struct Counted<'a> {
    out: &'a mut dyn Write,
    n: usize,
}

impl Write for Counted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.out.write(bytes)?;
        self.n += n;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// A number in a text: few digits, never an exponent that no one asked for.
fn short(value: f64) -> String {
    match value.abs() {
        _ if value.is_nan() => "not a number".to_owned(),
        _ if value.is_infinite() => "infinite".to_owned(),
        size if size >= 1000.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 0.001 || size == 0.0 => format!("{value:.3}"),
        _ => format!("{value:.1e}"),
    }
}

/// At most `n` letters of a text.
fn clipped(text: &str, n: usize) -> String {
    if text.chars().count() <= n {
        return text.to_owned();
    }
    text.chars().take(n.saturating_sub(1)).chain(['…']).collect()
}
