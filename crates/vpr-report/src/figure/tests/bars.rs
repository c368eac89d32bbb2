//! Bars of categories.

use super::{Curve, Figure, Panel, Shape, panel};

pub(super) fn encoders() -> Figure {
    let curve = |name: &str, values: [f64; 2]| {
        let points = values.into_iter().enumerate().map(|(at, it)| (at as f64, it)).collect();
        let band = values.iter().map(|it| (0.8 * it, 1.3 * it)).collect();
        Curve::new(name, points).within(band).shaped(Shape::Bars)
    };
    let curves = vec![
        curve("default", [1.1, 7.0]),
        curve("triplet", [1.5, 9.5]),
        curve("distance", [f64::NAN, 11.4]),
    ];
    let x_ticks = vec![(0.0, "Shop Facade".to_owned()), (1.0, "Station Escalator".to_owned())];
    Figure { panels: vec![Panel { x_ticks, ..panel("Places", ("place", "MTE, m"), curves) }] }
}

#[test]
fn bars_stand_on_zero_beside_each_other() {
    let svg = encoders().svg("bars");
    let bars: Vec<Vec<f64>> = svg
        .lines()
        .filter_map(|line| line.strip_prefix("<path class=\"m c")?.split_once("d=\"M"))
        .filter(|(_, path)| path.contains('V') && path.contains('H'))
        .map(|(_, path)| {
            let numbers = path.split(|it: char| !(it.is_ascii_digit() || it == '.'));
            numbers.filter_map(|it| it.parse().ok()).collect()
        })
        .collect();
    // Five: a value that is no number has none. Left edge, foot, head, right edge.
    assert_eq!(bars.len(), 5, "{svg}");
    assert!(bars.iter().all(|it| it[1] == bars[0][1] && it[2] < it[1]), "{bars:?}");
    let mut sides: Vec<(f64, f64)> = bars.iter().map(|it| (it[0], it[3])).collect();
    sides.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(sides.windows(2).all(|it| it[0].1 < it[1].0), "{sides:?}");
    let height = |at: usize| bars[at][1] - bars[at][2];
    assert!((height(1) / height(0) - 7.0 / 1.1).abs() < 0.1, "{bars:?}");
}
