//! The registry of techniques: what each is called in the thesis, in tables and where it is typed,
//! and what runs here.
//!
//! A technique is added by its own files and one line of `HAND_CRAFTED` or `NETWORKS`; every
//! table, command and cache learns of it from there.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
#[cfg(not(feature = "networks"))]
use vpr_core::Error;
use vpr_core::Result;
use vpr_data::DataRoots;
use vpr_vision::{cohog::CoHogParams, hog::HogParams};

use crate::{Describe, HandCrafted, Vlad};

/// A technique that runs here.
#[derive(Clone)]
pub struct Runner {
    /// Its name where it is typed.
    pub name: String,
    /// Its column in tables.
    pub column: &'static str,
    /// The name of what it gives where datasets under encoders are rows.
    pub encoder: String,
    /// What it does with images.
    pub technique: Arc<dyn Describe>,
}

/// A technique by name, if what it needs is at hand.
#[derive(Clone)]
pub enum Found {
    /// It runs here.
    Runs(Runner),
    /// Its weights are not at hand: which, and where they are from.
    Absent(String),
}

/// A hand-crafted technique: name, column, configuration.
type HandCraftedEntry = (&'static str, &'static str, fn() -> HandCrafted);

/// Name of HOG in the thesis' own configuration, which is not the released one (VB-11).
pub const HOG_THESIS: &str = "hog-thesis";

/// Techniques without a network.
const HAND_CRAFTED: [HandCraftedEntry; 3] = [
    ("hog", "HOG", || HandCrafted::Hog(HogParams::RELEASED)),
    (HOG_THESIS, "HOG, thesis configuration", || HandCrafted::Hog(HogParams::THESIS)),
    ("cohog", "CoHOG", || HandCrafted::CoHog(CoHogParams::default())),
];

/// Techniques without a network that run where they are asked for, and have no column where all run:
/// they take seconds per image, or are no technique of the thesis.
const ON_REQUEST: [HandCraftedEntry; 2] = [
    ("dense-vlad", "DenseVLAD", || HandCrafted::Vlad(Vlad::Dense)),
    ("hog-vlad", "VLAD of HOG cells", || HandCrafted::Vlad(Vlad::Hog)),
];

/// Networks that have a column wherever their weights are at hand: name in the registry of
/// weights, column. None is one of the thesis' ten: its NetVLAD is VGG-16. Every other name of that
/// registry runs as well where it is asked for.
const NETWORKS: [(&str, &str); 2] =
    [("default", "default network"), ("netvlad-mobilenetv2-rgb", "NetVLAD, MobileNetV2")];

/// Networks that have a column name, but no column where all run: other heads on the trunk of the
/// default network, whose weights are in `data/models` of every clone.
const HEADS: [(&str, &str); 2] =
    [("boq-default", "BoQ, default trunk"), ("salad-default", "SALAD, default trunk")];

/// A technique without a network by its name.
#[must_use]
pub fn hand_crafted(name: &str) -> Option<Runner> {
    let (name, column, make) =
        HAND_CRAFTED.into_iter().chain(ON_REQUEST).find(|entry| entry.0 == name)?;
    let (name, encoder) = (name.to_owned(), column.to_owned());
    Some(Runner { name, column, encoder, technique: Arc::new(make()) })
}

/// The names of techniques without a network that have a column.
pub fn hand_crafted_names() -> impl Iterator<Item = &'static str> {
    HAND_CRAFTED.into_iter().map(|entry| entry.0)
}

/// The names of techniques without a network that run where they are asked for.
pub fn on_request_names() -> impl Iterator<Item = &'static str> {
    ON_REQUEST.into_iter().map(|entry| entry.0)
}

/// The techniques that have a column, in order: those without a network, then the networks whose
/// weights are at hand.
///
/// # Errors
///
/// Weights that are there but are not those of the network.
pub fn runners(roots: &DataRoots) -> Result<Vec<Runner>> {
    let mut runners: Vec<Runner> = hand_crafted_names().filter_map(hand_crafted).collect();
    for name in network_names() {
        if let Found::Runs(runner) = find(name, roots)? {
            runners.push(runner);
        }
    }
    Ok(runners)
}

/// A technique by its name.
///
/// # Errors
///
/// [`vpr_core::Error::Unknown`] with the names there are; weights that are there but are not those of the
/// network.
pub fn find(name: &str, roots: &DataRoots) -> Result<Found> {
    match hand_crafted(name) {
        Some(runner) => Ok(Found::Runs(runner)),
        None => network(name, roots),
    }
}

/// Names and columns of the networks whose weights are not at hand, or that this program was built
/// without.
///
/// # Errors
///
/// Weights that are there but are not those of the network.
pub(crate) fn without_weights(find: impl Fn(&str) -> Result<Found>) -> Result<Vec<&'static str>> {
    let mut names = Vec::new();
    for (name, column) in NETWORKS {
        if matches!(find(name)?, Found::Absent(_)) {
            names.extend([name, column]);
        }
    }
    Ok(names)
}

#[cfg(feature = "networks")]
fn network_names() -> impl Iterator<Item = &'static str> {
    NETWORKS.into_iter().map(|entry| entry.0)
}

