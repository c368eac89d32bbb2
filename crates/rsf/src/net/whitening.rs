//! Adaptation in closed form: another projection of the features, fitted on references alone.

use burn::store::{ModuleSnapshot, bridge};
use nalgebra::{DMatrix, SymmetricEigen};
use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate, s};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use vpr_core::Error as CoreError;
use vpr_nets::{
    model::default::{DefaultEncoder, INPUT},
    train::{Affine, learned_whitening},
};

use super::Material;
use crate::{Error, Preset, Result};

/// References that are described at a time.
const BATCH: usize = 16;
/// Directions in which references differ less than this, as a share of the largest, are none.
const NOTHING: f64 = 1e-9;

/// References, and their variants by reference and seed.
type Batch = (Vec<usize>, Vec<(usize, u64)>);

/// How the projection is fitted. `prior` and `ridge` were chosen among twenty pairs by recall on
/// generated places of other seeds than the chapter's; `experiments/table-4.3-choice.toml` does it
/// on five such places, where a ridge of 3 is higher by two queries of 600 (`docs/parity.md`).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Whitening {
    /// Variants of each reference, besides itself.
    pub variants: usize,
    /// What they may look like.
    pub augmentations: Preset,
    /// Decides them.
    pub seed: u64,
    /// Share that the projection as it was keeps in the squared length of a descriptor: 0 forgets
    /// it, 1 would change nothing.
    pub prior: f64,
    /// Variance that every feature has within a place beside what was seen, as a share of the mean.
    pub ridge: f64,
}

impl Default for Whitening {
    fn default() -> Self {
        Self { variants: 4, augmentations: Preset::All, seed: 1, prior: 0.75, ridge: 1.0 }
    }
}

impl Whitening {
    /// Whitening alone, as it was published.
    pub const PUBLISHED: Self =
        Self { variants: 6, augmentations: Preset::All, seed: 1, prior: 0.0, ridge: 0.0 };

    /// The same under another seed, if there is one.
    #[must_use]
    pub fn seeded(self, seed: Option<u64>) -> Self {
        Self { seed: seed.unwrap_or(self.seed), ..self }
    }

    /// What its weights came of; `weights` stands for the network that it begins with.
    #[must_use]
    pub fn facts(&self, material: &Material, weights: &str) -> Vec<(&'static str, String)> {
        vec![
            ("whitened_from", weights.to_owned()),
            ("references", format!("{}, digest {}", material.len(), material.digest())),
            ("variants", format!("{}, {}", self.variants, self.augmentations.key())),
            ("prior", self.prior.to_string()),
            ("ridge", self.ridge.to_string()),
            ("seed", self.seed.to_string()),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ]
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`Error::TooFew`] without a variant; [`CoreError::Parameter`] with the first that is out of
    /// range.
    pub fn check(&self) -> Result<()> {
        if self.variants == 0 {
            let purpose = "variants of each reference, to see what changes within a place";
            return Err(Error::TooFew { n: 0, needed: 1, purpose });
        }
        let refuse = |name, value: f64, reason| -> Result<()> {
            Err(CoreError::Parameter { name, value: value.to_string(), reason }.into())
        };
        if !(0.0..1.0).contains(&self.prior) {
            return refuse("prior", self.prior, "must be from 0 to below 1");
        }
        if !(self.ridge >= 0.0 && self.ridge.is_finite()) {
            return refuse("ridge", self.ridge, "must be a number from 0");
        }
        Ok(())
    }

