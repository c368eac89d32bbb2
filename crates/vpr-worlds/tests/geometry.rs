//! Depth and pose of one image predict where its points are in another.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured; pixels are small"
)]

use image::GrayImage;
use nalgebra::Point3;
use ndarray::Array2;
use vpr_worlds::{Side, World, recipe_with};

struct Frame {
    image: GrayImage,
    depth: Array2<f32>,
    pose: vpr_core::Pose,
}

fn frame(world: &World, (side, index): (Side, usize)) -> Frame {
    let path = &world.images(side).unwrap()[index];
    let image = image::open(path).unwrap().to_luma8();
    let pose = world.poses(side).unwrap().six_dof().unwrap()[index];
    Frame { image, depth: world.depth(side, index).unwrap(), pose }
}

/// The first image of the references, and of the queries.
const FIRST: [(Side, usize); 2] = [(Side::References, 0), (Side::Queries, 0)];

fn still(name: &str, more: &[(&str, &str)]) -> World {
    let mut settings = vec![
        ("places", "1"),
        ("layout", "\"seven-scenes\""),
        ("tolerance", "{ radius_m = 5.0 }"),
        ("depth", "true"),
        ("references.film", "{ noise = 0.0 }"),
        ("queries.film", "{ noise = 0.0 }"),
    ];
    settings.extend(more);
    let cache = tempfile::tempdir().unwrap();
    let mut world =
        World::open(&recipe_with(name, &settings).unwrap(), cache.path(), &|| {}).unwrap();
    world.folder = cache.keep().join(world.folder.file_name().unwrap());
    world
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The pixels of `a` every 6 both ways, with where they are in `b` by depth and pose; only points
/// that `b` does not see behind something.
fn predicted(world: &World, a: &Frame, b: &Frame) -> Vec<((f64, f64), (f64, f64))> {
    let camera = world.recipe.camera;
    let mut pairs = Vec::new();
    for row in (8..camera.height - 8).step_by(6) {
        for column in (8..camera.width - 8).step_by(6) {
            let from = (f64::from(column) + 0.5, f64::from(row) + 0.5);
            let depth = f64::from(a.depth[(row as usize, column as usize)]);
            let ray = camera.direction(from.0, from.1);
            if !depth.is_finite() {
                continue;
            }
            let point = a.pose * Point3::from(ray * (depth / ray.z));
            let there = b.pose.inverse() * point;
            let Some(to) = camera.project(&there.coords).filter(|&to| camera.sees(to)) else {
                continue;
            };
            let seen = f64::from(b.depth[(to.1 as usize, to.0 as usize)]);
            if (seen - there.z).abs() < 0.03 * there.z {
                pairs.push((from, to));
            }
        }
    }
    pairs
}

/// Median distance, pixels, between where points come back to by the depth of `b` and where they
/// came from, and the number of points.
fn round_trip(world: &World, a: &Frame, b: &Frame) -> (f64, usize) {
    let camera = world.recipe.camera;
    let pairs = predicted(world, a, b);
    assert!(pairs.len() > 100, "{}: only {} points", world.recipe.name, pairs.len());
    let errors = pairs.iter().map(|&(from, to)| {
        let depth = f64::from(b.depth[(to.1 as usize, to.0 as usize)]);
        let ray = camera.direction(to.0.floor() + 0.5, to.1.floor() + 0.5);
        let point = a.pose.inverse() * (b.pose * Point3::from(ray * (depth / ray.z)));
        let back = camera.project(&point.coords).unwrap_or((-99.0, -99.0));
        // The pixel's middle is up to half a pixel from the predicted point: take that off.
        let off = (to.0 - to.0.floor() - 0.5, to.1 - to.1.floor() - 0.5);
        (back.0 - from.0 + off.0).hypot(back.1 - from.1 + off.1)
    });
    (median(errors.collect()), pairs.len())
}

/// A world, what is set in it, and which two images are compared.
type Case<'a> = (&'a str, &'a [(&'a str, &'a str)], [(Side, usize); 2]);

#[test]
fn depth_and_pose_agree_between_two_views_of_every_family() {
    let moves = [
        ("queries.offset", "{ lateral_m = 0.35, forward_m = 0.3, yaw_deg = 4.0 }"),
        ("references.condition.traffic", "0.0"),
        ("queries.condition.traffic", "0.0"),
    ];
    let of_grid = [("street.grid", "{ rows = 2, columns = 1, step_m = 0.5 }")];
    let distorted = [moves[0], moves[1], moves[2], ("camera.distortion", "-0.05")];
    let second = [(Side::References, 0), (Side::References, 1)];
    let grid = [(Side::Grid, 0), (Side::Grid, 1)];
    let viewpoint = [(Side::References, 0), (Side::Queries, 10)];
    // These two take many images: smaller ones.
    let small = [("camera", "{ width = 160, height = 120, focal = 115.0 }")];
    let many = [small[0], ("places", "40"), ("query_every", "40")];
    let cases: [Case; 11] = [
        ("street", &moves, FIRST),
        ("street", &distorted, FIRST),
        ("rail", &moves, FIRST),
        ("campus", &moves, FIRST),
        ("corridor", &moves, FIRST),
        ("rooms", &moves, FIRST),
        ("escalator", &moves, FIRST),
        ("shop-facade", &of_grid, grid),
        ("seven-scenes-office", &many, second),
        ("light-stage-viewpoints", &small, viewpoint),
        ("multi-lane", &[("references.condition.traffic", "0.0")], [FIRST[0], (Side::Queries, 1)]),
    ];
    for (name, settings, which) in cases {
        let world = still(name, settings);
        let [a, b] = which.map(|which| frame(&world, which));
        let (error, n) = round_trip(&world, &a, &b);
        println!("{name}: median reprojection error {error:.3} px over {n} points");
        assert!(error < 0.5, "{name}: {error} px");
    }
}

#[test]
fn the_overlap_is_symmetric_sideways_and_not_along_the_view() {
    let settings = [
        ("places", "12"),
        ("street.avenues", "1"),
        ("overlap", "true"),
        ("camera.width", "160"),
        ("camera.height", "120"),
        ("camera.focal", "115.0"),
        ("street.spacing_m", "2.5"),
        ("queries.offset", "{}"),
        ("references.condition.traffic", "0.0"),
        ("queries.condition.traffic", "0.0"),
    ];
    let matrix = |heading: &str| {
        let cache = tempfile::tempdir().unwrap();
        let mut all = settings.to_vec();
        all.push(("street.heading_deg", heading));
        let recipe = recipe_with("street", &all).unwrap();
        World::open(&recipe, cache.path(), &|| {}).unwrap().overlap().unwrap()
    };
    // The largest difference between two places' views of one another, beyond the crossing.
    let skew = |matrix: &Array2<f32>| {
        let all = (6..12).flat_map(|a| (6..12).map(move |b| (a, b)));
        all.map(|(a, b)| (matrix[(a, b)] - matrix[(b, a)]).abs()).fold(0.0, f32::max)
    };
    let (sideways, ahead) = (matrix("90.0"), matrix("0.0"));
    println!("largest skew: {:.3} sideways, {:.3} ahead", skew(&sideways), skew(&ahead));
    // A plane would give none (see the tests of `overlap`); houses have edges and trees before them.
    assert!(skew(&sideways) < 0.25 * skew(&ahead), "{sideways:.2}\n{ahead:.2}");
    // Who stands ahead sees less of what is seen from behind than the other way round.
    assert!((6..11).all(|a| ahead[(a, 11)] < ahead[(11, a)]), "{ahead:.2}");
}

/// Brightness at a point, between its four pixels.
fn brightness(image: &GrayImage, (x, y): (f64, f64)) -> f64 {
    let (x, y) = (x - 0.5, y - 0.5);
    let at = |column: f64, row: f64| {
        let column = (column as u32).min(image.width() - 1);
        let row = (row as u32).min(image.height() - 1);
        f64::from(image.get_pixel(column, row).0[0])
    };
    let (left, top) = (x.max(0.0).floor(), y.max(0.0).floor());
    let (s, t) = (x - left, y - top);
    let upper = at(left, top) * (1.0 - s) + at(left + 1.0, top) * s;
    let lower = at(left, top + 1.0) * (1.0 - s) + at(left + 1.0, top + 1.0) * s;
    upper * (1.0 - t) + lower * t
}

#[test]
fn images_agree_best_exactly_where_depth_and_pose_predict() {
    let moves = [
        ("queries.offset", "{ lateral_m = 0.3, yaw_deg = 2.0 }"),
        ("references.condition.traffic", "0.0"),
        ("queries.condition.traffic", "0.0"),
    ];
    let world = still("street", &moves);
    let (a, b): (Frame, Frame) = FIRST.map(|which| frame(&world, which)).into();
    let pairs = predicted(&world, &a, &b);
    let difference = |dx: f64, dy: f64| -> f64 {
        let each = pairs.iter().map(|&(from, to)| {
            (brightness(&a.image, from) - brightness(&b.image, (to.0 + dx, to.1 + dy))).abs()
        });
        each.sum::<f64>() / pairs.len() as f64
    };
    let shifts = (-4..=4).flat_map(|dy| (-4..=4).map(move |dx| (f64::from(dx), f64::from(dy))));
    let shifts = shifts.map(|(dx, dy)| (0.25 * dx, 0.25 * dy));
    let best = shifts.min_by(|p, q| difference(p.0, p.1).total_cmp(&difference(q.0, q.1))).unwrap();
    println!(
        "best shift {best:?} px: {:.2}, at none {:.2}",
        difference(best.0, best.1),
        difference(0.0, 0.0)
    );
    assert!(pairs.len() > 500 && best.0.hypot(best.1) < 0.5, "{best:?} over {}", pairs.len());
}
