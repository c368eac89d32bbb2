//! Several methods on the same queries: which differ, and how many queries it takes to tell.

use rayon::prelude::*;
use vpr_core::{
    Definition, Error, Evaluation, GroundTruth, Judged, Ranking, Result,
    metrics::{
        Difference, Discordant, McNemar, Plan,
        bootstrap::{Interval, Resampling, Z_95, wilson_interval},
        holm, paired_test,
    },
};

/// What one method found for the queries that all methods were asked.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// References of every query, best first.
    pub ranking: &'a Ranking,
    /// How sure the best match of every query is; higher is surer.
    pub confidence: &'a [f64],
}

/// A metric by which methods are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Whether one of the first N references is correct.
    RecallAt(usize),
    /// Area under the precision-recall curve of the best matches. Tests are about
    /// [`Definition::Corrected`], by which recall of all methods is relative to the same queries.
    AucPr,
}

/// How methods are compared.
#[derive(Clone, Debug)]
pub struct Protocol {
    /// The metrics, each a family of comparisons.
    pub metrics: Vec<Metric>,
    /// Which p-value of McNemar's test.
    pub test: McNemar,
    /// Methods are called different at a corrected p-value of at most this.
    pub level: f64,
    /// The power for which queries are counted.
    pub power: f64,
    /// Resamples of the paired bootstrap.
    pub resampling: Resampling,
}

/// Two methods by one metric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the first method.
    pub first: usize,
    /// Index of the second.
    pub second: usize,
    /// The metric.
    pub metric: Metric,
    /// First minus second, with the interval of the paired bootstrap.
    pub difference: Interval,
    /// Queries that only the first gets right, and only the second; of R@N.
    pub discordant: Option<Discordant>,
    /// McNemar's p-value of R@N, that of the paired bootstrap of AUC-PR.
    pub p_value: f64,
    /// The same after Holm's correction for all pairs of this metric.
    pub corrected: f64,
    /// The chance that a test at the level, without correction, sees a difference as large as this one
    /// with as many queries.
    pub power: f64,
    /// With how many queries that chance is the one of the protocol; none if no number was found.
    pub queries_for: Option<usize>,
}

/// A method that is best by a metric, and those that cannot be told from it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Best {
    /// Index of the method, the first of equal ones.
    pub method: usize,
    /// Methods whose difference from it is not significant after correction.
    pub not_told_apart: Vec<usize>,
}

/// All comparisons of some methods.
pub struct Comparison<'a> {
    methods: Vec<Judgements<'a>>,
    truth: &'a GroundTruth,
    /// Every pair by every metric: metrics in order, pairs in order of the methods.
    pub pairs: Vec<Pair>,
    protocol: Protocol,
}

struct Judgements<'a> {
    found: Found<'a>,
    judged: Judged,
}

impl<'a> Comparison<'a> {
    /// Compares every pair of methods by every metric.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if a method was not asked as many queries as the truth has,
    /// [`Error::Parameter`] for a level or power that is not between 0 and 1, and what the metrics
    /// report.
    pub fn new(methods: &[Found<'a>], truth: &'a GroundTruth, protocol: Protocol) -> Result<Self> {
        let judge = |found: &Found<'a>| {
            let (expected, actual) = (truth.len(), found.ranking.len());
            if expected != actual {
                return Err(Error::Mismatch { what: "queries of a method", expected, actual });
            }
            Ok(Judgements { found: *found, judged: Judged::new(&found.ranking.best(), truth)? })
        };
        let methods = methods.iter().map(judge).collect::<Result<Vec<_>>>()?;
        let mut comparison = Self { methods, truth, pairs: Vec::new(), protocol };
        for &metric in &comparison.protocol.metrics {
            let mut pairs = comparison.all_pairs(metric)?;
            let raw: Vec<f64> = pairs.iter().map(|it| it.p_value).collect();
            for (pair, corrected) in pairs.iter_mut().zip(holm(&raw)?) {
                pair.corrected = corrected;
            }
            comparison.pairs.append(&mut pairs);
        }
        Ok(comparison)
    }

