//! Fewer points that draw the same picture. Coordinates are tenths of a pixel, whole numbers, so
//! that a value rounded otherwise on another processor leaves the same points.

/// A place in tenths of a pixel.
pub(super) type Place = (i64, i64);

/// The points of a line without those closer than `tolerance` to what remains (Douglas and Peucker
/// 1973).
pub(super) fn simplify(points: &[Place], tolerance: i64) -> Vec<Place> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    keep[0] = true;
    keep[points.len() - 1] = true;
    let mut open = vec![(0, points.len() - 1)];
    while let Some((first, last)) = open.pop() {
        let farthest = (first + 1..last)
            .map(|index| (squared_distance(points[index], points[first], points[last]), index))
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((distance, index)) = farthest else { continue };
        if distance > (tolerance * tolerance) as f64 {
            keep[index] = true;
            open.extend([(first, index), (index, last)]);
        }
    }
    points.iter().zip(keep).filter_map(|(&point, keep)| keep.then_some(point)).collect()
}

/// From a point to the piece of a line between two others, squared.
fn squared_distance(point: Place, from: Place, to: Place) -> f64 {
    let (dx, dy) = ((to.0 - from.0) as f64, (to.1 - from.1) as f64);
    let (px, py) = ((point.0 - from.0) as f64, (point.1 - from.1) as f64);
    let length = dx * dx + dy * dy;
    let along = if length > 0.0 { ((px * dx + py * dy) / length).clamp(0.0, 1.0) } else { 0.0 };
    (px - along * dx).powi(2) + (py - along * dy).powi(2)
}

/// One point for every cell of side `cell` that has any, in order of the cells, whose corners lie
/// at `shift`.
pub(super) fn scatter(points: &[Place], cell: i64, shift: i64) -> Vec<Place> {
    let index = |at: i64| (at - shift).div_euclid(cell);
    let mut cells: Vec<Place> = points.iter().map(|it| (index(it.0), index(it.1))).collect();
    cells.sort_unstable();
    cells.dedup();
    let middle = |index: i64| index * cell + cell / 2 + shift;
    cells.into_iter().map(|it| (middle(it.0), middle(it.1))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_two_points_and_a_corner_stays() {
        let line: Vec<Place> = (0..100).map(|x| (x, 2 * x)).collect();
        assert_eq!(simplify(&line, 3), [(0, 0), (99, 198)]);
        let corner = [(0, 0), (50, 1), (100, 0), (100, 100)];
        assert_eq!(simplify(&corner, 3), [(0, 0), (100, 0), (100, 100)]);
        assert_eq!(simplify(&[(5, 5); 9], 3), [(5, 5), (5, 5)]);
    }

    #[test]
    fn what_is_left_out_is_within_the_tolerance() {
        let wave: Vec<Place> = (0..2000)
            .map(|x| {
                #[expect(clippy::cast_possible_truncation, reason = "a small number")]
                let y = (300.0 * (x as f64 / 90.0).sin()) as i64;
                (x, y)
            })
            .collect();
        let thin = simplify(&wave, 3);
        assert!(thin.len() < wave.len() / 10, "{}", thin.len());
        for &point in &wave {
            let nearest = thin.windows(2).map(|it| squared_distance(point, it[0], it[1]));
            assert!(nearest.fold(f64::INFINITY, f64::min) <= 9.0, "{point:?}");
        }
    }

    #[test]
    fn crowded_points_become_one() {
        let points = [(1, 1), (3, 18), (25, 1), (-1, 0)];
        assert_eq!(scatter(&points, 20, 0), [(-10, 10), (10, 10), (30, 10)]);
        assert_eq!(scatter(&points, 20, 10), [(0, 0), (0, 20), (20, 0)]);
    }
}
