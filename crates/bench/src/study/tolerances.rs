//! Tolerances that the published ground truths really have: table 3.2.

use vpr_core::{GroundTruth, Provenance, Result};
use vpr_data::{Tolerance, layout::vpr_bench::GroundTruthFile};
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};

use super::Context;

/// Column of the tolerance as text, which is what the thesis prints.
const COLUMN: &str = "Ground-truth Tolerance";

pub(super) fn run(
    table: &mut Table,
    datasets: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    for id in datasets {
        let row = context.sources.entry(id)?.name;
        if vpr_worlds::is_world(id) {
            generated(table, &row, id, context)?;
            continue;
        }
        let Some(file) = context.sources.ground_truth(id)? else {
            table.push(Cell::absent(row, COLUMN, context.sources.why_absent(id, "ground truth")?));
            continue;
        };
        // A list that lacks its end would only seem to be about fewer queries.
        let file = match context.sources.entry(id)?.queries {
            Some(n_queries) => file.about(n_queries)?,
            None => file,
        };
        let n = file.len();
        let provenance = match context.sources.provenance(id)? {
            Provenance::Generated => Provenance::Generated,
            _ => Provenance::Published,
        };
        if let Tolerance::Metres(_) = context.sources.entry(id)?.tolerance {
            let why = "metres cannot be checked: the published lists come without positions";
            table.push(Cell::absent(&row, COLUMN, why));
        } else {
            let (text, remark) = describe(&file);
            let cell = Cell::new(&row, COLUMN, text.as_str(), provenance, n);
            table.push(if remark.is_empty() { cell } else { cell.noted(remark) });
        }
        count(table, &row, &file.lists, provenance);
    }
    Ok(None)
}

/// How many references are correct at least and at most, new places aside.
fn count(table: &mut Table, row: &str, lists: &[Vec<i64>], provenance: Provenance) {
    let known = lists.iter().filter(|list| list.as_slice() != [-1]);
    let counts: Vec<usize> = known.map(Vec::len).collect();
    let most = counts.iter().copied().max().unwrap_or(0) as f64;
    let fewest = counts.iter().copied().min().unwrap_or(0) as f64;
    table.push(Cell::new(row, "fewest correct references", fewest, provenance, lists.len()));
    table.push(Cell::new(row, "most correct references", most, provenance, lists.len()));
}

/// The tolerance of a generated world: the lists of one in frames; of one in metres, whether its
/// truth follows from the positions, which real lists come without.
fn generated(table: &mut Table, row: &str, id: &str, context: Context<'_>) -> Result<()> {
    let Some(dataset) = context.images(id)? else { return Ok(()) };
    let (truth, provenance) = (&dataset.truth, dataset.provenance);
    let lists: Vec<Vec<i64>> = (0..truth.len())
        .map(|query| match truth.correct(query) {
            [] => vec![-1],
            some => some.iter().filter_map(|&reference| i64::try_from(reference).ok()).collect(),
        })
        .collect();
    let (text, remark) = match (context.sources.entry(id)?.tolerance, &dataset.poses) {
        (Tolerance::Metres(radius), Some((queries, references))) => {
            let follows = GroundTruth::within_radius(queries, references, radius)? == *truth;
            let remark = if follows { "" } else { "its lists do not follow from the positions" };
            (format!("± {radius} meters"), remark)
        }
        _ => describe(&GroundTruthFile { path: id.into(), lists: lists.clone() }),
    };
    let cell = Cell::new(row, COLUMN, text.as_str(), provenance, truth.len());
    table.push(if remark.is_empty() { cell } else { cell.noted(remark) });
    count(table, row, &lists, provenance);
    Ok(())
}

/// What the lists of a ground truth amount to, in the thesis' words where they fit, and a remark.
fn describe(file: &GroundTruthFile) -> (String, &'static str) {
    let lists: Vec<(i64, &[i64])> = (0..)
        .zip(&file.lists)
        .map(|(query, list)| (query, list.as_slice()))
        .filter(|(_, list)| !list.is_empty() && *list != [-1])
        .collect();
    let spans = |stride: i64| -> Option<i64> {
        let reach = |(query, list): &(i64, &[i64])| {
            list.iter().map(|reference| (reference - query * stride).abs()).max().unwrap_or(0)
        };
        let tolerance = lists.iter().map(reach).max()?;
        // Every reference in range must be listed, or the lists are not a range of frames.
        let is_range = lists.iter().all(|(query, list)| {
            let centre = query * stride;
            let low = (centre - tolerance).max(0);
            // Lists may end early where the references do, but not before the centre.
            list.iter().copied().eq((low..).take(list.len())) && list.contains(&centre)
        });
        is_range.then_some(tolerance)
    };
    if lists.iter().all(|(_, list)| list.len() == 1) {
        return ("Frame-to-frame".to_owned(), "");
    }
    if let Some(tolerance) = spans(1) {
        return (format!("± {tolerance} frames"), "");
    }
    if let Some(tolerance) = spans(10) {
        return (format!("± {tolerance} frames"), "around reference 10 q of query q");
    }
    let first = lists[0].1.len();
    if lists.iter().all(|(_, list)| list.len() == first) {
        return (format!("{first} frames"), "");
    }
    let most = lists.iter().map(|(_, list)| list.len()).max().unwrap_or(0);
    (format!("lists of up to {most} references"), "")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn describe_lists(lists: Vec<Vec<i64>>) -> (String, &'static str) {
        describe(&GroundTruthFile { path: "test".into(), lists })
    }

    #[test]
    fn ranges_of_frames_are_recognized() {
        let text = |lists| describe_lists(lists).0;
        assert_eq!(text(vec![vec![0], vec![1], vec![-1]]), "Frame-to-frame");
        assert_eq!(text(vec![vec![0, 1], vec![0, 1, 2], vec![1, 2]]), "± 1 frames");
        let every_tenth = describe_lists(vec![vec![0, 1], vec![9, 10, 11]]);
        assert_eq!(every_tenth, ("± 1 frames".into(), "around reference 10 q of query q"));
        assert_eq!(text(vec![vec![0, 7], vec![3, 9]]), "2 frames");
        assert_eq!(text(vec![vec![0, 7], vec![3]]), "lists of up to 2 references");
    }
}
