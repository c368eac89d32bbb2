//! Geometric verification of near and far pairs of images: inlier counts and how well they tell the two apart.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Deserialize;
use vpr_core::{Evaluation, Judged, Pose, Provenance, Result, metrics::effective};
use vpr_data::layout::seven_scenes;
use vpr_report::{
    figure::Figure,
    table::{Cell, Table},
};
use vpr_study::verification::{LocalFeature, Opened};
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image::{self, ImageSize, resize_bilinear},
    matching::{MatchParams, match_features},
    ransac::{RansacParams, correspondences, homography},
};

use super::Context;

/// Which pairs are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pairs {
    /// Near and far pairs, so many of each.
    pub n: usize,
    /// Near pairs are closer than this, in metres, and turned by less, in degrees.
    pub near: [f64; 2],
    /// Far pairs are farther apart than this, in metres, or turned by more, in degrees.
    pub far: [f64; 2],
    /// Width that images are resized to; their own if larger.
    pub width: usize,
}

/// Local features and the ways they are matched.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LocalMethod {
    /// The features.
    pub features: LocalFeature,
    /// Keypoints per image.
    pub keypoints: usize,
    /// Ways of matching, each a row of the table.
    pub rows: Vec<Row>,
}

/// A row of the table: which neighbours are matches.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Its label.
    pub name: String,
    /// Lowe's ratio test, none if left out.
    pub ratio: Option<f64>,
    /// Whether each of the two must be the nearest of the other.
    #[serde(default)]
    pub mutual: bool,
}

impl Row {
    fn matching(&self) -> MatchParams {
        MatchParams { ratio: self.ratio, mutual: self.mutual, max_distance: None }
    }
}

/// Two images, by index, and whether they are near.
type Pair = ([usize; 2], bool);

pub(super) fn run(
    table: &mut Table,
    dataset: &str,
    pairs: Pairs,
    methods: &[LocalMethod],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let folder = context.sources.locate(&context.sources.entry(dataset)?.path)?;
    let found = folder.as_deref().map(|folder| open(folder, pairs, context.seed)).transpose()?;
    for method in methods {
        let mut absent = |why: &str| {
            method.rows.iter().for_each(|row| table.push(Cell::absent(&row.name, COLUMN, why)));
        };
        let Some((images, found)) = &found else {
            absent(&context.sources.why_absent(dataset, "images")?);
            continue;
        };
        let weights = match method.features.find_weights(context.sources.roots())? {
            Ok(weights) => weights,
            Err(why) => {
                absent(&why);
                continue;
            }
        };
        let Opened { extractor, .. } =
            method.features.open(weights.as_deref(), method.keypoints)?;
        let features = describe(&*extractor, images, found, pairs.width, context)?;
        for row in &method.rows {
            let counts = count(&features, found, row.matching())?;
            report(table, &row.name, found, &counts)?;
        }
    }
    Ok(None)
}

const COLUMN: &str = "AUC-ROC";

/// The images of a scene and the pairs drawn among them.
fn open(folder: &Path, pairs: Pairs, seed: u64) -> Result<(Vec<PathBuf>, Vec<Pair>)> {
    let (queries, references) = seven_scenes::open(folder)?;
    let poses = [references.poses.six_dof()?, queries.poses.six_dof()?].concat();
    Ok(([references.images, queries.images].concat(), sample(&poses, pairs, seed)))
}

/// The same number of near and far pairs, drawn by the seed; fewer if there are not so many.
///
/// Near pairs are drawn evenly over all there are, whatever their distance in time.
fn sample(poses: &[Pose], pairs: Pairs, seed: u64) -> Vec<Pair> {
    let (mut near, mut far) = (Vec::new(), Vec::new());
    for first in 0..poses.len() {
        for second in first + 1..poses.len() {
            let between = poses[first].inv_mul(&poses[second]);
            let apart = [between.translation.vector.norm(), between.rotation.angle().to_degrees()];
            if apart[0] < pairs.near[0] && apart[1] < pairs.near[1] {
                near.push(([first, second], true));
            } else if apart[0] > pairs.far[0] || apart[1] > pairs.far[1] {
                far.push(([first, second], false));
            }
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = pairs.n.min(near.len()).min(far.len());
    let mut draw = |mut from: Vec<Pair>| {
        for at in 0..n {
            let other = rng.random_range(at as u64..from.len() as u64);
            from.swap(at, usize::try_from(other).expect("an index"));
        }
        from.truncate(n);
        from
    };
    [draw(near), draw(far)].concat()
}

/// Features of every image that a pair needs.
fn describe(
    extractor: &dyn Extractor,
    images: &[PathBuf],
    pairs: &[Pair],
    width: usize,
    context: Context<'_>,
) -> Result<BTreeMap<usize, LocalFeatures>> {
    let mut needed: Vec<usize> = pairs.iter().flat_map(|(pair, _)| *pair).collect();
    needed.sort_unstable();
    needed.dedup();
    context.sources.observer().start(extractor.name(), needed.len());
    let one = |&index: &usize| {
        let mut picture = image::decode(&images[index])?;
        if picture.width() > width {
            let height = (picture.height() * width).div_ceil(picture.width());
            picture = resize_bilinear(&picture, ImageSize { width, height })?;
        }
        let features = extractor.extract(&picture)?;
        context.sources.observer().step();
        Ok((index, features))
    };
    // Collected before looking for errors: the first of them is then the same in every run.
    let features: Vec<Result<_>> = needed.par_iter().map(one).collect();
    context.sources.observer().end();
    features.into_iter().collect()
}

/// Inliers of a homography for every pair.
fn count(
    features: &BTreeMap<usize, LocalFeatures>,
    pairs: &[Pair],
    matching: MatchParams,
) -> Result<Vec<f64>> {
    let of = |(pair, _): &Pair| {
        let [a, b] = pair.map(|index| &features[&index]);
        let matches = match_features(a, b, &matching)?;
        let points = correspondences(a, b, &matches);
        Ok(homography(&points, &RansacParams::HOMOGRAPHY)?.count() as f64)
    };
    let counts: Vec<Result<f64>> = pairs.par_iter().map(of).collect();
    counts.into_iter().collect()
}

fn report(table: &mut Table, row: &str, pairs: &[Pair], counts: &[f64]) -> Result<()> {
    let near: Vec<bool> = pairs.iter().map(|&(_, near)| near).collect();
    let judged = Judged::from_flags(near.clone(), vec![true; near.len()])?;
    let interval = Evaluation::of_confidence(counts, &judged)?.auc_roc_interval()?;
    let cell = Cell::new(row, COLUMN, interval.estimate, Provenance::Measured, pairs.len());
    table.push(cell.within(interval.low, interval.high, effective::METHOD));
    for (column, wanted) in [("inliers, near", true), ("inliers, far", false)] {
        let mut of: Vec<f64> =
            counts.iter().zip(&near).filter(|(_, near)| **near == wanted).map(|it| *it.0).collect();
        of.sort_by(f64::total_cmp);
        let (n, median) = (of.len(), of.get(of.len() / 2).copied().unwrap_or(0.0));
        table.push(Cell::new(row, column, median, Provenance::Measured, n).noted("median"));
    }
    Ok(())
}
