//! Published weights: read key by key, never executed.
//!
//! `.pth`/`.pt` files of PyTorch (zip archives since 1.6, and the older sequence of pickles) and
//! `.safetensors`, told apart by content; by their names Caffe's `.caffemodel`, mean images (`.binaryproto`,
//! `.npy`) and `.pkl`, scikit-learn's estimators. All become f32; a NaN or infinity is refused.
//! The reader is our own: pickles are decoded by `vpr-core`, a fixed list of opcodes and names,
//! and what is allocated is bounded by the length of the file.
//!
//! ```no_run
//! # fn example(network: &mut vpr_nets::layer::Conv2d) -> vpr_nets::Result<()> {
//! // A checkpoint whose keys begin with `backbone.`; its classifier is not part of the network.
//! let report = vpr_nets::weights::load(
//!     network,
//!     "resnet.pth".as_ref(),
//!     &[(r"^backbone\.", ""), (r"^fc\..*", "")],
//! )?;
//! println!("{report}");
//! # Ok(()) }
//! ```

mod apply;
mod caffe;
mod checkpoint;
mod estimators;
mod legacy;
mod mean_image;
mod prefix;
mod safetensors;
mod save;
mod shapes;
mod storage;
mod zip;

use std::{collections::BTreeMap, fmt, fs, path::Path};

use burn::store::{KeyRemapper, ModuleSnapshot};
use sha2::{Digest as _, Sha256};

pub(crate) use mean_image::MEAN_IMAGE;
pub use prefix::{Fitted, fit};
pub use save::{Precision, save};
pub(crate) use shapes::Shapes;

use crate::{Error, Result};

/// One tensor of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Length along each axis; empty for a single number.
    pub shape: Vec<usize>,
    /// The elements in row-major order, all finite.
    pub data: Vec<f32>,
}

/// All tensors of a file by key.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    path: std::path::PathBuf,
    digest: String,
    facts: BTreeMap<String, String>,
    tensors: BTreeMap<String, Tensor>,
}

/// What [`load`] did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Number of tensors that the network took.
    pub n_tensors: usize,
    /// Number of values in them.
    pub n_values: usize,
    /// SHA-256 of the file, in hexadecimal.
    pub digest: String,
    /// What all keys began with and was left out.
    pub prefix: Option<String>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { n_tensors, n_values, digest, prefix } = self;
        write!(f, "{n_tensors} tensors, {n_values} values, sha256 {digest}")?;
        match prefix {
            Some(prefix) => write!(f, "; keys begin with `{prefix}`, which is left out"),
            None => Ok(()),
        }
    }
}

/// Gives `module` the weights of the file at `path`, all of them.
///
/// `renames` are regular expressions, applied in order to each key of the file; a key that becomes
/// empty is left out. Modules are compared by PyTorch's names: a batch norm has `weight` and
/// `bias`, a linear layer an `out × in` weight. `num_batches_tracked` does not count. A prefix of all
/// keys that makes them fit is left out, see [`fit`].
///
/// # Errors
///
/// [`Error::Weights`] lists every missing, unexpected and mis-shaped key, and `module` stays as it
/// was; errors of [`Weights::open`]; [`Error::Pattern`].
pub fn load<M: ModuleSnapshot>(
    module: &mut M,
    path: &Path,
    renames: &[(&str, &str)],
) -> Result<Report> {
    let build = |weights: Weights| weights.renamed(renames)?.apply(module);
    let Fitted { value, prefix } = fit(|| Weights::open(path), build)?;
    Ok(Report { prefix, ..value })
}

impl Weights {
    /// Reads a file, whatever its format.
    ///
    /// Of a checkpoint that is a dictionary with an entry `state_dict`, `model_state_dict` or
    /// `model`, that entry is read; other nested dictionaries are flattened, keys joined by dots.
    /// A prefix `module.` that all keys share is removed. Of estimators of scikit-learn, which AP-GeM's
    /// checkpoint has beside its weights and `.pkl` files are, arrays are tensors, such as
    /// `pca.Landmarks_clean.mean_`; what else is no tensor is left out. A mean image is the tensor
    /// `mean_image`.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Io`]; [`vpr_core::Error::Format`] with key or byte where the file is
    /// truncated, malformed, names what is not on the list, or holds a NaN or infinity.
    pub fn open(path: &Path) -> Result<Self> {
        Self::read(path, &fs::read(path).map_err(vpr_core::Error::io(path))?)
    }

