//! Small pictures within a budget of bytes, each once, as styles that cards refer to.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, Write},
};

use super::{Judged, Report, Side, data::SHOWN, json, png};

/// Pictures made at a time.
const BATCH: usize = 64;
/// Longest side in pixels where a picture may take so many bytes; the first that fits is taken.
const SIZES: [(usize, u32); 4] = [(12_000, 200), (5000, 140), (2500, 104), (0, 80)];
const FULL: u32 = 240;

/// A picture of a dataset.
pub(super) type Picture = (usize, Side, usize);

/// Which pictures the file has.
#[derive(Default)]
pub(super) struct Pictures {
    pub(super) here: BTreeSet<Picture>,
    /// Why others are not.
    pub(super) unreadable: BTreeMap<Picture, String>,
}

/// The class of a picture.
pub(super) fn class((dataset, side, index): Picture) -> String {
    let side = if side == Side::Query { 'q' } else { 'r' };
    format!("{side}{dataset}-{index}")
}

/// Queries of a run in the order in which one would like to see them: by turns wrong and accepted,
/// right and rejected, wrong and rejected, right and accepted.
pub(super) fn by_interest(judged: &Judged) -> Vec<usize> {
    let mut kinds: [Vec<usize>; 4] = Default::default();
    for query in 0..judged.uncertainty.len() {
        let is_right = judged.is_correct(query).unwrap_or(true);
        kinds[match (is_right, judged.accepts(query)) {
            (false, true) => 0,
            (true, false) => 1,
            (false, false) => 2,
            (true, true) => 3,
        }]
        .push(query);
    }
    let by = |a: &usize, b: &usize| judged.uncertainty[*a].total_cmp(&judged.uncertainty[*b]);
    // The most certain of the wrong, the least certain of the right.
    kinds[0].sort_by(by);
    kinds[1].sort_by(|a, b| by(b, a));
    let longest = kinds.iter().map(Vec::len).max().unwrap_or(0);
    (0..longest)
        .flat_map(|rank| kinds.iter().filter_map(move |kind| kind.get(rank).copied()))
        .collect()
}

/// All pictures that cards may show, most wanted first.
fn wanted(report: &Report<'_>, judged: &[Judged]) -> Vec<Picture> {
    let orders: Vec<Vec<usize>> = judged.iter().map(by_interest).collect();
    let longest = orders.iter().map(Vec::len).max().unwrap_or(0);
    let (mut seen, mut wanted) = (BTreeSet::new(), Vec::new());
    for rank in 0..longest {
        for (run, order) in report.runs.iter().zip(&orders) {
            let Some(&query) = order.get(rank) else { continue };
            let dataset = &report.datasets[run.dataset];
            if dataset.thumbnails.is_none() {
                continue;
            }
            let matches = run.matches[query].iter().take(SHOWN).map(|it| it.reference);
            let truth = dataset.truth.and_then(|truth| truth.correct(query).first().copied());
            let pictures = matches.chain(truth).map(|it| (run.dataset, Side::Reference, it));
            for picture in std::iter::once((run.dataset, Side::Query, query)).chain(pictures) {
                if seen.insert(picture) {
                    wanted.push(picture);
                }
            }
        }
    }
    wanted
}

/// Writes as many pictures as `left` bytes hold, all of them without a limit.
pub(super) fn write(
    out: &mut dyn Write,
    report: &Report<'_>,
    judged: &[Judged],
    left: Option<usize>,
) -> io::Result<Pictures> {
    let wanted = wanted(report, judged);
    let mut pictures = Pictures::default();
    // Base 64 takes a third more; each picture has its name in two places.
    let each = left.map_or(usize::MAX, |left| left * 3 / 4 / wanted.len().max(1));
    let side = SIZES.into_iter().find(|it| each >= it.0).map_or(FULL, |it| it.1);
    let side = if left.is_none() { FULL } else { side };
    let mut left = left.unwrap_or(usize::MAX);
    writeln!(out, "<style>")?;
    'all: for batch in wanted.chunks(BATCH) {
        for (index, dataset) in report.datasets.iter().enumerate() {
            let Some(thumbnails) = dataset.thumbnails else { continue };
            let asked: Vec<(Side, usize)> =
                batch.iter().filter(|it| it.0 == index).map(|it| (it.1, it.2)).collect();
            for (&(side, picture), made) in asked.iter().zip(thumbnails(&asked, side)) {
                let picture = (index, side, picture);
                let style = match made {
                    Ok(file) => style(picture, &file),
                    Err(reason) => {
                        pictures.unreadable.insert(picture, reason);
                        continue;
                    }
                };
                if style.len() + 12 > left {
                    break 'all;
                }
                left -= style.len() + 12;
                out.write_all(style.as_bytes())?;
                pictures.here.insert(picture);
            }
        }
    }
    writeln!(out, "</style>")?;
    let here = pictures.here.iter().map(|it| json::string(&class(*it)));
    let bad = pictures.unreadable.iter().take(1000);
    let bad = bad.map(|(it, why)| format!("{}:{}", json::string(&class(*it)), json::string(why)));
    writeln!(
        out,
        "<script type=\"application/json\" id=\"pictures\">{{\"here\":{},\"bad\":{{{}}}}}</script>",
        json::list(here),
        bad.collect::<Vec<_>>().join(",")
    )?;
    Ok(pictures)
}

fn style(picture: Picture, file: &[u8]) -> String {
    let kind = if file.starts_with(b"\x89PNG") { "png" } else { "jpeg" };
    format!(
        ".{}{{background-image:url(data:image/{kind};base64,{})}}\n",
        class(picture),
        png::base64(file)
    )
}
