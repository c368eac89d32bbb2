//! `.npy` and `.npz`: what NumPy writes is read, what is written NumPy could read, lies are refused.

#![expect(clippy::unwrap_used, clippy::print_stderr, reason = "a test may")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use ndarray::{Array2, Array3, array};
use proptest::prelude::*;
use vpr_files::Result;
use vpr_files::npy;

/// A `.npy` file with this header and body.
fn file(header: &str, body: &[u8]) -> Vec<u8> {
    let len = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", len.as_slice(), header.as_bytes(), body].concat()
}

fn header(descr: &str, fortran_order: &str, shape: &str) -> String {
    format!("{{'descr': '{descr}', 'fortran_order': {fortran_order}, 'shape': {shape}, }}\n")
}

/// Writes `bytes` to a file and reads that with `read`.
fn read_bytes<T>(bytes: &[u8], read: impl Fn(&Path) -> Result<T>) -> Result<T> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("array.npy");
    fs::write(&path, bytes).unwrap();
    read(&path)
}

fn refusal(bytes: &[u8]) -> String {
    let err = read_bytes(bytes, npy::read_f32).unwrap_err().to_string();
    err.split_once("array.npy: ").unwrap().1.to_owned()
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("descriptors.npy");
    let values =
        Array2::from_shape_fn((300, 77), |(row, column)| (row * 100 + column) as f32 / 3.0);
    npy::write_f32(&path, values.view()).unwrap();
    assert_eq!(npy::read_f32(&path).unwrap(), values);
    assert_eq!(npy::read_f64(&path).unwrap(), values.mapv(f64::from));
    // Not the memory order is written, but the array.
    npy::write_f32(&path, values.t()).unwrap();
    assert_eq!(npy::read_f32(&path).unwrap(), values.t());
    npy::write_f64(&path, array![[1.0, 2.0]].view()).unwrap();
    assert_eq!(npy::read_f32_rounded(&path).unwrap(), (array![[1.0, 2.0]], "float64"));
    npy::write_i64(&path, &[-1, 5]).unwrap();
    assert_eq!(npy::read_i64(&path).unwrap().to_vec(), [-1, 5]);
    let left: Vec<PathBuf> =
        fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(left, [path], "a temporary file is left");
}

#[test]
fn writing_into_a_missing_folder_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("missing/descriptors.npy");
    let err = npy::write_f32(&path, array![[1.0]].view()).unwrap_err();
    assert!(err.to_string().ends_with("missing/descriptors.npy"), "{err}");
}

#[test]
fn either_byte_order_and_memory_order_is_read() {
    let body: Vec<u8> =
        [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|x| x.to_be_bytes()).collect();
    let bytes = file(&header(">f4", "True", "(3, 2)"), &body);
    let values = read_bytes(&bytes, npy::read_f32).unwrap();
    assert_eq!(values, array![[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]]);
    assert!(values.is_standard_layout());
    let bytes = file(&header(">u2", "False", "(2,)"), &[1, 0, 0, 7]);
    assert_eq!(read_bytes(&bytes, npy::read_i64).unwrap().to_vec(), [256, 7]);
}

#[test]
fn every_type_of_number_is_rounded_to_single_precision_and_named() {
    let rounded = |descr: &str, body: &[u8]| {
        let bytes = file(&header(descr, "False", "(1, 2)"), body);
        read_bytes(&bytes, npy::read_f32_rounded).unwrap()
    };
    // 1.0 and -0.5 in half precision.
    assert_eq!(rounded("<f2", &[0, 0x3c, 0, 0xb8]), (array![[1.0, -0.5]], "float16"));
    let doubles: Vec<u8> = [0.1_f64, 2.0].iter().flat_map(|it| it.to_le_bytes()).collect();
    assert_eq!(rounded("<f8", &doubles), (array![[0.1, 2.0]], "float64"));
    assert_eq!(rounded("|u1", &[0, 255]), (array![[0.0, 255.0]], "uint8"));
    assert_eq!(rounded(">i2", &[255, 255, 1, 0]), (array![[-1.0, 256.0]], "int16"));
    let half = file(&header("<f2", "False", "(1, 1)"), &[0, 0x3c]);
    assert_eq!(read_bytes(&half, npy::read_f32).unwrap(), array![[1.0]], "nothing is lost");
    let bools = file(&header("|b1", "False", "(1, 1)"), &[1]);
    let err = read_bytes(&bools, npy::read_f32_rounded).unwrap_err().to_string();
    assert!(err.ends_with("holds bool, not numbers"), "{err}");
}

