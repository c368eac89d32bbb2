//! The similarity of all queries with all references, in a few thousand squares.

use std::io::{self, Write};

use vpr_core::Similarities;

use super::{Judged, Report, escape, png};

/// Squares per side at most.
const SIDE: usize = 160;

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    let mut is_open = false;
    for (index, dataset) in report.datasets.iter().enumerate() {
        let Some(similarities) = dataset.similarities else { continue };
        let (width, height, levels) = pooled(similarities);
        if width == 0 || height == 0 {
            continue;
        }
        if !is_open {
            writeln!(
                out,
                "<section id=\"matrix\">\n<h2>Similarities</h2>\n<p class=\"notes\">Queries from top to bottom, references from \
                 left to right; light is similar. Right best matches are blue, wrong ones vermilion.</p>"
            )?;
            is_open = true;
        }
        let picture = png::base64(&png::grey(width, height, &levels));
        let (n_queries, n_references) = (dataset.queries.len(), dataset.references.len());
        let name = escape(&dataset.name);
        writeln!(
            out,
            "<figure class=\"map\"><figcaption>{name}</figcaption>\n<svg viewBox=\"0 0 640 480\" role=\"img\" \
             aria-label=\"Similarities of {n_queries} queries and {n_references} references of {name}\">\
             <image width=\"640\" height=\"480\" preserveAspectRatio=\"none\" style=\"image-rendering:pixelated\" \
             href=\"data:image/png;base64,{picture}\"/>"
        )?;
        let run = report.runs.iter().zip(judged).find(|it| it.0.dataset == index);
        for (class, wanted) in [("dot c0 small", true), ("dot c1 small", false)] {
            let Some((run, judged)) = run else { break };
            write!(out, "<path class=\"{class}\" d=\"")?;
            for (query, matches) in run.matches.iter().enumerate() {
                let is_wanted = judged.is_correct(query) == Some(wanted);
                if let (Some(best), true) = (matches.first(), is_wanted) {
                    let x = (best.reference as f64 + 0.5) / n_references as f64 * 640.0;
                    let y = (query as f64 + 0.5) / n_queries as f64 * 480.0;
                    write!(out, "M{x:.1} {y:.1}h0")?;
                }
            }
            writeln!(out, "\"/>")?;
        }
        writeln!(out, "</svg></figure>")?;
    }
    if is_open { writeln!(out, "</section>") } else { Ok(()) }
}

/// The highest similarity of every square, as a grey level: a match is a point, and a mean would
/// hide it.
fn pooled(similarities: &Similarities) -> (usize, usize, Vec<u8>) {
    let all = similarities.view();
    let (n_queries, n_references) = all.dim();
    let (height, width) = (n_queries.min(SIDE), n_references.min(SIDE));
    let mut highest = vec![f64::NEG_INFINITY; width * height];
    for ((query, reference), value) in all.indexed_iter() {
        let square = query * height / n_queries * width + reference * width / n_references;
        highest[square] = highest[square].max(*value);
    }
    let finite = || highest.iter().copied().filter(|it| it.is_finite());
    let (low, high) =
        (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    let level = |value: &f64| {
        let share = if high > low { (value - low) / (high - low) } else { 0.5 };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        let level = (share.clamp(0.0, 1.0) * 255.0) as u8;
        level
    };
    (width, height, highest.iter().map(level).collect())
}
