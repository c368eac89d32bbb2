//! What estimators look at: one type per kind of evidence, and what each costs to have.

use vpr_core::{Error, Map, Poses, Retrieval};

use crate::Result;

/// How much of the references a method must have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Share {
    /// Nothing.
    None,
    /// Of the best-ranked references only.
    TopK,
    /// Of the training data only, not of the map.
    Training,
    /// Of the pair of images that is judged.
    Pair,
    /// Of the query only.
    Query,
}

/// What a kind of evidence is made of: the columns of thesis table 5.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Needs {
    /// Whose global descriptors.
    pub descriptors: Share,
    /// Whose poses.
    pub poses: Share,
    /// Whose pixels, when a query is judged.
    pub images: Share,
}

impl Needs {
    /// Whether a query is judged without looking at a pair of images, whose local features must be
    /// found and matched: what costs hundreds of milliseconds in thesis table 5.2.
    #[must_use]
    pub fn is_efficient(self) -> bool {
        self.images != Share::Pair
    }
}

/// Evidence about the best match of a batch of queries.
pub trait Evidence {
    /// What it is made of.
    const NEEDS: Needs;

    /// Number of queries.
    fn len(&self) -> usize;

    /// Whether there is no query.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The distances of the nearest references of every query.
#[derive(Clone, Copy, Debug)]
pub struct Neighbors<'a> {
    retrieval: &'a Retrieval,
}

impl<'a> Neighbors<'a> {
    /// Takes what was retrieved.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if there is no query.
    pub fn new(retrieval: &'a Retrieval) -> Result<Self> {
        if retrieval.is_empty() {
            return Err(Error::Empty("queries").into());
        }
        Ok(Self { retrieval })
    }

    /// What was retrieved.
    #[must_use]
    pub fn retrieval(&self) -> &'a Retrieval {
        self.retrieval
    }
}

impl Evidence for Neighbors<'_> {
    const NEEDS: Needs =
        Needs { descriptors: Share::TopK, poses: Share::None, images: Share::None };

    fn len(&self) -> usize {
        self.retrieval.len()
    }
}

/// The nearest references of every query and where they were taken.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    retrieval: &'a Retrieval,
    poses: &'a Poses,
}

impl<'a> Places<'a> {
    /// Joins what was retrieved with the map it was retrieved from.
    ///
    /// # Errors
    ///
    /// As [`Self::from_poses`].
    pub fn new(retrieval: &'a Retrieval, map: &'a Map) -> Result<Self> {
        Self::from_poses(retrieval, map.poses())
    }

    /// Joins what was retrieved with the poses of all references.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if there is no query, [`Error::OutOfRange`] if a reference has no pose,
    /// [`Error::NotFinite`] names the reference whose pose is not finite, and
    /// [`crate::Error::OnePosition`] if all of several references have the same position.
    pub fn from_poses(retrieval: &'a Retrieval, poses: &'a Poses) -> Result<Self> {
        Neighbors::new(retrieval)?;
        let len = poses.len();
        let all = (0..retrieval.len()).flat_map(|query| retrieval.indices(query));
        if let Some(&index) = all.into_iter().find(|&&index| index >= len) {
            return Err(Error::OutOfRange { what: "pose of reference", index, len }.into());
        }
        poses.check_finite()?;
        if len > 1 && (1..len).all(|index| poses.position(index) == poses.position(0)) {
            return Err(crate::Error::OnePosition { n: len });
        }
        Ok(Self { retrieval, poses })
    }

    /// What was retrieved.
    #[must_use]
    pub fn retrieval(&self) -> &'a Retrieval {
        self.retrieval
    }

    /// Poses of all references.
    #[must_use]
    pub fn poses(&self) -> &'a Poses {
        self.poses
    }
}

impl Evidence for Places<'_> {
    const NEEDS: Needs =
        Needs { descriptors: Share::TopK, poses: Share::TopK, images: Share::None };

    fn len(&self) -> usize {
        self.retrieval.len()
    }
}

/// The variances that an encoder predicted with the queries' descriptors, `n_queries × dim` in rows,
/// or `n_queries × 1` where one variance stands for all dimensions.
#[derive(Clone, Copy, Debug)]
pub struct Variances<'a> {
    values: ndarray::ArrayView2<'a, f32>,
}

impl<'a> Variances<'a> {
    /// Takes variances, one row per query.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without a query or a column, [`Error::NotFinite`] names row and column of a
    /// value that is not finite, [`Error::Parameter`] of one that is negative.
    pub fn new(values: ndarray::ArrayView2<'a, f32>) -> Result<Self> {
        if values.is_empty() {
            return Err(Error::Empty("variances").into());
        }
        for ((row, column), &value) in values.indexed_iter() {
            if !value.is_finite() {
                let value = f64::from(value);
                return Err(Error::NotFinite { what: "variances", row, column, value }.into());
            }
            if value < 0.0 {
                let value = format!("{value} in row {row}, column {column}");
                let reason = "a variance is not negative";
                return Err(Error::Parameter { name: "variances", value, reason }.into());
            }
        }
        Ok(Self { values })
    }

    /// The values, one row per query.
    #[must_use]
    pub fn values(&self) -> ndarray::ArrayView2<'a, f32> {
        self.values
    }
}

impl Evidence for Variances<'_> {
    const NEEDS: Needs =
        Needs { descriptors: Share::None, poses: Share::Training, images: Share::Query };

    fn len(&self) -> usize {
        self.values.nrows()
    }
}

/// How many local features of each query agree with its best reference in one geometric model.
#[derive(Clone, Copy, Debug)]
pub struct InlierCounts<'a> {
    counts: &'a [usize],
}

impl<'a> InlierCounts<'a> {
    /// Takes one count per query.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without a query.
    pub fn new(counts: &'a [usize]) -> Result<Self> {
        if counts.is_empty() {
            return Err(Error::Empty("queries").into());
        }
        Ok(Self { counts })
    }

    /// One count per query.
    #[must_use]
    pub fn counts(&self) -> &'a [usize] {
        self.counts
    }
}

impl Evidence for InlierCounts<'_> {
    const NEEDS: Needs =
        Needs { descriptors: Share::None, poses: Share::None, images: Share::Pair };

    fn len(&self) -> usize {
        self.counts.len()
    }
}
