//! What can be seen of a line: it is cut where it leaves the axes.

/// A place, in shares of both axes.
pub(super) type Point = (f64, f64);

/// The straight lines between points as far as they lie within the unit square, in unbroken pieces.
/// A point that is nowhere breaks the line.
pub(super) fn visible(points: impl Iterator<Item = Option<Point>>) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let mut before = None;
    for point in points {
        match (before, point) {
            (Some(from), Some(to)) => {
                if let Some((start, end)) = clip(from, to) {
                    match pieces.last_mut() {
                        Some(piece) if piece.last() == Some(&start) => piece.push(end),
                        _ => pieces.push(vec![start, end]),
                    }
                }
            }
            (None, Some(at)) if is_inside(at) => pieces.push(vec![at]),
            _ => {}
        }
        before = point;
    }
    pieces
}

fn is_inside((x, y): Point) -> bool {
    (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y)
}

/// The part of a straight line within the unit square (Liang and Barsky 1984).
fn clip(from: Point, to: Point) -> Option<(Point, Point)> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (step, room) in [(-dx, from.0), (dx, 1.0 - from.0), (-dy, from.1), (dy, 1.0 - from.1)] {
        if step == 0.0 && room < 0.0 {
            return None;
        } else if step < 0.0 {
            first = first.max(room / step);
        } else if step > 0.0 {
            last = last.min(room / step);
        }
    }
    let at = |share: f64| (from.0 + share * dx, from.1 + share * dy);
    let start = if first > 0.0 { at(first) } else { from };
    let end = if last < 1.0 { at(last) } else { to };
    (first < last).then_some((start, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(points: &[Point]) -> Vec<Vec<Point>> {
        visible(points.iter().map(|&it| Some(it)))
    }

    #[test]
    fn what_lies_inside_stays_as_it_is() {
        let points = [(0.1, 0.2), (0.1, 0.2), (1.0, 0.0), (0.3, 0.9)];
        assert_eq!(pieces(&points), [points]);
        assert_eq!(pieces(&[(0.5, 0.5)]), [[(0.5, 0.5)]]);
        assert!(pieces(&[]).is_empty() && pieces(&[(2.0, 0.5)]).is_empty());
    }

    #[test]
    fn lines_end_at_the_edge_and_begin_there_again() {
        let points = [(0.0, 0.5), (0.25, 0.5), (0.5, -0.5), (0.75, 0.5)];
        let left = vec![(0.0, 0.5), (0.25, 0.5), (0.375, 0.0)];
        assert_eq!(pieces(&points), [left, vec![(0.625, 0.0), (0.75, 0.5)]]);
        // From outside to outside, through or past.
        assert_eq!(pieces(&[(-1.0, 0.5), (2.0, 0.5)]), [[(0.0, 0.5), (1.0, 0.5)]]);
        assert!(pieces(&[(-1.0, 0.5), (0.5, 2.0)]).is_empty());
        assert!(pieces(&[(-1.0, 2.0), (2.0, 2.0)]).is_empty());
    }

    #[test]
    fn a_point_that_is_nowhere_breaks_the_line() {
        let points = [Some((0.1, 0.1)), Some((0.2, 0.1)), None, Some((0.2, 0.1)), None];
        let pieces = visible(points.into_iter());
        assert_eq!(pieces, [vec![(0.1, 0.1), (0.2, 0.1)], vec![(0.2, 0.1)]]);
    }
}