    /// Whether each query of a method has a correct reference among the first `n`.
    #[must_use]
    pub fn hits(&self, method: usize, n: usize) -> Vec<bool> {
        let ranking = self.methods[method].found.ranking;
        let is_hit = |query: usize| {
            ranking.indices(query).iter().take(n).any(|&it| self.truth.is_correct(query, it))
        };
        (0..self.truth.len()).map(is_hit).collect()
    }

    /// The metric of one method with its own 95 % interval: Wilson's of R@N, that of
    /// [`Evaluation::auc_pr_interval`] of AUC-PR.
    ///
    /// # Errors
    ///
    /// [`Error::Undefined`] if AUC-PR has no value.
    pub fn value(&self, method: usize, metric: Metric, definition: Definition) -> Result<Interval> {
        match metric {
            Metric::RecallAt(n) => {
                let hits = self.hits(method, n);
                wilson_interval(hits.iter().filter(|it| **it).count(), hits.len(), Z_95)
            }
            Metric::AucPr => self.evaluation(method)?.auc_pr_interval(definition),
        }
    }

    /// The best method by a metric, and whom it cannot be told from.
    ///
    /// # Errors
    ///
    /// As [`Self::value`].
    pub fn best(&self, metric: Metric) -> Result<Best> {
        let mut best = (0, f64::NEG_INFINITY);
        for method in 0..self.methods.len() {
            let value = self.value(method, metric, Definition::Corrected)?.estimate;
            if value > best.1 {
                best = (method, value);
            }
        }
        let of_best = self.pairs.iter().filter(|it| {
            it.metric == metric
                && (it.first == best.0 || it.second == best.0)
                && it.corrected > self.protocol.level
        });
        let other = |it: &Pair| if it.first == best.0 { it.second } else { it.first };
        Ok(Best { method: best.0, not_told_apart: of_best.map(other).collect() })
    }

