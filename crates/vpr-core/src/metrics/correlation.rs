//! Rank correlation.

/// Spearman's rank correlation, equal values sharing the mean of their ranks; `None` if one side
/// has no order: fewer than two values, or all equal.
///
/// Agrees with `scipy.stats.spearmanr`.
///
/// # Panics
///
/// If the two are not equally many.
#[must_use]
pub fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    assert_eq!(x.len(), y.len(), "one value of each per item");
    let (x, y) = (ranks(x), ranks(y));
    let middle = (x.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - middle) * (b - middle)).sum()
    };
    let scale = (product(&x, &x) * product(&y, &y)).sqrt();
    (scale > 0.0).then(|| product(&x, &y) / scale)
}

/// The rank of every value from zero.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = |value: &f64| {
        let below = sorted.partition_point(|it| it < value);
        let upto = sorted.partition_point(|it| it <= value);
        (below + upto - 1) as f64 / 2.0
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_decide_and_ties_share() {
        let x = [0.0, 0.0, 1.0, 2.0];
        assert_eq!(spearman(&x, &[1.0, 1.0, 8.0, 9.0]), Some(1.0));
        assert_eq!(spearman(&x, &[9.0, 9.0, 8.0, 1.0]), Some(-1.0));
        // scipy.stats.spearmanr([0, 0, 1, 2], [3, 1, 2, 4]).
        let rho = spearman(&x, &[3.0, 1.0, 2.0, 4.0]).unwrap();
        assert!((rho - 0.632_455_532).abs() < 1e-9, "{rho}");
        assert_eq!(spearman(&x, &[5.0; 4]), None);
        assert_eq!(spearman(&[], &[]), None);
    }
}
