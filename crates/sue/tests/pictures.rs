//! Reports that show the images of matches, and how many inliers they have.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod program;

use std::{fs, path::Path};

use image::GrayImage;
use ndarray::Array2;
use program::{assert_refused, stderr, success, sue};
use vpr_core::{
    Descriptors, Map, PlanarPosition, Poses,
    map::{self, About, Names},
};

const N: usize = 4;

/// A map, queries that match it row by row, and a textured image under each name.
fn world(folder: &Path) {
    for (side, shift) in [("map", 0.0), ("queries", 0.01)] {
        let rows =
            Array2::from_shape_fn(
                (N, N),
                |(row, column)| {
                    if row == column { 1.0 } else { shift * column as f32 }
                },
            );
        let positions = (0..N).map(|i| PlanarPosition::new(i as f64 * 50.0, 0.0)).collect();
        let map = Map::new(Descriptors::new(rows).unwrap().normalized(), Poses::Planar(positions));
        let mut names = Names::default();
        fs::create_dir(folder.join(side)).unwrap();
        for place in 0..N {
            let name = format!("{place}.png");
            names.push(&name);
            let shift = 31 * u32::try_from(place).unwrap();
            let level = |x: u32, y: u32| {
                let (x, y) = (x / 7 + shift, y / 7);
                (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(2_246_822_519)).to_le_bytes()[2]
            };
            let image = GrayImage::from_fn(160, 120, |x, y| image::Luma([level(x, y)]));
            image.save(folder.join(side).join(name)).unwrap();
        }
        let about = About { encoder: Some("toy".to_owned()), ..About::default() };
        let path = folder.join(format!("{side}.safetensors"));
        map::write(&path, &map.unwrap(), Some(&names), about).unwrap();
    }
}

#[test]
fn a_report_shows_images_and_inliers() {
    let folder = tempfile::tempdir().unwrap();
    world(folder.path());
    let run = |more: &[&str]| {
        let input = ["--map", "map.safetensors", "--queries", "queries.safetensors", "-k", "2"];
        let always = ["evaluate", "--estimator", "l2", "--resamples", "20"];
        sue(folder.path(), &[&always[..], &input, more].concat())
    };
    let report = ["--report", "out.html"];
    let html = || fs::read_to_string(folder.path().join("out.html")).unwrap();
    // What a reader sees without scripts.
    let counts = || -> Vec<usize> {
        let html = html();
        let cards = html.split("</article>").filter_map(|it| it.split("<article").nth(1));
        let texts = cards.flat_map(|it| it.split(" inliers").collect::<Vec<_>>());
        texts.filter_map(|it| it.rsplit(' ').next()?.parse().ok()).collect()
    };
    success(&run(&report));
    assert!(!html().contains("data:image/jpeg") && counts().is_empty());

    let images = ["--map-images", "map", "--query-images", "queries"];
    success(&run(&[&report[..], &images, &["--verify", "sift"]].concat()));
    let pictures = html().matches("data:image/jpeg").count();
    assert!(pictures >= 2 * N, "{pictures} thumbnails");
    // The same image on both sides: what is matched agrees.
    let counts = counts();
    assert!(counts.len() >= N && counts.iter().all(|&it| it > 20), "{counts:?}");

    let usage = |more: &[&str], part: &str| {
        let output = run(more);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    };
    usage(&images, "--report");
    let nowhere = ["--map-images", "nowhere"];
    assert_refused(&run(&[&report[..], &nowhere].concat()), &["nowhere: is no folder of images"]);
    fs::create_dir(folder.path().join("empty")).unwrap();
    let empty = ["--query-images", "empty"];
    assert_refused(&run(&[&report[..], &empty].concat()), &["empty: no image of --queries"]);
    usage(&[&report[..], &images, &["--verify", "swift"]].concat(), "expected one of `sift`");
}
