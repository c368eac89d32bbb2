//! Which technique of a row is set bold: what a paired test tells from every other.

use vpr_core::{
    Definition, Error, Result, best_by_auc_pr, best_by_hits,
    metrics::{McNemar, bootstrap::Resampling},
};
use vpr_report::table::{Cell, Table};
use vpr_study::Subject;

/// Corrected p-values of at most this decide.
const LEVEL: f64 = 0.05;

/// Marks the best AUC-PR of subjects that are one dataset's, each definition by its own test.
pub(super) fn mark_auc_pr(
    table: &mut Table,
    row: &str,
    group: &[Subject],
    seed: u64,
) -> Result<()> {
    let resampling = Resampling { seed, ..Resampling::default() };
    for definition in [Definition::Published, Definition::Corrected] {
        let mut defined = Vec::new();
        for subject in group {
            let evaluation = subject.evaluation()?;
            match evaluation.auc_pr(definition) {
                Ok(_) => defined.push((subject, evaluation)),
                Err(Error::Undefined { .. }) => {}
                Err(err) => return Err(err),
            }
        }
        let (subjects, evaluations): (Vec<_>, Vec<_>) = defined.into_iter().unzip();
        let best = best_by_auc_pr(&evaluations, definition, &resampling, LEVEL)?;
        if let Some(best) = best {
            mark(table, row, subjects[best], Some(&definition.to_string()));
        }
    }
    Ok(())
}

/// Marks the best R@N of subjects that are one dataset's.
pub(super) fn mark_recall(table: &mut Table, row: &str, group: &[Subject], n: usize) -> Result<()> {
    let hits = group.iter().map(|it| hits(it, n)).collect::<Result<Vec<_>>>()?;
    if let Some(best) = best_by_hits(&hits, McNemar::MidP, LEVEL)? {
        mark(table, row, &group[best], None);
    }
    Ok(())
}

/// Whether each query has a correct reference among the first `n`.
pub(super) fn hits(subject: &Subject, n: usize) -> Result<Vec<bool>> {
    let ranking = subject.scores.ranking()?;
    let is_hit = |query: usize| {
        ranking.indices(query).iter().take(n).any(|&it| subject.truth.is_correct(query, it))
    };
    Ok((0..subject.truth.len()).map(is_hit).collect())
}

fn mark(table: &mut Table, row: &str, subject: &Subject, definition: Option<&str>) {
    let is_it = |cell: &&mut Cell| {
        cell.row == row
            && cell.column == subject.column
            && cell.provenance == subject.provenance
            && cell.definition.as_deref() == definition
    };
    table.cells.iter_mut().filter(is_it).for_each(|cell| cell.best = true);
}