/// An archive with one array `names`.
fn archive(descr: &str, shape: &[usize], body: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let mut archive = npy::npz::Writer::new(fs::File::create(&path).unwrap());
    archive.add("names", descr, shape, body.iter().map(|&byte| [byte])).unwrap();
    archive.finish().unwrap();
    (folder, path)
}

#[test]
fn texts_of_fixed_length_and_python_strings_are_read() {
    let texts = |descr: &str, shape: &[usize], body: &[u8]| {
        let (_folder, path) = archive(descr, shape, body);
        let err =
            |err: vpr_files::Error| err.to_string().split_once("`names`: ").unwrap().1.to_owned();
        npy::npz::read_texts(&path, "names").map_err(err)
    };
    let utf_32 =
        |text: &str| text.chars().flat_map(|it| u32::from(it).to_le_bytes()).collect::<Vec<u8>>();
    assert_eq!(texts("<U2", &[2], &utf_32("äbc\0")).unwrap(), ["äb", "c"]);
    assert_eq!(texts("|S2", &[2], b"abc\0").unwrap(), ["ab", "c"]);
    assert!(texts("|S1", &[1], &[0xff]).unwrap_err().contains("only 0 are there and fit"));
    assert!(texts("<U1", &[1, 1], &utf_32("a")).unwrap_err().contains("1 dimensions"));
    assert_eq!(texts("<f4", &[1], &[0; 4]).unwrap_err(), "byte 0: holds float32, not text");
    // Protocol 0: `numpy.ndarray` of shape (2,) with a list of two strings.
    let pickle = |second: &str| {
        format!(
            "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(I2\n\
             tcnumpy\ndtype\n(S'O8'\nI0\nI1\ntR(I3\nS'|'\nNNNI-1\nI-1\nI63\ntbI00\n(lVa.jpg\n\
             a{second}atb."
        )
    };
    assert_eq!(texts("|O", &[2], pickle("Vb.jpg\n").as_bytes()).unwrap(), ["a.jpg", "b.jpg"]);
    let err = texts("|O", &[2], pickle("I7\n").as_bytes()).unwrap_err();
    assert_eq!(err, "row 1 is an int, not text");
}

#[test]
fn another_type_or_number_of_dimensions_is_refused() {
    let f64s = file(&header("<f8", "False", "(1, 1)"), &[0; 8]);
    assert_eq!(refusal(&f64s), "byte 0: holds float64, not float32");
    let vector = file(&header("<f4", "False", "(1,)"), &[0; 4]);
    assert_eq!(refusal(&vector), "byte 0: has shape [1], but 2 dimensions are expected");
    let complex = file(&header("<c8", "False", "(1, 1)"), &[0; 8]);
    assert!(refusal(&complex).ends_with("in the header: dtype `<c8` is not read"));
    let brain = file(&header("|V2", "False", "(1, 1)"), &[0; 2]);
    assert!(refusal(&brain).ends_with("if bfloat16, save it as float32"));
    let huge = file(&header("<u8", "False", "(1,)"), &[255; 8]);
    let err = read_bytes(&huge, npy::read_i64).unwrap_err().to_string();
    assert!(err.ends_with("of 1 elements, only 0 are there and fit"), "{err}");
    let objects = file(&header("|O", "False", "(1, 1)"), b"N.......");
    assert!(
        refusal(&objects).contains("holds object") || refusal(&objects).contains("bytes follow")
    );
    let err = read_bytes(&f64s, npy::read_objects).unwrap_err().to_string();
    assert!(err.ends_with("holds float64, not objects"), "{err}");
}

