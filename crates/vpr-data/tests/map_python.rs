//! A map is read by Python with the `safetensors` package alone.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

use std::process::Command;

use ndarray::array;
use vpr_core::{
    Poses, Position,
    map::{About, Coordinates, MapWriter, Names, RowType},
};

const SCRIPT: &str = r#"
import sys
from safetensors import safe_open

with safe_open(sys.argv[1], framework="numpy") as f:
    rows = f.get_tensor("descriptors")
    if "scales" in f.keys():
        rows = rows * f.get_tensor("scales")[:, None]
    ends, names = f.get_tensor("name_offsets"), f.get_tensor("names").tobytes()
    print(rows.shape, [round(float(x), 3) for x in rows[1]])
    print(f.get_tensor("positions").tolist())
    print([names[a:b].decode() for a, b in zip(ends, ends[1:])])
    print(f.metadata()["encoder"], "/", f.metadata()["coordinates"])
"#;

#[test]
fn python_reads_a_map_with_the_safetensors_package_alone() {
    let Some(python) = std::env::var_os("VPR_PYTHON") else {
        eprintln!("skipped: VPR_PYTHON names no Python with safetensors and numpy");
        return;
    };
    for row_type in [RowType::F32, RowType::F16, RowType::I8] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.safetensors");
        let encoder = Some("HOG".to_owned());
        let about = About { encoder, coordinates: Some(Coordinates::Local), ..About::default() };
        let mut writer = MapWriter::create(&path, 3, row_type, about).unwrap();
        let rows = array![[0.0, 1.0, -1.0], [0.25, 0.5, 1.0]];
        let positions = [Position::new(0.5, 1.5, 2.5), Position::new(-1.0, 0.0, 9.0)];
        let names: Names = ["a.jpg", "straße.png"].into_iter().collect();
        let poses = Poses::Spatial(positions.to_vec());
        writer.append(rows.view(), Some(&poses), Some(&names)).unwrap();
        writer.finish().unwrap();
        let output =
            Command::new(&python).args(["-c", SCRIPT]).arg(&path).output().expect("python runs");
        let row = if row_type == RowType::I8 { "0.252, 0.504, 1.0" } else { "0.25, 0.5, 1.0" };
        let expected = format!(
            "(2, 3) [{row}]\n[[0.5, 1.5, 2.5], [-1.0, 0.0, 9.0]]\n\
             ['a.jpg', 'straße.png']\nHOG / local\n"
        );
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(String::from_utf8_lossy(&output.stdout), expected, "{row_type}: {error}");
    }
}
