//! What must not change an uncertainty, and what must change it.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use ndarray::Array2;
use proptest::prelude::*;
use sue::{
    Density, DensityCompensatedSue, DistanceKind, Error, L2Distance, Neighbors, PaScore, Places,
    RatioSpread, SimilarityDistribution, StatisticalUncertainty, Sue, SueDefinition, SueParams,
    UncertaintyEstimator, Uniform,
};
use vpr_core::{PlanarPosition, Poses, Position, Retrieval};

fn retrieval(distances: &[f32]) -> Retrieval {
    let k = distances.len();
    let indices = Array2::from_shape_fn((1, k), |(_, rank)| rank);
    Retrieval::new(indices, Array2::from_shape_vec((1, k), distances.to_vec()).unwrap()).unwrap()
}

fn sue(definition: SueDefinition, lambda: f64, k: usize) -> Sue {
    let distance = DistanceKind::Euclidean;
    Sue::new(SueParams { k, lambda, distance, clip_m: None, definition }).unwrap()
}

fn planar(points: &[(f64, f64)]) -> Poses {
    Poses::Planar(points.iter().map(|it| PlanarPosition::new(it.0, it.1)).collect())
}

fn estimate(sue: &Sue, distances: &[f32], poses: &Poses) -> f64 {
    let retrieval = retrieval(distances);
    sue.estimate(&Places::from_poses(&retrieval, poses).unwrap()).unwrap()[0]
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1e-6)
}

prop_compose! {
    /// Ascending distances and as many distinct points.
    fn neighbours()(
        mut distances in prop::collection::vec(0.01_f32..2.0, 3..12),
        points in prop::collection::vec((-1e3..1e3_f64, -1e3..1e3_f64), 12),
    ) -> (Vec<f32>, Vec<(f64, f64)>) {
        distances.sort_by(f32::total_cmp);
        let n = distances.len();
        (distances, points[..n].to_vec())
    }
}

proptest! {
    #[test]
    fn moving_the_map_changes_nothing(
        (distances, points) in neighbours(),
        angle in 0.0..6.3_f64,
        shift in (-1e4..1e4_f64, -1e4..1e4_f64),
        mirrored in any::<bool>(),
    ) {
        let moved: Vec<(f64, f64)> = points
            .iter()
            .map(|&(x, y)| {
                let x = if mirrored { -x } else { x };
                let (sin, cos) = angle.sin_cos();
                (cos * x - sin * y + shift.0, sin * x + cos * y + shift.1)
            })
            .collect();
        for definition in [SueDefinition::Corrected, SueDefinition::Thesis] {
            let sue = sue(definition, 5.0, distances.len());
            let (before, after) = (
                estimate(&sue, &distances, &planar(&points)),
                estimate(&sue, &distances, &planar(&moved)),
            );
            prop_assert!(near(before, after), "{before} {after}");
        }
    }

    #[test]
    fn a_constant_on_all_distances_changes_nothing(
        (distances, points) in neighbours(),
        constant in prop::sample::select(vec![0.5_f32, 8.0, 64.0]),
    ) {
        // Distances that stay exact in f32, so that only the definition is tested.
        let coarse: Vec<f32> = distances.iter().map(|it| (it * 1024.0).round() / 1024.0).collect();
        let farther: Vec<f32> = coarse.iter().map(|it| it + constant).collect();
        let sue = sue(SueDefinition::Corrected, 350.0, distances.len());
        let poses = planar(&points);
        let (before, after) = (estimate(&sue, &coarse, &poses), estimate(&sue, &farther, &poses));
        prop_assert!(near(before, after), "{before} {after}");
    }

    #[test]
    fn the_definitions_agree_where_nothing_is_clipped_or_lost((distances, points) in neighbours()) {
        let k = distances.len();
        let poses = planar(&points);
        let of = |definition| estimate(&sue(definition, 3.0, k), &distances, &poses);
        let corrected = of(SueDefinition::Corrected);
        prop_assert!(near(of(SueDefinition::Thesis), corrected));
        prop_assert!(near(2.0 * of(SueDefinition::Published), corrected), "half of the trace");
    }

    #[test]
    fn a_planar_map_in_space_has_the_same_spread((distances, points) in neighbours()) {
        let spatial = points.iter().map(|it| Position::new(it.0, 7.0, it.1)).collect();
        let sue = sue(SueDefinition::Corrected, 3.0, distances.len());
        let (plane, space) = (
            estimate(&sue, &distances, &planar(&points)),
            estimate(&sue, &distances, &Poses::Spatial(spatial)),
        );
        prop_assert!(near(plane, space));
    }

    #[test]
    fn vanishing_decay_is_uniform((distances, points) in neighbours()) {
        let (k, poses) = (distances.len(), planar(&points));
        let retrieval = retrieval(&distances);
        let places = Places::from_poses(&retrieval, &poses).unwrap();
        let uniform = Uniform::new(k).unwrap().estimate(&places).unwrap()[0];
        let sue = sue(SueDefinition::Corrected, 1e-12, k).estimate(&places).unwrap()[0];
        prop_assert!((uniform - sue).abs() < 1e-6 * uniform.max(1.0));
    }

    #[test]
    fn ratios_do_not_see_the_scale_of_similarities((mut distances, _) in neighbours()) {
        for distance in &mut distances {
            *distance /= 2.0;
        }
        let retrieval = retrieval(&distances);
        let neighbors = Neighbors::new(&retrieval).unwrap();
        let rs = RatioSpread.estimate(&neighbors).unwrap()[0];
        let sd = SimilarityDistribution.estimate(&neighbors).unwrap()[0];
        let su = StatisticalUncertainty.estimate(&neighbors).unwrap()[0];
        prop_assert!((0.0..=1.0).contains(&rs) && (0.0..=1.0).contains(&sd));
        prop_assert!((su - f64::midpoint(rs, sd)).abs() < 1e-15);
        let pa = PaScore.estimate(&neighbors).unwrap()[0];
        prop_assert!((0.0..=1.0).contains(&pa));
        prop_assert_eq!(L2Distance.estimate(&neighbors).unwrap()[0], f64::from(distances[0]));
    }
}

