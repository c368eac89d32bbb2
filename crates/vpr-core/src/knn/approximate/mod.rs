//! Approximate search by `USearch`'s HNSW graph, ranked exactly afterwards.
//!
//! The graph chooses candidates, so the distances and the order of what is returned are exact, but
//! a neighbour can be missing; how many are is measured and kept beside the index.

mod codes;
mod sidecar;

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    sync::{Condvar, Mutex},
    thread,
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use usearch::Index;

use self::{codes::Coder, sidecar::Sidecar};
use super::{Metric, RowSource, SearchParams, rescore, search};
use crate::{Descriptors, Error, Result, Retrieval, map::BlockDigest};
use vpr_files::{NewFile, replace};

/// How the graph holds the references. It only chooses candidates, so small is enough.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HnswCodes {
    /// As they are.
    F32,
    /// Half the bytes.
    F16,
    /// A quarter of the bytes: steps of one size for all values, a 127th of the largest magnitude
    /// or of eight times the root mean square, whichever is smaller.
    #[default]
    Int8,
}

/// The shape of the graph and the effort of a search in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HnswParams {
    /// How the graph holds the references.
    pub codes: HnswCodes,
    /// Links of a reference.
    pub connectivity: usize,
    /// Candidates looked at while a reference is added.
    pub expansion_add: usize,
    /// Candidates looked at while a query is searched.
    pub expansion_search: usize,
    /// Candidates whose full rows are read, for every neighbour wanted.
    pub oversample: usize,
}

impl Default for HnswParams {
    fn default() -> Self {
        Self {
            codes: HnswCodes::default(),
            connectivity: 16,
            expansion_add: 128,
            expansion_search: 64,
            oversample: 2,
        }
    }
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
    coder: Coder,
    sidecar: Sidecar,
    permits: Permits,
}

/// Rows that are read at once while a graph is built.
const ROWS_AT_ONCE: usize = 1024;

impl Hnsw {
    /// Builds the graph on one thread, in the order of the rows, so that it is the same each time.
    ///
    /// `source` names what the rows are of, [`OpenMap::digest`](crate::map::OpenMap::digest) for
    /// instance; a search compares it.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for the Manhattan metric, which `USearch` does not have, and for what
    /// `USearch` refuses; [`Error::Empty`] without references; those of [`RowSource::block`].
    pub fn build(
        rows: &(impl RowSource + ?Sized),
        metric: Metric,
        params: &HnswParams,
        source: Option<String>,
    ) -> Result<Self> {
        if rows.is_empty() || rows.dim() == 0 {
            return Err(Error::Empty("references to index"));
        }
        let mut scratch = Vec::new();
        let mut coder = Coder::new(metric, params.codes)?;
        for range in pieces(rows) {
            coder.look_at(rows.block(range, &mut scratch)?);
        }
        let (len, dim) = (rows.len(), rows.dim());
        let sidecar = Sidecar::new(metric, params, (len, dim), coder.step(), source);
        let index = sidecar.empty_index()?;
        // One thread: USearch draws the levels of the graph per thread.
        index.reserve_capacity_and_threads(len, 1).map_err(refused)?;
        for range in pieces(rows) {
            let first = range.start;
            let block = rows.block(range, &mut scratch)?;
            for (row, at) in block.chunks_exact(dim).zip(first..) {
                coder.add(&index, at as u64, row)?;
            }
        }
        let permits = Permits::new();
        index.reserve_capacity_and_threads(len, permits.total).map_err(refused)?;
        Ok(Self { index, coder, sidecar, permits })
    }

