use super::*;

/// Numbers from −1 to 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn pixel(&mut self) -> [f64; 2] {
        [320.0 + 320.0 * self.next(), 240.0 + 240.0 * self.next()]
    }
}

const TRUE_H: [[f64; 3]; 3] = [[0.95, 0.08, 10.0], [-0.06, 0.97, 25.0], [1e-5, -2e-5, 1.0]];

fn map(matrix: &[[f64; 3]; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    let [across, down, scale] = matrix.map(|row| row[0] * x + row[1] * y + row[2]);
    [across / scale, down / scale]
}

/// The first `n_inliers` follow [`TRUE_H`] up to half a pixel.
fn plane(n_inliers: usize, n_outliers: usize) -> Vec<Correspondence> {
    let mut noise = Noise(7);
    let of = |index| {
        let query = noise.pixel();
        let exact = map(&TRUE_H, query);
        let near = exact.map(|it| it + 0.5 * noise.next());
        Correspondence { query, reference: if index < n_inliers { near } else { noise.pixel() } }
    };
    (0..n_inliers + n_outliers).map(of).collect()
}

/// Points in front of two cameras, the first `n_inliers` seen by both.
fn scene(n_inliers: usize, n_outliers: usize) -> Vec<Correspondence> {
    let mut noise = Noise(11);
    let (sin, cos) = 0.1_f64.sin_cos();
    let of = |index| {
        let [x, y, z] = [2.0 * noise.next(), 1.5 * noise.next(), 5.0 + 2.0 * noise.next()];
        let moved = [cos * x - sin * z + 1.0, y, sin * x + cos * z + 0.2];
        let project = |[x, y, z]: [f64; 3]| [585.0 * x / z + 320.0, 585.0 * y / z + 240.0];
        let reference = if index < n_inliers { project(moved) } else { noise.pixel() };
        Correspondence { query: project([x, y, z]), reference }
    };
    (0..n_inliers + n_outliers).map(of).collect()
}

const CAMERA: Intrinsics = Intrinsics { focal: [585.0, 585.0], center: [320.0, 240.0] };

#[test]
fn a_plane_is_found_among_outliers() {
    let points = plane(60, 140);
    let found = homography(&points, &RansacParams::HOMOGRAPHY).unwrap();
    assert!(found.mask[..60].iter().all(|&inlier| inlier), "{} of 60", found.count());
    assert!(found.count() <= 64, "{}", found.count());
    let model = found.model.unwrap();
    for corner in [[0.0, 0.0], [640.0, 0.0], [640.0, 480.0], [0.0, 480.0]] {
        let (ours, exact) = (map(&model, corner), map(&TRUE_H, corner));
        let off = (ours[0] - exact[0]).hypot(ours[1] - exact[1]);
        assert!(off < 1.5, "{corner:?}: {off}");
    }
}

#[test]
fn epipolar_geometry_is_found_among_outliers() {
    let points = scene(80, 60);
    let found = fundamental(&points, &RansacParams::EPIPOLAR).unwrap();
    assert!(found.mask[..80].iter().filter(|&&it| it).count() >= 78, "{}", found.count());
    assert!(found.count() < 105, "{}", found.count());
    let found = essential(&points, [CAMERA; 2], &RansacParams::EPIPOLAR).unwrap();
    assert!(found.mask[..80].iter().filter(|&&it| it).count() >= 78, "{}", found.count());
    assert!(found.count() < 105, "{}", found.count());
}

#[test]
fn the_number_of_iterations_is_fixed_unless_confidence_is_given() {
    let points = plane(100, 0);
    let fixed = homography(&points, &RansacParams::HOMOGRAPHY).unwrap();
    assert_eq!(fixed.iterations, 1000);
    let params = RansacParams { confidence: Some(0.995), ..RansacParams::HOMOGRAPHY };
    let early = homography(&points, &params).unwrap();
    assert!(early.iterations < 50, "{}", early.iterations);
    assert_eq!(early.count(), 100);
}

#[test]
fn the_seed_decides() {
    let points = plane(12, 300);
    let of = |seed| {
        let params = RansacParams { seed, iterations: 30, ..RansacParams::HOMOGRAPHY };
        homography(&points, &params).unwrap()
    };
    assert_eq!(of(3), of(3));
    assert!((0..20).any(|seed| of(seed).mask != of(0).mask));
}

#[test]
fn too_few_or_degenerate_points_have_no_inlier() {
    for n in 0..4 {
        let found = homography(&plane(n, 0), &RansacParams::HOMOGRAPHY).unwrap();
        assert_eq!((found.count(), found.mask.len(), found.model), (0, n, None));
    }
    assert_eq!(homography(&plane(4, 0), &RansacParams::HOMOGRAPHY).unwrap().count(), 4);
    assert_eq!(fundamental(&scene(7, 0), &RansacParams::EPIPOLAR).unwrap().count(), 0);
    assert_eq!(essential(&scene(4, 0), [CAMERA; 2], &RansacParams::EPIPOLAR).unwrap().count(), 0);
}

/// What real matches look like where images have nothing in common.
#[test]
fn degenerate_sets_never_panic() {
    let point = |query, reference| Correspondence { query, reference };
    let line: Vec<_> = (0..20).map(|i| point([f64::from(i), 0.0], [0.0, f64::from(i)])).collect();
    let same = vec![point([5.0, 5.0], [9.0, 9.0]); 20];
    let hub: Vec<_> = plane(0, 20).iter().map(|it| point(it.query, [50.0, 60.0])).collect();
    for points in [line, same, hub] {
        assert_eq!(homography(&points, &RansacParams::HOMOGRAPHY).unwrap().mask.len(), 20);
        assert_eq!(fundamental(&points, &RansacParams::EPIPOLAR).unwrap().mask.len(), 20);
        let found = essential(&points, [CAMERA; 2], &RansacParams::EPIPOLAR).unwrap();
        assert_eq!(found.mask.len(), 20);
    }
}

/// Two orientations of one keypoint, as SIFT gives them: OpenCV counts all four.
#[test]
fn four_of_which_two_coincide_are_inliers() {
    let mut points = plane(4, 0);
    points[3] = points[2];
    assert_eq!(homography(&points, &RansacParams::HOMOGRAPHY).unwrap().count(), 4);
    points[3] = points[0];
    points[2] = points[0];
    let found = homography(&points, &RansacParams::HOMOGRAPHY).unwrap();
    assert_eq!(found.mask.len(), 4);
}

/// Many features that match one point are no evidence of a plane.
#[test]
fn a_hub_is_not_a_plane() {
    let hub: Vec<_> = plane(0, 30)
        .iter()
        .map(|it| Correspondence { query: it.query, reference: [50.0, 60.0] })
        .collect();
    assert_eq!(homography(&hub, &RansacParams::HOMOGRAPHY).unwrap().count(), 0);
}

#[test]
fn wrong_numbers_are_named() {
    let nan = [Correspondence { query: [0.0, f64::NAN], reference: [0.0; 2] }];
    let error = homography(&nan, &RansacParams::HOMOGRAPHY).unwrap_err();
    assert!(matches!(error, Error::NotFinite { row: 0, column: 1, .. }), "{error}");
    let huge = [Correspondence { query: [0.0, 1e300], reference: [0.0; 2] }; 4];
    assert!(homography(&huge, &RansacParams::HOMOGRAPHY).is_err());
    let tiny = Intrinsics { focal: [1e-300, 1.0], ..CAMERA };
    let far = [Correspondence { query: [9.0, 9.0], reference: [9.0, 9.0] }; 5];
    assert!(essential(&far, [CAMERA, tiny], &RansacParams::EPIPOLAR).is_err());
    let bad = |params| homography(&[], &params).unwrap_err().to_string();
    let default = RansacParams::HOMOGRAPHY;
    assert!(bad(RansacParams { threshold: 0.0, ..default }).starts_with("`threshold` = 0"));
    assert!(bad(RansacParams { iterations: 0, ..default }).starts_with("`iterations` = 0"));
    assert!(bad(RansacParams { confidence: Some(1.0), ..default }).starts_with("`confidence` = 1"));
    let flat = Intrinsics { focal: [0.0, 1.0], ..CAMERA };
    assert!(essential(&[], [CAMERA, flat], &RansacParams::EPIPOLAR).is_err());
}

#[test]
fn exact_planes_are_recovered_among_three_outliers_in_five() {
    for seed in 0..20 {
        let mut noise = Noise(seed);
        let of = |index| {
            let query = noise.pixel();
            let reference = if index % 5 < 2 { map(&TRUE_H, query) } else { noise.pixel() };
            Correspondence { query, reference }
        };
        let points: Vec<_> = (0..200).map(of).collect();
        let params = RansacParams { seed, threshold: 0.1, ..RansacParams::HOMOGRAPHY };
        let found = homography(&points, &params).unwrap();
        assert!(points.iter().zip(&found.mask).step_by(5).all(|(_, &inlier)| inlier));
        let model = found.model.unwrap();
        for (ours, exact) in model.as_flattened().iter().zip(TRUE_H.as_flattened()) {
            assert!((ours - exact).abs() < 1e-3 * exact.abs().max(1e-3), "{seed}: {model:?}");
        }
        assert_eq!(homography(&points, &params).unwrap(), found);
    }
}

/// The unit vector of nine entries, up to its sign.
fn apart(ours: &[[f64; 3]; 3], exact: &[[f64; 3]; 3]) -> f64 {
    let pairs = || ours.as_flattened().iter().zip(exact.as_flattened());
    let dot: f64 = pairs().map(|(a, b)| a * b).sum();
    let (a, b): (f64, f64) = (pairs().map(|(a, _)| a * a).sum(), pairs().map(|(_, b)| b * b).sum());
    1.0 - dot.abs() / (a * b).sqrt()
}

#[test]
fn five_exact_points_give_the_essential_matrix_among_others() {
    let (sin, cos) = 0.1_f64.sin_cos();
    // [t]ₓ R of `scene`, t = (1, 0, 0.2).
    let exact = [[0.0, -0.2, 0.0], [0.2 * cos - sin, 0.0, -0.2 * sin - cos], [0.0, 1.0, 0.0]];
    let points: Vec<_> = scene(100, 0)
        .iter()
        .map(|it| Correspondence {
            query: CAMERA.normalize(it.query),
            reference: CAMERA.normalize(it.reference),
        })
        .collect();
    for sample in points.chunks_exact(5) {
        let mut models = Vec::new();
        Essential::fit(sample, &mut models);
        let nearest = models.iter().map(|it| apart(it, &exact)).fold(1.0, f64::min);
        assert!(nearest < 1e-8, "{nearest} of {}", models.len());
    }
}

#[test]
fn points_that_coincide_or_are_on_a_line_are_no_plane() {
    let point = |query, reference| Correspondence { query, reference };
    let same = vec![point([5.0, 5.0], [9.0, 9.0]); 20];
    let line: Vec<_> = (0..20).map(|i| point([f64::from(i), 0.0], [0.0, f64::from(i)])).collect();
    for points in [same, line] {
        let found = homography(&points, &RansacParams::HOMOGRAPHY).unwrap();
        assert_eq!((found.count(), found.model), (0, None));
    }
}