#[test]
fn headers_that_lie_about_the_size_are_refused_without_allocating() {
    for shape in [
        "(3, 2)",
        "(1, 1)",
        "(1000000000000, 1000000)",
        "(18446744073709551615, 2)",
        "(4611686018427387904, 4611686018427387904)",
        "(0, 9223372036854775807)",
        "()",
    ] {
        let reason = refusal(&file(&header("<f4", "False", shape), &[0; 20]));
        assert!(reason.contains("but 20 bytes follow"), "{shape}: {reason}");
    }
    // No byte is missing here, but the product of the other lengths does not fit.
    let empty = file(&header("<f4", "False", "(9223372036854775807, 4, 0)"), &[]);
    assert!(!refusal(&empty).is_empty());
}

#[test]
fn archives_are_read_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arrays.npz");
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/arrays.npz");
    assert_eq!(npy::npz::names(&golden).unwrap(), ["descriptors", "frames"]);
    let descriptors: Array2<f32> = npy::npz::read(&golden, "descriptors").unwrap();
    assert_eq!(descriptors, array![[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
    let frames: Array3<u8> = npy::npz::read(&golden, "frames").unwrap();
    assert_eq!((frames.dim(), frames.sum()), ((2, 2, 2), 28));
    let err = npy::npz::read::<f32, ndarray::Ix2>(&golden, "poses").unwrap_err().to_string();
    assert!(err.ends_with("array `poses`: is not there; known: descriptors, frames"), "{err}");
    let err = npy::npz::read::<f32, ndarray::Ix2>(&golden, "frames").unwrap_err().to_string();
    assert!(err.ends_with("array `frames`: byte 0: holds uint8, not float32"), "{err}");
    fs::write(&path, b"PK\x03\x04nonsense").unwrap();
    assert!(npy::npz::names(&path).unwrap_err().to_string().contains("arrays.npz"));
}

#[test]
fn the_frames_of_nordland_are_read() {
    let Some(data) = std::env::var_os("VPR_DATA") else {
        return eprintln!("skipped: VPR_DATA is not set");
    };
    let path = Path::new(&data).join("nordland-64x32/nordland_64x32_u8.npz");
    for (season, sum) in [("summer", 708_441_846), ("winter", 841_340_288)] {
        let frames: Array3<u8> = npy::npz::read(&path, season).unwrap();
        assert_eq!(frames.dim(), (3576, 32, 64));
        assert_eq!(frames.iter().map(|&value| u64::from(value)).sum::<u64>(), sum, "{season}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_never_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8), 1..5), cut in any::<prop::sample::Index>()) {
        let mut bytes = file(&header("<f4", "False", "(3, 2)"), &[7; 24]);
        for (index, bit) in flips {
            *index.get_mut(&mut bytes) ^= 1_u8 << bit;
        }
        if let Ok(values) = read_bytes(&bytes, npy::read_f32) {
            prop_assert_eq!(values.len(), 6);
        }
        bytes.truncate(cut.index(bytes.len()));
        prop_assert!(read_bytes(&bytes, npy::read_f32).is_err());
    }

    #[test]
    fn damaged_archives_never_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8), 1..5)) {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/arrays.npz");
        let mut bytes = fs::read(golden).unwrap();
        for (index, bit) in flips {
            *index.get_mut(&mut bytes) ^= 1_u8 << bit;
        }
        if let Ok(values) = read_bytes(&bytes, |path| npy::npz::read::<f32, ndarray::Ix2>(path, "descriptors")) {
            prop_assert_eq!(values.len(), 6);
        }
    }
}
