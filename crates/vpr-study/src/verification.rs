//! Geometric verification: the one table of local features, and inliers of best matches.

use std::{
    collections::BTreeMap,
    fmt,
    path::{Path, PathBuf},
    str::FromStr,
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use vpr_core::{Error, Result};
use vpr_data::DataRoots;
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image,
    matching::{MatchParams, match_features},
    ransac::{RansacParams, correspondences, fundamental, homography},
};

use crate::{Sources, Store};

/// Features kept per image (thesis §5.3.1).
const FEATURES: usize = 5000;

/// Keypoints with their descriptors, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LocalFeature {
    /// SIFT (Lowe 2004), as OpenCV's.
    Sift,
    /// ORB (Rublee et al. 2011), as ORB-SLAM3's.
    Orb,
    /// `XFeat` (Potje et al. 2024).
    XFeat,
    /// DISK (Tyszkiewicz et al. 2020).
    Disk,
    /// `SuperPoint` (`DeTone` et al. 2018).
    SuperPoint,
    /// DELF-style attentive features (Noh et al. 2017).
    Delf,
}

/// A local feature with its weights.
pub struct Opened {
    /// Finds and describes keypoints.
    pub extractor: Box<dyn Extractor>,
    /// Digest of its weights; empty without.
    pub weights: String,
}

impl LocalFeature {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Sift, Self::Orb, Self::XFeat, Self::Disk, Self::SuperPoint, Self::Delf];

    /// Its name where it is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sift => "sift",
            Self::Orb => "orb",
            Self::XFeat => "xfeat",
            Self::Disk => "disk",
            Self::SuperPoint => "superpoint",
            Self::Delf => "delf",
        }
    }

    /// The names under which its weights are published, of which one is looked for below `weights/`
    /// of a data folder; none if it has no weights.
    #[must_use]
    pub fn weights(self) -> &'static [&'static str] {
        match self {
            Self::Sift | Self::Orb => &[],
            Self::XFeat => &["xfeat.pt"],
            Self::Disk => &["disk-depth-save.pth"],
            Self::SuperPoint => &["superpoint_v6_from_tf.pth", "superpoint_v1.pth"],
            Self::Delf => &["delf.pth"],
        }
    }

    /// Whether it is a network.
    #[must_use]
    pub fn is_learned(self) -> bool {
        !self.weights().is_empty()
    }

    /// The file of its weights in one of these folders; what is missing, in words, if none has it.
    ///
    /// # Errors
    ///
    /// A folder that cannot be searched.
    pub fn find_weights(self, roots: &DataRoots) -> Result<Result<Option<PathBuf>, String>> {
        if !self.is_learned() {
            return Ok(Ok(None));
        }
        for file in self.weights() {
            if let Some(path) = roots.locate(&Path::new("weights").join(file))? {
                return Ok(Ok(Some(path)));
            }
        }
        Ok(Err(format!("its weights, weights/{}, are not at hand", self.weights().join(" or "))))
    }

    /// The features with these weights, keeping at most `keypoints` per image.
    ///
    /// # Errors
    ///
    /// Weights that cannot be read or are not those of the network.
    #[cfg(feature = "networks")]
    pub fn open(self, weights: Option<&Path>, keypoints: usize) -> Result<Opened> {
        let digest = match weights {
            Some(path) => vpr_nets::weights::Weights::open(path)?.digest().to_owned(),
            None => String::new(),
        };
        let extractor = vpr_nets::local::by_name(self.name(), weights, keypoints)?;
        Ok(Opened { extractor, weights: digest })
    }

    /// The features, keeping at most `keypoints` per image.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for a network: this program was built without.
    #[cfg(not(feature = "networks"))]
    pub fn open(self, _: Option<&Path>, keypoints: usize) -> Result<Opened> {
        use vpr_vision::{
            orb::{Orb, OrbParams},
            sift::{Sift, SiftParams},
        };
        let features = keypoints;
        let extractor: Box<dyn Extractor> = match self {
            Self::Sift => Box::new(Sift(SiftParams { features, ..SiftParams::default() })),
            Self::Orb => Box::new(Orb(OrbParams { features, ..OrbParams::default() })),
            _ => {
                let reason = "this program was built without networks";
                let value = self.name().to_owned();
                return Err(Error::Parameter { name: "features", value, reason });
            }
        };
        Ok(Opened { extractor, weights: String::new() })
    }
}

impl fmt::Display for LocalFeature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for LocalFeature {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|it| it.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            Error::Unknown { kind: "local feature", name: name.to_owned(), known }
        })
    }
}

/// Local features and a geometric model, as the thesis sets them: 5 000 features, ratio 0.6,
/// 1 000 RANSAC iterations (§5.3.1); a homography as the released code, where not named otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LocalMethod {
    /// SIFT and a homography.
    Sift,
    /// SIFT and a fundamental matrix.
    SiftFundamental,
    /// DELF.
    Delf,
    /// `SuperPoint`.
    #[serde(rename = "superpoint")]
    SuperPoint,
    /// `XFeat`.
    #[serde(rename = "xfeat")]
    XFeat,
    /// DISK.
    Disk,
}

/// What verification of matches gave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verified {
    /// Inliers of every query with its best reference.
    Counts(Vec<usize>),
    /// Images or weights are not at hand, and which.
    NotAtHand(String),
}

