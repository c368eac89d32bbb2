//! Sequence matching in the manner of `SeqSLAM`: a query is matched together with its neighbours in
//! time.
//!
//! Milford and Wyeth, *`SeqSLAM`* (2012): differences are normalised against those of nearby references,
//! then averaged along straight lines of several speeds, and the best speed counts. The paper looks
//! back only, its released code (`OpenSeqSLAM`) to both sides; both exist here by name.

use ndarray::{Array2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use vpr_core::{Error, Result, Similarities};

/// Which neighbours of a query are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Window {
    /// The query and those before it, as the paper: usable while driving
    #[default]
    Causal,
    /// As many before as after it, as the released code
    Centred,
}

/// How sequences are matched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SequenceParams {
    /// Queries in a sequence, the one that is matched included.
    pub length: usize,
    /// Where they lie.
    pub window: Window,
    /// Slowest and fastest speed, in references per query.
    pub speeds: [f64; 2],
    /// Distance from one speed to the next.
    pub speed_step: f64,
    /// References on each side against which a difference is normalised; 0: not normalised.
    pub contrast: usize,
}

impl Default for SequenceParams {
    /// Those of `OpenSeqSLAM`: 10 frames, 0.8 to 1.2 by 0.1, a contrast window of 10.
    fn default() -> Self {
        let (window, speeds) = (Window::default(), [0.8, 1.2]);
        Self { length: 10, window, speeds, speed_step: 0.1, contrast: 5 }
    }
}

impl SequenceParams {
    fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| Err(Error::Parameter { name, value, reason });
        let [slowest, fastest] = self.speeds;
        if self.length == 0 {
            return refuse("length", "0".to_owned(), "must be positive");
        }
        if !(0.0..=100.0).contains(&slowest) || !(slowest..=100.0).contains(&fastest) {
            let value = format!("{slowest} to {fastest}");
            return refuse("speeds", value, "must ascend from 0 to at most 100");
        }
        if !(1e-3..=100.0).contains(&self.speed_step) {
            let value = self.speed_step.to_string();
            return refuse("speed_step", value, "must be from 0.001 to 100");
        }
        Ok(())
    }

    /// Offsets of a sequence's queries from the one that is matched.
    fn offsets(&self) -> std::ops::RangeInclusive<isize> {
        let length = isize::try_from(self.length).unwrap_or(isize::MAX);
        match self.window {
            Window::Causal => 1 - length..=0,
            Window::Centred => -(length / 2)..=(length - 1) / 2,
        }
    }

    fn speeds(&self) -> impl Iterator<Item = f64> + Clone + use<> {
        let ([slowest, fastest], step) = (self.speeds, self.speed_step);
        let last = fastest + 1e-9;
        (0_u32..).map(move |at| slowest + f64::from(at) * step).take_while(move |&it| it <= last)
    }
}

/// The similarity of every query with every reference along their sequences: the mean over those of
/// its queries and references that exist, at the best speed.
///
/// Queries and references must be in the order of time. The similarity of a sequence that leaves the
/// traverse is the mean over what is left of it.
///
/// # Errors
///
/// [`Error::Parameter`] for parameters out of range.
pub fn along_sequences(
    similarities: &Similarities,
    params: &SequenceParams,
) -> Result<Similarities> {
    params.check()?;
    let values = normalised(similarities, params.contrast);
    let (n_queries, n_references) = values.dim();
    let mut along = Array2::zeros(values.dim());
    let rows = along.axis_iter_mut(Axis(0)).into_par_iter().enumerate();
    rows.for_each(|(query, mut row)| {
        for (reference, best) in row.iter_mut().enumerate() {
            let mean = |speed: f64| {
                let (mut sum, mut n) = (0.0, 0_u32);
                for offset in params.offsets() {
                    let Some(at) = query.checked_add_signed(offset).filter(|&it| it < n_queries)
                    else {
                        continue;
                    };
                    #[expect(clippy::cast_possible_truncation, reason = "a few frames")]
                    let shift = (speed * offset as f64).round() as isize;
                    let other = reference.checked_add_signed(shift);
                    if let Some(other) = other.filter(|&it| it < n_references) {
                        sum += values[(at, other)];
                        n += 1;
                    }
                }
                sum / f64::from(n)
            };
            *best = params.speeds().map(mean).fold(f64::NEG_INFINITY, f64::max);
        }
    });
    Similarities::new(along)
}

