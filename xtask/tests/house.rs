//! The invariants of `ARCHITECTURE.md` that a program can check: who may depend on whom, who names
//! burn, how files are called.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

/// Every package with those of the workspace that it may depend on; dependencies of tests aside.
const ARROWS: [(&str, &[&str]); 14] = [
    ("vpr-files", &[]),
    ("vpr-core", &["vpr-files"]),
    ("vpr-data", &["vpr-core", "vpr-files"]),
    ("vpr-report", &["vpr-core", "vpr-files"]),
    ("vpr-vision", &["vpr-core"]),
    ("vpr-nets", &["vpr-core", "vpr-files", "vpr-vision"]),
    ("vpr-worlds", &["vpr-core", "vpr-data", "vpr-files", "vpr-report"]),
    (
        "vpr-study",
        &[
            "vpr-core",
            "vpr-data",
            "vpr-files",
            "vpr-nets",
            "vpr-report",
            "vpr-vision",
            "vpr-worlds",
        ],
    ),
    (
        "vpr-default-encoder",
        &["vpr-core", "vpr-data", "vpr-nets", "vpr-report", "vpr-vision", "vpr-worlds"],
    ),
    ("vpr-bench", CHAPTER),
    ("vpr-sue", CHAPTER),
    ("vpr-copr", CHAPTER),
    ("vpr-rsf", CHAPTER),
    ("xtask", &[]),
];

/// What a chapter may stand on; never another chapter.
const CHAPTER: &[&str] = &[
    "vpr-core",
    "vpr-data",
    "vpr-files",
    "vpr-nets",
    "vpr-report",
    "vpr-study",
    "vpr-vision",
    "vpr-worlds",
];

/// Packages that only some may name.
const RESERVED: [(&str, &[&str]); 4] = [
    ("burn", &["vpr-nets", "vpr-sue", "vpr-copr", "vpr-rsf"]),
    ("kornia-image", &["vpr-vision"]),
    ("kornia-imgproc", &["vpr-vision"]),
    ("hdf5-pure", &["vpr-data"]),
];

/// The most dependencies that xtask may have: every command waits for it.
const XTASK_DEPENDENCIES: usize = 4;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// The dependencies of every package, those of tests aside.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .current_dir(workspace())
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let of = |package: &Value| {
        let all = package["dependencies"].as_array().unwrap();
        all.iter().filter(|it| it["kind"].is_null()).map(|it| text(&it["name"])).collect()
    };
    packages.iter().map(|package| (text(&package["name"]), of(package))).collect()
}

/// All Rust files below `crates` and `xtask`.
fn sources() -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = ["crates", "xtask"].map(|it| workspace().join(it)).to_vec();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|it| it == "rs") {
                files.push(path);
            }
        }
    }
    assert!(files.len() > 400, "{} files", files.len());
    files
}

#[test]
fn arrows_between_packages_go_one_way() {
    let dependencies = dependencies();
    let named: BTreeSet<&str> = ARROWS.iter().map(|arrow| arrow.0).collect();
    let there: BTreeSet<&str> = dependencies.keys().map(String::as_str).collect();
    assert_eq!(there, named, "a package without a floor, or a floor without a package");
    for (floor, (package, allowed)) in ARROWS.iter().enumerate() {
        let below: BTreeSet<&str> = ARROWS[..floor].iter().map(|arrow| arrow.0).collect();
        for allowed in *allowed {
            assert!(below.contains(allowed), "{package} may not stand on {allowed} above it");
        }
        for dependency in dependencies[*package].iter().filter(|it| named.contains(it.as_str())) {
            assert!(allowed.contains(&dependency.as_str()), "{package} depends on {dependency}");
        }
    }
}

#[test]
fn heavy_packages_have_one_home() {
    for (package, dependencies) in dependencies() {
        for (reserved, homes) in RESERVED {
            let is_home = homes.contains(&package.as_str());
            assert!(is_home || !dependencies.contains(reserved), "{package} depends on {reserved}");
        }
        if package == "xtask" {
            assert!(dependencies.len() <= XTASK_DEPENDENCIES, "{dependencies:?}");
        }
    }
}

/// The features of every package from a registry, as the workspace is built with these arguments.
fn features(arguments: &[&str]) -> BTreeMap<String, String> {
    let output = Command::new(env!("CARGO"))
        .current_dir(workspace())
        .args(["tree", "--workspace", "--offline", "--no-dedupe", "--prefix", "none"])
        .args(["--format", "{p}|{f}"])
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let packages = text.lines().filter(|line| !line.contains(" (/"));
    packages
        .filter_map(|line| line.split_once('|'))
        .map(|(package, features)| (package.to_owned(), features.to_owned()))
        .collect()
}

/// What one command compiled, the next does not compile again: programs, tests and the first table
/// ask every dependency for the same features.
#[test]
fn no_dependency_is_compiled_twice() {
    let tests = features(&["--edges", "normal,build,dev"]);
    let first = ["--no-default-features", "--features", "vpr-bench/cli"];
    for arguments in [&[][..], &first] {
        let programs = features(&[&["--edges", "normal,build"], arguments].concat());
        assert!(programs.len() > 150, "{} packages", programs.len());
        for (package, features) in programs {
            assert_eq!(tests[&package], features, "features of {package}, with {arguments:?}");
        }
    }
}

#[test]
fn burn_is_named_in_vpr_nets_and_net_folders_only() {
    let mut n = 0;
    for path in sources() {
        let inside = path.strip_prefix(workspace()).unwrap();
        let is_home = inside.starts_with("crates/vpr-nets")
            || inside.components().any(|part| part.as_os_str() == "net");
        let text = fs::read_to_string(&path).unwrap();
        let is_named = text.lines().any(|line| {
            !line.trim_start().starts_with("//") && line.contains(concat!("burn", "::"))
        });
        assert!(is_home || !is_named, "{} names burn", inside.display());
        n += usize::from(is_named);
    }
    assert!(n > 50, "{n} files name burn");
}

#[test]
fn no_file_is_called_after_nothing() {
    for path in sources() {
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        let vague = ["utils", "util", "helpers", "helper", "common", "misc"];
        assert!(!vague.contains(&stem.as_str()), "{}", path.display());
    }
}

#[test]
fn the_architecture_page_shows_every_package() {
    let page = fs::read_to_string(workspace().join("ARCHITECTURE.md")).unwrap();
    for (package, _) in ARROWS {
        let name = package.strip_prefix("vpr-").unwrap_or(package);
        assert!(page.contains(package) || page.contains(&format!("`{name}`")), "{package}");
    }
}
