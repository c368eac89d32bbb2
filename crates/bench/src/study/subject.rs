//! Pairs of dataset and technique for which there are scores, stored or computed here.

use std::sync::Arc;

use vpr_core::{
    BestMatches, Definition, Error, GroundTruth, Result, Similarities,
    dataset::Dataset,
    table::{Cell, Provenance, Table},
};
use vpr_vision::{cohog::CoHogParams, hog::HogParams};

use super::Context;
use crate::{
    data::Scores,
    evaluate::Evaluation,
    technique::{Describe, HandCrafted, Technique},
};

/// Column of HOG in the thesis' own configuration, which is not the released one (VB-11).
pub(super) const HOG_THESIS: &str = "HOG, thesis configuration";

/// One technique on one dataset.
pub(super) struct Subject {
    /// Name of the dataset.
    pub(super) row: String,
    /// Name of the technique.
    pub(super) column: &'static str,
    pub(super) provenance: Provenance,
    pub(super) similarities: Similarities,
    pub(super) best: BestMatches,
    pub(super) truth: GroundTruth,
    pub(super) note: Option<String>,
}

impl Subject {
    pub(super) fn evaluation(&self) -> Result<Evaluation<'_>> {
        Evaluation::of_matches(self.best.clone(), &self.similarities, &self.truth)
    }

    /// `Corridor / NetVLAD`, where techniques are rows.
    pub(super) fn label(&self) -> String {
        format!("{} / {}", self.row, self.column)
    }

    /// A cell about this subject; `column` and `row` as the table has them.
    pub(super) fn cell(&self, row: &str, column: &str, value: f64) -> Cell {
        let cell = Cell::new(row, column, value, self.provenance, self.truth.len());
        match &self.note {
            Some(note) => cell.noted(note),
            None => cell,
        }
    }
}

/// A technique that runs here, and its column.
pub(super) type Runner = (&'static str, Box<dyn Describe>);

/// The techniques run here on every image dataset; the one place that says which.
pub(super) fn runners(context: Context<'_>) -> Result<Vec<Runner>> {
    let mut runners: Vec<Runner> = vec![
        ("HOG", Box::new(HandCrafted::Hog(HogParams::RELEASED))),
        (HOG_THESIS, Box::new(HandCrafted::Hog(HogParams::THESIS))),
        ("CoHOG", Box::new(HandCrafted::CoHog(CoHogParams::default()))),
    ];
    for (column, network) in context.data.networks()? {
        runners.push((column, Box::new(network)));
    }
    Ok(runners)
}

/// All subjects of these datasets; datasets or techniques without data become absent cells.
pub(super) fn subjects(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Vec<Subject>> {
    let mut subjects = Vec::new();
    for id in datasets {
        let before = subjects.len();
        subjects.extend(stored(id, context)?);
        subjects.extend(computed(id, false, context)?);
        if subjects.len() == before {
            let why = context.data.why_absent(id, "stored matches or images")?;
            let row = &context.data.entry(id)?.name;
            for technique in Technique::ALL {
                table.push(Cell::absent(row, technique.name(), &why));
            }
        }
    }
    Ok(subjects)
}

/// Techniques whose matches the authors stored.
pub(super) fn stored(id: &str, context: Context<'_>) -> Result<Vec<Subject>> {
    let mut subjects = Vec::new();
    for technique in Technique::ALL {
        let Some(stored) = context.data.stored(id, technique)? else { continue };
        let note = clamped(stored.n_clamped);
        subjects.push(Subject {
            row: context.data.entry(id)?.name.clone(),
            column: technique.name(),
            provenance: Provenance::Published,
            similarities: stored.similarities,
            best: stored.best,
            truth: stored.truth,
            note,
        });
    }
    Ok(subjects)
}

/// What to say of a ground truth that points past the references (VB-15).
fn clamped(n: usize) -> Option<String> {
    (n > 0).then(|| {
        format!("{n} entries of the ground truth point past the references and are dropped")
    })
}

/// The techniques that run here, if the images are at hand; both sides exchanged if `swapped`.
pub(super) fn computed(id: &str, swapped: bool, context: Context<'_>) -> Result<Vec<Subject>> {
    let Some(dataset) = context.images(id)? else { return Ok(Vec::new()) };
    let remark = context.data.entry(id)?.note;
    let truth = if swapped { dataset.truth.swapped() } else { dataset.truth.clone() };
    let subject = |(column, technique): Runner| {
        let scores = match_images(technique.as_ref(), column, &dataset, swapped, context)?;
        let note = clamped(dataset.n_clamped).or(scores.note.clone()).or_else(|| remark.clone());
        Ok(Subject {
            row: dataset.name.clone(),
            column,
            provenance: dataset.provenance,
            best: scores.similarities.best(),
            similarities: scores.similarities.clone(),
            truth: truth.clone(),
            note,
        })
    };
    runners(context)?.into_iter().map(subject).collect()
}

/// Scores of one technique on the images of a dataset, queries and references exchanged if
/// `swapped`; computed once per process.
pub(super) fn match_images(
    technique: &dyn Describe,
    column: &str,
    dataset: &Dataset,
    swapped: bool,
    context: Context<'_>,
) -> Result<Arc<Scores>> {
    let (queries, references) = if swapped {
        (&dataset.references, &dataset.queries)
    } else {
        (&dataset.queries, &dataset.references)
    };
    // Two names may mean one world; its folder is named by what it was rendered from.
    let images = queries.first().map_or_else(String::new, |path| path.display().to_string());
    context.data.scores((images, technique.key(), swapped), || {
        let n_images = queries.len() + references.len();
        context.observer.start(&format!("{column} on {}", dataset.name), n_images);
        let step = || context.observer.step();
        let queries = technique.encode(queries, &step)?;
        let references = technique.encode(references, &step)?;
        context.observer.end();
        let matched = queries.match_with(&references)?;
        let note = (matched.n_fallbacks > 0).then(|| {
            let n = matched.n_fallbacks;
            format!("in {n} queries no region passes the entropy threshold: all are used (VB-12)")
        });
        Ok(Scores { similarities: matched.similarities, note })
    })
}

/// Pushes a metric under both definitions; a definition without a value becomes a noted cell.
pub(super) fn push_both(
    table: &mut Table,
    subject: &Subject,
    row: &str,
    column: &str,
    metric: impl Fn(Definition) -> Result<f64>,
) -> Result<()> {
    for definition in [Definition::Published, Definition::Corrected] {
        table.push(value_cell(subject, row, column, definition, metric(definition))?);
    }
    Ok(())
}

/// A cell with the value of a metric, or without one and why.
pub(super) fn value_cell(
    subject: &Subject,
    row: &str,
    column: &str,
    definition: Definition,
    value: Result<f64>,
) -> Result<Cell> {
    let cell = match value {
        Ok(value) => subject.cell(row, column, value),
        Err(err @ Error::Undefined { .. }) => {
            let cell = subject.cell(row, column, 0.0).noted(err.to_string());
            Cell { value: None, ..cell }
        }
        Err(err) => return Err(err),
    };
    Ok(cell.defined(definition))
}