    /// The same of bytes; `path` is what errors call them.
    ///
    /// # Errors
    ///
    /// Those of [`Self::open`], reading apart.
    pub fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut facts = BTreeMap::new();
        let mut beside = BTreeMap::new();
        let tensors = if caffe::is_caffe(path) {
            caffe::read(path, bytes)?
        } else if estimators::is_pickle(path) {
            estimators::read(path, bytes)?
        } else if mean_image::is_mean_image(path) {
            mean_image::read(path, bytes)?
        } else if zip::is_archive(bytes) {
            let [tensors, arrays] = zip::read(path, bytes)?;
            beside = arrays;
            tensors
        } else if legacy::is_legacy(bytes) {
            let [tensors, arrays] = legacy::read(path, bytes)?;
            beside = arrays;
            tensors
        } else {
            facts = safetensors::facts(path, bytes)?;
            safetensors::read(path, bytes)?
        };
        if tensors.is_empty() {
            return Err(Error::format(path, "content", "there is no tensor in it"));
        }
        let mut tensors = storage::without_shared_prefix(tensors);
        // Weights are first, should one be called like an array.
        tensors.extend(
            beside.into_iter().filter(|(key, _)| !tensors.contains_key(key)).collect::<Vec<_>>(),
        );
        let digest = hexadecimal(&Sha256::digest(bytes));
        Ok(Self { path: path.to_owned(), digest, facts, tensors })
    }

    /// The file they are from.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// SHA-256 of the file, in hexadecimal.
    #[must_use]
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// What [`save`] was given beside the weights; nothing for formats that have no place for it.
    #[must_use]
    pub fn facts(&self) -> &BTreeMap<String, String> {
        &self.facts
    }

    /// Keys in order, each with its tensor.
    #[must_use]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&str, &Tensor)> {
        self.tensors.iter().map(|(key, tensor)| (key.as_str(), tensor))
    }

    /// The tensor of one key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Tensor> {
        self.tensors.get(key)
    }

    /// These with those of another file, whose keys must be others; the digest is that of both digests.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Format`] if both have a key.
    pub fn joined(mut self, other: Self) -> Result<Self> {
        for (key, tensor) in other.tensors {
            if self.tensors.contains_key(&key) {
                let reason = format!("{} has it too", self.path.display());
                return Err(Error::format(&other.path, key, reason));
            }
            self.tensors.insert(key, tensor);
        }
        self.digest = hexadecimal(&Sha256::digest(format!("{}{}", self.digest, other.digest)));
        Ok(self)
    }

    /// Takes the tensor of `key` out, whatever its shape.
    pub(crate) fn take_any(&mut self, key: &str) -> Option<Tensor> {
        self.tensors.remove(key)
    }

    /// Takes the tensor of `key` out, which must have `shape`.
    ///
    /// # Errors
    ///
    /// [`Error::Weights`] if it is missing or has another shape.
    pub fn take(&mut self, key: &str, shape: &[usize]) -> Result<Tensor> {
        let mut mismatch = crate::Mismatch::default();
        match self.tensors.remove(key) {
            Some(tensor) if tensor.shape == shape => return Ok(tensor),
            Some(tensor) => {
                mismatch.shapes.push((key.to_owned(), shape.to_vec(), tensor.shape));
            }
            None => mismatch.missing.push(key.to_owned()),
        }
        Err(Error::Weights { path: self.path.clone(), mismatch: Box::new(mismatch) })
    }

    /// Adds or replaces the tensor of `key`.
    pub fn put(&mut self, key: &str, tensor: Tensor) {
        self.tensors.insert(key.to_owned(), tensor);
    }

    /// The same tensors under changed keys or shapes; `None` leaves one out.
    #[must_use]
    pub fn mapped(
        mut self,
        mut map: impl FnMut(String, Tensor) -> Option<(String, Tensor)>,
    ) -> Self {
        let tensors = std::mem::take(&mut self.tensors);
        self.tensors = tensors.into_iter().filter_map(|(key, tensor)| map(key, tensor)).collect();
        self
    }

    /// The same tensors under other keys: as in [`load`].
    ///
    /// # Errors
    ///
    /// [`Error::Pattern`]; [`vpr_core::Error::Format`] if two keys become one.
    pub fn renamed(mut self, renames: &[(&str, &str)]) -> Result<Self> {
        let mut remapper = KeyRemapper::new();
        for &(pattern, replacement) in renames {
            remapper = remapper.add_pattern(pattern, replacement).map_err(|err| {
                Error::Pattern { pattern: pattern.to_owned(), reason: err.to_string() }
            })?;
        }
        let pairs = remapper.to_regex_pairs();
        for (key, tensor) in std::mem::take(&mut self.tensors) {
            let new_key = pairs.iter().fold(key.clone(), |key, (pattern, replacement)| {
                pattern.replace_all(&key, replacement).into_owned()
            });
            if !new_key.is_empty() && self.tensors.insert(new_key.clone(), tensor).is_some() {
                let reason = format!("another key is renamed to `{new_key}` as well");
                return Err(Error::format(&self.path, key, reason));
            }
        }
        Ok(self)
    }

    /// Gives all tensors to `module`.
    ///
    /// # Errors
    ///
    /// [`Error::Weights`] as for [`load`].
    pub fn apply<M: ModuleSnapshot>(self, module: &mut M) -> Result<Report> {
        let Self { path, digest, tensors, .. } = self;
        let (n_tensors, n_values) = apply::apply(&path, tensors, module)?;
        Ok(Report { n_tensors, n_values, digest, prefix: None })
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    use fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
