//! Labels pushed apart.

/// Middles as near to the wanted ones as they can be without overlap, in order: neighbours that
/// would overlap move as one, to their common mean. All lie between `low` and `high` if they fit.
pub(super) fn apart(wanted: &[f64], heights: &[f64], low: f64, high: f64) -> Vec<f64> {
    // In units in which every item has no height: subtract what lies before it.
    let mut before = 0.0;
    let mut offsets = Vec::with_capacity(wanted.len());
    for height in heights {
        offsets.push(before + height / 2.0);
        before += height;
    }
    // Pools of the isotonic regression: mean and size.
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for (want, offset) in wanted.iter().zip(&offsets) {
        let mut pool = (want - offset, 1);
        while let Some(&(mean, n)) = pools.last().filter(|it| it.0 >= pool.0) {
            pools.pop();
            let total = mean * n as f64 + pool.0 * pool.1 as f64;
            pool = (total / (n + pool.1) as f64, n + pool.1);
        }
        pools.push(pool);
    }
    let starts = pools.iter().flat_map(|&(mean, n)| std::iter::repeat_n(mean, n));
    let highest = (high - before).max(low);
    starts.zip(&offsets).map(|(start, offset)| start.clamp(low, highest) + offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_move_as_little_as_they_must() {
        // Far apart: where they want to be.
        assert_eq!(apart(&[10.0, 50.0], &[10.0, 10.0], 0.0, 100.0), [10.0, 50.0]);
        // Both want 50: half a height away each.
        assert_eq!(apart(&[50.0, 50.0], &[10.0, 10.0], 0.0, 100.0), [45.0, 55.0]);
        // At the edge: pushed inside, still apart.
        assert_eq!(apart(&[99.0, 99.0], &[10.0, 10.0], 0.0, 100.0), [85.0, 95.0]);
        assert_eq!(apart(&[1.0, 2.0, 90.0], &[10.0; 3], 0.0, 100.0), [5.0, 15.0, 90.0]);
        let crowded = apart(&[50.0; 9], &[14.0; 9], 0.0, 100.0);
        assert!(crowded.windows(2).all(|it| it[1] - it[0] >= 14.0 - 1e-9), "{crowded:?}");
    }
}
