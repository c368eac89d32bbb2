//! Pairs of dataset and technique for which there are scores, stored or computed here.

use std::sync::Arc;

use vpr_core::{
    BestMatches, Definition, Error, Evaluation, GroundTruth, Judged, Provenance, Result, metrics,
};
use vpr_report::table::{Cell, Table};

use crate::{Direction, Runner, Scores, Sources, Technique, stored::clamped};

/// One technique on one dataset.
#[derive(Clone)]
pub struct Subject {
    /// Name of the dataset.
    pub row: String,
    /// Name of the technique.
    pub column: &'static str,
    /// Where numbers about it come from.
    pub provenance: Provenance,
    /// What the technique finds.
    pub scores: Arc<Scores>,
    /// Which references are correct.
    pub truth: Arc<GroundTruth>,
    /// The best references, judged.
    pub judged: Judged,
    /// What a reader must know.
    pub note: Option<String>,
}

impl Subject {
    /// Judges what a technique found.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if scores and truth are about different numbers of queries or references.
    pub fn new(
        row: &str,
        column: &'static str,
        provenance: Provenance,
        scores: Arc<Scores>,
        truth: Arc<GroundTruth>,
    ) -> Result<Self> {
        if scores.similarities().n_references() != truth.n_references() {
            return Err(Error::Mismatch {
                what: "references that were scored, as the ground truth has",
                expected: truth.n_references(),
                actual: scores.similarities().n_references(),
            });
        }
        let judged = Judged::new(&scores.best().reference, &truth)?;
        let row = row.to_owned();
        Ok(Self { row, column, provenance, scores, truth, judged, note: None })
    }

    /// The same with a remark.
    #[must_use]
    pub fn noted(self, note: Option<String>) -> Self {
        Self { note, ..self }
    }

    /// The same matches in another row and under another truth.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn under(&self, row: &str, truth: GroundTruth) -> Result<Self> {
        let (scores, truth) = (Arc::clone(&self.scores), Arc::new(truth));
        Ok(Self::new(row, self.column, self.provenance, scores, truth)?.noted(self.note.clone()))
    }

    /// The best references and their similarities.
    #[must_use]
    pub fn best(&self) -> &BestMatches {
        self.scores.best()
    }

    /// The best matches in the order of their similarities.
    ///
    /// # Errors
    ///
    /// None for judged scores.
    pub fn evaluation(&self) -> Result<Evaluation<'_>> {
        Evaluation::of_confidence(&self.best().confidence, &self.judged)
    }

    /// [`metrics::recall_at`] for `n` up to [`crate::MAX_RANK`].
    ///
    /// # Errors
    ///
    /// As the metric.
    pub fn recall_at(&self, n: usize) -> Result<f64> {
        metrics::recall_at(n, self.scores.ranking()?, &self.truth)
    }

    /// `Corridor / NetVLAD`, where techniques are rows.
    #[must_use]
    pub fn label(&self) -> String {
        format!("{} / {}", self.row, self.column)
    }

    /// A cell about this subject; `column` and `row` as the table has them.
    #[must_use]
    pub fn cell(&self, row: &str, column: &str, value: f64) -> Cell {
        let cell = Cell::new(row, column, value, self.provenance, self.truth.len());
        match &self.note {
            Some(note) => cell.noted(note),
            None => cell,
        }
    }

    /// A cell with the value of a metric, or without one and why.
    ///
    /// # Errors
    ///
    /// That of the metric, unless it says that there is no value.
    pub fn value_cell(
        &self,
        row: &str,
        column: &str,
        definition: Definition,
        value: Result<f64>,
    ) -> Result<Cell> {
        let cell = match value {
            Ok(value) => self.cell(row, column, value),
            Err(err @ Error::Undefined { .. }) => {
                let cell = self.cell(row, column, 0.0).noted(err.to_string());
                Cell { value: None, ..cell }
            }
            Err(err) => return Err(err),
        };
        Ok(cell.defined(definition))
    }

    /// Pushes a metric under both definitions; a definition without a value becomes a noted cell.
    ///
    /// # Errors
    ///
    /// As [`Self::value_cell`].
    pub fn push_both(
        &self,
        table: &mut Table,
        row: &str,
        column: &str,
        metric: impl Fn(Definition) -> Result<f64>,
    ) -> Result<()> {
        for definition in [Definition::Published, Definition::Corrected] {
            table.push(self.value_cell(row, column, definition, metric(definition))?);
        }
        Ok(())
    }
}

impl Sources<'_> {
    /// All subjects of these datasets; datasets or techniques without data become absent cells.
    ///
    /// # Errors
    ///
    /// Data that is there but malformed.
    pub fn subjects(&self, table: &mut Table, datasets: &[String]) -> Result<Vec<Subject>> {
        let mut subjects = Vec::new();
        for id in datasets {
            let before = subjects.len();
            subjects.extend(self.stored_subjects(id)?);
            subjects.extend(self.computed_subjects(id, Direction::AsReleased)?);
            if subjects.len() == before {
                let row = self.entry(id)?.name;
                self.push_absent(table, id, &row)?;
            }
        }
        Ok(subjects)
    }

    /// A row of cells that say that a dataset is not at hand.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`].
    pub fn push_absent(&self, table: &mut Table, id: &str, row: &str) -> Result<()> {
        let why = self.why_absent(id, "stored matches or images")?;
        for technique in Technique::ALL {
            table.push(Cell::absent(row, technique.name(), &why));
        }
        Ok(())
    }

    /// Techniques whose matches the authors stored.
    ///
    /// # Errors
    ///
    /// Data that is there but malformed.
    pub fn stored_subjects(&self, id: &str) -> Result<Vec<Subject>> {
        let mut subjects = Vec::new();
        for technique in Technique::ALL {
            let Some(stored) = self.stored(id, technique)? else { continue };
            let row = self.entry(id)?.name;
            let (scores, truth) = (Arc::clone(&stored.scores), Arc::clone(&stored.truth));
            let subject = Subject::new(&row, technique.name(), stored.provenance, scores, truth)?;
            subjects.push(subject.noted(stored.note()));
        }
        Ok(subjects)
    }

    /// The techniques that run here, if the images are at hand.
    ///
    /// # Errors
    ///
    /// Data that is there but malformed.
    pub fn computed_subjects(&self, id: &str, direction: Direction) -> Result<Vec<Subject>> {
        let Some(dataset) = self.images(id)? else { return Ok(Vec::new()) };
        let remark = self.entry(id)?.note;
        let truth = Arc::new(match direction {
            Direction::AsReleased => dataset.truth.clone(),
            Direction::Swapped => dataset.truth.swapped(),
        });
        let subject = |runner: &Runner| {
            let scores = self.scores(runner, &dataset, direction)?;
            let note = clamped(dataset.n_clamped)
                .or_else(|| scores.note().map(str::to_owned))
                .or_else(|| remark.clone());
            let (row, provenance) = (&dataset.name, dataset.provenance);
            let truth = Arc::clone(&truth);
            Ok(Subject::new(row, runner.column, provenance, scores, truth)?.noted(note))
        };
        self.runners()?.iter().map(subject).collect()
    }
}
