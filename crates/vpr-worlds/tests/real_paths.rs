//! Rooms along the real camera paths of 7-Scenes; needs `VPR_DATA`.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and prints what it measured"
)]

use vpr_worlds::{Side, World, recipe_with};

#[test]
fn images_have_the_poses_of_the_published_files() {
    let Some(data) = std::env::var_os("VPR_DATA") else {
        println!("skipped: VPR_DATA is not set");
        return;
    };
    let folder = std::path::Path::new(&data).join("7scenes/poses");
    let quoted = format!("{folder:?}");
    let settings = [
        ("seven_scenes.poses", quoted.as_str()),
        ("places", "6"),
        ("camera.width", "64"),
        ("camera.height", "48"),
        ("camera.focal", "58.5"),
    ];
    let recipe = recipe_with("seven-scenes-heads", &settings).unwrap();
    let cache = tempfile::tempdir().unwrap();
    let world = World::open(&recipe, cache.path(), &|| {}).unwrap();
    let poses = world.poses(Side::References).unwrap();
    // Line by line: `name qw qx qy qz tx ty tz f`, world-to-camera; the centre is -Rᵀ t.
    let text = std::fs::read_to_string(folder.join("heads_train.txt")).unwrap();
    let mut rows: Vec<(&str, [f64; 7])> = text
        .lines()
        .map(|line| {
            let mut fields = line.split(' ');
            let name = fields.next().unwrap();
            (name, std::array::from_fn(|_| fields.next().unwrap().parse().unwrap()))
        })
        .collect();
    rows.sort_by(|a, b| a.0.cmp(b.0));
    for index in 0..6 {
        let [w, x, y, z, tx, ty, tz] = rows[index * rows.len() / 6].1;
        let rotation =
            nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let centre = -(rotation.inverse() * nalgebra::Vector3::new(tx, ty, tz));
        assert!((poses.position(index).coords - centre).norm() < 1e-6, "frame {index}");
    }
    // Every frame sees a wall within a few metres, none the void.
    let depth = world.depth(Side::Queries, 0).unwrap();
    assert!(depth.iter().all(|&depth| depth > 0.02 && depth < 12.0));
}
