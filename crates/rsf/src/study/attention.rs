//! Where the learned queries of `BoQ` look before and after an adaptation (figure 4.5).

use std::path::Path;

use vpr_core::Provenance;
use vpr_data::Dataset;
use vpr_nets::{
    encode::registry::Method,
    model::{Tunable as _, headed::BoqDefault},
    weights::Weights,
};
use vpr_report::{
    page::Sheet,
    table::{Cell, Table},
};
use vpr_study::{ContactSheet, Frame, Sources, Tile};
use vpr_vision::image::{self, ImageSize, RgbImage, from_pixels, resize_bilinear};

use super::{
    Encoder, Place,
    gallery::{drawn, kept},
    recalls,
};
use crate::{Result, net::looks};

/// Queries of a place that are shown.
const SHOWN: usize = 3;
/// Learned queries of the last block that are shown.
const LEARNED: usize = 3;
const LEGEND: &str = "Each row: a query image, then for its correct reference where a learned query of \
    BoQ's last block looks, before and after; brighter: more attention. Frames: blue and ✓ if the image \
    is matched right by that network, vermilion and ✗ if wrong.";

/// Attention over an image before and after.
pub(super) fn attention(
    table: &mut Table,
    places: &[Place],
    encoder: &Encoder,
    sources: &Sources<'_>,
) -> Result<Option<Sheet>> {
    let mut sheet = ContactSheet::default();
    for place in places {
        let Some(dataset) = place.at_hand(&["change of attention"], table, sources)? else {
            continue;
        };
        let networks = [boq(place, &encoder.unadapted(), sources)?, boq(place, encoder, sources)?];
        let found = recalls::before_and_after(place, encoder, &dataset, sources)?;
        let ([Some(old), Some(new)], Ok([first, second])) = (networks, found) else {
            let why = "weights are not at hand";
            table.push(Cell::absent(&place.name, "change of attention", why));
            continue;
        };
        let queries = chosen(&dataset, &first, &second);
        let (mut moved, mut spread, mut n) = (0.0, [0.0; 2], 0_usize);
        for &query in &queries {
            let Some(reference) = correct(&dataset, query) else { continue };
            let image = image::decode(&dataset.references[reference])?;
            let maps = [looks(&old, &image)?, looks(&new, &image)?];
            for (a, b) in maps[0].0.iter().zip(&maps[1].0) {
                moved += distance(a, b);
                spread[0] += effective(a);
                spread[1] += effective(b);
                n += 1;
            }
            // Pictures of real places are not ours to pass on.
            if dataset.provenance != Provenance::Generated {
                continue;
            }
            let mut tiles = vec![
                Tile::query(&dataset.queries, query, String::new()),
                Tile::reference(&dataset.references, reference, true, String::new()),
            ];
            let right = [first[query], second[query]].map(|it| dataset.truth.is_correct(query, it));
            for learned in strongest(&maps[1].0, LEARNED) {
                for (side, when) in ["before", "after"].iter().enumerate() {
                    let shown = overlaid(&image, &maps[side].0[learned], maps[side].1)?;
                    tiles.push(Tile {
                        image: kept(&shown, sources)?,
                        name: (*when).to_owned(),
                        frame: if right[side] { Frame::Correct } else { Frame::Wrong },
                        remark: format!("query {learned}"),
                    });
                }
            }
            sheet.add_row(format!("{}: image {query}", place.name), tiles);
        }
        let share = |sum: f64| sum / n.max(1) as f64;
        let mut cell = |column: &str, value: f64| {
            table.push(Cell::new(&place.name, column, value, dataset.provenance, n));
        };
        cell("change of attention", share(moved));
        cell("positions before", share(spread[0]));
        cell("positions after", share(spread[1]));
    }
    drawn(&sheet, LEGEND)
}

