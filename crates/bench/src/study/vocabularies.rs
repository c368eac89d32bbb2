//! Techniques with a vocabulary that every clone has, beside others and beside the author's files: dense-vlad.

use serde::Deserialize;
use vpr_core::{
    Definition, Error, Provenance, Result,
    metrics::{
        Discordant, McNemar,
        bootstrap::{Resampling, Z_95, wilson_interval},
        effective,
    },
};
use vpr_report::table::{Cell, Table, p_value};
use vpr_study::{Direction, Runner, Subject, Technique};

use super::{Context, best};

/// The N of R@N.
const RANKS: [usize; 2] = [1, 5];

/// What is compared, and on what.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vocabularies {
    /// Techniques by name, the ones with a vocabulary and those beside them.
    pub techniques: Vec<String>,
    /// Datasets, by id.
    pub datasets: Vec<String>,
    /// Techniques whose stored matches stand beside.
    pub stored: Vec<Technique>,
    /// Where a dataset has more pairs of images, `CoHOG`, which compares regions, is left out.
    pub max_cohog_pairs: usize,
}

pub(super) fn run(table: &mut Table, study: &Vocabularies, context: Context<'_>) -> Result<()> {
    let sources = context.sources;
    let runners: Vec<Runner> = study
        .techniques
        .iter()
        .filter_map(|name| sources.runner(name).transpose())
        .collect::<Result<_>>()?;
    for id in &study.datasets {
        let Some(dataset) = sources.images(id)? else {
            let why = sources.why_absent(id, "images")?;
            let name = sources.entry(id)?.name;
            for runner in &runners {
                table.push(Cell::absent(format!("{name}, R@1"), runner.column, &why));
            }
            continue;
        };
        let remark = sources.entry(id)?.note;
        let subject = |runner: &Runner| {
            let scores = sources.scores(runner, &dataset, Direction::AsReleased)?;
            let note = scores.note().map(str::to_owned).or_else(|| remark.clone());
            let (row, truth) = (&dataset.name, dataset.truth.clone().into());
            let subject = Subject::new(row, runner.column, dataset.provenance, scores, truth)?;
            Ok(subject.noted(note))
        };
        let n_pairs = dataset.queries.len() * dataset.references.len();
        let is_left_out = |it: &&Runner| it.name == "cohog" && n_pairs > study.max_cohog_pairs;
        let computed = runners
            .iter()
            .filter(|it| !is_left_out(it))
            .map(subject)
            .collect::<Result<Vec<_>>>()?;
        let stored: Vec<Subject> = sources
            .stored_subjects(id)?
            .into_iter()
            .filter(|it| study.stored.iter().any(|technique| technique.name() == it.column))
            .collect();
        for n in RANKS {
            let row = format!("{}, R@{n}", dataset.name);
            for group in [&computed, &stored] {
                push_recall(table, &row, group, n)?;
            }
        }
        let row = format!("{}, AUC-PR", dataset.name);
        for group in [&computed, &stored] {
            push_areas(table, &row, group, context.seed)?;
        }
        for ours in &computed {
            if let Some(theirs) = stored.iter().find(|it| it.column == ours.column) {
                push_costs(table, theirs, ours, context.seed)?;
            }
        }
    }
    Ok(())
}

fn push_recall(table: &mut Table, row: &str, group: &[Subject], n: usize) -> Result<()> {
    for it in group {
        let hits = best::hits(it, n)?;
        let n_hits = hits.iter().filter(|it| **it).count();
        let share = wilson_interval(n_hits, hits.len(), Z_95)?;
        let cell = it.cell(row, it.column, share.estimate);
        table.push(cell.within(share.low, share.high, "Wilson"));
    }
    best::mark_recall(table, row, group, n)
}

fn push_areas(table: &mut Table, row: &str, group: &[Subject], seed: u64) -> Result<()> {
    for it in group {
        let evaluation = it.evaluation()?;
        for definition in [Definition::Published, Definition::Corrected] {
            let value = evaluation.auc_pr(definition);
            let cell = it.value_cell(row, it.column, definition, value)?;
            table.push(match evaluation.auc_pr_interval(definition) {
                Ok(interval) => cell.within(interval.low, interval.high, effective::METHOD),
                Err(Error::Undefined { .. }) => cell,
                Err(err) => return Err(err),
            });
        }
    }
    best::mark_auc_pr(table, row, group, seed)
}

/// What the author's stored matches have more than ours, on the same queries.
fn push_costs(table: &mut Table, theirs: &Subject, ours: &Subject, seed: u64) -> Result<()> {
    let resampling = Resampling { seed, ..Resampling::default() };
    let cell = |metric: String, value: f64| {
        let row = format!("{}, {metric}: author's matches minus ours", ours.row);
        Cell::new(row, ours.column, value, Provenance::Measured, ours.truth.len())
    };
    for n in RANKS {
        let (first, second) = (best::hits(theirs, n)?, best::hits(ours, n)?);
        let share = |hits: &[bool], queries: &[usize]| {
            Ok(queries.iter().filter(|&&it| hits[it]).count() as f64 / queries.len() as f64)
        };
        let test = vpr_core::metrics::paired_test(
            first.len(),
            &resampling,
            |it| share(&first, it),
            |it| share(&second, it),
        )?;
        let p = Discordant::count(&first, &second)?.p_value(McNemar::MidP);
        let interval = test.interval;
        let cell = cell(format!("R@{n}"), interval.estimate);
        let cell = cell.within(interval.low, interval.high, "paired bootstrap");
        table.push(cell.noted(format!("McNemar's test, mid-p: p {}", p_value(p))));
    }
    let (first, second) = (theirs.evaluation()?, ours.evaluation()?);
    for definition in [Definition::Published, Definition::Corrected] {
        let test = first.auc_pr_test(&second, definition, &resampling)?;
        let interval = test.interval;
        let cell = cell("AUC-PR".to_owned(), interval.estimate).defined(definition);
        let cell = cell.within(interval.low, interval.high, "paired bootstrap");
        table.push(cell.noted(format!("paired bootstrap: p {}", p_value(test.p_value))));
    }
    Ok(())
}