#[cfg(not(feature = "networks"))]
fn network_names() -> impl Iterator<Item = &'static str> {
    std::iter::empty()
}

#[cfg(feature = "networks")]
fn network(name: &str, roots: &DataRoots) -> Result<Found> {
    use vpr_nets::encode::{by_name, registry::Method};

    let method = Method::find(name, None)?;
    let dimension = method.dimension(None)?;
    if method.locate(dimension, &roots.roots).is_none() {
        let origin = method.origin(dimension);
        return Ok(Found::Absent(format!("{name}: its weights are not at hand; origin: {origin}")));
    }
    let named = NETWORKS.into_iter().chain(HEADS);
    let column = named.into_iter().find(|entry| entry.0 == name).map_or("network", |it| it.1);
    let technique = Arc::new(crate::Network::new(by_name(name, None, &roots.roots)?.into()));
    let (name, encoder) = (name.to_owned(), name.to_owned());
    Ok(Found::Runs(Runner { name, column, encoder, technique }))
}

#[cfg(not(feature = "networks"))]
fn network(name: &str, _: &DataRoots) -> Result<Found> {
    if NETWORKS.iter().any(|entry| entry.0 == name) {
        return Ok(Found::Absent(format!("{name}: this program was built without networks")));
    }
    let known = hand_crafted_names()
        .chain(on_request_names())
        .chain(NETWORKS.into_iter().map(|entry| entry.0));
    let known = known.collect::<Vec<_>>().join(", ");
    Err(Error::Unknown { kind: "technique", name: name.to_owned(), known })
}

/// One of the ten techniques of the thesis.
///
/// All ten have stored matches for some datasets; HOG, `CoHOG` and `DenseVLAD` also run here, from images,
/// and the others where their weights are at hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Technique {
    /// `NetVLAD`, VGG-16, 4096 dimensions (Arandjelović et al. 2016).
    #[serde(rename = "NetVLAD")]
    NetVlad,
    /// `Region-VLAD` on `AlexNet`-Places365 (Khaliq et al. 2020).
    #[serde(rename = "RegionVLAD")]
    RegionVlad,
    /// Regional HOG with entropy-based regions (Zaffar et al. 2020).
    #[serde(rename = "CoHOG")]
    CoHog,
    /// One HOG descriptor of the whole image (Dalal and Triggs 2005).
    #[serde(rename = "HOG")]
    Hog,
    /// `AlexNet` conv3 with random projections (Sünderhauf et al. 2015).
    AlexNet,
    /// `AMOSNet` conv5 with spatial pyramid (Chen et al. 2017).
    #[serde(rename = "AMOSNet")]
    AmosNet,
    /// `HybridNet` conv5 with spatial pyramid (Chen et al. 2017).
    HybridNet,
    /// Convolutional auto-encoder of HOG (Merrill and Huang 2018).
    #[serde(rename = "CALC")]
    Calc,
    /// ResNet-101 with generalised mean pooling and average-precision loss (Revaud et al. 2019).
    #[serde(rename = "AP-GeM")]
    ApGem,
    /// VLAD of dense SIFT (Torii et al. 2015).
    #[serde(rename = "DenseVLAD")]
    DenseVlad,
}

impl Technique {
    /// All ten, in the column order of table 3.5.
    pub const ALL: [Self; 10] = [
        Self::NetVlad,
        Self::RegionVlad,
        Self::CoHog,
        Self::Hog,
        Self::AlexNet,
        Self::AmosNet,
        Self::HybridNet,
        Self::Calc,
        Self::ApGem,
        Self::DenseVlad,
    ];

    /// The name as the thesis prints it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NetVlad => "NetVLAD",
            Self::RegionVlad => "RegionVLAD",
            Self::CoHog => "CoHOG",
            Self::Hog => "HOG",
            Self::AlexNet => "AlexNet",
            Self::AmosNet => "AMOSNet",
            Self::HybridNet => "HybridNet",
            Self::Calc => "CALC",
            Self::ApGem => "AP-GeM",
            Self::DenseVlad => "DenseVLAD",
        }
    }

    /// The name where it is typed, as in `--method`.
    #[must_use]
    pub fn typed_name(self) -> &'static str {
        match self {
            Self::NetVlad => "netvlad",
            Self::RegionVlad => "regionvlad",
            Self::CoHog => "cohog",
            Self::Hog => "hog",
            Self::AlexNet => "alexnet",
            Self::AmosNet => "amosnet",
            Self::HybridNet => "hybridnet",
            Self::Calc => "calc",
            Self::ApGem => "ap-gem",
            Self::DenseVlad => "dense-vlad",
        }
    }

    /// The name VPR-Bench gives its folder of stored matches and its entries of dictionaries.
    #[must_use]
    pub fn stored_name(self) -> &'static str {
        match self {
            Self::AlexNet => "AlexNet_VPR",
            Self::ApGem => "ap-gem-r101",
            Self::DenseVlad => "denseVLAD",
            _ => self.name(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_is_the_one_in_experiment_files() {
        for technique in Technique::ALL {
            #[cfg(feature = "networks")]
            assert!(find(technique.typed_name(), &DataRoots::default()).is_ok());
            assert_eq!(serde_json::to_value(technique).unwrap(), technique.name());
        }
    }
}
