//! H as a strategy.

use std::path::Path;

use burn::{
    module::Module,
    tensor::{Device, Tensor, TensorData},
};
use vpr_core::{Definition, Error as CoreError};
use vpr_nets::{
    regress::{DescriptorRegressor, DescriptorRegressorConfig, RELATIVE_POSE, from_official},
    weights::Weights,
};

use super::relative_pose;
use crate::{
    Error, Result, Selection,
    regression::{Regressor, Request, Told},
};

/// The network H: one anchor, the one a target was placed from.
#[derive(Clone, Debug)]
pub struct NetworkRegressor {
    network: DescriptorRegressor,
    definition: Definition,
    dimension: usize,
    encoder: Option<String>,
    digest: String,
}

const NAME: &str = "network H";

impl NetworkRegressor {
    /// A trained network; `definition` is that of the relative poses it was trained on.
    #[must_use]
    pub fn new(network: DescriptorRegressor, dimension: usize, definition: Definition) -> Self {
        let network = network.valid();
        Self { network, definition, dimension, encoder: None, digest: String::new() }
    }

    /// Reads weights that [`super::train`] or the authors' code wrote. What ours say of the relative
    /// poses they were trained on counts; the authors' are [`Definition::Published`].
    ///
    /// # Errors
    ///
    /// [`vpr_nets::Error::Weights`] with keys that are missing, unexpected or of another shape;
    /// [`CoreError::Format`] if the file says what this program does not know.
    pub fn open(path: &Path) -> Result<Self> {
        let weights = Weights::open(path)?;
        let said = weights.facts().get("relative_pose").map(String::as_str);
        let definition = match said {
            None | Some("published") => Definition::Published,
            Some("corrected") => Definition::Corrected,
            Some(other) => {
                let reason = format!("`{}` is neither published nor corrected", shown(other));
                return Err(CoreError::format(path, "metadata `relative_pose`", reason).into());
            }
        };
        let encoder = weights.facts().get("encoder").cloned();
        let digest = weights.digest().to_owned();
        // The authors count activations too, so that they have no layer of an odd number.
        let is_official = weights.get("net_regdesc.1.weight").is_none();
        let weights = if is_official { from_official(weights) } else { weights };
        let config = DescriptorRegressorConfig::from_weights(&weights, "")?;
        let mut network = config.init(&Device::flex());
        weights.apply(&mut network)?;
        let dimension = config.dimension;
        Ok(Self { encoder, digest, ..Self::new(network, dimension, definition) })
    }

    /// Length of the descriptors it regresses.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Which relative poses it was trained on.
    #[must_use]
    pub fn definition(&self) -> Definition {
        self.definition
    }

    /// The encoder whose descriptors it was trained on, if the file says so.
    #[must_use]
    pub fn encoder(&self) -> Option<&str> {
        self.encoder.as_deref()
    }

    /// SHA-256 of the file, empty if there was none.
    #[must_use]
    pub fn digest(&self) -> &str {
        &self.digest
    }
}

/// The start of a text that somebody else wrote.
fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

