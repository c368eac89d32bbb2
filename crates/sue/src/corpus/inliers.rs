//! Geometric verification of the best matches of a corpus.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use vpr_core::{Error, npy};
use vpr_vision::{
    features::LocalFeatures,
    image,
    matching::{MatchParams, match_features},
    ransac::{RansacParams, correspondences, fundamental, homography},
    sift::{self, SiftParams},
};

use super::{Corpus, Sources, keys::key};
use crate::Result;

/// Local features and a geometric model, as the thesis sets them: 5 000 features, ratio 0.6,
/// 1 000 RANSAC iterations (§5.3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LocalMethod {
    /// SIFT and a homography, as the released code.
    Sift,
    /// SIFT and a fundamental matrix.
    SiftFundamental,
}

impl LocalMethod {
    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sift => "SIFT-RANSAC",
            Self::SiftFundamental => "SIFT-RANSAC, fundamental",
        }
    }

    /// Finds and describes the features of one image.
    ///
    /// # Errors
    ///
    /// If the file cannot be read or decoded, by its path.
    pub fn detect(self, path: &Path) -> Result<LocalFeatures> {
        let image = image::gray(&image::decode(path)?);
        match self {
            Self::Sift | Self::SiftFundamental => {
                Ok(sift::detect(&image, &SiftParams::default()).map_err(|err| err.in_file(path))?)
            }
        }
    }

    /// How many matched features agree in one model.
    ///
    /// # Errors
    ///
    /// Those of matching and RANSAC for malformed features.
    pub fn verify(self, query: &LocalFeatures, reference: &LocalFeatures) -> Result<usize> {
        let matches = match_features(query, reference, &MatchParams::RATIO)?;
        let points = correspondences(query, reference, &matches);
        Ok(match self {
            Self::Sift => homography(&points, &RansacParams::HOMOGRAPHY)?.count(),
            Self::SiftFundamental => fundamental(&points, &RansacParams::EPIPOLAR)?.count(),
        })
    }

    /// Everything a count depends on besides the images.
    fn digest(self) -> String {
        let sift = serde_json::to_string(&SiftParams::default()).unwrap_or_default();
        let ransac = serde_json::to_string(&[RansacParams::HOMOGRAPHY, RansacParams::EPIPOLAR]);
        format!("inliers 1 {self:?} {sift} {}", ransac.unwrap_or_default())
    }
}

/// Inliers of every query with its best reference, from the cache if they were counted before;
/// `None` without images.
///
/// Queries are verified in parallel; each image's features are found once.
///
/// # Errors
///
/// An image that cannot be read, by its path.
pub fn inlier_counts(
    corpus: &Corpus,
    method: LocalMethod,
    sources: &Sources<'_>,
) -> Result<Option<Vec<usize>>> {
    let Some((queries, references)) = &corpus.images else { return Ok(None) };
    let best = corpus.retrieval.best();
    let pairs: Vec<(&PathBuf, &PathBuf)> =
        queries.iter().zip(best.iter().map(|&it| &references[it])).collect();
    let images: Vec<&PathBuf> = pairs.iter().flat_map(|pair| [pair.0, pair.1]).collect();
    let folder = sources.cache.join("inliers");
    let path = folder.join(format!("{}.npy", key(&method.digest(), &images)?));
    if let Some(counts) = cached(&path, pairs.len()) {
        return Ok(Some(counts));
    }
    sources.observer.start(&format!("{} on {}", method.name(), corpus.label()), pairs.len());
    let mut users: BTreeMap<&PathBuf, Vec<usize>> = BTreeMap::new();
    for (query, pair) in pairs.iter().enumerate() {
        users.entry(pair.1).or_default().push(query);
    }
    let counted: Vec<Result<Vec<(usize, usize)>>> = users
        .into_par_iter()
        .map(|(reference, queries)| {
            let reference = method.detect(reference)?;
            let count = |query: usize| {
                let count = method.verify(&method.detect(pairs[query].0)?, &reference)?;
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
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    let stored: Vec<i64> = counts.iter().map(|&count| count as i64).collect();
    npy::write_i64(&path, &stored)?;
    Ok(Some(counts))
}

/// Counts from the cache, if there are as many as asked for and all make sense.
fn cached(path: &Path, n: usize) -> Option<Vec<usize>> {
    let stored = npy::read_i64(path).ok().filter(|stored| stored.len() == n)?;
    stored.iter().map(|&count| usize::try_from(count).ok()).collect()
}
