//! Queries with what was found for them: the most telling ones without a script, all with it.

use std::io::{self, Write};

use super::{
    Judged, Report, Side, clipped,
    data::SHOWN,
    escape,
    outcome::label,
    short,
    thumbnails::{Picture, Pictures, by_interest, class},
};

/// Bytes kept for the cards.
pub(super) const RESERVED: usize = 120_000;
/// Cards of every run in the file itself.
const CARDS: usize = 12;
/// Cards of all runs.
const MOST: usize = 36;

pub(super) fn write(
    out: &mut dyn Write,
    report: &Report<'_>,
    judged: &[Judged],
    pictures: &Pictures,
) -> io::Result<()> {
    writeln!(
        out,
        "<section id=\"gallery\">\n<h2>Gallery</h2>\n<p class=\"notes\" id=\"shown\">The most certain of the wrong matches, the \
         least certain of the right ones, and some of the others.</p>\n<div id=\"cards\" class=\"cards\">"
    )?;
    let each = (MOST / report.runs.len().max(1)).clamp(2, CARDS);
    for (index, judged) in judged.iter().enumerate() {
        for query in by_interest(judged).into_iter().take(each) {
            card(out, report, (index, judged), query, pictures)?;
        }
    }
    writeln!(
        out,
        "</div>\n<p class=\"script\"><button type=\"button\" id=\"more\" hidden>more</button></p>\n</section>"
    )
}

fn card(
    out: &mut dyn Write,
    report: &Report<'_>,
    (run, judged): (usize, &Judged),
    query: usize,
    pictures: &Pictures,
) -> io::Result<()> {
    let run = &report.runs[run];
    let (of, dataset) = (run.dataset, &report.datasets[run.dataset]);
    let truth = dataset.truth;
    let mark = match judged.is_correct(query) {
        Some(true) => "✓ right",
        Some(false) => "✗ wrong",
        None => "not judged",
    };
    let (verdict, sign) =
        if judged.accepts(query) { ("accepted", "≤") } else { ("rejected", "&gt;") };
    let uncertainty = judged.uncertainty[query];
    let reason = if uncertainty.is_finite() {
        format!("{} {sign} {}", short(uncertainty), short(judged.threshold))
    } else {
        short(uncertainty)
    };
    writeln!(
        out,
        "<article class=\"card\"><h3>{}: <b>{mark}</b>, {verdict}</h3><p>{}: {reason}</p>\n<div class=\"row\">",
        escape(&clipped(&run.name, 80)),
        escape(&label(run, judged)),
    )?;
    picture(
        out,
        pictures,
        (of, Side::Query, query),
        &dataset.queries[query],
        ("query", "the query"),
    )?;
    let is_correct = |it: usize| truth.map(|truth| truth.is_correct(query, it));
    for it in run.matches[query].iter().take(SHOWN) {
        let (class, sign) = match is_correct(it.reference) {
            Some(true) => ("right", "✓ "),
            Some(false) => ("wrong", "✗ "),
            None => ("query", ""),
        };
        let inliers = it.inliers.map_or(String::new(), |it| format!(", {it} inliers"));
        let caption = format!("{sign}{}{inliers}", short(it.distance));
        let name = &dataset.references[it.reference];
        picture(out, pictures, (of, Side::Reference, it.reference), name, (class, &caption))?;
    }
    let shown: Vec<usize> = run.matches[query].iter().take(SHOWN).map(|it| it.reference).collect();
    if let Some(&first) = truth.and_then(|truth| truth.correct(query).first())
        && !shown.iter().any(|&it| is_correct(it) == Some(true))
    {
        let name = &dataset.references[first];
        picture(out, pictures, (of, Side::Reference, first), name, ("right", "truth"))?;
    }
    writeln!(out, "</div></article>")
}

fn picture(
    out: &mut dyn Write,
    pictures: &Pictures,
    which: Picture,
    name: &str,
    (kind, caption): (&str, &str),
) -> io::Result<()> {
    let text = match pictures.unreadable.get(&which) {
        _ if pictures.here.contains(&which) => String::new(),
        Some(reason) => format!("<i>cannot be read: {}</i>", escape(&clipped(reason, 80))),
        None => "<i>no picture here</i>".to_owned(),
    };
    let label = escape(name);
    writeln!(
        out,
        "<figure class=\"{kind}\"><div class=\"im {}\" role=\"img\" aria-label=\"{label}\">{text}</div>\
         <figcaption>{}<br><small title=\"{label}\"><bdi>{}</bdi></small></figcaption></figure>",
        class(which),
        escape(caption),
        escape(&tail(name)),
    )
}

/// The end of a name, where images differ.
fn tail(name: &str) -> String {
    let n = name.chars().count();
    if n <= 24 {
        name.to_owned()
    } else {
        format!("…{}", name.chars().skip(n - 23).collect::<String>())
    }
}
