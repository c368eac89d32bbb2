//! The two sets of images that a truth is about.

use std::path::{Path, PathBuf};

/// The images of one side: how many, and what they are called if they have names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Side {
    /// Number of images.
    pub len: usize,
    /// Their names in order, paths for images of a folder.
    pub names: Option<Vec<String>>,
    /// The folder that their names begin with.
    pub folder: Option<PathBuf>,
}

/// Queries and references.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sides {
    /// What is looked up.
    pub queries: Side,
    /// What it is looked up in.
    pub references: Side,
}

impl Side {
    /// Images without names.
    #[must_use]
    pub fn numbered(len: usize) -> Self {
        Self { len, names: None, folder: None }
    }

    /// Images by name.
    #[must_use]
    pub fn named(names: Vec<String>) -> Self {
        Self { len: names.len(), names: Some(names), folder: None }
    }

    /// Image files below a folder.
    #[must_use]
    pub fn images(folder: &Path, images: &[PathBuf]) -> Self {
        let names = images.iter().map(|image| image.to_string_lossy().into_owned()).collect();
        Self { folder: Some(folder.to_owned()), ..Self::named(names) }
    }

    /// The name of one image, or its number.
    #[must_use]
    pub fn name(&self, index: usize) -> String {
        let name = self.names.as_ref().and_then(|names| names.get(index));
        name.cloned().unwrap_or_else(|| index.to_string())
    }
}
