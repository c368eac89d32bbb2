//! How the numbers of `bench evaluate` are printed: the line of the field, or a table with
//! intervals.

use clap::ValueEnum;
use vpr_core::{
    Definition, Evaluation, GroundTruth, Judged, Provenance, Ranking,
    metrics::{
        bootstrap::{Interval, Z_95, wilson_interval},
        effective, recall_at,
    },
};
use vpr_report::table::{Cell, Format, Table};

use super::retrieved::Retrieved;

/// Formats of the numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum OutputFormat {
    /// `R@1: 66.7, R@5: 66.7`, as VPR-methods-evaluation prints
    #[default]
    Line,
    /// That line, and a table with intervals
    Table,
    /// One number per line, all digits, with intervals
    Csv,
    /// The same as JSON
    Json,
}

/// `R@1: 98.8, R@5: 99.7, …`
pub(super) fn line(
    recall_values: &[usize],
    ranking: &Ranking,
    truth: &GroundTruth,
) -> vpr_core::Result<String> {
    let entries = recall_values.iter().map(|&n| {
        let recall = recall_at(n, ranking, truth)?;
        Ok(format!("R@{n}: {:.1}", 100.0 * recall))
    });
    Ok(entries.collect::<vpr_core::Result<Vec<String>>>()?.join(", "))
}

/// AUC-PR in both definitions.
pub(super) fn auc_pr_line(retrieved: &Retrieved, truth: &GroundTruth) -> vpr_core::Result<String> {
    let judged = Judged::new(&retrieved.ranking.best(), truth)?;
    let evaluation = Evaluation::of_confidence(&retrieved.confidence, &judged)?;
    let [published, corrected] =
        [evaluation.auc_pr(Definition::Published)?, evaluation.auc_pr(Definition::Corrected)?];
    Ok(format!("AUC-PR: {published:.3} (published), {corrected:.3} (corrected)"))
}

/// All numbers with 95 % intervals over the choice of queries.
pub(super) fn table(
    recall_values: &[usize],
    auc_pr: bool,
    provenance: Provenance,
    retrieved: &Retrieved,
    truth: &GroundTruth,
) -> vpr_core::Result<Table> {
    let n = truth.len();
    let title = format!(
        "{n} queries, {} references; {} queries have a correct one",
        truth.n_references(),
        truth.n_known()
    );
    let mut numbers = Numbers { table: Table::new("evaluation", title), n, provenance };
    let alone = retrieved.alone.as_ref();
    let rankings = [("", Some(&retrieved.ranking)), (" (images one by one)", alone)];
    for (suffix, ranking) in rankings {
        let Some(ranking) = ranking else { continue };
        for &rank in recall_values {
            let interval = wilson_interval(n_found(rank, ranking, truth), n, Z_95)?;
            numbers.push(&format!("R@{rank}{suffix}"), None, interval, "Wilson");
        }
    }
    if auc_pr {
        let judged = Judged::new(&retrieved.ranking.best(), truth)?;
        let evaluation = Evaluation::of_confidence(&retrieved.confidence, &judged)?;
        for definition in [Definition::Published, Definition::Corrected] {
            let interval = evaluation.auc_pr_interval(definition);
            match interval {
                Ok(interval) => {
                    numbers.push("AUC-PR", Some(definition), interval, effective::METHOD);
                }
                Err(err @ vpr_core::Error::Undefined { .. }) => {
                    let area = evaluation.auc_pr(definition)?;
                    let cell = numbers.cell("AUC-PR", "value", Some(definition), area);
                    numbers.table.push(cell.noted(err.to_string()));
                }
                Err(err) => return Err(err),
            }
        }
    }
    Ok(numbers.table)
}

/// A table under construction.
struct Numbers {
    table: Table,
    n: usize,
    provenance: Provenance,
}

impl Numbers {
    fn cell(&self, row: &str, column: &str, definition: Option<Definition>, value: f64) -> Cell {
        let cell = Cell::new(row, column, value, self.provenance, self.n);
        match definition {
            Some(definition) => cell.defined(definition),
            None => cell,
        }
    }

    fn push(&mut self, row: &str, definition: Option<Definition>, it: Interval, method: &str) {
        let value = self.cell(row, "value", definition, it.estimate);
        self.table.push(value.within(it.low, it.high, method));
    }
}

/// How many queries have a correct reference among the first `rank`.
fn n_found(rank: usize, ranking: &Ranking, truth: &GroundTruth) -> usize {
    let is_found = |&query: &usize| {
        ranking.indices(query).iter().take(rank).any(|&it| truth.is_correct(query, it))
    };
    (0..truth.len()).filter(is_found).count()
}

/// The format of tables that this is.
pub(super) fn format_of(format: OutputFormat) -> Format {
    match format {
        OutputFormat::Line | OutputFormat::Table => Format::Table,
        OutputFormat::Csv => Format::Csv,
        OutputFormat::Json => Format::Json,
    }
}
