//! Caffe's and Matlab's files hold what other readers say; what is cut or damaged is refused.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::path::{Path, PathBuf};

use ndarray::array;
use proptest::prelude::*;
use vpr_files::{
    caffe::{decode_blob, decode_model, read_blob, read_model},
    mat::{MAX_INFLATION, MatFile},
};

/// What `golden/weights.py` writes.
fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

#[test]
fn both_forms_of_a_layer_hold_the_same() {
    let forms = [("new.caffemodel", vec![4]), ("older.caffemodel", vec![1, 1, 1, 4])];
    for (name, bias_shape) in forms {
        let layers = read_model(&golden(name)).unwrap();
        assert_eq!(layers.len(), 1, "the rectifier has no weights");
        assert_eq!((layers[0].name.as_str(), layers[0].blobs.len()), ("conv", 2));
        let [weights, bias] = &layers[0].blobs[..] else { panic!("{layers:?}") };
        assert_eq!(weights.shape, [4, 1, 3, 3]);
        assert_eq!((weights.values[0], weights.values[35]), (-17.0 / 8.0, 18.0 / 8.0));
        assert_eq!(bias.values, [0.5, -1.0, 0.25, 2.0]);
        assert_eq!(bias.shape, bias_shape);
    }
    let mean = read_blob(&golden("mean.binaryproto")).unwrap();
    assert_eq!((mean.shape, mean.values[11]), (vec![1, 3, 2, 2], 115.5));
}

#[test]
fn arrays_are_those_of_scipy() {
    for name in ["compressed.mat", "plain.mat"] {
        let file = MatFile::open(&golden(name)).unwrap();
        assert_eq!(file.names().collect::<Vec<_>>(), ["CX", "lambda", "counts", "whole", "signs"]);
        let matrix = |name: &str| file.array_named(name).unwrap().to_matrix().unwrap();
        assert_eq!(matrix("CX"), array![[0.0, 0.25, 0.5], [0.75, 1.0, 1.25]]);
        assert_eq!(matrix("lambda"), array![[0.1], [2.5], [-3.0]]);
        assert_eq!(matrix("signs"), array![[-1.0, 1.0]]);
        assert_eq!(matrix("whole")[[1, 2]], 258.0 % 7.0);
        let counts = file.array_named("counts").unwrap();
        assert_eq!(counts.shape(), [2, 3, 4]);
        // The first axis is the fastest: element (1, 0, 0) of a C-ordered count is 12.
        assert_eq!(counts.to_f64s()[..3], [0.0, 12.0, 4.0]);
        assert!(counts.to_matrix().is_none() && file.array_named("cell").is_none());
    }
    let others = MatFile::open(&golden("compressed.mat")).unwrap().others().to_vec();
    let others: Vec<_> = others.iter().map(|it| (it.name.as_str(), it.what)).collect();
    let expected = [
        ("cell", "a cell array"),
        ("info", "a structure"),
        ("title", "text"),
        ("turns", "a complex array"),
    ];
    assert_eq!(others, expected);
}

#[test]
fn refusals_say_where() {
    let refusal = |bytes: &[u8]| decode_model(bytes).unwrap_err().to_string();
    assert_eq!(refusal(b""), "byte 0: the file ends, and no layer had weights");
    // Field 100 claims 4 GiB.
    assert_eq!(
        refusal(b"\xa2\x06\xff\xff\xff\xff\x0f"),
        "byte 0: needs 4294967295 bytes, only 0 follow"
    );
    assert_eq!(refusal(b"\x0b"), "byte 0: wire type 3 is not read");
    assert_eq!(refusal(b"\x02\x00"), "byte 0: field number 0");
    assert_eq!(
        refusal(b"\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"),
        "byte 0: a number is longer than 64 bits"
    );
    // Shape 2³² × 2³² and one value.
    let huge = b"\x3a\x0c\x0a\x0a\x80\x80\x80\x80\x10\x80\x80\x80\x80\x10\x2a\x04\0\0\0\0";
    assert_eq!(
        decode_blob(huge).unwrap_err().to_string(),
        "byte 0: a blob of shape [4294967296, 4294967296] has 1 values"
    );
    let older = b"\x12\x04\x0a\x02\x0a\x00";
    assert_eq!(refusal(older), "byte 2: a layer in the form of 2013, which is not read");

    let bytes = std::fs::read(golden("plain.mat")).unwrap();
    let changed = |at: usize, value: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = value;
        MatFile::decode(bytes).unwrap_err().to_string()
    };
    assert!(changed(126, b'X').starts_with("byte 126: no mark of the order of bytes"));
    assert!(changed(125, 2).starts_with("byte 124: not version 5; 7.3 is HDF5"));
    assert_eq!(changed(128, 99), "byte 128: data of type 99 are not read");
    assert!(changed(160, 200).starts_with("byte 176: 24 bytes of F32"), "{}", changed(160, 200));
}

/// A file of one compressed element of zeros.
fn bomb(n_zeros: u32) -> Vec<u8> {
    use std::io::Write as _;
    let mut matrix = Vec::new();
    let mut element = |kind: u32, data: &[u8]| {
        matrix.extend(kind.to_le_bytes());
        matrix.extend(u32::try_from(data.len()).unwrap().to_le_bytes());
        matrix.extend(data);
        matrix.resize(matrix.len().next_multiple_of(8), 0);
    };
    element(6, &[6, 0, 0, 0, 0, 0, 0, 0]);
    element(5, &[n_zeros.to_le_bytes(), 1_u32.to_le_bytes()].concat());
    element(1, b"x");
    element(2, &vec![0; n_zeros as usize]);
    let mut content = [14_u32, u32::try_from(matrix.len()).unwrap()].map(u32::to_le_bytes).concat();
    content.extend(matrix);
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(&content).unwrap();
    let packed = encoder.finish().unwrap();
    let mut file = vec![b' '; 124];
    file.extend([0, 1, b'I', b'M']);
    file.extend(15_u32.to_le_bytes());
    file.extend(u32::try_from(packed.len()).unwrap().to_le_bytes());
    file.extend(packed);
    file
}

#[test]
fn what_inflates_without_end_is_refused() {
    let small = MatFile::decode(bomb(60_000)).unwrap();
    assert_eq!(small.array_named("x").unwrap().to_f64s(), vec![0.0; 60_000]);
    let file = bomb(50_000_000);
    assert!(50_000_000 > file.len() * MAX_INFLATION * 10);
    let refusal = MatFile::decode(file).unwrap_err().to_string();
    assert!(refusal.starts_with("byte 128: all compressed elements inflate to more"), "{refusal}");
}

proptest! {
    #[test]
    fn no_damage_panics(cut in 0_usize..4000, at in 0_usize..4000, value: u8) {
        for name in ["new.caffemodel", "older.caffemodel", "mean.binaryproto", "compressed.mat", "plain.mat"] {
            let mut bytes = std::fs::read(golden(name)).unwrap();
            bytes.truncate(cut);
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
            let _ = decode_model(&bytes);
            let _ = decode_blob(&bytes);
            if let Ok(file) = MatFile::decode(bytes) {
                let names: Vec<_> = file.names().collect();
                for name in names {
                    let _ = file.array_named(name).unwrap().to_f64s();
                }
            }
        }
    }
}
