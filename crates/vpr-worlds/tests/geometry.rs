//! Depth and pose of one image predict where its points are in another.

use image::GrayImage;
use nalgebra::Point3;
use ndarray::Array2;
use vpr_worlds::{Side, World, recipe_with};

struct Frame {
    image: GrayImage,
    depth: Array2<f32>,
    pose: vpr_core::Pose,
}

fn frame(world: &World, side: Side) -> Frame {
    let path = &world.images(side).unwrap()[0];
    let image = image::open(path).unwrap().to_luma8();
    let pose = world.poses(side).unwrap().six_dof().unwrap()[0];
    Frame { image, depth: world.depth(side, 0).unwrap(), pose }
}

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

#[test]
fn depth_and_pose_agree_between_two_views_of_every_family() {
    let moves = [
        ("queries.offset", "{ lateral_m = 0.35, forward_m = 0.3, yaw_deg = 4.0 }"),
        ("references.condition.traffic", "0.0"),
        ("queries.condition.traffic", "0.0"),
    ];
    for name in ["street", "rail", "campus", "corridor", "rooms"] {
        let world = still(name, &moves);
        let (a, b) = (frame(&world, Side::References), frame(&world, Side::Queries));
        let pairs = predicted(&world, &a, &b);
        assert!(pairs.len() > 200, "{name}: only {} points", pairs.len());
        let camera = world.recipe.camera;
        // There and back again: the depth at the predicted pixel leads back to where it came from.
        let errors = pairs.iter().map(|&(from, to)| {
            let depth = f64::from(b.depth[(to.1 as usize, to.0 as usize)]);
            let ray = camera.direction(to.0.floor() + 0.5, to.1.floor() + 0.5);
            let point = a.pose.inverse() * (b.pose * Point3::from(ray * (depth / ray.z)));
            let back = camera.project(&point.coords).unwrap_or((-99.0, -99.0));
            // The pixel's middle is up to half a pixel from the predicted point: take that off.
            let off = (to.0 - to.0.floor() - 0.5, to.1 - to.1.floor() - 0.5);
            (back.0 - from.0 + off.0).hypot(back.1 - from.1 + off.1)
        });
        let error = median(errors.collect());
        println!("{name}: median reprojection error {error:.3} px over {} points", pairs.len());
        assert!(error < 0.5, "{name}: {error} px");
    }
}

/// Sum of squared differences of two patches of 7 × 7 pixels.
fn cost(a: &GrayImage, from: (f64, f64), b: &GrayImage, to: (f64, f64)) -> f64 {
    let mut sum = 0.0;
    for dy in -3..=3_i32 {
        for dx in -3..=3_i32 {
            let at = |image: &GrayImage, (x, y): (f64, f64)| {
                let (x, y) = (x as i32 + dx, y as i32 + dy);
                let x = x.clamp(0, image.width() as i32 - 1) as u32;
                let y = y.clamp(0, image.height() as i32 - 1) as u32;
                f64::from(image.get_pixel(x, y).0[0])
            };
            sum += (at(a, from) - at(b, to)).powi(2);
        }
    }
    sum
}

#[test]
fn patches_are_found_where_depth_and_pose_predict_them() {
    let world = still(
        "street",
        &[
            ("queries.offset", "{ lateral_m = 0.3, yaw_deg = 2.0 }"),
            ("references.condition.traffic", "0.0"),
            ("queries.condition.traffic", "0.0"),
        ],
    );
    let (a, b) = (frame(&world, Side::References), frame(&world, Side::Queries));
    let mut errors = Vec::new();
    let ring = [
        (3.0, 0.0),
        (-3.0, 0.0),
        (0.0, 3.0),
        (0.0, -3.0),
        (2.0, 2.0),
        (-2.0, 2.0),
        (2.0, -2.0),
        (-2.0, -2.0),
    ];
    for (from, to) in predicted(&world, &a, &b) {
        // Only corners can tell where they are: an edge looks the same further along.
        let unlike =
            |&(dx, dy): &(f64, f64)| cost(&a.image, from, &a.image, (from.0 + dx, from.1 + dy));
        if ring.iter().map(unlike).fold(f64::INFINITY, f64::min) < 20_000.0 {
            continue;
        }
        let moved = |dx: f64, dy: f64| cost(&a.image, from, &b.image, (to.0 + dx, to.1 + dy));
        let shifts = (-3..=3).flat_map(|dy| (-3..=3).map(move |dx| (f64::from(dx), f64::from(dy))));
        let best = shifts.min_by(|p, q| moved(p.0, p.1).total_cmp(&moved(q.0, q.1))).unwrap();
        errors.push(best.0.hypot(best.1));
    }
    let (n, error) = (errors.len(), median(errors));
    println!("median offset {error} px over {n} patches");
    assert!(n > 50 && error < 0.5, "{error} px over {n} patches");
}
