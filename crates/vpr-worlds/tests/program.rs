//! The `worlds` program.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(feature = "cli")]

use std::process::{Command, Output};

fn worlds(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_worlds")).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn listing_names_every_world_on_stdout() {
    let output = worlds(&["list"]);
    assert_eq!(output.status.code(), Some(0));
    let listed = text(&output.stdout);
    assert_eq!(listed.lines().count(), vpr_worlds::names().len());
    assert!(listed.contains("world/rail\t250\tNordland\n"), "{listed}");
}

#[test]
fn nonsense_exits_with_2_and_names_the_key() {
    let cases =
        [("places=-1", "places"), ("street.snow=1", "snow"), ("places=1000000000", "places")];
    for (set, part) in cases {
        let output = worlds(&["render", "world/street", "--set", set]);
        assert_eq!(output.status.code(), Some(2), "{set}");
        assert!(text(&output.stderr).contains(part), "{set}: {}", text(&output.stderr));
    }
    assert_eq!(worlds(&["render", "world/atlantis"]).status.code(), Some(2));
}

#[test]
fn rendering_prints_the_folder_and_previewing_writes_a_sheet() {
    let cache = tempfile::tempdir().unwrap();
    let folder = cache.path().to_str().unwrap();
    let small = ["--set", "places=2", "--set", "camera.width=48", "--set", "camera.height=36"];
    let output = worlds(&[&["render", "world/campus", "--cache", folder][..], &small].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(std::path::Path::new(printed.trim()).join("ground_truth_new.npy").is_file());
    let sheet = cache.path().join("sheet.png");
    let output =
        worlds(&[&["preview", "world/campus", "-o", sheet.to_str().unwrap()][..], &small].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(image::image_dimensions(&sheet).unwrap(), (4 * 52, 40));
}
