//! Geometric verification of the best matches of a corpus.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use vpr_core::{Error, dataset::DataRoots, npy};
use vpr_nets::{local, weights::Weights};
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image,
    matching::{MatchParams, match_features},
    ransac::{RansacParams, correspondences, fundamental, homography},
};

use super::{Corpus, Sources, keys::key};
use crate::Result;

/// Features kept per image (thesis §5.3.1).
const FEATURES: usize = 5000;

/// Local features and a geometric model, as the thesis sets them: 5 000 features, ratio 0.6,
/// 1 000 RANSAC iterations (§5.3.1); a homography as the released code, where not named otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LocalMethod {
    /// SIFT (Lowe 2004).
    Sift,
    /// SIFT and a fundamental matrix.
    SiftFundamental,
    /// DELF (Noh et al. 2017).
    Delf,
    /// `SuperPoint` (`DeTone` et al. 2018).
    #[serde(rename = "superpoint")]
    SuperPoint,
    /// `XFeat` (Potje et al. 2024).
    #[serde(rename = "xfeat")]
    XFeat,
    /// DISK (Tyszkiewicz et al. 2020).
    Disk,
}

/// What verification of a corpus gave.
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
    extractor: Box<dyn Extractor>,
    /// Digest of the weights; empty without.
    weights: String,
}

impl LocalMethod {
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

    /// Its features by the name `vpr_nets::local` has for them, and the file of their weights below
    /// `weights/` of a data folder.
    fn features(self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Sift | Self::SiftFundamental => ("sift", None),
            Self::Delf => ("delf", Some("delf.pth")),
            Self::SuperPoint => ("superpoint", Some("superpoint_v1.pth")),
            Self::XFeat => ("xfeat", Some("xfeat.pt")),
            Self::Disk => ("disk", Some("disk-depth-save.pth")),
        }
    }

    /// The method with its weights from one of these folders; `Err` inside is what is missing.
    ///
    /// # Errors
    ///
    /// Weights that are there but are not those of the network.
    pub fn open(self, roots: &DataRoots) -> Result<Result<Verifier, String>> {
        let (features, file) = self.features();
        let path = match file {
            None => None,
            Some(file) => match roots.find(&Path::new("weights").join(file)) {
                Ok(path) => Some(path),
                Err(_) => {
                    return Ok(Err(format!("its weights, weights/{file}, are not at hand")));
                }
            },
        };
        let weights = match &path {
            Some(path) => Weights::open(path)?.digest().to_owned(),
            None => String::new(),
        };
        let extractor = local::by_name(features, path.as_deref(), FEATURES)?;
        Ok(Ok(Verifier { method: self, extractor, weights }))
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
        Ok(self.extractor.extract(&image).map_err(|err| err.in_file(path))?)
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
        let (method, weights) = (self.method, &self.weights);
        format!("inliers 2 {method:?} {FEATURES} {weights} {}", ransac.unwrap_or_default())
    }
}

/// Inliers of every query with its best reference, from the cache if they were counted before.
///
/// Queries are verified in parallel; the features of a reference are found once.
///
/// # Errors
///
/// An image that cannot be read, by its path.
pub fn inlier_counts(
    corpus: &Corpus,
    method: LocalMethod,
    sources: &Sources<'_>,
) -> Result<Verified> {
    let Some((queries, references)) = &corpus.images else {
        return Ok(Verified::NotAtHand("there are no images to verify".to_owned()));
    };
    let verifier = match method.open(sources.roots)? {
        Ok(verifier) => verifier,
        Err(why) => return Ok(Verified::NotAtHand(why)),
    };
    let best = corpus.retrieval.best();
    let pairs: Vec<(&PathBuf, &PathBuf)> =
        queries.iter().zip(best.iter().map(|&it| &references[it])).collect();
    let images: Vec<&PathBuf> = pairs.iter().flat_map(|pair| [pair.0, pair.1]).collect();
    let folder = sources.cache.join("inliers");
    let path = folder.join(format!("{}.npy", key(&verifier.digest(), &images)?));
    if let Some(counts) = cached(&path, pairs.len()) {
        return Ok(Verified::Counts(counts));
    }
    sources.observer.start(&format!("{} on {}", method.name(), corpus.label()), pairs.len());
    let mut users: BTreeMap<&PathBuf, Vec<usize>> = BTreeMap::new();
    for (query, pair) in pairs.iter().enumerate() {
        users.entry(pair.1).or_default().push(query);
    }
    let counted: Vec<Result<Vec<(usize, usize)>>> = users
        .into_par_iter()
        .map(|(reference, queries)| {
            let reference = verifier.detect(reference)?;
            let count = |query: usize| {
                let count = verifier.verify(&verifier.detect(pairs[query].0)?, &reference)?;
                sources.observer.step();
                Ok((query, count))
            };
            queries.into_iter().map(count).collect()
        })
        .collect();
    sources.observer.end();
    let mut counts = vec![0; pairs.len()];
    for group in counted {
        for (query, count) in group? {
            counts[query] = count;
        }
    }
    fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    let stored: Vec<i64> =
        counts.iter().map(|&count| i64::try_from(count).unwrap_or(i64::MAX)).collect();
    npy::write_i64(&path, &stored)?;
    Ok(Verified::Counts(counts))
}

/// Counts from the cache, if there are as many as asked for and all make sense.
fn cached(path: &Path, n: usize) -> Option<Vec<usize>> {
    let stored = npy::read_i64(path).ok().filter(|stored| stored.len() == n)?;
    stored.iter().map(|&count| usize::try_from(count).ok()).collect()
}
