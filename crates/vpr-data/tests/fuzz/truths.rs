//! Truths, labels and scores: damaged files are refused or read; cuts of what says its own length or
//! end are always noticed.

use std::{fs, path::Path};

use vpr_core::{Error, Result};
use vpr_data::truth::{self, Labels, Reading, Scale, Side, Sides, Source};

use crate::targets::Target;

fn sides() -> Sides {
    let named = |prefix: &str, n: usize| {
        Side::named((0..n).map(|index| format!("{prefix}/{index}.jpg")).collect())
    };
    Sides { queries: named("q", 3), references: named("db", 4) }
}

fn problems<T>(result: Result<T>) -> Vec<Error> {
    result.err().into_iter().collect()
}

fn read(path: &Path) -> Vec<Error> {
    problems(truth::read(path, &Reading::default(), &sides()))
}

/// A target that reads the file `file` as a truth.
macro_rules! truth_target {
    ($name:literal, $file:literal, $notices_cuts:literal) => {
        Target {
            name: $name,
            file: $file,
            read: |folder| read(&folder.join($file)),
            notices_all: false,
            notices_cuts: $notices_cuts,
        }
    };
}

pub(crate) const TARGETS: &[Target] = &[
    truth_target!("truth-npy", "a.npy", true),
    truth_target!("truth-npz", "a.npz", true),
    truth_target!("truth-pickle", "a.pkl", true),
    truth_target!("truth-json", "a.json", true),
    truth_target!("truth-csv", "a.csv", false),
    truth_target!("truth-text", "a.txt", false),
    Target {
        name: "labels",
        file: "labels.csv",
        read: |folder| {
            let path = folder.join("labels.csv");
            let labels = Labels::File { path, queries: None, column: None };
            problems(Source::Labels(labels).truth(&sides()))
        },
        notices_all: false,
        notices_cuts: false,
    },
    Target {
        name: "scores",
        file: "scores.txt",
        read: |folder| {
            problems(truth::read_scores(&folder.join("scores.txt"), Scale::Similarities))
        },
        notices_all: false,
        notices_cuts: false,
    },
];

/// Writes one sound file of every form.
pub(crate) fn write_seeds(corpus: &Path) {
    let folder = tempfile::tempdir().unwrap();
    super::truth_files::write_all(folder.path());
    for (target, files) in [
        ("truth-npy", &["vpr_bench.npy", "arrays.npy", "padded.npy", "matrix.npy"][..]),
        ("truth-npz", &["one.npz", "utm.npz"]),
        ("truth-pickle", &["lists.pkl", "dict.pkl"]),
        ("truth-json", &["lists.json", "rows.json", "dict.json"]),
        ("truth-csv", &["pairs.csv", "cells.csv", "order.csv"]),
        ("truth-text", &["pairs.txt", "lines.txt", "matrix.txt"]),
    ] {
        let place = corpus.join(target);
        fs::create_dir_all(&place).unwrap();
        for file in files {
            let name = file.split('.').next().unwrap();
            // JSON without the line's end: whether that is cut off cannot be noticed.
            let bytes = fs::read(folder.path().join(file)).unwrap();
            let whole = if target == "truth-json" { bytes.trim_ascii_end() } else { &bytes };
            fs::write(place.join(format!("sound-{name}")), whole).unwrap();
        }
    }
    let write = |target: &str, text: &str| {
        let place = corpus.join(target);
        fs::create_dir_all(&place).unwrap();
        fs::write(place.join("sound"), text).unwrap();
    };
    let labels = "name,label\nq/0.jpg,a\nq/1.jpg,b\nq/2.jpg,c\ndb/0.jpg,a\ndb/1.jpg,a\ndb/2.jpg,b\ndb/3.jpg,d\n";
    write("labels", labels);
    write("scores", "0.5 1.0 0.25\n2 0 4e0\n");
}
