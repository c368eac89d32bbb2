//! Truths, labels and scores: damaged files are refused or read, and cuts of what says its own
//! length are always noticed.

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
    ($name:literal, $file:literal) => {
        Target {
            name: $name,
            file: $file,
            read: |folder| read(&folder.join($file)),
            notices_all: false,
        }
    };
}

pub(crate) const TARGETS: &[Target] = &[
    truth_target!("truth-npy", "a.npy"),
    truth_target!("truth-npz", "a.npz"),
    truth_target!("truth-pickle", "a.pkl"),
    truth_target!("truth-json", "a.json"),
    truth_target!("truth-csv", "a.csv"),
    truth_target!("truth-text", "a.txt"),
    Target {
        name: "labels",
        file: "labels.csv",
        read: |folder| {
            let path = folder.join("labels.csv");
            let labels = Labels::File { path, queries: None, column: None };
            problems(Source::Labels(labels).truth(&sides()))
        },
        notices_all: false,
    },
    Target {
        name: "scores",
        file: "scores.txt",
        read: |folder| {
            problems(truth::read_scores(&folder.join("scores.txt"), Scale::Similarities))
        },
        notices_all: false,
    },
];

/// Targets whose files say how long they are, or end with a sign: no cut goes unnoticed.
const SAY_THEIR_END: [&str; 4] = ["truth-npy", "truth-npz", "truth-pickle", "truth-json"];

#[test]
fn no_cut_goes_unnoticed_where_a_file_says_its_end() {
    let folder = tempfile::tempdir().unwrap();
    for target in TARGETS.iter().filter(|target| SAY_THEIR_END.contains(&target.name)) {
        let seeds = crate::corpus().join(target.name);
        let mut n_cuts = 0;
        for seed in fs::read_dir(seeds).unwrap() {
            let path = seed.unwrap().path();
            let bytes = fs::read(&path).unwrap();
            let place = folder.path().join(target.file);
            fs::write(&place, &bytes).unwrap();
            if !(target.read)(folder.path()).is_empty() {
                continue;
            }
            // The last line of JSON may lack its end: it is whole.
            let end = bytes.trim_ascii_end().len();
            for length in 0..end {
                fs::write(&place, &bytes[..length]).unwrap();
                let noticed = !(target.read)(folder.path()).is_empty();
                assert!(noticed, "{}: cut at {length}", path.display());
                n_cuts += 1;
            }
        }
        assert!(n_cuts > 10, "{}", target.name);
    }
}

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
            fs::copy(folder.path().join(file), place.join(format!("sound-{name}"))).unwrap();
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
