//! Numbers as people read them.

use super::{Interval, Value};

/// Share by which the two sides of an interval may differ and still be one number.
const ALIKE: f64 = 0.25;

/// A value with its interval, if it has one: `.865 ± .03`, `.865 (.81–.89)` where the two sides
/// differ.
pub(super) fn with_interval(value: &Value, interval: Option<&Interval>) -> String {
    let (Value::Number(value), Some(interval)) = (value, interval) else { return text(value) };
    let (below, above) = (value - interval.low, interval.high - value);
    let half = below.max(above);
    if !(half.is_finite() && half > 0.0) {
        return format!("{} ± 0", number(*value));
    }
    // One digit of the interval says how many of the value mean something; one more is shown.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4")]
    let decimals = (-half.log10().floor()).clamp(0.0, 4.0) as usize;
    let shown = fixed(*value, decimals + 1);
    if (below - above).abs() <= ALIKE * half {
        return format!("{shown} ± {}", fixed(half, decimals));
    }
    let (low, high) = (fixed(interval.low, decimals), fixed(interval.high, decimals));
    let to = if interval.low < 0.0 { " to " } else { "–" };
    format!("{shown} ({low}{to}{high})")
}

/// A p-value: `= 0.031`, or `< 0.001`, for none is zero.
#[must_use]
pub fn p_value(value: f64) -> String {
    if value < 0.001 { "< 0.001".to_owned() } else { format!("= {value:.3}") }
}

/// A number: whole, or four decimals, or two if large; fractions without the zero before the point.
pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value.fract() == 0.0 && magnitude < 1e9 {
        format!("{value}")
    } else if magnitude >= 100.0 {
        format!("{value:.2}")
    } else if magnitude >= 1e-3 {
        fixed(value, 4)
    } else {
        format!("{value:.2e}")
    }
}

pub(super) fn text(value: &Value) -> String {
    match value {
        Value::Number(value) => number(*value),
        Value::Text(text) => text.clone(),
    }
}

fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if let Some(rest) = text.strip_prefix("0.") {
        return format!(".{rest}");
    }
    match text.strip_prefix("-0.") {
        Some(rest) => format!("-.{rest}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(value: f64, low: f64, high: f64) -> String {
        let interval = Interval { low, high, method: "Wilson".to_owned() };
        with_interval(&Value::Number(value), Some(&interval))
    }

    #[test]
    fn intervals_show_their_width_or_their_ends() {
        assert_eq!(shown(0.8648, 0.834, 0.893), ".865 ± .03");
        assert_eq!(shown(0.865, 0.81, 0.89), ".865 (.81–.89)");
        assert_eq!(shown(0.02, -0.11, 0.23), ".02 (-.1 to .2)");
        assert_eq!(shown(0.5, 0.496, 0.504), ".5000 ± .004");
        assert_eq!(shown(12.34, 9.1, 15.6), "12.3 ± 3");
        assert_eq!(shown(1.0, 1.0, 1.0), "1 ± 0");
        assert_eq!(shown(1.0, 0.96, 1.0), "1.000 (.96–1.00)");
    }

    #[test]
    fn numbers_read_well() {
        let printed = [0.0, 0.5, -0.25, 111.0, 35_721.0, 138.384, 12.5, 2.4e-6].map(number);
        let expected = ["0", ".5000", "-.2500", "111", "35721", "138.38", "12.5000", "2.40e-6"];
        assert_eq!(printed, expected);
    }
}
