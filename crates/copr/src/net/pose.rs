//! The pose between two cameras from their descriptors alone, thesis §6.2.4: the fine step after a
//! coarse retrieval.

use std::path::Path;

use burn::{
    module::Module,
    tensor::{Device, Tensor, TensorData},
};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use ndarray::ArrayView2;
use vpr_core::{Definition, Error as CoreError, Pose};
use vpr_nets::{
    loss::relative_pose,
    regress::RELATIVE_POSE,
    train::{Learner, Report, Run, seeded},
    weights::{self, Precision, Weights},
};

use super::{PairBatch, Pairs, Training, head::RelativeHead, training::fitted};
use crate::Result;

/// What the metadata of a file says it is.
const NETWORK: &str = "relative pose of two descriptors";

/// From the descriptors of a reference and of a query to the pose of the query seen from the
/// reference, in the reference's axes.
#[derive(Clone, Debug)]
pub struct PoseNetwork {
    head: RelativeHead,
    dimension: usize,
    definition: Definition,
}

impl PoseNetwork {
    /// Reads weights that [`train_pose`] wrote.
    ///
    /// # Errors
    ///
    /// [`vpr_nets::Error::Weights`] and [`CoreError::Format`] if the file is not one of these.
    pub fn open(path: &Path) -> Result<Self> {
        let weights = Weights::open(path)?;
        let wrong = |reason: &str| CoreError::format(path, "weights", reason.to_owned());
        if weights.facts().get("network").map(String::as_str) != Some(NETWORK) {
            return Err(wrong("are not of a network for relative poses").into());
        }
        let definition = match weights.facts().get("activation").map(String::as_str) {
            Some("none") => Definition::Published,
            Some("gelu") => Definition::Corrected,
            _ => return Err(wrong("do not say which activation the network has").into()),
        };
        let width = weights.get("hidden.weight").and_then(|it| it.shape.first().copied());
        let dimension = width.ok_or_else(|| wrong("have no `hidden.weight`"))? / 2;
        let mut head = RelativeHead::new(dimension).valid();
        weights.apply(&mut head)?;
        Ok(Self { head, dimension, definition })
    }

    /// Whether it is the released head or the one with an activation.
    #[must_use]
    pub fn definition(&self) -> Definition {
        self.definition
    }

    /// Where each query is, seen from its reference: `n × dim` of each.
    ///
    /// # Errors
    ///
    /// [`CoreError::Mismatch`] for descriptors of another length or number, [`CoreError::NotFinite`] names
    /// the first query without a pose.
    pub fn relative(
        &self,
        references: ArrayView2<'_, f32>,
        queries: ArrayView2<'_, f32>,
    ) -> Result<Vec<Pose>> {
        let (n, expected) = (queries.nrows(), self.dimension);
        for (what, expected, actual) in [
            ("values of a descriptor", expected, queries.ncols()),
            ("values of a descriptor", expected, references.ncols()),
            ("references, one per query", n, references.nrows()),
        ] {
            if expected != actual {
                return Err(CoreError::Mismatch { what, expected, actual }.into());
            }
        }
        let device = Device::flex();
        let tensor = |rows: ArrayView2<'_, f32>| {
            let values = rows.iter().copied().collect::<Vec<f32>>();
            Tensor::<2>::from_data(TensorData::new(values, [n, expected]), &device)
        };
        let bent = self.definition == Definition::Corrected;
        let found = self.head.forward(tensor(references), tensor(queries), bent).into_data();
        let values: Vec<f64> = found.iter::<f32>().map(f64::from).collect();
        let poses: Vec<Pose> = values.chunks(RELATIVE_POSE).map(pose).collect();
        vpr_core::Poses::SixDof(poses.clone()).check_finite()?;
        Ok(poses)
    }
}

/// `tx ty tz qw qx qy qz`; a quaternion of any length but zero.
fn pose(values: &[f64]) -> Pose {
    let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
    let turn = Quaternion::new(at(3), at(4), at(5), at(6));
    let turn = UnitQuaternion::try_new(turn, 1e-12).unwrap_or_default();
    Isometry3::from_parts(Translation3::new(at(0), at(1), at(2)), turn)
}

/// The head while it learns.
#[derive(Module, Debug)]
struct Pupil {
    head: RelativeHead,
    #[module(skip)]
    bent: bool,
}

impl Learner for Pupil {
    type Batch = PairBatch;

    fn learn(&self, batch: PairBatch, device: &Device) -> Tensor<1> {
        let (n, dim) = (batch.n, batch.targets.len() / batch.n.max(1));
        let tensor = |values: Vec<f32>, width: usize| {
            Tensor::<2>::from_data(TensorData::new(values, [n, width]), device)
        };
        let (anchors, targets) = (tensor(batch.anchors, dim), tensor(batch.targets, dim));
        let found = self.head.forward(anchors, targets, self.bent);
        relative_pose(found, tensor(batch.relative, RELATIVE_POSE))
    }
}