/// A local method with its weights.
pub struct Verifier {
    method: LocalMethod,
    features: Opened,
}

/// The matches to verify: queries, references, and which reference each query was matched with.
#[derive(Clone, Copy, Debug)]
pub struct Matches<'a> {
    /// Images of the queries.
    pub queries: &'a [PathBuf],
    /// Images of the references.
    pub references: &'a [PathBuf],
    /// Index of a reference, one per query.
    pub best: &'a [usize],
}

impl LocalMethod {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Sift, Self::SiftFundamental, Self::Delf, Self::SuperPoint, Self::XFeat, Self::Disk];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sift => "SIFT-RANSAC",
            Self::SiftFundamental => "SIFT-RANSAC, fundamental",
            Self::Delf => "DELF-RANSAC",
            Self::SuperPoint => "Super-RANSAC",
            Self::XFeat => "XFeat-RANSAC",
            Self::Disk => "DISK-RANSAC",
        }
    }

    /// Its local features.
    #[must_use]
    pub fn features(self) -> LocalFeature {
        match self {
            Self::Sift | Self::SiftFundamental => LocalFeature::Sift,
            Self::Delf => LocalFeature::Delf,
            Self::SuperPoint => LocalFeature::SuperPoint,
            Self::XFeat => LocalFeature::XFeat,
            Self::Disk => LocalFeature::Disk,
        }
    }

    /// The method with its weights from one of these folders; `Err` inside is what is missing.
    ///
    /// # Errors
    ///
    /// Weights that are there but are not those of the network.
    pub fn open(self, roots: &DataRoots) -> Result<Result<Verifier, String>> {
        Ok(match self.features().find_weights(roots)? {
            Ok(weights) => {
                let features = self.features().open(weights.as_deref(), FEATURES)?;
                Ok(Verifier { method: self, features })
            }
            Err(why) => Err(why),
        })
    }
}

impl Verifier {
    /// Finds and describes the features of one image.
    ///
    /// # Errors
    ///
    /// If the file cannot be read or decoded, by its path.
    pub fn detect(&self, path: &Path) -> Result<LocalFeatures> {
        let image = image::decode(path)?;
        self.features.extractor.extract(&image).map_err(|err| err.in_file(path))
    }

    /// How many matched features agree in one model.
    ///
    /// # Errors
    ///
    /// Those of matching and RANSAC for malformed features.
    pub fn verify(&self, query: &LocalFeatures, reference: &LocalFeatures) -> Result<usize> {
        let matches = match_features(query, reference, &MatchParams::RATIO)?;
        let points = correspondences(query, reference, &matches);
        Ok(match self.method {
            LocalMethod::SiftFundamental => fundamental(&points, &RansacParams::EPIPOLAR)?.count(),
            _ => homography(&points, &RansacParams::HOMOGRAPHY)?.count(),
        })
    }

    /// Everything a count depends on besides the images.
    fn digest(&self) -> String {
        let ransac = serde_json::to_string(&[RansacParams::HOMOGRAPHY, RansacParams::EPIPOLAR]);
        let (method, weights) = (self.method, &self.features.weights);
        format!("inliers 3 {method:?} {FEATURES} {weights} {}", ransac.unwrap_or_default())
    }

    /// Inliers of every query with its reference; the features of a reference are found once.
    fn count(&self, matches: Matches<'_>, step: impl Fn() + Sync) -> Result<Vec<usize>> {
        let mut users: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (query, &reference) in matches.best.iter().enumerate() {
            users.entry(reference).or_default().push(query);
        }
        let counted: Vec<Result<Vec<(usize, usize)>>> = users
            .into_par_iter()
            .map(|(reference, queries)| {
                let reference = self.detect(&matches.references[reference])?;
                let count = |query: usize| {
                    let count = self.verify(&self.detect(&matches.queries[query])?, &reference)?;
                    step();
                    Ok((query, count))
                };
                queries.into_iter().map(count).collect()
            })
            .collect();
        let mut counts = vec![0; matches.best.len()];
        for group in counted {
            for (query, count) in group? {
                counts[query] = count;
            }
        }
        Ok(counts)
    }
}

impl Sources<'_> {
    /// Inliers of every query with its best reference, from the store if they were counted before.
    /// `label` is what progress is told about.
    ///
    /// # Errors
    ///
    /// An image that cannot be read, by its path; weights that are not those of the network.
    pub fn inlier_counts(
        &self,
        label: &str,
        matches: Matches<'_>,
        method: LocalMethod,
    ) -> Result<Verified> {
        let verifier = match method.open(self.roots())? {
            Ok(verifier) => verifier,
            Err(why) => return Ok(Verified::NotAtHand(why)),
        };
        let paired: Vec<PathBuf> =
            matches.best.iter().map(|&it| matches.references[it].clone()).collect();
        let key = Store::key(&verifier.digest(), [matches.queries, &paired])?;
        let counts = self.store().counts(&key, matches.best.len(), || {
            let observer = self.observer();
            observer.start(&format!("{} on {label}", method.name()), matches.best.len());
            let counts = verifier.count(matches, || observer.step());
            observer.end();
            counts
        })?;
        Ok(Verified::Counts(counts))
    }
}
