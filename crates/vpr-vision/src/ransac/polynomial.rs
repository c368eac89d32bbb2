//! Real roots of polynomials.

/// Number of coefficients of a polynomial of degree 10.
const N: usize = 11;

/// The real roots of a polynomial of degree 10 at which its sign changes, from the constant up.
///
/// Those beyond ±1 are the reciprocals of the roots of the polynomial read backwards, so that nothing is evaluated
/// beyond ±1, however large a root is.
pub(super) fn real_roots(polynomial: &[f64; N]) -> impl Iterator<Item = f64> {
    let mut backwards = *polynomial;
    backwards.reverse();
    let far = roots_within_one(&backwards);
    // Of the two sides that both have ±1, one is asked.
    let far = far.into_iter().filter(|it| *it != 0.0 && it.abs() < 1.0).map(|it| 1.0 / it);
    roots_within_one(polynomial).into_iter().chain(far)
}

/// From −1 to 1, in order. Between two neighbouring roots of its derivative a polynomial has at most one.
fn roots_within_one(polynomial: &[f64; N]) -> Vec<f64> {
    let mut derivatives = [*polynomial; N];
    for order in 1..N {
        let before = derivatives[order - 1];
        derivatives[order] = [0.0; N];
        for power in 1..N {
            // The binomial instead of the factorial: a positive factor moves no root.
            derivatives[order][power - 1] = before[power] * power as f64 / order as f64;
        }
    }
    let mut roots = Vec::with_capacity(N);
    let mut ends = Vec::with_capacity(N + 1);
    for order in (0..N - 1).rev() {
        let (own, slope) = (&derivatives[order][..N - order], &derivatives[order + 1]);
        ends.clear();
        ends.push(-1.0);
        ends.append(&mut roots);
        ends.push(1.0);
        let scale = (order + 1) as f64;
        roots
            .extend(ends.windows(2).filter_map(|it| {
                root_between(own, &slope[..N - order - 1], scale, [it[0], it[1]])
            }));
    }
    roots
}

/// The root between two ends of which only one is above 0, by Newton's steps that stay between, and halving.
fn root_between(
    own: &[f64],
    slope: &[f64],
    scale: f64,
    [mut low, mut high]: [f64; 2],
) -> Option<f64> {
    let value =
        |polynomial: &[f64], at: f64| polynomial.iter().rev().fold(0.0, |sum, it| sum * at + it);
    let rises = value(own, high) > 0.0;
    if (value(own, low) > 0.0) == rises {
        return None;
    }
    let mut at = 0.5 * (low + high);
    // Halving alone ends after 60 steps: f64 resolves no more between −1 and 1.
    for _ in 0..100 {
        let here = value(own, at);
        if here == 0.0 {
            break;
        }
        if (here > 0.0) == rises {
            high = at;
        } else {
            low = at;
        }
        let newton = at - here / (scale * value(slope, at));
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - at).abs() <= 1e-16 {
            break;
        }
        at = next;
    }
    Some(at)
}
