//! What a study made, and the committed page that it is written to and checked against.

use std::{fs, path::Path};

use vpr_core::{Error, Result};
use vpr_files::replace;

use crate::{
    experiment::Experiment,
    figure::Figure,
    index,
    table::{
        Cell, Checked, Drawings, Finding, Table, check, csv_page, html_page, markdown_page,
        read_csv,
    },
};

/// How far a coordinate of a drawing may be from the committed one, in pixels.
const DRAWING_TOLERANCE: f64 = 1.0;

/// What a study made: numbers, and drawings of them.
#[derive(Clone, Debug)]
pub struct Report {
    /// The numbers.
    pub table: Table,
    /// The drawing, if it is a figure.
    pub figure: Option<Figure>,
    /// The contact sheet, if it has one.
    pub sheet: Option<Sheet>,
}

/// Images in coloured frames, as a PNG file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sheet {
    /// The file.
    pub png: Vec<u8>,
    /// What the colours mean.
    pub legend: &'static str,
}

impl Report {
    /// A table without drawings.
    #[must_use]
    pub fn new(table: Table, figure: Option<Figure>) -> Self {
        Self { table, figure, sheet: None }
    }

    fn svg(&self, figure: &Figure) -> String {
        figure.svg(&format!("{}: {}", self.table.id, self.table.title))
    }

    fn drawings(&self) -> Drawings<'_> {
        let sheet = self.sheet.as_ref().map(|sheet| sheet.legend);
        Drawings { figure: self.figure.is_some(), sheet }
    }

    /// Writes the page, its CSV and its drawings into a folder, and lists it there; each file
    /// appears whole or not at all.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the folder cannot be written.
    pub fn write<S>(&self, experiment: &Experiment<S>, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).map_err(Error::io(folder))?;
        let path = |extension: &str| folder.join(format!("{}.{extension}", self.table.id));
        // The page says what its CSV says, digit by digit, also to whoever checks it.
        replace(&path("csv"), csv_page(&self.table).as_bytes())?;
        let text = markdown_page(&self.table, &experiment.source, self.drawings());
        replace(&path("md"), text.as_bytes())?;
        if let Some(figure) = &self.figure {
            replace(&path("svg"), self.svg(figure).as_bytes())?;
        }
        if let Some(sheet) = &self.sheet {
            replace(&path("png"), &sheet.png)?;
        }
        Ok(replace(&folder.join(index::FILE), index::index(folder)?.as_bytes())?)
    }

    /// Writes what [`Self::write`] does, and the page and the list for a browser too.
    ///
    /// # Errors
    ///
    /// As [`Self::write`].
    pub fn write_site<S>(&self, experiment: &Experiment<S>, folder: &Path) -> Result<()> {
        self.write(experiment, folder)?;
        let text = html_page(&self.table, &experiment.source, self.drawings());
        replace(&folder.join(format!("{}.html", self.table.id)), text.as_bytes())?;
        Ok(replace(&folder.join(index::HTML), index::html(folder)?.as_bytes())?)
    }

    /// Compares with the committed files in a folder and with the expected numbers.
    ///
    /// Besides the cells (see [`check`]), the Markdown page must be the one that its CSV gives; a
    /// figure and a contact sheet must be those that would be written, as far as all their data is
    /// at hand. `without` names methods whose weights are not, as rows and columns call them: their cells
    /// are counted as not at hand.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] or [`Error::Format`] for committed files that are there but cannot be read.
    pub fn check<S>(
        &self,
        experiment: &Experiment<S>,
        folder: &Path,
        without: &[&str],
    ) -> Result<Checked> {
        let path = |extension: &str| folder.join(format!("{}.{extension}", self.table.id));
        let Some(committed) = present(&path("csv"), read_csv)? else {
            let findings = vec![missing(&path("csv"))];
            return Ok(Checked { findings, ..Checked::default() });
        };
        let mut checked = check(&self.table, &committed, &experiment.expect, without);
        self.check_markdown(&mut checked, experiment, committed, &path("md"))?;
        let list = folder.join(index::FILE);
        match present(&list, read_text)? {
            None => checked.findings.push(missing(&list)),
            // A page that is missing was found above.
            Some(_) if !path("md").exists() => {}
            Some(text) if text.contains(&index::line(folder, &self.table.id)?) => {
                checked.n_compared += 1;
            }
            Some(_) => checked.findings.push(stale(&list)),
        }
        if checked.n_not_at_hand > 0 {
            return Ok(checked);
        }
        if let Some(figure) = &self.figure {
            let drawn = self.svg(figure);
            match present(&path("svg"), read_text)? {
                None => checked.findings.push(missing(&path("svg"))),
                Some(page) if is_same_drawing(&page, &drawn) => checked.n_compared += 1,
                Some(_) => checked.findings.push(stale(&path("svg"))),
            }
        }
        if let Some(sheet) = &self.sheet {
            match present(&path("png"), |path| fs::read(path).map_err(Error::io(path)))? {
                None => checked.findings.push(missing(&path("png"))),
                Some(page) if page == sheet.png => checked.n_compared += 1,
                Some(_) => checked.findings.push(stale(&path("png"))),
            }
        }
        Ok(checked)
    }

    /// The page must be what its CSV gives, whatever is at hand now.
    fn check_markdown<S>(
        &self,
        checked: &mut Checked,
        experiment: &Experiment<S>,
        committed: Vec<Cell>,
        path: &Path,
    ) -> Result<()> {
        let Some(page) = present(path, read_text)? else {
            checked.findings.push(missing(path));
            return Ok(());
        };
        // Which notes are footnotes is not written in the CSV.
        let is_quiet =
            |cell: &Cell| self.table.cells.iter().any(|it| it.quiet && it.key() == cell.key());
        let quiet = |cell: Cell| Cell { quiet: is_quiet(&cell), ..cell };
        let cells = committed.into_iter().map(quiet).collect();
        let table = Table { cells, ..self.table.clone() };
        if markdown_page(&table, &experiment.source, self.drawings()) == page {
            checked.n_compared += 1;
        } else {
            checked.findings.push(stale(path));
        }
        Ok(())
    }
}

