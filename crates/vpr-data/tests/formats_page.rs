//! `docs/formats.md` is what the code says, and its examples are read.

use std::{
    fs,
    path::{Path, PathBuf},
};

use vpr_core::Position;
use vpr_data::exchange::{self, Entry, Example, Format, Kind, entries, page};

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md")
}

fn whole() -> String {
    page(&entries().collect::<Vec<_>>(), vpr_data::truth::FORMATS)
}

#[test]
fn the_page_is_what_the_code_says() {
    let there = fs::read_to_string(path()).unwrap();
    assert!(
        there == whole(),
        "docs/formats.md differs: cargo test -p vpr-data --test formats_page -- --ignored"
    );
}

/// Writes the page anew.
#[test]
#[ignore = "writes into the source tree"]
fn write_the_page() {
    fs::write(path(), whole()).unwrap();
}

#[test]
fn every_example_is_read_by_the_format_it_is_of() {
    let mut n_read = 0;
    for (format, entry) in Format::ALL.into_iter().zip(entries()) {
        assert_eq!(format.name(), entry.name, "in the same order");
        let Example::Text { path, text } = entry.example else { continue };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(path);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, text).unwrap();
        // Formats of folders are given theirs.
        let is_folder = matches!(format, Format::Kapture | Format::SevenScenes | Format::VprEval);
        let place = if is_folder { folder.path() } else { &file };
        n_read += 1;
        if matches!(format.kind(), Kind::Pairs | Kind::DescriptorsAndPairs) {
            let pairs = exchange::read_pairs(format, place).unwrap();
            assert_eq!(pairs.lists[0].references, ["db/a.jpg", "db/b.jpg"], "{format}");
            continue;
        }
        let parts = exchange::read(format, place).unwrap();
        let first = parts.poses.unwrap().position(0);
        let expected = match format {
            Format::LatLon => Position::new(593_139.468_903_316, 5_763_197.818_897_061, 0.0),
            Format::PoseCsv => Position::new(349_000.5, 6_173_000.25, 0.0),
            Format::UtmNames => Position::new(549_678.37, 4_180_874.6, 0.0),
            _ => Position::new(1.0, 2.0, 3.0),
        };
        assert!((first - expected).norm() < 1e-6, "{format}: {first}");
    }
    assert_eq!(n_read, 11);
}

#[test]
fn ground_truths_have_a_place_of_their_own() {
    let truth = Entry {
        name: "lists",
        about: "A list per query.",
        example: Example::Python("np.save(\"gt.npy\", lists)"),
        taken_by: "`bench evaluate --ground-truth`",
        refused: "Nothing.",
    };
    let page = page(&[], &[truth]);
    let between = page.split_once("<!-- ground truths -->").unwrap().1;
    let between = between.split_once("<!-- /ground truths -->").unwrap().0;
    assert!(between.contains("## Ground truths\n\n### `lists`\n\nA list per query."), "{between}");
}
