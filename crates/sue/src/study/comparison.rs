//! AUC-PR of all estimators: table 5.2.

use std::collections::BTreeMap;

use vpr_core::{Definition, Error, Evaluation, Provenance, best_by_auc_pr};
use vpr_report::table::{Cell, Table, Value};

use vpr_study::verification::LocalMethod;

use super::{
    Context,
    subject::{EFFICIENT, Labelled, Scored, Subject, open},
    timing,
};
use crate::{Result, corpus::COUNTERPARTS};

/// An estimator is called the best of a row at corrected p-values of at most this.
const LEVEL: f64 = 0.05;
/// Column of the share of correct best matches.
const BASE_RATE: &str = "base rate";
/// The estimator that others are compared with.
const REFERENCE: &str = "SUE";
/// Row of times, as thesis table 5.2 has a column.
const TIME: &str = "Time, ms per query";
/// Footnote of a value that chance explains.
const WITHIN_CHANCE: &str =
    "not significantly different from SUE (paired bootstrap over queries, 95 %)";

pub(super) fn run(table: &mut Table, subjects: &[Subject], context: Context<'_>) -> Result<()> {
    let all = open(table, subjects, REFERENCE, context)?;
    for (opened, verify) in &all {
        let scored = opened.score_all(verify, context)?;
        let base = opened.cell(&opened.row, BASE_RATE, opened.corpus.judged.base_rate());
        for definition in [Definition::Published, Definition::Corrected] {
            table.push(base.clone().defined(definition));
        }
        for it in &scored {
            let chance = is_within_chance(opened, &scored, it, context)?;
            let remark = it.remark().or_else(|| chance.then(|| WITHIN_CHANCE.to_owned()));
            let place = (opened.row.as_str(), it.name);
            opened.push_auc(table, place, it, remark.as_deref())?;
        }
        mark_best(table, opened, &scored, context)?;
    }
    average(table);
    if context.timings {
        times(table, &all, context)?;
    }
    Ok(())
}

/// Whether the difference of AUC-PR to SUE has an interval with 0 in it.
fn is_within_chance(
    opened: &Labelled,
    scored: &[Scored],
    it: &Scored,
    context: Context<'_>,
) -> Result<bool> {
    let reference = scored.iter().find(|it| it.name == REFERENCE);
    let (Some(Scored { uncertainty: Ok(first), .. }), Ok(second)) = (reference, &it.uncertainty)
    else {
        return Ok(false);
    };
    // Matches of other descriptors cannot be paired.
    if it.name == REFERENCE || it.own.is_some() {
        return Ok(false);
    }
    let judged = &opened.corpus.judged;
    let (first, second) = (Evaluation::new(first, judged)?, Evaluation::new(second, judged)?);
    match second.auc_pr_difference(&first, &context.resampling()) {
        Ok(interval) => Ok(interval.low <= 0.0 && interval.high >= 0.0),
        Err(Error::Undefined { .. }) => Ok(false),
        Err(err) => Err(err.into()),
    }
}

/// Marks what the paired bootstrap tells from every other estimator of the row.
fn mark_best(
    table: &mut Table,
    opened: &Labelled,
    scored: &[Scored],
    context: Context<'_>,
) -> Result<()> {
    // A generated row is the same with all weights and without: what needs some does not contend.
    let needs_weights = |name: &str| {
        LocalMethod::ALL.iter().any(|it| it.name() == name && it.features().is_learned())
    };
    let contends = |it: &&Scored| opened.is_real() || !needs_weights(it.name);
    for definition in [Definition::Published, Definition::Corrected] {
        let (mut names, mut evaluations) = (Vec::new(), Vec::new());
        for it in scored.iter().filter(contends) {
            let Ok(uncertainty) = &it.uncertainty else { continue };
            let evaluation = Evaluation::new(uncertainty, it.judged(opened))?;
            match evaluation.auc_pr(definition) {
                Ok(_) => {
                    names.push(it.name);
                    evaluations.push(evaluation);
                }
                Err(Error::Undefined { .. }) => {}
                Err(err) => return Err(err.into()),
            }
        }
        let best = best_by_auc_pr(&evaluations, definition, &context.resampling(), LEVEL)?;
        let Some(best) = best.map(|it| names[it]) else { continue };
        let definition = definition.to_string();
        let is_it = |cell: &&mut Cell| {
            cell.row == opened.row
                && cell.column == best
                && cell.definition.as_ref() == Some(&definition)
        };
        table.cells.iter_mut().filter(is_it).for_each(|cell| cell.best = true);
    }
    Ok(())
}

/// The mean over the six counterparts of every method that has a value on all of them.
fn average(table: &mut Table) {
    let mut sums: BTreeMap<(String, Option<String>), (usize, f64, usize)> = BTreeMap::new();
    for cell in &table.cells {
        let is_counterpart = COUNTERPARTS.iter().any(|it| it.name == cell.row);
        if let (true, Some(Value::Number(value))) = (is_counterpart, &cell.value) {
            let key = (cell.column.clone(), cell.definition.clone());
            let entry = sums.entry(key).or_default();
            *entry = (entry.0 + 1, entry.1 + value, entry.2 + cell.n);
        }
    }
    let columns: Vec<String> = table.cells.iter().map(|cell| cell.column.clone()).collect();
    let place = |column: &str| columns.iter().position(|it| it == column);
    let mut entries: Vec<_> = sums.into_iter().collect();
    entries.sort_by_key(|((column, definition), _)| {
        (place(column), definition.clone() != Some("published".to_owned()))
    });
    for ((column, definition), (count, sum, n)) in entries {
        if count == COUNTERPARTS.len() {
            let mean = sum / count as f64;
            let cell = Cell::new("Average", column, mean, Provenance::Generated, n);
            table.push(Cell { definition, ..cell });
        }
    }
}

/// One row of times, all from the first corpus with images.
fn times(
    table: &mut Table,
    all: &[(Labelled, Vec<LocalMethod>)],
    context: Context<'_>,
) -> Result<()> {
    let Some((opened, verify)) =
        all.iter().find(|it| it.0.corpus.images.is_some() && !it.1.is_empty()).or(all.first())
    else {
        return Ok(());
    };
    let note = format!("on {}, one thread", opened.row);
    let mut push = |column: &str, value: f64| {
        table.push(opened.cell(TIME, column, value).noted(&note).timing());
    };
    for (choice, scored) in EFFICIENT.iter().zip(opened.score(&EFFICIENT)?) {
        if scored.uncertainty.is_ok() {
            push(scored.name, timing::efficient(opened, *choice)?);
        }
    }
    for (learned, corpus) in &opened.learned {
        if let Ok(corpus) = corpus {
            push(learned.name(), timing::predicted(corpus, *learned)?);
        }
    }
    for &method in verify {
        if let Ok(verifier) = method.open(context.corpora.sources().roots())?
            && let Some(value) = timing::verification(opened, &verifier)?
        {
            push(method.name(), value);
        }
    }
    Ok(())
}
