//! The taxonomy of metrics: table 3.3.

use vpr_core::{Provenance, metrics::catalogue::CATALOGUE};
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};

pub(super) fn run(table: &mut Table) -> Option<Figure> {
    for metric in CATALOGUE {
        let yes_no = if metric.false_positives_allowed { "Yes" } else { "No" };
        let functions = match metric.functions {
            [] => "measured by `bench`".to_owned(),
            functions => functions.join(", "),
        };
        let texts = [
            ("Primary Usage", metric.usage_label()),
            ("Output", metric.output.to_string()),
            ("FP Allowed?", yes_no.to_owned()),
            ("Primary Audience", metric.audience.to_string()),
            ("Nature", metric.nature.to_string()),
            ("functions", functions),
        ];
        for (column, text) in texts {
            let mut cell = Cell::new(metric.name, column, text.as_str(), Provenance::Published, 1);
            if !metric.in_thesis {
                cell = cell.noted("not in the thesis; our classification");
            }
            table.push(cell);
        }
    }
    None
}
