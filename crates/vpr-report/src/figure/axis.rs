//! From values to places along an axis, and the numbers beside it.

use super::Scale;

/// An axis over the values it must show, no farther.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    scale: Scale,
    /// Ends, in logarithms if the scale is one of factors.
    low: f64,
    high: f64,
    /// Places along the axis, from 0 to 1, and what stands there.
    pub(super) ticks: Vec<(f64, String)>,
}

impl Axis {
    /// An axis over finite values with about `n` numbers, or with named places.
    pub(super) fn over(
        values: impl Iterator<Item = f64>,
        scale: Scale,
        n: f64,
        named: &[(f64, String)],
    ) -> Self {
        let values = values.filter_map(|value| transform(scale, value));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| {
            (low.min(it), high.max(it))
        });
        let (low, high) = if low > high {
            (0.0, 1.0)
        } else if high - low <= 1e-12 * low.abs() {
            (low - 0.5, high + 0.5)
        } else {
            (low, high)
        };
        let mut axis = Self { scale, low, high, ticks: Vec::new() };
        axis.ticks = match (named, scale) {
            ([], Scale::Linear) => axis.steps(n),
            ([], Scale::Log) => axis.factors(n),
            (named, _) => named
                .iter()
                .filter_map(|(value, name)| Some((axis.share(*value)?, name.clone())))
                .collect(),
        };
        axis
    }

    /// Where a value lies along the axis, 0 to 1; `None` if it cannot be shown.
    pub(super) fn share(&self, value: f64) -> Option<f64> {
        self.beyond(value).filter(|share| (0.0..=1.0).contains(share))
    }

    /// The same, also before and behind the ends of the axis; at them where only rounding says
    /// otherwise.
    pub(super) fn beyond(&self, value: f64) -> Option<f64> {
        let share = (transform(self.scale, value)? - self.low) / (self.high - self.low);
        let end = if share < 0.5 { 0.0 } else { 1.0 };
        Some(if (share - end).abs() <= 1e-9 { end } else { share })
    }

    fn steps(&self, n: f64) -> Vec<(f64, String)> {
        let rough = (self.high - self.low) / n.max(1.0);
        let power = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|it| it * power >= rough * 0.7);
        let step = step.unwrap_or(10.0) * power;
        let first = (self.low / step - 1e-9).ceil();
        let count = ((self.high - first * step) / step + 1e-9).floor();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        let count = count.clamp(0.0, 50.0) as usize;
        let value = |index: usize| (first + index as f64) * step;
        (0..=count)
            .filter_map(|index| Some((self.share(value(index))?, number(value(index), step))))
            .collect()
    }

    fn factors(&self, n: f64) -> Vec<(f64, String)> {
        let span = self.high - self.low;
        let within: &[f64] = if span < 1.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        #[expect(clippy::cast_possible_truncation, reason = "a logarithm")]
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        let every = usize::try_from(last - first).unwrap_or(1) as f64 / (2.0 * n).max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        let every = every.ceil().max(1.0) as usize;
        let powers =
            (first..=last).step_by(every).flat_map(|it| within.iter().map(move |f| (it, f)));
        powers
            .filter_map(|(power, factor)| {
                let value = factor * 10_f64.powi(power);
                Some((self.share(value)?, number(value, value / factor)))
            })
            .collect()
    }
}

fn transform(scale: Scale, value: f64) -> Option<f64> {
    let transformed = if scale == Scale::Log { value.log10() } else { value };
    transformed.is_finite().then_some(transformed)
}

/// A number beside an axis, with as many decimals as its step needs.
fn number(value: f64, step: f64) -> String {
    let value = if value.abs() < step * 1e-6 { 0.0 } else { value };
    if value != 0.0 && (value.abs() >= 1e5 || step < 1e-4) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 15")]
        let digits =
            (value.abs().log10().floor() - (step.log10() + 1e-9).floor()).clamp(0.0, 15.0) as usize;
        let text = format!("{value:.digits$e}");
        return match text.split_once('e') {
            Some((digits, power)) if digits.contains('.') => {
                format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
            }
            _ => text,
        };
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4")]
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 4.0) as usize;
    let decimals = if value == 0.0 && step < 1e-4 { 0 } else { decimals };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|it| it.1.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::over([0.62, 0.97].into_iter(), Scale::Linear, 4.0, &[]);
        assert_eq!(texts(&axis), ["0.7", "0.8", "0.9"]);
        assert!((axis.share(0.62).unwrap()).abs() < 1e-12 && axis.share(0.5).is_none());
        let axis = Axis::over([-1.0, f64::NAN, 1.0].into_iter(), Scale::Linear, 4.0, &[]);
        assert_eq!(texts(&axis), ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        let axis = Axis::over([1.16e-6, 1.29e-6].into_iter(), Scale::Linear, 3.0, &[]);
        assert_eq!(texts(&axis), ["1.2e-6", "1.25e-6"]);
        let axis = Axis::over([0.0, 250_000.0].into_iter(), Scale::Linear, 3.0, &[]);
        assert_eq!(texts(&axis), ["0", "1e5", "2e5"]);
        let axis = Axis::over([0.0, 250.0].into_iter(), Scale::Linear, 3.0, &[]);
        assert_eq!(texts(&axis), ["0", "100", "200"]);
    }

    #[test]
    fn factors_leave_out_what_is_not_positive() {
        let axis = Axis::over([0.0, 0.1, 1000.0].into_iter(), Scale::Log, 5.0, &[]);
        assert_eq!(texts(&axis), ["0.1", "1", "10", "100", "1000"]);
        assert_eq!(axis.share(0.0), None);
        assert!((axis.share(10.0).unwrap() - 0.5).abs() < 1e-12);
        let axis = Axis::over([3.0, 30.0].into_iter(), Scale::Log, 4.0, &[]);
        assert_eq!(texts(&axis), ["5", "10", "20"]);
    }

    #[test]
    fn one_value_or_none_still_makes_an_axis() {
        assert_eq!(Axis::over([2.0].into_iter(), Scale::Linear, 2.0, &[]).share(2.0), Some(0.5));
        assert!(!Axis::over([].into_iter(), Scale::Linear, 2.0, &[]).ticks.is_empty());
        let named = [(0.0, "before".to_owned()), (9.0, "beyond".to_owned())];
        let axis = Axis::over([0.0, 1.0].into_iter(), Scale::Linear, 2.0, &named);
        assert_eq!(texts(&axis), ["before"]);
    }
}
