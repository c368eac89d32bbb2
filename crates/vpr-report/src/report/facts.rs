//! Where the report comes from, and what is in it.

use std::io::{self, Write};

use super::{Report, escape};

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>) -> io::Result<()> {
    writeln!(out, "<section id=\"facts\" aria-label=\"origin\">\n<dl>")?;
    for (name, value) in &report.facts {
        writeln!(out, "<dt>{}</dt><dd>{}</dd>", escape(name), escape(value))?;
    }
    for dataset in &report.datasets {
        let missing = [
            (dataset.truth.is_none(), "truth"),
            (dataset.poses.is_none(), "positions"),
            (dataset.thumbnails.is_none(), "pictures"),
        ];
        let missing: Vec<&str> = missing.iter().filter(|it| it.0).map(|it| it.1).collect();
        let without = if missing.is_empty() {
            String::new()
        } else {
            format!("; without {}", missing.join(", "))
        };
        let (n_queries, n_references) = (dataset.queries.len(), dataset.references.len());
        writeln!(
            out,
            "<dt>{}</dt><dd>{n_queries} queries, {n_references} references{without}</dd>",
            escape(&dataset.name)
        )?;
    }
    writeln!(out, "</dl>\n</section>")
}