    /// Which variants are drawn: references in batches, each followed by its variants' seeds.
    fn drawn(&self, n: usize) -> Vec<Batch> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let rows: Vec<usize> = (0..n).collect();
        let batch = |part: &[usize]| {
            let variants = part.iter().flat_map(|&row| std::iter::repeat_n(row, self.variants));
            (part.to_vec(), variants.map(|row| (row, random.random())).collect())
        };
        rows.chunks(BATCH).map(batch).collect()
    }

    /// The projection for features of a map, of which there is a row for each reference and each of
    /// its variants; `places` says which. `before` is the projection as it was, or none. Without a
    /// prior a map of `n` references tells `n − 1` directions apart; if there are to be more, the
    /// others are zero.
    ///
    /// With a prior, descriptors under both projections, each at a mean squared length of one, stand
    /// side by side under the weights `√prior` and `√(1 − prior)`: cosines are those of the old
    /// descriptors and of the whitened ones, mixed. They are turned so that the first `to` numbers
    /// hold what the features at hand have in them.
    ///
    /// # Errors
    ///
    /// Those of [`Self::check`] and of [`learned_whitening`].
    pub fn fit(
        &self,
        features: ArrayView2<'_, f32>,
        places: &[usize],
        before: &Affine,
    ) -> Result<Affine> {
        self.check()?;
        let (n, from) = features.dim();
        let to = before.weight.ncols();
        if self.prior == 0.0 && self.ridge == 0.0 {
            let n_places = places.iter().max().map_or(0, |last| last + 1);
            let used = to.min(from).min(n_places.saturating_sub(1));
            return Ok(padded(&learned_whitening(features, places, used)?, to));
        }
        let (features, places) = self.with_ridge(features, places)?;
        let whitened = learned_whitening(features.view(), &places, from)?;
        let (seen, _) = features.view().split_at(Axis(0), n);
        let stacked = stacked(before, &whitened, self.prior, seen)?;
        Ok(turned(&stacked, seen, to))
    }

    /// Two more images for every feature, of a place of their own, which differ in that feature
    /// alone: what they add to the scatter within places is the ridge.
    fn with_ridge(
        &self,
        features: ArrayView2<'_, f32>,
        places: &[usize],
    ) -> Result<(Array2<f32>, Vec<usize>)> {
        let from = features.ncols();
        let (means, middle) = means(features, places);
        let scatter: f64 = features
            .outer_iter()
            .zip(places)
            .flat_map(|(row, place)| row.to_vec().into_iter().zip(means[*place].clone()))
            .map(|(value, mean)| (f64::from(value) - mean).powi(2))
            .sum();
        let step = (self.ridge * scatter / (2.0 * from as f64)).sqrt();
        let mut rows = Array2::zeros((2 * from, from));
        #[expect(clippy::cast_possible_truncation, reason = "features are f32")]
        for (number, mut row) in rows.outer_iter_mut().enumerate() {
            row.iter_mut().zip(&middle).for_each(|(it, middle)| *it = *middle as f32);
            row[number / 2] += if number % 2 == 0 { step } else { -step } as f32;
        }
        let first = means.len();
        let places = places.iter().copied().chain((0..2 * from).map(|it| first + it / 2));
        Ok((joined(Axis(0), &[features, rows.view()])?, places.collect()))
    }
}

/// The mean of every place, and of these.
fn means(features: ArrayView2<'_, f32>, places: &[usize]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let n_places = places.iter().max().map_or(0, |last| last + 1);
    let mut sums = vec![vec![0.0; features.ncols()]; n_places];
    let mut counts = vec![0.0_f64; n_places];
    for (row, place) in features.outer_iter().zip(places) {
        counts[*place] += 1.0;
        sums[*place].iter_mut().zip(row).for_each(|(sum, value)| *sum += f64::from(*value));
    }
    for (sum, count) in sums.iter_mut().zip(&counts) {
        for it in sum.iter_mut() {
            *it /= count.max(1.0);
        }
    }
    let mut middle = vec![0.0; features.ncols()];
    for mean in &sums {
        middle.iter_mut().zip(mean).for_each(|(it, value)| *it += value / n_places as f64);
    }
    (sums, middle)
}

/// The map of features, row by row, in a fixed order of sums.
#[must_use]
pub fn projected(affine: &Affine, features: ArrayView2<'_, f32>) -> Array2<f32> {
    let mut rows = Array2::zeros((features.nrows(), affine.weight.ncols()));
    for (mut row, features) in rows.outer_iter_mut().zip(features.outer_iter()) {
        row.assign(&affine.bias);
        for (value, weights) in features.iter().zip(affine.weight.outer_iter()) {
            row.scaled_add(*value, &weights);
        }
    }
    rows
}

/// Both maps side by side, each at a mean squared length of its share.
fn stacked(
    before: &Affine,
    whitened: &Affine,
    prior: f64,
    seen: ArrayView2<'_, f32>,
) -> Result<Affine> {
    let scaled = |affine: &Affine, share: f64| {
        let squares: f64 = projected(affine, seen).iter().map(|it| f64::from(*it).powi(2)).sum();
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        let scale = (share * seen.nrows() as f64 / squares.max(f64::MIN_POSITIVE)).sqrt() as f32;
        (affine.weight.mapv(|it| it * scale), affine.bias.mapv(|it| it * scale))
    };
    let (a, b) = (scaled(before, prior), scaled(whitened, 1.0 - prior));
    Ok(Affine {
        weight: joined(Axis(1), &[a.0.view(), b.0.view()])?,
        bias: a.1.iter().chain(&b.1).copied().collect(),
    })
}

