//! The techniques of chapter 3: what they are called and which run here.

mod hand_crafted;
mod network;

use serde::{Deserialize, Serialize};

pub use hand_crafted::{Describe, Features, HandCrafted, Matched};
pub use network::{Network, networks};

/// One of the ten techniques of the thesis.
///
/// All ten have stored matches for some datasets; HOG and `CoHOG` also run here, from images.
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
            assert_eq!(serde_json::to_value(technique).unwrap(), technique.name());
        }
    }
}
