//! An encoder as a file of safetensors: the words in half precision, the projection in bytes.

use std::{collections::HashMap, path::Path};

use half::f16;
use ndarray::Array2;
use safetensors::{
    Dtype, SafeTensors,
    tensor::{TensorView, serialize},
};
use vpr_core::{Descriptors, Error, Result, map::BlockDigest};

use super::{Local, Projection, VladEncoder, Vocabulary};

/// The fact under which the local features are kept.
const LOCAL: &str = "local";

impl VladEncoder {
    /// What [`Self::read`] reads; `facts` say how it was made.
    ///
    /// # Errors
    ///
    /// None for an encoder that [`Self::new`] accepted.
    pub fn to_bytes(&self, facts: &[(&str, String)]) -> Result<Vec<u8>> {
        let refuse = |reason: String| Error::format("vocabulary", "content", reason);
        let halves = |values: &[f32]| -> Vec<u8> {
            values.iter().flat_map(|&it| f16::from_f32(it).to_le_bytes()).collect()
        };
        let centres = self.vocabulary.centres();
        let mut parts = vec![(
            "words",
            Dtype::F16,
            vec![centres.len(), centres.dim()],
            halves(centres.as_slice()),
        )];
        if let Some(projection) = &self.projection {
            let shape = vec![projection.scales.len(), projection.mean.len()];
            let scales = projection.scales.iter().flat_map(|it| it.to_le_bytes()).collect();
            let bytes = projection.bytes.iter().map(|it| it.to_le_bytes()[0]).collect();
            parts.push(("projection.mean", Dtype::F16, vec![shape[1]], halves(&projection.mean)));
            parts.push(("projection.scales", Dtype::F32, vec![shape[0]], scales));
            parts.push(("projection.components", Dtype::I8, shape, bytes));
        }
        let mut tensors = Vec::new();
        for (name, dtype, shape, bytes) in &parts {
            let view = TensorView::new(*dtype, shape.clone(), bytes);
            tensors.push((*name, view.map_err(|err| refuse(err.to_string()))?));
        }
        let mut told: HashMap<String, String> =
            facts.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
        let local = serde_json::to_string(&self.local).map_err(|err| refuse(err.to_string()))?;
        told.insert(LOCAL.to_owned(), local);
        serialize(tensors, Some(told)).map_err(|err| refuse(err.to_string()))
    }

    /// Digest of the words and the projection, in hexadecimal: encoders with the same digest and the
    /// same [`Self::local`] give the same numbers.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut bytes: Vec<u8> = Vec::new();
        let mut floats =
            |values: &[f32]| bytes.extend(values.iter().flat_map(|it| it.to_le_bytes()));
        floats(self.vocabulary.centres().as_slice());
        if let Some(projection) = &self.projection {
            floats(&projection.mean);
            floats(&projection.scales);
            bytes.extend(projection.bytes.iter().map(|it| it.to_le_bytes()[0]));
        }
        BlockDigest::of(&bytes).to_hex()
    }

    /// Reads an encoder; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if something is missing, of another shape or type, or not finite.
    pub fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let refuse = |place: &str, reason: String| Error::format(path, place, reason);
        let (_, metadata) =
            SafeTensors::read_metadata(bytes).map_err(|err| refuse("header", err.to_string()))?;
        let tensors =
            SafeTensors::deserialize(bytes).map_err(|err| refuse("header", err.to_string()))?;
        let local = metadata.metadata().as_ref().and_then(|facts| facts.get(LOCAL));
        let local = local.ok_or_else(|| refuse(LOCAL, "is missing".to_owned()))?;
        let local: Local =
            serde_json::from_str(local).map_err(|err| refuse(LOCAL, err.to_string()))?;
        let part = |name: &str, dtype: Dtype, axes: usize| {
            let view = tensors.tensor(name).map_err(|err| refuse(name, err.to_string()))?;
            if view.dtype() != dtype || view.shape().len() != axes {
                let (found, shape) = (view.dtype(), view.shape());
                return Err(refuse(name, format!("{found:?} of shape {shape:?}")));
            }
            Ok(view)
        };
        let halves = |bytes: &[u8]| -> Vec<f32> {
            bytes.as_chunks().0.iter().map(|&it| f16::from_le_bytes(it).to_f32()).collect()
        };
        let words = part("words", Dtype::F16, 2)?;
        let shape = (words.shape()[0], words.shape()[1]);
        let rows = Array2::from_shape_vec(shape, halves(words.data()));
        let rows = rows.map_err(|err| refuse("words", err.to_string()))?;
        if rows.is_empty() {
            return Err(refuse("words", "there are none".to_owned()));
        }
        let vocabulary = Vocabulary::from_centres(Descriptors::new(rows)?);
        let projection = if tensors.tensor("projection.components").is_err() {
            None
        } else {
            let components = part("projection.components", Dtype::I8, 2)?;
            let mean = halves(part("projection.mean", Dtype::F16, 1)?.data());
            let scales = part("projection.scales", Dtype::F32, 1)?;
            let scales = scales.data().as_chunks().0.iter().copied().map(f32::from_le_bytes);
            let scales: Vec<f32> = scales.collect();
            let bytes = components.data().iter().map(|&it| i8::from_le_bytes([it])).collect();
            if components.shape() != [scales.len(), mean.len()] {
                let reason = "means and scales do not belong to them".to_owned();
                return Err(refuse("projection.components", reason));
            }
            if !mean.iter().chain(&scales).all(|it| it.is_finite()) {
                return Err(refuse("projection.mean", "is not finite".to_owned()));
            }
            Some(Projection { mean, scales, bytes })
        };
        Self::new(local, vocabulary, projection).map_err(|err| err.in_file(path))
    }
}