    fn evaluation(&self, method: usize) -> Result<Evaluation<'_>> {
        let it = &self.methods[method];
        Evaluation::of_confidence(it.found.confidence, &it.judged)
    }

    fn all_pairs(&self, metric: Metric) -> Result<Vec<Pair>> {
        let n = self.methods.len();
        let pairs: Vec<(usize, usize)> =
            (0..n).flat_map(|first| (first + 1..n).map(move |second| (first, second))).collect();
        match metric {
            Metric::RecallAt(rank) => {
                let hits: Vec<Vec<bool>> = (0..n).map(|it| self.hits(it, rank)).collect();
                let pair = |&(a, b): &(usize, usize)| self.recall_pair(rank, a, b, &hits);
                pairs.par_iter().map(pair).collect()
            }
            Metric::AucPr => pairs.iter().map(|&(a, b)| self.area_pair(a, b)).collect(),
        }
    }

    fn recall_pair(
        &self,
        n: usize,
        first: usize,
        second: usize,
        hits: &[Vec<bool>],
    ) -> Result<Pair> {
        let Protocol { test, level, power, resampling, .. } = &self.protocol;
        let (a, b) = (&hits[first], &hits[second]);
        let discordant = Discordant::count(a, b)?;
        let share = |hits: &[bool], queries: &[usize]| {
            Ok(queries.iter().filter(|&&query| hits[query]).count() as f64 / queries.len() as f64)
        };
        let difference = paired_test(a.len(), resampling, |it| share(a, it), |it| share(b, it))?;
        let of_all = |count: usize| count as f64 / a.len() as f64;
        let (wins, losses) = (of_all(discordant.first), of_all(discordant.second));
        let plan = Plan { first: wins, second: losses, level: *level, test: *test };
        let p_value = discordant.p_value(*test);
        Ok(Pair {
            first,
            second,
            metric: Metric::RecallAt(n),
            difference: difference.interval,
            discordant: Some(discordant),
            p_value,
            corrected: p_value,
            power: plan.power(a.len())?,
            queries_for: plan.queries_for(*power)?,
        })
    }

    fn area_pair(&self, first: usize, second: usize) -> Result<Pair> {
        let Protocol { level, power, resampling, .. } = &self.protocol;
        let [a, b] = [self.evaluation(first)?, self.evaluation(second)?];
        let test: Difference = a.auc_pr_test(&b, Definition::Corrected, resampling)?;
        Ok(Pair {
            first,
            second,
            metric: Metric::AucPr,
            difference: test.interval,
            discordant: None,
            p_value: test.p_value,
            corrected: test.p_value,
            power: test.power(test.n_queries, *level)?,
            queries_for: test.queries_for(*power, *level)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    /// Two hundred queries of one correct reference each, 0; a method is right where `right` says.
    fn ranking(right: impl Fn(usize) -> bool) -> Ranking {
        Ranking::new(Array2::from_shape_fn((200, 2), |(query, rank)| {
            usize::from(right(query) == (rank == 1))
        }))
        .unwrap()
    }

    fn protocol() -> Protocol {
        Protocol {
            metrics: vec![Metric::RecallAt(1), Metric::AucPr],
            test: McNemar::MidP,
            level: 0.05,
            power: 0.8,
            resampling: Resampling { n_resamples: 500, ..Resampling::default() },
        }
    }

    #[test]
    fn a_clear_winner_is_told_apart_and_a_near_one_is_not() {
        let truth = GroundTruth::from_lists(vec![vec![0]; 200], 2).unwrap();
        let rankings = [
            ranking(|it| it % 10 < 9),
            ranking(|it| it % 10 < 5),
            ranking(|it| it % 20 < 17 || it == 18),
        ];
        let confidence: Vec<f64> = (0..200_u8).map(|it| f64::from(it % 7)).collect();
        let found = rankings.each_ref().map(|ranking| Found { ranking, confidence: &confidence });
        let comparison = Comparison::new(&found, &truth, protocol()).unwrap();
        assert_eq!(comparison.pairs.len(), 6);
        // The third loses to the first on 19 queries and wins on 10: p = 0.099.
        let best = comparison.best(Metric::RecallAt(1)).unwrap();
        assert_eq!(best, Best { method: 0, not_told_apart: vec![2] });
        let [first, .., last] = &comparison.pairs[..3] else { panic!("three pairs") };
        let discordant = first.discordant.unwrap();
        assert_eq!((discordant.first, discordant.second), (80, 0));
        assert!(first.corrected < 1e-6 && first.power > 0.999);
        approx(first.difference.estimate, 0.4);
        assert!(first.queries_for.unwrap() < 200);
        assert_eq!((last.first, last.second), (1, 2));
        // The same method twice.
        let same = [found[0], found[0], found[1]];
        let comparison = Comparison::new(&same, &truth, protocol()).unwrap();
        let best = comparison.best(Metric::AucPr).unwrap();
        assert_eq!(best, Best { method: 0, not_told_apart: vec![1] });
        let equal = comparison.pairs[0];
        assert_eq!((equal.p_value, equal.queries_for), (1.0, None));
    }

    fn approx(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let truth = GroundTruth::from_lists(vec![vec![0]; 3], 2).unwrap();
        let (ranking, confidence) = (ranking(|_| true), vec![0.0; 200]);
        let found = [Found { ranking: &ranking, confidence: &confidence }; 2];
        let refused = Comparison::new(&found, &truth, protocol());
        assert!(matches!(refused.err(), Some(Error::Mismatch { .. })));
        let truth = GroundTruth::from_lists(vec![vec![0]; 200], 2).unwrap();
        let level = Protocol { level: 5.0, ..protocol() };
        assert!(Comparison::new(&found, &truth, level).is_err());
    }
}
