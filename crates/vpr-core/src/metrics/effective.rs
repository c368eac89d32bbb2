//! Intervals of areas under curves that hold where nearly all matches are right, or nearly none.
//!
//! A resampled area cannot leave what was observed: with two wrong matches among fifty, bootstrap
//! intervals of every kind end too early, and without a wrong match they have no width
//! (`docs/statistics.md` has the coverage of each). Here the variance of the area, by the delta
//! method, says how many queries the area is worth as if it were a share of them, and Wilson's
//! interval of that share is taken (Korn and Graubard 1998 do so for surveys). The variance is that
//! of the matches with one right and one wrong match more, which may rank anywhere, so it is never
//! zero. Nothing is drawn: the same matches give the same bits.

use super::bootstrap::{Interval, wilson};
use crate::Definition;

/// How these intervals are called in cells.
pub const METHOD: &str = "Wilson, effective queries";

/// Matches of one confidence, counted; counts need not be whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Group {
    /// Correct matches.
    pub(crate) right: f64,
    /// Wrong matches of queries that have a correct reference.
    pub(crate) wrong: f64,
    /// Matches of queries that have none.
    pub(crate) unknown: f64,
}

/// An area and the variance that the delta method gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Area {
    value: f64,
    variance: f64,
}

impl Group {
    fn size(self) -> f64 {
        self.right + self.wrong + self.unknown
    }
}

/// 95 % interval of `estimate`, the area under the precision–recall curve of groups of falling
/// confidence. At least one match is right, or at least one query known.
///
/// A right match that counts in its own precision makes the area of few right matches too large:
/// the lower end is around the area without them, the upper end around the one with them. The
/// quantile is Student's, with as many degrees of freedom as there are right matches.
pub(crate) fn precision_recall(
    groups: &[Group],
    estimate: f64,
    definition: Definition,
) -> Interval {
    let moments = pr_area(&with_one_more_of_each(groups), definition);
    let (without, with) = own_match(groups, definition);
    let n_right = groups.iter().map(|it| it.right).sum();
    let ends = (without.min(estimate), with.max(estimate));
    around(estimate, ends, moments, (size(groups), student_95(n_right)))
}

/// 95 % interval of `estimate`, the area under the ROC curve of right against wrong matches, at
/// least one of each. The quantile is Student's, with as many degrees of freedom as the fewer have.
pub(crate) fn roc(groups: &[Group], estimate: f64) -> Interval {
    let moments = roc_area(&with_one_more_of_each(groups));
    let (n_right, n) =
        groups.iter().fold((0.0, 0.0), |(right, all), it| (right + it.right, all + it.size()));
    around(estimate, (estimate, estimate), moments, (n, student_95(n_right.min(n - n_right))))
}

/// Wilson's interval, its ends around these two values.
fn around(
    estimate: f64,
    (low, high): (f64, f64),
    Area { value, variance }: Area,
    (n, z): (f64, f64),
) -> Interval {
    // Where many are tied the variance may be tiny, or none: that is not more than was seen.
    let n_effective = (value * (1.0 - value) / variance).min(n);
    Interval {
        estimate,
        // By rounding an area may be above 1.
        low: wilson(low, n_effective, z).0.max(0.0).min(estimate),
        high: wilson(high, n_effective, z).1.min(1.0).max(estimate),
        n_undefined: 0,
    }
}

/// One right and one wrong match more, spread evenly over the ranks.
fn with_one_more_of_each(groups: &[Group]) -> Vec<Group> {
    let n = size(groups);
    let more = |it: &Group| {
        let share = it.size() / n;
        Group { right: it.right + share, wrong: it.wrong + share, unknown: it.unknown }
    };
    groups.iter().map(more).collect()
}

fn size(groups: &[Group]) -> f64 {
    groups.iter().map(|it| it.size()).sum()
}

/// What recall is relative to.
fn n_positives(groups: &[Group], definition: Definition) -> f64 {
    let of = |it: &Group| match definition {
        Definition::Published => it.right,
        Definition::Corrected => it.right + it.wrong,
    };
    groups.iter().map(of).sum()
}

