//! Networks by name, through the program alone, on real images where `VPR_DATA` has them.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

use std::{
    path::{Path, PathBuf},
    process::Command,
};

/// What `bench evaluate` prints for Corridor; `None` without the data.
fn corridor(method: &str) -> Option<String> {
    let Some(data) = std::env::var_os("VPR_DATA").map(PathBuf::from) else {
        println!("skipped: VPR_DATA is not set, weights/ and vpr-bench/ are in it");
        return None;
    };
    let places = data.join("vpr-bench/datasets/corridor");
    let output = Command::new(env!("CARGO_BIN_EXE_bench"))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .args(["evaluate", "--method", method, "--auc-pr", "--recall-values", "1", "5"])
        .arg("--database-folder")
        .arg(places.join("ref"))
        .arg("--queries-folder")
        .arg(places.join("query"))
        .arg("--ground-truth")
        .arg(places.join("ground_truth_new.npy"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

/// The number behind `label`.
fn number(text: &str, label: &str) -> f64 {
    let rest = text.split(label).nth(1).unwrap_or_else(|| panic!("no `{label}` in {text}"));
    rest.trim_start().split([',', ' ', '\n']).next().unwrap().parse().unwrap()
}

#[test]
fn netvlad_on_corridor_has_the_numbers_of_its_file() {
    let Some(text) = corridor("netvlad-mobilenetv2-rgb") else { return };
    println!("{text}");
    for (label, expected) in [("R@1:", 45.0), ("R@5:", 82.0)] {
        let actual = number(&text, label);
        assert!((actual - expected).abs() <= 1.0, "{label} {actual}, not {expected}");
    }
    // An independent forward pass has .545; ours .547, docs/parity.md.
    let area = number(&text, "AUC-PR:");
    assert!((area - 0.545).abs() <= 0.01, "AUC-PR {area}, not .545");
}

#[test]
fn the_gray_network_runs() {
    let Some(text) = corridor("netvlad-mobilenetv2-gray") else { return };
    println!("{text}");
    assert!(number(&text, "R@1:") > 20.0, "{text}");
}

#[test]
fn an_unknown_method_is_refused_by_name() {
    let output = Command::new(env!("CARGO_BIN_EXE_bench"))
        .args(["evaluate", "--database-folder", ".", "--queries-folder", ".", "--method", "sift3"])
        .arg("--no-labels")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8(output.stderr).unwrap();
    for name in ["sift3", "hog", "cohog", "dense-vlad", "default", "cosplace"] {
        assert!(text.contains(name), "{name} is not in {text}");
    }
}
