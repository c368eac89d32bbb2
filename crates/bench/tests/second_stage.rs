//! What may follow retrieval, as a user meets it: sequences and re-ranking by inliers.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    path::Path,
    process::{Command, Output},
};

const WORLD: &str = "world/corridor?places=8&camera.width=160&camera.height=120&camera.focal=110.0";

fn evaluate(extra: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.args(["evaluate", "--dataset", WORLD, "--method", "hog"]).args(extra);
    command.env_remove("VPR_DATA");
    command.env("VPR_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench-second-stage"));
    command.output().unwrap()
}

fn texts(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn recall_is_said_before_and_after_with_the_time_per_query() {
    let plain = evaluate(&["--recall-values", "1"]);
    let (before, _) = texts(&plain);
    let stages = evaluate(&["--recall-values", "1", "--sequence", "3", "--rerank", "3"]);
    let (after, said) = texts(&stages);
    assert_eq!(stages.status.code(), Some(0), "{said}");
    assert_eq!(after.lines().count(), 1, "stdout is the result line: {after}");
    let line = |what: &str| {
        said.lines().find(|line| line.starts_with(what)).unwrap_or_else(|| panic!("{said}"))
    };
    assert_eq!(line("retrieved: "), format!("retrieved: {}", before.trim_end()));
    for what in ["sequences of 3: R@1: ", "first 3 by inliers: R@1: "] {
        assert!(line(what).ends_with(" ms per query"), "{said}");
    }
    let last = line("first 3 by inliers: ");
    assert!(last.contains(after.trim_end()), "{last} is not of {after}");
}

#[test]
fn windows_have_names_and_lengths_are_checked() {
    let causal = texts(&evaluate(&["--sequence", "4", "--sequence-window", "causal"]));
    let default = texts(&evaluate(&["--sequence", "4"]));
    assert_eq!(causal.0, default.0);
    let centred = evaluate(&["--sequence", "4", "--sequence-window", "centred"]);
    assert_eq!(centred.status.code(), Some(0));
    let refused = evaluate(&["--sequence", "0"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(texts(&refused).1.contains("must be at least 1"), "{}", texts(&refused).1);
    // A window of nothing.
    assert_eq!(evaluate(&["--sequence-window", "centred"]).status.code(), Some(2));
}
