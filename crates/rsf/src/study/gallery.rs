//! Images in frames: what augmentations make of references (figure 4.3), and what is found before
//! and after an adaptation (figure 4.4).

use std::{fs, path::PathBuf};

use vpr_core::{Error as CoreError, map::BlockDigest};
use vpr_data::Dataset;
use vpr_report::{
    page::Sheet,
    table::{Cell, Table},
};
use vpr_study::{ContactSheet, Frame, Sources, Tile};
use vpr_vision::image::{self, RgbImage};

use super::{Encoder, Place, recalls};
use crate::{Augmentation, Augmentations, Preset, Result};

/// Queries of each kind.
const SHOWN: usize = 4;
const AUGMENTED: &str = "Each row: a reference, then each augmentation alone, under the name that \
    Kornia has for it (fog and night are ours), with the mean change in grey levels.";
const FOUND: &str = "Columns: a query, what was found before and what is found after; blue and ✓: \
    correct reference; vermilion and ✗: wrong reference.";

/// One reference of each place under every augmentation.
pub(super) fn augmentations(
    table: &mut Table,
    places: &[Place],
    seed: u64,
    sources: &Sources<'_>,
) -> Result<Option<Sheet>> {
    let mut sheet = ContactSheet::default();
    for place in places {
        let Some(dataset) = place.at_hand(&["change"], table, sources)? else { continue };
        let index = dataset.references.len() / 2;
        let reference = image::decode(&dataset.references[index])?;
        let mut tiles = vec![Tile {
            image: dataset.references[index].clone(),
            name: format!("ref {index}"),
            frame: Frame::Neutral,
            remark: String::new(),
        }];
        for augmentation in Preset::All.augmentations().0 {
            let name = augmentation.change.name();
            let always = Augmentations(vec![Augmentation { p: 1.0, ..augmentation }]);
            let changed = always.apply(&reference, seed);
            let change = change(&reference, &changed);
            let n = reference.width() * reference.height();
            table.push(Cell::new(&place.name, name, change, dataset.provenance, n));
            tiles.push(Tile {
                image: kept(&changed, sources)?,
                name: name.trim_start_matches("Random").to_owned(),
                frame: Frame::Neutral,
                remark: format!("{change:.0} levels"),
            });
        }
        let (first, second) = tiles.split_at(tiles.len().div_ceil(2));
        sheet.add_row(place.name.clone(), first.to_vec());
        sheet.add_row("", second.to_vec());
    }
    drawn(&sheet, AUGMENTED)
}

/// Queries that only one of two encoders matches: the first of each kind in the order of the map.
pub(super) fn found(
    table: &mut Table,
    places: &[Place],
    encoder: &Encoder,
    sources: &Sources<'_>,
) -> Result<Option<Sheet>> {
    let mut sheet = ContactSheet::default();
    for place in places {
        let Some(dataset) = place.at_hand(&["gained"], table, sources)? else { continue };
        let [before, after] = match recalls::before_and_after(place, encoder, &dataset, sources)? {
            Ok(found) => found,
            Err(why) => {
                table.push(Cell::absent(&place.name, "gained", &why));
                continue;
            }
        };
        let is_right = |best: &[usize], query: usize| dataset.truth.is_correct(query, best[query]);
        for (column, from, to) in [("gained", false, true), ("lost", true, false)] {
            let queries: Vec<usize> = (0..dataset.queries.len())
                .filter(|&it| is_right(&before, it) == from && is_right(&after, it) == to)
                .filter(|&it| !dataset.truth.is_new_place(it))
                .collect();
            let n = dataset.truth.n_known();
            table.push(Cell::new(&place.name, column, queries.len() as f64, dataset.provenance, n));
            // Pictures of real places are not ours to pass on.
            if dataset.provenance != vpr_core::Provenance::Generated || queries.is_empty() {
                continue;
            }
            let step = queries.len().div_ceil(SHOWN);
            let tiles = queries.iter().step_by(step).flat_map(|&query| {
                row(&dataset, query, [("before", before[query]), ("after", after[query])])
            });
            sheet.add_row(format!("{}: {column}", place.name), tiles.collect());
        }
    }
    drawn(&sheet, FOUND)
}

fn row(dataset: &Dataset, query: usize, found: [(&str, usize); 2]) -> Vec<Tile> {
    let reference = |(when, index): (&str, usize)| {
        let correct = dataset.truth.is_correct(query, index);
        Tile::reference(&dataset.references, index, correct, when.to_owned())
    };
    let asked = Tile::query(&dataset.queries, query, String::new());
    std::iter::once(asked).chain(found.map(reference)).collect()
}

/// Mean absolute difference of two images, grey levels.
fn change(a: &RgbImage, b: &RgbImage) -> f64 {
    let pairs = a.as_slice().iter().zip(b.as_slice());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    sum / a.as_slice().len().max(1) as f64
}

/// The sheet with its legend, if anything is on it.
pub(super) fn drawn(sheet: &ContactSheet, legend: &'static str) -> Result<Option<Sheet>> {
    Ok(if sheet.is_empty() { None } else { Some(sheet.draw(legend)?) })
}

/// The image as a file of the cache, named by what it shows.
pub(super) fn kept(image: &RgbImage, sources: &Sources<'_>) -> Result<PathBuf> {
    let folder = sources.cache().join("rsf-augmented");
    fs::create_dir_all(&folder).map_err(CoreError::io(&folder))?;
    let path = folder.join(format!("{}.png", BlockDigest::of(image.as_slice()).to_hex()));
    image::write_png(image, &path)?;
    Ok(path)
}