/// Turned so that the first `to` numbers hold most of what these features come to; the lengths and
/// angles of descriptors of references stay if they lie in so many directions.
fn turned(affine: &Affine, seen: ArrayView2<'_, f32>, to: usize) -> Affine {
    let rows = projected(affine, seen);
    let (n, wide) = rows.dim();
    let rows = DMatrix::from_fn(n, wide, |row, column| f64::from(rows[(row, column)]));
    let SymmetricEigen { eigenvectors, eigenvalues } = (rows.tr_mul(&rows)).symmetric_eigen();
    let mut order: Vec<usize> = (0..wide).collect();
    order.sort_by(|a, b| eigenvalues[*b].total_cmp(&eigenvalues[*a]).then(a.cmp(b)));
    let largest = order.first().map_or(0.0, |it| eigenvalues[*it]);
    order.retain(|it| eigenvalues[*it] > NOTHING * largest);
    order.truncate(to);
    let turn = |row: &[f32], column: usize| -> f32 {
        let direction = eigenvectors.column(order[column]);
        let sum: f64 = row.iter().zip(direction.iter()).map(|(a, b)| f64::from(*a) * b).sum();
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        let sum = sum as f32;
        sum
    };
    let turned = |row: &[f32]| (0..order.len()).map(|it| turn(row, it)).collect::<Vec<f32>>();
    let mut weight = Array2::zeros((affine.weight.nrows(), order.len()));
    for (mut to, from) in weight.outer_iter_mut().zip(affine.weight.outer_iter()) {
        to.assign(&Array1::from(turned(&from.to_vec())));
    }
    padded(&Affine { weight, bias: turned(&affine.bias.to_vec()).into() }, to)
}

/// With zeros up to `to` numbers.
fn padded(affine: &Affine, to: usize) -> Affine {
    let (from, used) = affine.weight.dim();
    let mut weight = Array2::zeros((from, to));
    weight.slice_mut(s![.., ..used]).assign(&affine.weight);
    let mut bias = Array1::zeros(to);
    bias.slice_mut(s![..used]).assign(&affine.bias);
    Affine { weight, bias }
}

/// The network under another projection of its pooled features, see [`Whitening::fit`]; learned
/// whitening is that of Radenović, Tolias and Chum (2019, section 3.3): what differs between variants
/// of one reference counts little. The trunk stays.
///
/// # Errors
///
/// Those of [`Whitening::fit`].
pub fn whiten(
    settings: &Whitening,
    network: DefaultEncoder,
    material: &Material,
) -> Result<DefaultEncoder> {
    settings.check()?;
    let before = projection(&network)?;
    let (features, places) = pooled_features(settings, &network, material)?;
    let fitted = settings.fit(features.view(), &places, &before)?;
    Ok(network.with_projection(&fitted)?)
}

/// What the trunk makes of references and their variants, and of which reference each is.
pub(crate) fn pooled_features(
    settings: &Whitening,
    network: &DefaultEncoder,
    material: &Material,
) -> Result<(Array2<f32>, Vec<usize>)> {
    let pooled = |images: Vec<f32>| network.pooled(&images, INPUT, BATCH);
    features(settings, material.len(), |rows, variants| {
        let augmentations = settings.augmentations.augmentations();
        Ok(vec![
            pooled(material.plain(rows)?)?,
            pooled(material.changed(&augmentations, variants)?)?,
        ])
    })
}

/// Features of references and their variants, batch after batch, and of which reference each is.
pub(crate) fn features(
    settings: &Whitening,
    n: usize,
    mut describe: impl FnMut(&[usize], &[(usize, u64)]) -> Result<Vec<Array2<f32>>>,
) -> Result<(Array2<f32>, Vec<usize>)> {
    let (mut parts, mut places) = (Vec::new(), Vec::new());
    for (rows, variants) in settings.drawn(n) {
        parts.extend(describe(&rows, &variants)?);
        places.extend(rows);
        places.extend(variants.iter().map(|it| it.0));
    }
    let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
    Ok((joined(Axis(0), &views)?, places))
}

fn joined(axis: Axis, parts: &[ArrayView2<'_, f32>]) -> Result<Array2<f32>> {
    let shapes = |cause: ndarray::ShapeError| {
        Error::from(CoreError::format("features", "shape", cause.to_string()))
    };
    concatenate(axis, parts).map_err(shapes)
}

/// The projection that a network has.
pub(crate) fn projection(network: &DefaultEncoder) -> Result<Affine> {
    let refused = |cause: String| CoreError::format("default network", "projection", cause);
    let tensors = network.collect(None, None, false);
    let values = |name: &str| -> Result<Vec<f32>> {
        let tensor = tensors.iter().find(|it| it.name == name);
        let tensor = tensor.ok_or_else(|| refused(format!("no `{name}`")))?;
        let data = bridge::to_data(tensor).map_err(|cause| refused(cause.to_string()))?;
        Ok(data.try_to_vec().map_err(|cause| refused(format!("{cause:?}")))?)
    };
    let (weight, bias) = (values("head.weight")?, values("head.bias")?);
    let shape = (weight.len() / bias.len().max(1), bias.len());
    let weight = Array2::from_shape_vec(shape, weight).map_err(|it| refused(it.to_string()))?;
    Ok(Affine { weight, bias: bias.into() })
}
