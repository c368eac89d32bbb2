//! `bench map` from descriptors to pairs and back.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::{
    path::Path,
    process::{Command, Output},
};

use ndarray::Array2;
use vpr_files::npy;

/// A program that has ended.
struct Ended(Output);

impl Ended {
    fn success(self) -> Self {
        self.code(0)
    }

    fn code(self, expected: i32) -> Self {
        assert_eq!(self.0.status.code(), Some(expected), "{}", stderr(&self));
        self
    }
}

fn bench(folder: &Path, args: &str) -> Ended {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    let output = command.current_dir(folder).arg("map").args(args.split_whitespace()).output();
    Ended(output.expect("the program starts"))
}

fn stdout(ended: &Ended) -> String {
    String::from_utf8(ended.0.stdout.clone()).unwrap()
}

fn stderr(ended: &Ended) -> String {
    String::from_utf8(ended.0.stderr.clone()).unwrap()
}

/// Four references on a line, in the plane and among the descriptors.
fn references(folder: &Path) {
    let rows = Array2::from_shape_fn((4, 3), |(row, column)| (row * (column + 1)) as f32);
    npy::write_f32(&folder.join("refs.npy"), rows.view()).unwrap();
    npy::write_f32(&folder.join("queries.npy"), (&rows + 0.25).view()).unwrap();
    let poses = "name,easting,northing\na.jpg,0,0\nb.jpg,10,0\nc.jpg,20,0\nd.jpg,30,0\n";
    std::fs::write(folder.join("refs.csv"), poses).unwrap();
}

#[test]
fn build_search_verify() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    references(folder);
    bench(folder, "build --descriptors refs.npy --encoder line --metric cosine m.safetensors")
        .success();
    let info = stdout(&bench(folder, "info m.safetensors").success());
    assert!(info.contains("references: 4\ndimension: 3\n"), "{info}");
    assert!(info.contains("encoder: line\n") && info.contains("metric: cosine\n"), "{info}");
    bench(folder, "verify m.safetensors").success();
    let args = "search m.safetensors --queries queries.npy -k 1 --metric euclidean";
    let found = stdout(&bench(folder, args).success());
    assert!(found.starts_with("query,rank,reference,distance\n0,1,a.jpg,0.433"), "{found}");
    let near = stdout(&bench(folder, &format!("{args} --near 19,0,5")).success());
    assert!(near.lines().skip(1).all(|line| line.contains(",c.jpg,")), "{near}");
}

#[test]
fn damage_is_exit_code_one_and_no_map_is_two() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    references(folder);
    bench(folder, "build --descriptors refs.npy m.safetensors").success();
    let mut bytes = std::fs::read(folder.join("m.safetensors")).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(folder.join("m.safetensors"), &bytes).unwrap();
    let verify = bench(folder, "verify m.safetensors").code(1);
    assert!(stdout(&verify).starts_with("m.safetensors: tensor `block_digests`: "));
    let search = bench(folder, "search m.safetensors --queries queries.npy").code(2);
    assert!(stderr(&search).starts_with("error: m.safetensors: "), "{}", stderr(&search));
    bench(folder, "info nothing.safetensors").code(2);
}

#[test]
fn segments_merge_and_formats_convert() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    references(folder);
    for _ in 0..2 {
        bench(folder, "build --descriptors refs.npy --append city").success();
    }
    bench(folder, "verify city").code(0);
    bench(folder, "merge city --out city.safetensors").success();
    bench(folder, "convert city.safetensors half.safetensors --row-type f16").success();
    let info = stdout(&bench(folder, "info half.safetensors").success());
    assert!(info.contains("references: 8\ndimension: 3\nrow type: f16\n"), "{info}");
    bench(folder, "convert refs.npy refs.h5").success();
    bench(folder, "convert refs.h5 back.npy").success();
    let [before, after] =
        ["refs.npy", "back.npy"].map(|name| npy::read_f32(&folder.join(name)).unwrap());
    assert_eq!(before, after);
    let missing = bench(folder, "convert refs.h5 poses.tum").code(2);
    assert_eq!(stderr(&missing), "error: refs.h5: content: no poses in the file\n");
}

#[test]
fn regressed_rows_are_told_and_can_be_left_out() {
    use vpr_core::map::{About, MapWriter, Names, OpenMap, Opening, Origin, Origins, RowType};

    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    references(folder);
    let rows = Array2::from_shape_fn((4, 3), |(row, column)| (row * (column + 1)) as f32);
    let path = folder.join("dense.safetensors");
    let mut writer = MapWriter::create(&path, 3, RowType::F32, About::default()).unwrap();
    let names = |all: [&str; 2]| all.into_iter().collect::<Names>();
    writer.append(rows.slice(ndarray::s![..2, ..]), None, Some(&names(["a", "b"]))).unwrap();
    let mut origins = Origins::default();
    origins.push_regressed(&[0, 1]).unwrap();
    origins.push_regressed(&[1]).unwrap();
    let more = names(["r0", "r1"]);
    let two = rows.slice(ndarray::s![2.., ..]);
    writer.append_regressed(two, None, Some(&more), &origins).unwrap();
    writer.finish().unwrap();

    let info = stdout(&bench(folder, "info dense.safetensors").success());
    assert!(info.contains("references: 4\n") && info.contains("regressed: 2\n"), "{info}");
    let search = "search dense.safetensors --queries queries.npy -k 1";
    let found = stdout(&bench(folder, search).success());
    assert!(found.contains("\n3,1,r1,"), "{found}");
    let found = stdout(&bench(folder, &format!("{search} --measured")).success());
    assert!(
        found.contains("\n3,1,b,") && !found.contains(",r0,") && !found.contains(",r1,"),
        "{found}"
    );

    bench(folder, "convert dense.safetensors half.safetensors --row-type f16").success();
    let half = OpenMap::open(&folder.join("half.safetensors"), Opening::default()).unwrap();
    let kept = half.origins().unwrap().unwrap();
    assert_eq!(kept.get(2), Some(Origin::Regressed(&[0, 1])));
    let told = bench(folder, "convert dense.safetensors dense.npz").success();
    assert!(stderr(&told).contains("2 of them are"), "{}", stderr(&told));
    bench(folder, "verify dense.safetensors").success();
}
