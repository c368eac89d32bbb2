//! Scores under growing variation and the area between the curves: figure 3.19.

use std::{collections::BTreeMap, path::PathBuf};

use vpr_core::{
    Definition, Result,
    dataset::layout::vpr_bench::{image_folder, read_curves},
    figure::{Curve, Figure, Panel},
    metrics::area_between_curves,
    table::{Cell, Provenance, Table},
};

use super::{Context, subject::hand_crafted};
use crate::technique::{HandCrafted, Technique};

/// The kinds of variation and the files of their stored curves: same place, other place.
const VARIATIONS: [(&str, &str, &str); 2] = [
    (
        "viewpoint",
        "viewpoint_variations_varied_scores_dict.pkl",
        "viewpoint_variations_mismatch_scores_dict.pkl",
    ),
    (
        "illumination",
        "illumination_variation_varied_scores_dict.pkl",
        "illumination_variation_mismatch_scores_dict.pkl",
    ),
];

/// The scores of a key frame with the same place and with another, position by position.
struct Curves {
    same: Vec<f64>,
    other: Vec<f64>,
}

pub(super) fn run(
    table: &mut Table,
    stored: &str,
    series: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for (variation, same, other) in VARIATIONS {
        let folder = context.data.entry(stored)?.path.clone();
        let files = (context.data.find(folder.join(same)), context.data.find(folder.join(other)));
        if let (Some(same), Some(other)) = files {
            let (same, other) = (read_curves(&same)?, read_curves(&other)?);
            for (technique, curves) in paired(&same, &other) {
                report(
                    table,
                    &mut figure,
                    technique.name(),
                    variation,
                    &curves,
                    Provenance::Published,
                )?;
            }
        } else {
            for technique in &Technique::ALL[..8] {
                let why = context.data.why_absent(stored, "stored curves")?;
                table.push(Cell::absent(technique.name(), format!("{variation} ABC"), why));
            }
        }
        for id in series {
            measure(table, &mut figure, id, variation, context)?;
        }
    }
    Ok(Some(figure))
}

/// The techniques that both dictionaries have, in the order of table 3.5.
fn paired(
    same: &BTreeMap<String, Vec<f64>>,
    other: &BTreeMap<String, Vec<f64>>,
) -> Vec<(Technique, Curves)> {
    let curves = |technique: Technique| {
        let name = technique.stored_name();
        let curves = Curves { same: same.get(name)?.clone(), other: other.get(name)?.clone() };
        Some((technique, curves))
    };
    Technique::ALL.into_iter().filter_map(curves).collect()
}

/// Runs HOG and `CoHOG` on a series of images, if it is at hand.
fn measure(
    table: &mut Table,
    figure: &mut Figure,
    id: &str,
    variation: &str,
    context: Context<'_>,
) -> Result<()> {
    let entry = context.data.entry(id)?;
    let folder = |place: &str| {
        let parent = entry.path.parent()?;
        context.data.find(parent.join("invariance").join(variation).join(place))
    };
    let (Some(same), Some(other)) = (folder("same"), folder("other")) else {
        let why = context.data.why_absent(id, "image series")?;
        table.push(Cell::absent(&entry.name, format!("{variation} ABC"), why));
        return Ok(());
    };
    let (same, other) = (image_folder(&same)?, image_folder(&other)?);
    for (column, technique) in hand_crafted() {
        let curves = Curves {
            same: scores(&technique, &same[..1], &same)?,
            other: scores(&technique, &same[..1], &other)?,
        };
        let row = format!("{column}, {}", entry.name);
        report(table, figure, &row, variation, &curves, context.data.provenance(id)?)?;
    }
    Ok(())
}

fn scores(technique: &HandCrafted, key: &[PathBuf], images: &[PathBuf]) -> Result<Vec<f64>> {
    let key = technique.encode(key, &|| ())?;
    let images = technique.encode(images, &|| ())?;
    Ok(key.match_with(&images)?.similarities.view().row(0).to_vec())
}

/// The area under both definitions, and the first position that another place can beat.
fn report(
    table: &mut Table,
    figure: &mut Figure,
    row: &str,
    variation: &str,
    curves: &Curves,
    provenance: Provenance,
) -> Result<()> {
    let n = curves.same.len();
    for definition in [Definition::Published, Definition::Corrected] {
        let area = area_between_curves(definition, &curves.same, &curves.other)?;
        let cell = Cell::new(row, format!("{variation} ABC"), area, provenance, n);
        table.push(cell.defined(definition));
    }
    // §3.3.8: the same place must not score below *any* score of the other place.
    let highest_other = curves.other.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let n_below = curves.same.iter().filter(|&&score| score <= highest_other).count();
    let share = n_below as f64 / n as f64;
    let cell =
        Cell::new(row, format!("{variation}: share another place can beat"), share, provenance, n);
    table.push(cell.defined(Definition::Corrected));
    let points = |scores: &[f64]| (1..).zip(scores).map(|(x, &y)| (f64::from(x), y)).collect();
    figure.panels.push(Panel {
        title: format!("{row}: {variation}"),
        x_label: "position".to_owned(),
        y_label: "score".to_owned(),
        curves: vec![
            Curve { name: "same place".to_owned(), points: points(&curves.same) },
            Curve { name: "other place".to_owned(), points: points(&curves.other) },
        ],
    });
    Ok(())
}