/// Every similarity less the mean of its neighbours in the map, divided by their standard deviation.
fn normalised(similarities: &Similarities, reach: usize) -> Array2<f64> {
    let view = similarities.view();
    if reach == 0 {
        return view.to_owned();
    }
    let mut values = Array2::zeros(view.dim());
    for (mut row, source) in values.outer_iter_mut().zip(view.outer_iter()) {
        for (at, value) in row.iter_mut().enumerate() {
            let near = source
                .slice(ndarray::s![at.saturating_sub(reach)..(at + reach + 1).min(source.len())]);
            let mean = near.sum() / near.len() as f64;
            let variance =
                near.iter().map(|it| (it - mean).powi(2)).sum::<f64>() / near.len() as f64;
            *value = if variance > 0.0 { (source[at] - mean) / variance.sqrt() } else { 0.0 };
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(value: impl Fn(usize, usize) -> f64) -> Similarities {
        Similarities::new(Array2::from_shape_fn((8, 8), |(query, reference)| {
            value(query, reference)
        }))
        .unwrap()
    }

    const PLAIN: SequenceParams = SequenceParams {
        length: 3,
        window: Window::Causal,
        speeds: [1.0, 1.0],
        speed_step: 0.1,
        contrast: 0,
    };

    #[test]
    fn a_sequence_outvotes_one_wrong_frame() {
        let diagonal = |query: usize, reference: usize| f64::from(u8::from(query == reference));
        // Query 4 looks most like reference 1.
        let scores = matrix(|query, reference| match (query, reference) {
            (4, 1) => 1.5,
            _ => diagonal(query, reference),
        });
        assert_eq!(scores.best().reference[4], 1);
        for window in [Window::Causal, Window::Centred] {
            let along = along_sequences(&scores, &SequenceParams { window, ..PLAIN }).unwrap();
            assert_eq!(along.best().reference, (0..8).collect::<Vec<_>>(), "{window:?}");
        }
    }

    /// By hand: the causal mean of query 2 at reference 2 is over (0, 0), (1, 1), (2, 2); the centred
    /// one over (1, 1), (2, 2), (3, 3).
    #[test]
    fn windows_lie_where_they_say() {
        let scores = matrix(|query, reference| (10 * query + reference) as f64);
        let at = |window| {
            let along = along_sequences(&scores, &SequenceParams { window, ..PLAIN }).unwrap();
            [along.view()[(2, 2)], along.view()[(0, 0)]]
        };
        assert_eq!(at(Window::Causal), [11.0, 0.0]);
        assert_eq!(at(Window::Centred), [22.0, 5.5]);
    }

    #[test]
    fn the_best_speed_counts() {
        // References were taken at twice the speed: query q is at reference 2 q.
        let scores = matrix(|query, reference| f64::from(u8::from(reference == 2 * query)));
        let slow = along_sequences(&scores, &PLAIN).unwrap();
        let fast = SequenceParams { speeds: [1.0, 2.0], speed_step: 0.5, ..PLAIN };
        let fast = along_sequences(&scores, &fast).unwrap();
        assert_eq!(fast.view()[(3, 6)], 1.0);
        assert!(slow.view()[(3, 6)] < 0.5);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let scores = matrix(|_, _| 0.0);
        let refused = |params: SequenceParams| along_sequences(&scores, &params).is_err();
        assert!(refused(SequenceParams { length: 0, ..PLAIN }));
        assert!(refused(SequenceParams { speeds: [2.0, 1.0], ..PLAIN }));
        assert!(refused(SequenceParams { speed_step: 0.0, ..PLAIN }));
        assert!(refused(SequenceParams { speed_step: f64::NAN, ..PLAIN }));
    }
}
