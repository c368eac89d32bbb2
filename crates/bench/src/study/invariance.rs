//! Scores under growing variation and the area between the curves: figure 3.19.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::Deserialize;
use vpr_core::{Definition, Provenance, Result, Similarities, metrics::area_between_curves};
use vpr_data::layout::vpr_bench::{image_folder, read_curves};
use vpr_report::{
    figure::{Curve, Figure, Panel},
    table::{Cell, Table},
};

use vpr_study::{Describe, Direction, Runner, Technique};

use super::Context;

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

/// Images of one place varied and of another place varied alike, on one stage.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// What varies.
    pub variation: String,
    /// Dataset whose one reference is the key frame; the first half of the queries shows its place,
    /// the second half another.
    pub dataset: String,
}

/// Where the curves come from.
pub(super) struct Sources<'a> {
    /// Dataset with stored curves.
    pub(super) stored: Option<&'a str>,
    /// Datasets with folders of image series.
    pub(super) series: &'a [String],
    /// Datasets that are one stage each.
    pub(super) stages: &'a [Stage],
}

pub(super) fn run(
    table: &mut Table,
    sources: &Sources<'_>,
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for (variation, same, other) in VARIATIONS {
        if let Some(stored) = sources.stored {
            let files = (same, other);
            published(table, &mut figure, stored, (variation, files), context)?;
        }
        for id in sources.series {
            measure(table, &mut figure, id, variation, context)?;
        }
    }
    for stage in sources.stages {
        on_stage(table, &mut figure, stage, context)?;
    }
    Ok(Some(figure))
}

/// The curves that the authors stored.
fn published(
    table: &mut Table,
    figure: &mut Figure,
    stored: &str,
    (variation, (same, other)): (&str, (&str, &str)),
    context: Context<'_>,
) -> Result<()> {
    let folder = context.sources.entry(stored)?.path;
    let file = |name: &str| context.sources.locate(&folder.join(name));
    let files = (file(same)?, file(other)?);
    if let (Some(same), Some(other)) = files {
        let (same, other) = (read_curves(&same)?, read_curves(&other)?);
        for (technique, curves) in paired(&same, &other) {
            let name = technique.name();
            report(table, figure, name, variation, &curves, Provenance::Published)?;
        }
        return Ok(());
    }
    for technique in &Technique::ALL[..8] {
        let why = context.sources.why_absent(stored, "stored curves")?;
        table.push(Cell::absent(technique.name(), format!("{variation} ABC"), why));
    }
    Ok(())
}

/// Runs the techniques on a stage.
fn on_stage(
    table: &mut Table,
    figure: &mut Figure,
    stage: &Stage,
    context: Context<'_>,
) -> Result<()> {
    let variation = stage.variation.as_str();
    let Some(dataset) = context.images(&stage.dataset)? else {
        let why = context.sources.why_absent(&stage.dataset, "images")?;
        let row = context.sources.entry(&stage.dataset)?.name;
        table.push(Cell::absent(row, format!("{variation} ABC"), why));
        return Ok(());
    };
    for runner in context.sources.runners()? {
        let column = runner.column;
        let scores = context.sources.scores(runner, &dataset, Direction::Swapped)?;
        let curves = halves(scores.similarities());
        let row = format!("{column}, {}", dataset.name);
        report(table, figure, &row, variation, &curves, dataset.provenance)?;
    }
    Ok(())
}

/// The scores of the key frame with all variations, those of its own place and of the other.
fn halves(similarities: &Similarities) -> Curves {
    let scores = similarities.view().row(0).to_vec();
    let (same, other) = scores.split_at(scores.len() / 2);
    Curves { same: same.to_vec(), other: other.to_vec() }
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
    let entry = context.sources.entry(id)?;
    let folder = |place: &str| {
        let parent = entry.path.parent().unwrap_or(Path::new(""));
        context.sources.locate(&parent.join("invariance").join(variation).join(place))
    };
    let (Some(same), Some(other)) = (folder("same")?, folder("other")?) else {
        let why = context.sources.why_absent(id, "image series")?;
        table.push(Cell::absent(&entry.name, format!("{variation} ABC"), why));
        return Ok(());
    };
    let (same, other) = (image_folder(&same)?, image_folder(&other)?);
    for Runner { column, technique, .. } in context.sources.runners()? {
        let curves = Curves {
            same: scores(technique.as_ref(), &same[..1], &same)?,
            other: scores(technique.as_ref(), &same[..1], &other)?,
        };
        let row = format!("{column}, {}", entry.name);
        report(table, figure, &row, variation, &curves, context.sources.provenance(id)?)?;
    }
    Ok(())
}

fn scores(technique: &dyn Describe, key: &[PathBuf], images: &[PathBuf]) -> Result<Vec<f64>> {
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
            Curve::new("same place", points(&curves.same)),
            Curve::new("other place", points(&curves.other)),
        ],
        ..Panel::default()
    });
    Ok(())
}
