//! Approximate search by USearch's HNSW graph, ranked exactly afterwards.
//!
//! The graph chooses candidates, so the distances and the order of what is returned are exact, but
//! a neighbour can be missing; how many are is measured and kept beside the index.

use std::{fs, path::Path, thread};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use usearch::{Index, IndexOptions, MetricKind, ScalarKind};
use xxhash_rust::xxh3::xxh3_64;

use super::{Metric, RowSource, SearchParams, rescore, row, search};
use crate::{Descriptors, Error, Result, Retrieval};

/// The shape of the graph and the effort of a search in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HnswParams {
    /// Links of a reference.
    pub connectivity: usize,
    /// Candidates looked at while a reference is added.
    pub expansion_add: usize,
    /// Candidates looked at while a query is searched.
    pub expansion_search: usize,
}

impl Default for HnswParams {
    fn default() -> Self {
        Self { connectivity: 16, expansion_add: 128, expansion_search: 64 }
    }
}

/// What is written beside an index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sidecar {
    metric: Metric,
    params: HnswParams,
    len: usize,
    dim: usize,
    /// Digest of the index file (XXH3, 64 bits): USearch trusts what it maps.
    digest: u64,
    recall: Option<MeasuredRecall>,
}

/// How many of the exact neighbours the graph found when it was last measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredRecall {
    /// Neighbours wanted for every query.
    pub k: usize,
    /// Number of queries.
    pub n_queries: usize,
    /// Share of the exact neighbours that were found, 0 to 1.
    pub recall: f64,
}

/// An HNSW graph over the references.
pub struct Hnsw {
    index: Index,
    sidecar: Sidecar,
}

impl Hnsw {
    /// Builds the graph on one thread, in the order of the rows, so that it is the same each time.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for the Manhattan metric, which USearch does not have, and for what
    /// USearch refuses; [`Error::Empty`] without references; those of [`RowSource::block`].
    pub fn build(
        rows: &(impl RowSource + ?Sized),
        metric: Metric,
        params: &HnswParams,
    ) -> Result<Self> {
        if rows.is_empty() {
            return Err(Error::Empty("references to index"));
        }
        let (len, dim) = (rows.len(), rows.dim());
        let sidecar = Sidecar { metric, params: *params, len, dim, digest: 0, recall: None };
        let index = sidecar.empty_index()?;
        index.reserve(len).map_err(refused)?;
        let mut scratch = Vec::new();
        for reference in 0..len {
            index.add(reference as u64, row(rows, reference, &mut scratch)?).map_err(refused)?;
        }
        Ok(Self { index, sidecar })
    }

    /// The `k` nearest of at least `expansion_search` candidates of every query; `rows` are the full
    /// rows, of which only those of the candidates are read.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the rows are not those of the index, by number and dimension, and those
    /// of [`rescore`].
    pub fn search(
        &self,
        rows: &(impl RowSource + ?Sized),
        queries: &Descriptors,
        k: usize,
    ) -> Result<Retrieval> {
        let Sidecar { metric, params, len, dim, .. } = self.sidecar;
        for (what, expected, actual) in [
            ("rows of the indexed references", len, rows.len()),
            ("dimension of the indexed references", dim, rows.dim()),
            ("dimension of the query descriptors", dim, queries.dim()),
        ] {
            if expected != actual {
                return Err(Error::Mismatch { what, expected, actual });
            }
        }
        let count = k.max(params.expansion_search).min(len);
        // USearch has working memory for as many searches at once as the machine has threads.
        let n_threads = thread::available_parallelism().map_or(1, usize::from);
        let per_thread = queries.len().div_ceil(n_threads).max(1);
        let candidates: Vec<Vec<usize>> = queries
            .as_slice()
            .par_chunks(per_thread * dim)
            .map(|some| some.chunks_exact(dim).map(|query| self.candidates(query, count)).collect())
            .collect::<Result<Vec<Vec<_>>>>()?
            .concat();
        rescore(rows, queries, &candidates, &SearchParams { metric, k, block_rows: None })
    }

    /// Compares with exact search and remembers the result.
    ///
    /// # Errors
    ///
    /// Those of [`Self::search`].
    pub fn measure(
        &mut self,
        rows: &(impl RowSource + ?Sized),
        queries: &Descriptors,
        k: usize,
    ) -> Result<MeasuredRecall> {
        let exact = search(
            rows,
            queries,
            &SearchParams { metric: self.sidecar.metric, k, block_rows: None },
        )?;
        let found = self.search(rows, queries, k)?;
        let shared = (0..queries.len()).map(|query| {
            let found = found.indices(query);
            exact
                .indices(query)
                .iter()
                .filter(|index| found.iter().any(|other| other == *index))
                .count()
        });
        let recall = shared.sum::<usize>() as f64 / (exact.k() * queries.len()).max(1) as f64;
        let measured = MeasuredRecall { k: exact.k(), n_queries: queries.len(), recall };
        self.sidecar.recall = Some(measured);
        Ok(measured)
    }

    /// What [`Self::measure`] found, also after the index was saved and opened.
    #[must_use]
    pub fn recall(&self) -> Option<MeasuredRecall> {
        self.sidecar.recall
    }

    /// Changes how many candidates a search looks at.
    pub fn set_expansion_search(&mut self, candidates: usize) {
        self.index.change_expansion_search(candidates);
        self.sidecar.params.expansion_search = candidates;
        self.sidecar.recall = None;
    }