fn missing(path: &Path) -> Finding {
    Finding::new(format!("{}: no committed page", path.display()))
}

fn stale(path: &Path) -> Finding {
    Finding::new(format!("{}: is not what would be written", path.display()))
}

fn read_text(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(Error::io(path))
}

/// What a file holds; `None` if there is none.
fn present<T>(path: &Path, read: impl FnOnce(&Path) -> Result<T>) -> Result<Option<T>> {
    let is_there = path.try_exists().map_err(Error::io(path))?;
    is_there.then(|| read(path)).transpose()
}

/// Whether two drawings have the same elements at the same places, up to rounding.
fn is_same_drawing(a: &str, b: &str) -> bool {
    let (a, b) = (tokens(a), tokens(b));
    a.len() == b.len()
        && a.iter().zip(&b).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() <= DRAWING_TOLERANCE,
            _ => a == b,
        })
}

/// Numbers, and what stands between them.
fn tokens(text: &str) -> Vec<&str> {
    let is_number = |it: char| it.is_ascii_digit() || matches!(it, '.' | '-');
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let kind = is_number(first);
        let end = rest.find(|it| is_number(it) != kind).unwrap_or(rest.len());
        let (token, after) = rest.split_at(end);
        tokens.push(token);
        rest = after;
    }
    tokens
}

#[cfg(test)]
mod tests {
    use vpr_core::Provenance;

    use super::*;
    use crate::figure::{Curve, Panel};

    fn report(value: f64) -> Report {
        let mut table = Table::new("figure-0", "t");
        table.push(Cell::new("street", "HOG", value, Provenance::Generated, 9).noted("all"));
        let curves = vec![Curve::new("HOG", vec![(0.0, 0.0), (1.0, value)])];
        let figure = Figure { panels: vec![Panel { curves, ..Panel::default() }] };
        let sheet = Sheet { png: vec![1, 2, 3], legend: "Grey: query." };
        Report { table, figure: Some(figure), sheet: Some(sheet) }
    }

    fn findings(report: &Report, folder: &Path) -> Vec<String> {
        let experiment = Experiment::new("figure-0", "t", ());
        let checked = report.check(&experiment, folder, &[]).unwrap();
        checked.findings.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_written_passes_and_every_file_that_differs_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let report = report(0.5);
        assert!(findings(&report, folder.path())[0].contains("no committed page"));
        report.write(&Experiment::new("figure-0", "t", ()), folder.path()).unwrap();
        assert_eq!(findings(&report, folder.path()), [""; 0]);
        for (file, from, to) in [
            ("figure-0.md", "all", "some"),
            ("figure-0.svg", "HOG", "H0G"),
            ("index.md", "figure-0.md", "figure-1.md"),
        ] {
            let path = folder.path().join(file);
            let text = fs::read_to_string(&path).unwrap();
            fs::write(&path, text.replace(from, to)).unwrap();
            let found = findings(&report, folder.path());
            assert!(found.len() == 1 && found[0].contains(file), "{found:?}");
            fs::write(&path, text).unwrap();
        }
        fs::write(folder.path().join("figure-0.png"), [1, 2]).unwrap();
        assert_eq!(findings(&report, folder.path()).len(), 1);
    }

    #[test]
    fn coordinates_may_round_and_shapes_may_not_change() {
        assert!(is_same_drawing("<line x=\"10\" y=\"5\"/>", "<line x=\"11\" y=\"5\"/>"));
        assert!(!is_same_drawing("<line x=\"10\"/>", "<line x=\"13\"/>"));
        assert!(!is_same_drawing("<line x=\"10\"/>", "<rect x=\"10\"/>"));
        assert!(!is_same_drawing("1 2", "1 2 3"));
    }
}