/// The network of a row; `None` if its weights are not at hand.
fn boq(place: &Place, encoder: &Encoder, sources: &Sources<'_>) -> Result<Option<BoqDefault>> {
    let path = if let Some(weights) = encoder.weights_for(place, None) {
        sources.locate(Path::new(&weights))?
    } else {
        let method = Method::find(&encoder.method, None)?;
        let file = method.file(method.dimension(None)?);
        sources.locate(&Path::new("models").join(file))?
    };
    let Some(path) = path else { return Ok(None) };
    let mut network = BoqDefault::init(&vpr_nets::device());
    network.take(Weights::open(&path)?)?;
    Ok(Some(network))
}

/// Queries that only one of both matches, then others, at equal steps along the map.
fn chosen(dataset: &Dataset, before: &[usize], after: &[usize]) -> Vec<usize> {
    let is_right = |best: &[usize], query: usize| dataset.truth.is_correct(query, best[query]);
    let known = (0..dataset.queries.len()).filter(|&it| !dataset.truth.is_new_place(it));
    let kinds = [(false, true), (true, false), (true, true)];
    let known: Vec<usize> = known.collect();
    let of_kind = |&(old, new): &(bool, bool)| {
        let all = known.iter().copied();
        let all: Vec<usize> =
            all.filter(|&it| (is_right(before, it), is_right(after, it)) == (old, new)).collect();
        all.get(all.len() / 2).copied()
    };
    kinds.iter().filter_map(of_kind).take(SHOWN).collect()
}

/// The first correct reference of a query.
fn correct(dataset: &Dataset, query: usize) -> Option<usize> {
    (0..dataset.references.len()).find(|&it| dataset.truth.is_correct(query, it))
}

/// Half the sum of absolute differences: 0 for the same attention, 1 for attention elsewhere.
fn distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| 0.5 * f64::from((a - b).abs())).sum()
}

/// How many positions the attention is spread over: one over the sum of squares.
fn effective(of: &[f32]) -> f64 {
    1.0 / of.iter().map(|it| f64::from(*it).powi(2)).sum::<f64>().max(f64::MIN_POSITIVE)
}

/// The learned queries that look at the fewest positions, the most pointed first.
fn strongest(maps: &[Vec<f32>], n: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..maps.len()).collect();
    order.sort_by(|&a, &b| effective(&maps[a]).total_cmp(&effective(&maps[b])).then(a.cmp(&b)));
    order.truncate(n);
    order
}

/// The image, dark where nothing is attended to.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "grey levels")]
fn overlaid(image: &RgbImage, of: &[f32], [rows, columns]: [usize; 2]) -> Result<RgbImage> {
    let largest = of.iter().fold(f32::MIN_POSITIVE, |largest, it| largest.max(*it));
    let levels = of.iter().flat_map(|it| [(255.0 * it / largest).round() as u8; 3]).collect();
    let size = ImageSize { width: image.width(), height: image.height() };
    let small: RgbImage = from_pixels(ImageSize { width: columns, height: rows }, levels);
    let mask = resize_bilinear(&small, size)?;
    let pixel = |(level, mask): (&u8, &u8)| {
        (f64::from(*level) * (0.25 + 0.75 * f64::from(*mask) / 255.0)).round() as u8
    };
    let pixels = image.as_slice().iter().zip(mask.as_slice()).map(pixel).collect();
    Ok(from_pixels(size, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attention_is_compared_and_the_most_pointed_comes_first() {
        let (even, pointed) = (vec![0.25; 4], vec![0.0, 1.0, 0.0, 0.0]);
        assert_eq!(distance(&even, &even), 0.0);
        assert_eq!(distance(&even, &pointed), 0.75);
        assert_eq!([effective(&even), effective(&pointed)], [4.0, 1.0]);
        assert_eq!(strongest(&[even.clone(), pointed, even], 2), [1, 0]);
    }

    #[test]
    fn what_is_not_attended_to_is_dark() {
        let image = from_pixels(ImageSize { width: 4, height: 1 }, vec![200; 12]);
        let shown = overlaid(&image, &[0.0, 1.0], [1, 2]).unwrap();
        assert_eq!((shown.as_slice()[0], shown.as_slice()[9]), (50, 200));
    }
}