/// The area by trapezoids from the artificial point (0, 1), as [`super::auc_pr`], for counts that
/// need not be whole. Every group has right matches.
fn pr_area(groups: &[Group], definition: Definition) -> Area {
    let positives = n_positives(groups, definition);
    let (mut right, mut accepted) = (0.0, 0.0);
    // Matches accepted and precision, after each group.
    let mut after = Vec::with_capacity(groups.len());
    let mut sum = 0.0;
    let mut before = 1.0;
    for group in groups {
        right += group.right;
        accepted += group.size();
        let precision: f64 = right / accepted;
        sum += group.right * f64::midpoint(before, precision);
        after.push((accepted, precision));
        before = precision;
    }
    let value = sum / positives;
    // How the sum grows with one more match of each kind: in its own group by the precision there,
    // and in all later groups, whose precision it moves.
    let (mut later_right, mut later_wrong, mut variance) = (0.0, 0.0, 0.0);
    for (index, group) in groups.iter().enumerate().rev() {
        let (accepted, precision) = after[index];
        let next = groups.get(index + 1).map_or(0.0, |it| it.right);
        let weight = f64::midpoint(group.right, next) / accepted;
        later_right += weight * (1.0 - precision);
        later_wrong += weight * precision;
        let before = if index == 0 { 1.0 } else { after[index - 1].1 };
        let of_right = f64::midpoint(before, precision) + later_right - value;
        let of_unknown = -later_wrong;
        let of_wrong = match definition {
            Definition::Published => of_unknown,
            Definition::Corrected => of_unknown - value,
        };
        variance += group.right * of_right * of_right
            + group.wrong * of_wrong * of_wrong
            + group.unknown * of_unknown * of_unknown;
    }
    Area { value, variance: variance / (positives * positives) }
}

/// Mean precision at the right matches, without each of them in its own precision and with it. Half
/// a match as precise as all of them are on average stands before the first.
fn own_match(groups: &[Group], definition: Definition) -> (f64, f64) {
    const PRIOR: f64 = 0.5;
    let n_right: f64 = groups.iter().map(|it| it.right).sum();
    if n_right == 0.0 {
        return (0.0, 0.0);
    }
    let (mut right, mut accepted, mut with) = (0.0, 0.0, 0.0);
    let (mut before, mut area) = (1.0, 0.0);
    for group in groups {
        right += group.right;
        accepted += group.size();
        with += group.right * right / accepted;
        area += group.right * f64::midpoint(before, right / accepted);
        before = right / accepted;
    }
    let (mut right, mut accepted, mut without) = (0.0, 0.0, 0.0);
    for group in groups {
        right += group.right;
        accepted += group.size();
        without += group.right * (right - 1.0 + PRIOR * area / n_right) / (accepted - 1.0 + PRIOR);
    }
    let positives = n_positives(groups, definition);
    ((without / positives).max(0.0), with / positives)
}

/// The area and its variance (`DeLong` et al. 1988). Every group has right and wrong matches.
fn roc_area(groups: &[Group]) -> Area {
    let n_right: f64 = groups.iter().map(|it| it.right).sum();
    let n_wrong: f64 = groups.iter().map(|it| it.wrong + it.unknown).sum();
    // Of each group: share of the wrong below a right match, of the right above a wrong match.
    let (mut right, mut wrong, mut value) = (0.0, 0.0, 0.0);
    let mut shares = Vec::with_capacity(groups.len());
    for group in groups {
        let here = group.wrong + group.unknown;
        let below = (n_wrong - wrong - here / 2.0) / n_wrong;
        let above = (right + group.right / 2.0) / n_right;
        value += group.right * below / n_right;
        shares.push((below, above, here));
        (right, wrong) = (right + group.right, wrong + here);
    }
    let of = |(group, &(below, above, here)): (&Group, &(f64, f64, f64))| {
        group.right * ((below - value) / n_right).powi(2)
            + here * ((above - value) / n_wrong).powi(2)
    };
    Area { value, variance: groups.iter().zip(&shares).map(of).sum() }
}