#[test]
fn the_released_clip_is_not_invariant_to_mirroring() {
    let sue = Sue::new(SueParams { k: 3, lambda: 1.0, ..*Sue::published().params() }).unwrap();
    let distances = [0.1, 0.2, 0.3];
    let there = estimate(&sue, &distances, &planar(&[(0.0, 0.0), (1.0, 0.0), (3000.0, 0.0)]));
    let mirrored = estimate(&sue, &distances, &planar(&[(0.0, 0.0), (-1.0, 0.0), (-3000.0, 0.0)]));
    assert!((there - mirrored).abs() > 1e5, "{there} {mirrored}");
}

#[test]
fn a_symmetric_clip_bounds_the_spread() {
    let params = SueParams { k: 2, lambda: 1.0, clip_m: Some(500.0), ..*Sue::corrected().params() };
    let value =
        estimate(&Sue::new(params).unwrap(), &[0.1, 0.1], &planar(&[(0.0, 0.0), (1e6, 0.0)]));
    assert!((value - 500.0 * 500.0).abs() < 1e-6, "{value}");
}

#[test]
fn a_perfect_double_is_ambiguous_and_weights_that_vanish_are_named() {
    let retrieval = retrieval(&[0.0, 0.0]);
    assert_eq!(PaScore.estimate(&Neighbors::new(&retrieval).unwrap()).unwrap(), [1.0]);
    let poses = planar(&[(0.0, 0.0), (1.0, 0.0)]);
    let far = Retrieval::new(
        Array2::from_shape_fn((2, 2), |(_, rank)| rank),
        ndarray::array![[0.1, 0.2], [1e3, 2e3]],
    )
    .unwrap();
    let places = Places::from_poses(&far, &poses).unwrap();
    let err = sue(SueDefinition::Thesis, 350.0, 2).estimate(&places).unwrap_err();
    assert!(matches!(err, Error::Underflow { query: 1, .. }), "{err}");
}

#[test]
fn density_counts_distinct_positions() {
    // Four tiles of one panorama, one lone place: the panorama must not win by its number.
    let poses = planar(&[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (100.0, 0.0)]);
    let retrieval = retrieval(&[0.1; 5]);
    let places = Places::from_poses(&retrieval, &poses).unwrap();
    let sue = sue(SueDefinition::Corrected, 1.0, 5);
    let distinct = DensityCompensatedSue::new(sue, &poses, 1, Density::Distinct).unwrap();
    let spacing: Vec<f64> = distinct.spacing().collect();
    assert_eq!(spacing.len(), 5);
    assert!(spacing.iter().all(|z| (z - 100.0).abs() < 1e-9), "{spacing:?}");
    assert!(near(distinct.estimate(&places).unwrap()[0], sue.estimate(&places).unwrap()[0]));
    // As eq. 5.12 reads, z of every tile is 0 for k below 4 and only the lone place has weight.
    let plain = DensityCompensatedSue::new(sue, &poses, 1, Density::Plain).unwrap();
    assert_eq!(plain.estimate(&places).unwrap(), [0.0]);
    let tiles = Retrieval::new(
        Array2::from_shape_fn((1, 4), |(_, rank)| rank),
        Array2::from_elem((1, 4), 0.1_f32),
    )
    .unwrap();
    let params = SueParams { k: 4, ..*sue.params() };
    let plain = DensityCompensatedSue::new(Sue::new(params).unwrap(), &poses, 1, Density::Plain);
    let err = plain.unwrap().estimate(&Places::from_poses(&tiles, &poses).unwrap()).unwrap_err();
    assert!(matches!(err, Error::NoDensity { query: 0, k: 4, nth: 1 }), "{err}");
}

#[test]
fn wrong_input_is_named() {
    let err = |params: SueParams| Sue::new(params).unwrap_err().to_string();
    let good = *Sue::corrected().params();
    assert!(err(SueParams { lambda: 0.0, ..good }).contains("`lambda` = 0"));
    assert!(err(SueParams { lambda: f64::NAN, ..good }).contains("`lambda`"));
    assert!(err(SueParams { k: 0, ..good }).contains("`k` = 0"));
    let pair = retrieval(&[0.1, 0.2]);
    let of = |poses: &Poses| Places::from_poses(&pair, poses).unwrap_err().to_string();
    assert!(of(&planar(&[(1.0, 1.0), (1.0, 1.0)])).contains("all 2 references"));
    assert!(of(&planar(&[(1.0, 1.0), (1.0, f64::NAN)])).contains("row 1, column 1"));
    assert!(of(&planar(&[(1.0, 1.0)])).contains("pose of reference 1"));
    let none = Retrieval::new(Array2::zeros((0, 2)), Array2::zeros((0, 2))).unwrap();
    assert!(Neighbors::new(&none).unwrap_err().to_string().contains("no queries"));
}
