//! The `worlds` program.
#![cfg(feature = "cli")]

use assert_cmd::Command;

fn worlds(args: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("worlds").unwrap().args(args).assert()
}

#[test]
fn listing_names_every_world_on_stdout() {
    let output = worlds(&["list"]).success().get_output().stdout.clone();
    let text = String::from_utf8(output).unwrap();
    assert_eq!(text.lines().count(), vpr_worlds::names().len());
    assert!(text.contains("world/rail\t250\tNordland\n"), "{text}");
}

#[test]
fn nonsense_exits_with_2_and_names_the_key() {
    for (set, part) in
        [("places=-1", "places"), ("street.snow=1", "snow"), ("places=1000000000", "places")]
    {
        let output =
            worlds(&["render", "world/street", "--set", set]).code(2).get_output().stderr.clone();
        let text = String::from_utf8(output).unwrap();
        assert!(text.contains(part), "{set}: {text}");
    }
    worlds(&["render", "world/atlantis"]).code(2);
}

#[test]
fn rendering_prints_the_folder_and_previewing_writes_a_sheet() {
    let cache = tempfile::tempdir().unwrap();
    let folder = cache.path().to_str().unwrap();
    let small = ["--set", "places=2", "--set", "camera.width=48", "--set", "camera.height=36"];
    let output = worlds(&[&["render", "world/campus", "--cache", folder][..], &small].concat());
    let printed = String::from_utf8(output.success().get_output().stdout.clone()).unwrap();
    assert!(std::path::Path::new(printed.trim()).join("ground_truth_new.npy").is_file());
    let sheet = cache.path().join("sheet.png");
    worlds(&[&["preview", "world/campus", "-o", sheet.to_str().unwrap()][..], &small].concat())
        .success();
    assert_eq!(image::image_dimensions(&sheet).unwrap(), (4 * 52, 40));
}