/// Trains a network for relative poses as [`super::train`] trains H. [`Definition::Published`] is the
/// released head, one linear map; [`Definition::Corrected`] bends between its layers.
///
/// # Errors
///
/// [`CoreError::Parameter`] for pairs whose relative poses are not in the anchors' axes; otherwise those
/// of [`super::train`].
pub fn train_pose(
    settings: &Training,
    definition: Definition,
    pairs: (&Pairs, &Pairs),
    run: &mut Run,
    folder: &Path,
    (output, facts): (&Path, &[(&str, String)]),
    observe: impl FnMut(&Report, f64) -> vpr_core::Result<()>,
) -> Result<PoseNetwork> {
    if pairs.0.definition() != Definition::Corrected {
        let (name, value) = ("definition", pairs.0.definition().to_string());
        let reason = "a pose is told in the axes of the anchor";
        return Err(CoreError::Parameter { name, value, reason }.into());
    }
    let (head, bent) = (RelativeHead::new(pairs.0.dim()), definition == Definition::Corrected);
    let fresh = seeded(Pupil { head, bent }, settings.seed);
    let (step, loss, path) =
        fitted(settings, fresh, pairs, (run, folder), |pupil| &pupil.head, observe)?;
    let mut head = RelativeHead::new(pairs.0.dim()).valid();
    Weights::open(&path)?.apply(&mut head)?;
    let mut facts: Vec<(&str, String)> =
        facts.iter().filter(|it| it.0 != "network").cloned().collect();
    facts.push(("network", NETWORK.to_owned()));
    facts.push(("activation", if bent { "gelu" } else { "none" }.to_owned()));
    facts.push(("best", format!("step {step}, validation loss {loss:.5}")));
    weights::save(&head, output, &facts, Precision::Half)?;
    PoseNetwork::open(output)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use vpr_core::{Descriptors, Map, Poses};

    use super::*;
    use crate::{regression::narrow, sequences};

    const DIM: usize = 12;

    /// Descriptors that say where on a line they were taken.
    fn pairs(n: usize) -> Pairs {
        let at = |row: usize| 0.1 * row as f64;
        let rows = Array2::from_shape_fn((n, DIM), |(row, column)| {
            narrow((at(row) + column as f64).sin())
        });
        let poses = (0..n).map(|row| Pose::translation(at(row), 0.0, 0.0)).collect();
        let map = Map::new(Descriptors::new(rows).unwrap(), Poses::SixDof(poses)).unwrap();
        Pairs::near(map, &sequences(None, n), (0.5, 10.0), Definition::Corrected).unwrap()
    }

    #[test]
    fn it_learns_how_far_along_a_line_two_images_are() {
        let folder = tempfile::tempdir().unwrap();
        let settings = Training {
            steps: 1000,
            batch: 16,
            rate: 5e-3,
            validated_every: 200,
            halved_every: 400,
            ..Training::default()
        };
        // One linear map cannot follow a sine, but knows which way.
        for (definition, share) in [(Definition::Published, 0.75), (Definition::Corrected, 0.5)] {
            let pairs = pairs(30);
            let facts = settings.facts(&pairs, &pairs, "a line");
            let name = definition.to_string();
            let (work, output) = (folder.path().join(&name), folder.path().join(name + ".st"));
            let log = settings.log(&output.with_extension("csv"));
            let mut run = Run::open(&work, &facts, log).unwrap();
            let (both, out) = ((&pairs, &pairs), (output.as_path(), &facts[..]));
            let network =
                train_pose(&settings, definition, both, &mut run, &work, out, |_, _| Ok(()))
                    .unwrap();
            assert_eq!(network.definition, definition);
            let batch = pairs.batch(0, 20, 1);
            let rows = |values: &[f32]| Array2::from_shape_vec((20, DIM), values.to_vec()).unwrap();
            let (anchors, targets) = (rows(&batch.anchors), rows(&batch.targets));
            let found = network.relative(anchors.view(), targets.view()).unwrap();
            let (mut error, mut plain) = (0.0, 0.0);
            for (found, truth) in found.iter().zip(batch.relative.chunks(RELATIVE_POSE)) {
                error += (found.translation.x - f64::from(truth[0])).abs();
                plain += f64::from(truth[0]).abs();
            }
            assert!(error < share * plain, "{definition}: {error} of {plain}");
            let short = anchors.slice(ndarray::s![.., ..2]);
            assert!(network.relative(short, targets.view()).is_err());
        }
        let h = folder.path().join("h");
        weights::save(&RelativeHead::new(2), &h, &[], Precision::Single).unwrap();
        let err = PoseNetwork::open(&h).unwrap_err().to_string();
        assert!(err.contains("relative poses"), "{err}");
    }

    #[test]
    fn a_quaternion_is_scaled_to_length_one() {
        let found = pose(&[1.0, 2.0, 3.0, 2.0, 0.0, 0.0, 0.0]);
        assert_eq!(found, Pose::translation(1.0, 2.0, 3.0));
        assert_eq!(pose(&[0.0; 7]), Pose::identity());
    }
}
