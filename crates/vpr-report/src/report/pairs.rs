//! Wins and losses per query between two runs on the same dataset.

use std::io::{self, Write};

use vpr_core::metrics::{Discordant, McNemar};

use super::{Judged, Report, escape};
use crate::table::p_value;

/// Pairs listed.
const MOST: usize = 15;

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    let pairs: Vec<(usize, usize)> = (0..judged.len())
        .flat_map(|first| (first + 1..judged.len()).map(move |second| (first, second)))
        .filter(|&(a, b)| report.runs[a].dataset == report.runs[b].dataset)
        // Runs that differ in their uncertainties only find the same references.
        .filter(|&(a, b)| judged[a].correct.is_some() && judged[a].correct != judged[b].correct)
        .take(MOST)
        .collect();
    if pairs.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "<section id=\"pairs\">\n<h2>Query by query</h2>\n<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"wins and losses\">\n<table>\n<thead><tr>\
         <th scope=\"col\">first</th><th scope=\"col\">second</th><th scope=\"col\">both right</th>\
         <th scope=\"col\">only first</th><th scope=\"col\">only second</th><th scope=\"col\">both wrong</th>\
         <th scope=\"col\">chance of so uneven a split</th></tr></thead>\n<tbody>"
    )?;
    for (a, b) in pairs {
        let (Some(first), Some(second)) = (&judged[a].correct, &judged[b].correct) else {
            continue;
        };
        let count = |wanted: (bool, bool)| {
            first.iter().zip(second).filter(|it| (*it.0, *it.1) == wanted).count()
        };
        let (wins, losses) = (count((true, false)), count((false, true)));
        let p = Discordant { n_queries: first.len(), first: wins, second: losses }
            .p_value(McNemar::Exact);
        let p = escape(p_value(p).trim_start_matches("= "));
        writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{wins}</td><td>{losses}</td><td>{}</td><td>{p}</td></tr>",
            escape(&report.runs[a].name),
            escape(&report.runs[b].name),
            count((true, true)),
            count((false, false)),
        )?;
    }
    writeln!(
        out,
        "</tbody>\n</table>\n</div>\n<p class=\"notes\">The chance (McNemar's exact test, two-sided) is that of a split at \
         least as uneven if both were equally good; below 0.05 the difference is more than luck of the \
         queries.</p>\n</section>"
    )
}