/// The .975 quantile of Student's distribution; fewer than one degree of freedom count as one.
fn student_95(degrees: f64) -> f64 {
    const Z: f64 = super::bootstrap::Z_95;
    const FIRST: [f64; 4] =
        [12.706_204_736_174_7, 4.302_652_729_749_46, 3.182_446_305_284_26, 2.776_445_105_197_8];
    if let Some((_, &quantile)) =
        (1_u32..).zip(&FIRST).find(|(df, _)| degrees < f64::from(*df) + 0.5)
    {
        return quantile;
    }
    // Cornish and Fisher's series, right to 3e-4 from five degrees on.
    let power = |n: i32| Z.powi(n);
    let terms = [
        (power(3) + Z) / 4.0,
        (5.0 * power(5) + 16.0 * power(3) + 3.0 * Z) / 96.0,
        (3.0 * power(7) + 19.0 * power(5) + 17.0 * power(3) - 15.0 * Z) / 384.0,
        (79.0 * power(9) + 776.0 * power(7) + 1482.0 * power(5) - 1920.0 * power(3) - 945.0 * Z)
            / 92160.0,
    ];
    terms.iter().rev().fold(0.0, |sum, term| (sum + term) / degrees) + Z
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn groups(counts: &[(u8, u8, u8)]) -> Vec<Group> {
        let of = |&(right, wrong, unknown): &(u8, u8, u8)| Group {
            right: f64::from(right),
            wrong: f64::from(wrong),
            unknown: f64::from(unknown),
        };
        counts.iter().map(of).collect()
    }

    /// The derivative of the area by one count, by differences.
    fn slope(
        groups: &[Group],
        definition: Definition,
        change: impl Fn(&mut Group, f64),
        at: usize,
    ) -> f64 {
        let step = 1e-5;
        let area = |by: f64| {
            let mut moved = groups.to_vec();
            change(&mut moved[at], by);
            pr_area(&moved, definition).value
        };
        (area(step) - area(-step)) / (2.0 * step)
    }

    proptest! {
        #[test]
        fn the_variance_is_the_one_of_the_derivatives(
            counts in prop::collection::vec((1_u8..5, 1_u8..5, 1_u8..5), 1..7),
        ) {
            let groups = groups(&counts);
            for definition in [Definition::Published, Definition::Corrected] {
                let mut expected = 0.0;
                for at in 0..groups.len() {
                    let of_right = slope(&groups, definition, |it, by| it.right += by, at);
                    let of_wrong = slope(&groups, definition, |it, by| it.wrong += by, at);
                    let of_unknown = slope(&groups, definition, |it, by| it.unknown += by, at);
                    expected += groups[at].right * of_right.powi(2)
                        + groups[at].wrong * of_wrong.powi(2)
                        + groups[at].unknown * of_unknown.powi(2);
                }
                let variance = pr_area(&groups, definition).variance;
                prop_assert!((variance - expected).abs() < 1e-6 * (1.0 + expected), "{variance} {expected}");
            }
        }

        #[test]
        fn an_interval_holds_its_estimate_and_has_a_width(
            counts in prop::collection::vec((0_u8..4, 0_u8..4, 0_u8..2), 1..20),
        ) {
            let mut groups = groups(&counts);
            groups[0].right += 1.0;
            for definition in [Definition::Published, Definition::Corrected] {
                let kept: Vec<Group> = groups.iter().copied().filter(|it| it.size() > 0.0).collect();
                let estimate = pr_area(&kept, definition).value.min(1.0);
                let it = precision_recall(&kept, estimate, definition);
                prop_assert!(0.0 <= it.low && it.low <= estimate && estimate <= it.high && it.high <= 1.0);
                prop_assert!(it.high - it.low > 1e-3, "{it:?}");
            }
        }
    }

    #[test]
    fn without_a_wrong_match_the_lower_end_is_that_of_a_share() {
        let all_right = vec![Group { right: 1.0, ..Group::default() }; 50];
        let interval = precision_recall(&all_right, 1.0, Definition::Published);
        assert_eq!(interval.high, 1.0);
        // Wilson's for 50 of 50 is .929; the area is worth a little less than 50 queries.
        assert!((0.87..0.93).contains(&interval.low), "{interval:?}");
        let one = precision_recall(&all_right[..1], 1.0, Definition::Published);
        assert!(one.low < 0.1 && one.high == 1.0, "{one:?}");
    }

    #[test]
    fn the_variance_of_delong_by_hand() {
        // Right, wrong, right, wrong: one pair of four is in the wrong order.
        let groups = groups(&[(1, 0, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1)]);
        let area = roc_area(&groups);
        assert_eq!(area.value, 0.75);
        // Shares of the wrong below: 1 and 1/2; of the right above: 1/2 and 1; each ¼ off, halved.
        assert_eq!(area.variance, 4.0 * (0.25_f64 / 2.0).powi(2));
    }

    #[test]
    fn ties_of_all_are_worth_no_more_than_their_number() {
        let interval = roc(&groups(&[(10, 10, 0)]), 0.5);
        // Wilson's of 10 of 20 is .299 to .701; Student's quantile is a little wider.
        assert!((0.25..0.31).contains(&interval.low), "{interval:?}");
        assert!((interval.low + interval.high - 1.0).abs() < 1e-12, "{interval:?}");
    }

    #[test]
    fn quantiles_of_scipy() {
        // scipy.stats.t.ppf(0.975, df).
        let cases = [
            (0.0, 12.7062),
            (1.0, 12.7062),
            (4.0, 2.7764),
            (5.0, 2.570_58),
            (30.0, 2.0423),
            (1e9, 1.95996),
        ];
        for (df, expected) in cases {
            assert!((student_95(df) - expected).abs() < 4e-4, "{df}: {}", student_95(df));
        }
    }
}