impl Regressor for NetworkRegressor {
    fn name(&self) -> &'static str {
        NAME
    }

    fn selection(&self) -> Selection {
        Selection::Own
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        let (n, dim) = (requests.len(), self.dimension);
        if out.len() != n * dim {
            let (what, actual) = ("values of a descriptor", out.len() / n.max(1));
            return Err(CoreError::Mismatch { what, expected: dim, actual }.into());
        }
        if n == 0 {
            return Ok(Told::default());
        }
        let (mut anchors, mut relative) = (Vec::with_capacity(n * dim), Vec::new());
        for request in requests {
            let Some(anchor) = request.anchors.first() else {
                let (target, method) = (request.target, NAME);
                return Err(Error::TooFewAnchors { target, method, needed: 1, found: 0 });
            };
            anchors.extend_from_slice(anchor.descriptor);
            relative.extend(relative_pose(anchor.pose, &request.pose, self.definition));
        }
        let device = Device::flex();
        let tensor = |values: Vec<f32>, width: usize| {
            Tensor::<2>::from_data(TensorData::new(values, [n, width]), &device)
        };
        let found = self.network.forward(tensor(anchors, dim), tensor(relative, RELATIVE_POSE));
        let values = found.into_data();
        for (at, (out, value)) in out.iter_mut().zip(values.iter::<f32>()).enumerate() {
            if !value.is_finite() {
                let (target, column) = (requests[at / dim].target, at % dim);
                return Err(Error::NotFinite { target, column, value: f64::from(value) });
            }
            *out = value;
        }
        Ok(Told::default())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
    use vpr_core::Pose;

    use super::*;
    use crate::regression::Anchor;

    fn golden(name: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/copr_regressor").join(name)
    }

    fn regress(network: &NetworkRegressor, pairs: &[(Pose, Pose)], rows: &[f32]) -> Vec<f32> {
        let dim = network.dimension();
        let request = |(target, (anchor, pose)): (usize, &'_ (Pose, Pose))| {
            (target, *anchor, *pose, &rows[target * dim..][..dim])
        };
        let all: Vec<_> = pairs.iter().enumerate().map(request).collect();
        let requests: Vec<Request<'_>> = all
            .iter()
            .map(|(target, anchor, pose, descriptor)| Request {
                target: *target,
                pose: *pose,
                anchors: vec![Anchor { pose: anchor, descriptor }],
            })
            .collect();
        let mut out = vec![0.0; pairs.len() * dim];
        network.regress(&requests, &mut out).unwrap();
        out
    }

    #[test]
    fn published_is_the_official_network() {
        let io = Weights::open(&golden("io.safetensors")).unwrap();
        let values = |key: &str| io.get(key).unwrap().data.clone();
        let (relative, expected) = (values("input.relative_pose"), values("output.descriptor"));
        // The anchor stands at the origin; the official quaternions have any length.
        let pose = |way: &[f32]| {
            let [tx, ty, tz, w, i, j, k] = [0, 1, 2, 3, 4, 5, 6].map(|at| f64::from(way[at]));
            let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
            (Pose::identity(), Isometry3::from_parts(Translation3::new(tx, ty, tz), turn))
        };
        let pairs: Vec<_> = relative.chunks(RELATIVE_POSE).map(pose).collect();
        for file in ["weights.safetensors", "weights.pth"] {
            let network = NetworkRegressor::open(&golden(file)).unwrap();
            assert_eq!((network.dimension(), network.definition()), (32, Definition::Published));
            let found = regress(&network, &pairs, &values("input.anchor"));
            for (found, expected) in found.iter().zip(&expected) {
                approx::assert_abs_diff_eq!(found, expected, epsilon = 1e-4);
            }
        }
    }

    #[test]
    fn corrected_sees_the_same_in_a_turned_and_shifted_world() {
        let open = || NetworkRegressor::open(&golden("weights.safetensors")).unwrap();
        let rows: Vec<f32> = (0_u8..96).map(|at| f32::from(at).sin()).collect();
        let pose = |at: u8| {
            let [a, b, c] = [0.7, 1.1, 1.9].map(|rate: f64| (rate * f64::from(at)).sin());
            Isometry3::new([3.0 * a, 3.0 * b, 3.0 * c].into(), [c, a, b].into())
        };
        let pairs: Vec<(Pose, Pose)> = (0..3).map(|at| (pose(at), pose(at + 9))).collect();
        let by = Isometry3::new([40.0, -7.0, 3.0].into(), [1.0, -2.0, 0.5].into());
        let moved: Vec<_> =
            pairs.iter().map(|(anchor, target)| (by * anchor, by * target)).collect();
        let difference = |network: &NetworkRegressor| {
            let (here, there) = (regress(network, &pairs, &rows), regress(network, &moved, &rows));
            here.iter().zip(&there).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let corrected = NetworkRegressor { definition: Definition::Corrected, ..open() };
        assert!(difference(&corrected) < 1e-4, "{}", difference(&corrected));
        assert!(difference(&open()) > 1e-2, "the released one does not: {}", difference(&open()));
    }

    #[test]
    fn descriptors_of_another_length_are_refused() {
        let network = NetworkRegressor::open(&golden("weights.safetensors")).unwrap();
        let pose = Pose::identity();
        let anchors = vec![Anchor { pose: &pose, descriptor: &[1.0, 2.0] }];
        let requests = [Request { target: 0, pose, anchors }];
        let err = network.regress(&requests, &mut [0.0; 2]).unwrap_err().to_string();
        assert!(err.contains("expected 32, got 2"), "{err}");
    }
}