    /// Writes the graph to `path` and its description to `path` with `.json` appended, last.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] and [`Error::Format`] if a file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let beside = |end: &str| {
            let mut name = path.as_os_str().to_owned();
            name.push(end);
            std::path::PathBuf::from(name)
        };
        let (partial, json) = (beside(".partial"), beside(".json"));
        self.index
            .save(text(&partial)?)
            .map_err(|err| Error::format(path, "index", err.to_string()))?;
        let digest = xxh3_64(&fs::read(&partial).map_err(Error::io(&partial))?);
        let sidecar = Sidecar { digest, ..self.sidecar.clone() };
        let described = serde_json::to_vec_pretty(&sidecar)
            .map_err(|err| Error::format(&json, "description", err.to_string()))?;
        fs::rename(&partial, path).map_err(Error::io(path))?;
        fs::write(&json, described).map_err(Error::io(&json))
    }

    /// Maps what [`Self::save`] wrote; the file is read once to check its digest.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a file cannot be read, [`Error::Format`] if it is damaged or not such a file.
    pub fn open(path: &Path) -> Result<Self> {
        let mut json = path.as_os_str().to_owned();
        json.push(".json");
        let json = Path::new(&json);
        let described = fs::read(json).map_err(Error::io(json))?;
        let sidecar: Sidecar = serde_json::from_slice(&described)
            .map_err(|err| Error::format(json, format!("line {}", err.line()), err.to_string()))?;
        if xxh3_64(&fs::read(path).map_err(Error::io(path))?) != sidecar.digest {
            return Err(Error::format(
                path,
                "index",
                "digest differs from the description beside it",
            ));
        }
        let index = sidecar.empty_index()?;
        index.view(text(path)?).map_err(|err| Error::format(path, "index", err.to_string()))?;
        if (index.size(), index.dimensions()) != (sidecar.len, sidecar.dim) {
            return Err(Error::format(
                path,
                "index",
                "size differs from the description beside it",
            ));
        }
        index.change_expansion_search(sidecar.params.expansion_search);
        Ok(Self { index, sidecar })
    }

    fn candidates(&self, query: &[f32], count: usize) -> Result<Vec<usize>> {
        let found = self.index.search(query, count).map_err(refused)?;
        found
            .keys
            .into_iter()
            .map(|key| usize::try_from(key).map_err(|_| Error::Empty("reference with this key")))
            .collect()
    }
}

impl Sidecar {
    fn empty_index(&self) -> Result<Index> {
        let metric = match self.metric {
            Metric::Euclidean => MetricKind::L2sq,
            Metric::Cosine => MetricKind::Cos,
            Metric::InnerProduct => MetricKind::IP,
            Metric::Manhattan => {
                let value = "manhattan".to_owned();
                return Err(Error::Parameter {
                    name: "metric",
                    value,
                    reason: "is not one of USearch",
                });
            }
        };
        let options = IndexOptions {
            dimensions: self.dim,
            metric,
            quantization: ScalarKind::F32,
            connectivity: self.params.connectivity,
            expansion_add: self.params.expansion_add,
            expansion_search: self.params.expansion_search,
            multi: false,
        };
        Index::new(&options).map_err(refused)
    }
}

fn refused(err: impl ToString) -> Error {
    Error::Parameter { name: "hnsw", value: err.to_string(), reason: "refused by USearch" }
}

fn text(path: &Path) -> Result<&str> {
    path.to_str().ok_or_else(|| Error::format(path, "path", "USearch needs a path in UTF-8"))
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn rows(n_rows: usize) -> Descriptors {
        let mut rng = ChaCha8Rng::seed_from_u64(n_rows as u64);
        Descriptors::new(Array2::from_shape_simple_fn((n_rows, 16), || {
            rng.random_range(-1.0_f32..1.0)
        }))
        .unwrap()
    }

    #[test]
    fn an_opened_index_finds_what_the_saved_one_found() {
        let (references, queries) = (rows(2000), rows(50));
        let mut hnsw = Hnsw::build(&references, Metric::Euclidean, &HnswParams::default()).unwrap();
        let measured = hnsw.measure(&references, &queries, 10).unwrap();
        assert!(measured.recall > 0.95, "{measured:?}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.usearch");
        hnsw.save(&path).unwrap();
        let opened = Hnsw::open(&path).unwrap();
        assert_eq!(opened.recall(), Some(measured));
        let found = |hnsw: &Hnsw| hnsw.search(&references, &queries, 10).unwrap();
        assert_eq!(found(&opened), found(&hnsw));
    }

    #[test]
    fn damage_is_found_before_usearch_sees_it() {
        let hnsw = Hnsw::build(&rows(100), Metric::Cosine, &HnswParams::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.usearch");
        hnsw.save(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&path, &bytes).unwrap();
        assert!(matches!(Hnsw::open(&path), Err(Error::Format { .. })));
        fs::write(&path, &bytes[..middle]).unwrap();
        assert!(matches!(Hnsw::open(&path), Err(Error::Format { .. })));
    }

    #[test]
    fn manhattan_is_refused() {
        let hnsw = Hnsw::build(&rows(10), Metric::Manhattan, &HnswParams::default());
        assert!(matches!(hnsw, Err(Error::Parameter { name: "metric", .. })));
    }
}
