//! All metrics of all estimators.

use vpr_report::table::{Cell, Table};

use super::{
    Context,
    subject::{Subject, open},
};
use crate::Result;
use vpr_core::Evaluation;

pub(super) fn run(table: &mut Table, subjects: &[Subject], context: Context<'_>) -> Result<()> {
    for (opened, verify) in open(table, subjects, "AUC-ROC", context)? {
        for scored in opened.score_all(&verify, context)? {
            let Ok(uncertainty) = &scored.uncertainty else { continue };
            let summary = Evaluation::new(uncertainty, scored.judged(&opened))?.summary()?;
            let row = format!("{}: {}", opened.row, scored.name);
            let values = [
                ("base rate", Some(summary.base_rate)),
                ("AUC-PR, published", summary.auc_pr_published),
                ("AUC-PR, corrected", summary.auc_pr_corrected),
                ("AUC-ROC", summary.auc_roc),
                ("AURC", Some(summary.aurc)),
                ("excess AURC", Some(summary.excess_aurc)),
                ("R@95%P", summary.recall_at_95_precision),
            ];
            for (column, value) in values {
                let cell = opened.cell(&row, column, 0.0);
                let remarked = |cell: Cell| match scored.remark() {
                    Some(remark) => cell.noted(remark),
                    None => cell,
                };
                table.push(match value {
                    Some(value) => remarked(Cell { value: Some(value.into()), ..cell }),
                    None => {
                        Cell { value: None, ..cell.noted("undefined: all or no match is correct") }
                    }
                });
            }
        }
    }
    Ok(())
}