    /// The `k` nearest among the candidates that the graph finds for every query; `rows` are the
    /// full rows, of which only those of the candidates are read. Queries are spread over threads.
    /// A query for which the graph has fewer than `k` candidates is searched exactly.
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
        let k = k.min(len);
        let count = k.saturating_mul(params.oversample.max(1)).min(len);
        let params = SearchParams { metric, k, block_rows: None };
        let candidates: Vec<Vec<usize>> = queries
            .as_slice()
            .par_chunks(dim)
            .map(|query| {
                let found = self.candidates(query, count)?;
                if found.len() >= k { Ok(found) } else { exactly(rows, query, &params) }
            })
            .collect::<Result<_>>()?;
        rescore(rows, queries, &candidates, &params)
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
        let params = SearchParams { metric: self.sidecar.metric, k, block_rows: None };
        let exact = search(rows, queries, &params)?;
        let found = self.search(rows, queries, k)?;
        let shared = (0..queries.len()).map(|query| {
            let (found, exact) = (found.indices(query), exact.indices(query));
            exact.iter().filter(|index| found.iter().any(|other| other == *index)).count()
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

    /// What the rows are of, as given to [`Self::build`].
    #[must_use]
    pub fn source(&self) -> Option<&str> {
        self.sidecar.source.as_deref()
    }

    /// How descriptors are compared.
    #[must_use]
    pub fn metric(&self) -> Metric {
        self.sidecar.metric
    }

    /// Changes how many candidates a search looks at; the recall has to be measured again.
    pub fn set_expansion_search(&mut self, candidates: usize) {
        self.index.change_expansion_search(candidates);
        self.sidecar.params.expansion_search = candidates;
        self.sidecar.recall = None;
    }

    /// Changes how many full rows a search reads for every neighbour wanted; the recall has to be
    /// measured again.
    pub fn set_oversample(&mut self, oversample: usize) {
        self.sidecar.params.oversample = oversample;
        self.sidecar.recall = None;
    }

    /// Writes the graph to `path` and its description to `path` with `.json` appended. Each appears
    /// whole or not at all; a graph whose description is of another one is refused on opening.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] and [`Error::Format`] if a file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut bytes = vec![0; self.index.serialized_length()];
        let saved = self.index.save_to_buffer(&mut bytes);
        saved.map_err(|err| Error::format(path, "index", err.to_string()))?;
        let sidecar = Sidecar { digest: BlockDigest::of(&bytes).to_hex(), ..self.sidecar.clone() };
        let mut file = NewFile::create(path)?;
        file.file().write_all(&bytes).map_err(Error::io(path))?;
        file.commit()?;
        Ok(replace(&description_of(path), &sidecar.to_json())?)
    }

    /// Maps what [`Self::save`] wrote; the file is read once to check its digest, because `USearch`
    /// trusts what it maps.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a file cannot be read, [`Error::Format`] if it is damaged or not such a file.
    pub fn open(path: &Path) -> Result<Self> {
        let wrong = |reason: String| Error::format(path, "index", reason);
        let sidecar = Sidecar::read(&description_of(path))?;
        let bytes = fs::read(path).map_err(Error::io(path))?;
        if BlockDigest::of(&bytes).to_hex() != sidecar.digest {
            return Err(wrong("digest differs from the description beside it".to_owned()));
        }
        drop(bytes);
        let index = sidecar.empty_index()?;
        let text =
            path.to_str().ok_or_else(|| wrong("USearch needs a path in UTF-8".to_owned()))?;
        index.view(text).map_err(|err| wrong(err.to_string()))?;
        if (index.size(), index.dimensions()) != (sidecar.len, sidecar.dim) {
            return Err(wrong("size differs from the description beside it".to_owned()));
        }
        index.change_expansion_search(sidecar.params.expansion_search);
        let coder = Coder::with_step(sidecar.metric, sidecar.params.codes, sidecar.step)?;
        Ok(Self { index, coder, sidecar, permits: Permits::new() })
    }

    fn candidates(&self, query: &[f32], count: usize) -> Result<Vec<usize>> {
        let found = self.permits.with_one(|| self.coder.search(&self.index, query, count));
        let keys = found?.keys.into_iter();
        keys.map(|key| usize::try_from(key).map_err(refused)).collect()
    }
}

/// The rows of a source in pieces that it likes to read.
fn pieces(rows: &(impl RowSource + ?Sized)) -> impl Iterator<Item = std::ops::Range<usize>> {
    let mut start = 0;
    std::iter::from_fn(move || {
        let end = rows.piece_end(start, ROWS_AT_ONCE).min(rows.len());
        let range = start..end;
        start = end;
        (!range.is_empty()).then_some(range)
    })
}

/// The exact neighbours of one query.
fn exactly(
    rows: &(impl RowSource + ?Sized),
    query: &[f32],
    params: &SearchParams,
) -> Result<Vec<usize>> {
    let query = ndarray::ArrayView2::from_shape((1, query.len()), query);
    let query = Descriptors::new(query.expect("one row").to_owned())?;
    Ok(search(rows, &query, params)?.indices(0).to_vec())
}

fn description_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

fn refused(err: impl ToString) -> Error {
    Error::Parameter { name: "hnsw", value: err.to_string(), reason: "refused by USearch" }
}

/// `USearch` has working memory for so many searches at a time, and does not look how many there are.
struct Permits {
    total: usize,
    free: Mutex<usize>,
    returned: Condvar,
}

impl Permits {
    fn new() -> Self {
        let total = thread::available_parallelism().map_or(1, usize::from);
        Self { total, free: Mutex::new(total), returned: Condvar::new() }
    }

    /// Runs `search`, which must not wait for another one.
    fn with_one<T>(&self, search: impl FnOnce() -> T) -> T {
        let free = self.free.lock().expect("nobody panics while counting");
        let mut free = self
            .returned
            .wait_while(free, |free| *free == 0)
            .expect("nobody panics while counting");
        *free -= 1;
        drop(free);
        let found = search();
        *self.free.lock().expect("nobody panics while counting") += 1;
        self.returned.notify_one();
        found
    }
}
