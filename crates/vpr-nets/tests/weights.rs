//! Checkpoints of every format give the same tensors; damaged and hostile ones are refused.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod checkpoints;

use std::{fs, path::PathBuf};

use burn::{
    module::Module,
    nn::{BatchNorm, BatchNormConfig, Linear, LinearConfig},
    tensor::{Device, Tensor},
};
use checkpoints::{
    Entry, entry, legacy_checkpoint, safetensors, state_dict, zip_checkpoint, zip_of,
};
use proptest::prelude::*;
use vpr_nets::{Error, weights};

/// Two features in, one out, then a normalisation.
#[derive(Module, Debug)]
struct Small {
    fc: Linear,
    norm: BatchNorm,
}

fn small() -> Small {
    let device = Device::flex();
    Small { fc: LinearConfig::new(2, 1).init(&device), norm: BatchNormConfig::new(1).init(&device) }
}

fn entries() -> Vec<Entry> {
    vec![
        entry("fc.weight", &[1, 2], &[2.0, 3.0]),
        entry("fc.bias", &[1], &[1.0]),
        entry("norm.weight", &[1], &[4.0]),
        entry("norm.bias", &[1], &[-1.0]),
        entry("norm.running_mean", &[1], &[1.0]),
        entry("norm.running_var", &[1], &[4.0]),
        entry("norm.num_batches_tracked", &[1], &[7.0]),
    ]
}

type Write = fn(&[Entry]) -> Vec<u8>;

fn formats() -> [(&'static str, Write); 3] {
    [("zip", zip_checkpoint), ("legacy", legacy_checkpoint), ("safetensors", safetensors)]
}

struct File {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

fn file(bytes: &[u8]) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.pth");
    fs::write(&path, bytes).unwrap();
    File { path, _folder: folder }
}

fn load(bytes: &[u8], module: &mut Small) -> vpr_nets::Result<weights::Report> {
    weights::load(module, &file(bytes).path, &[])
}

fn refusal(bytes: &[u8]) -> String {
    let message = load(bytes, &mut small()).unwrap_err().to_string();
    assert!(message.contains("weights.pth: "), "{message}");
    message
}

fn output(module: &Small) -> f32 {
    let input = Tensor::<2>::from_data([[1.0, 1.0]], &Device::flex());
    module.norm.forward(module.fc.forward(input)).into_scalar()
}

#[test]
fn every_format_gives_the_same_network() {
    for (format, write) in formats() {
        let mut module = small();
        let report = load(&write(&entries()), &mut module).unwrap();
        assert_eq!((report.n_tensors, report.n_values), (6, 7), "{format}");
        let output = output(&module);
        // 2 + 3 + 1 = 6; (6 − 1) / √(4 + 1e-5) · 4 − 1
        assert!((output - 9.0).abs() < 1e-4, "{format}: {output}");
    }
}

#[test]
fn strides_are_followed() {
    let mut transposed = entry("w", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    transposed.strides = vec![1, 2];
    for write in [zip_checkpoint, legacy_checkpoint] {
        let file = file(&write(&[entry("w", &[2, 3], &transposed.data)]));
        let plain = weights::Weights::open(&file.path).unwrap();
        assert_eq!(plain.get("w").unwrap().data, transposed.data);
    }
    let file = file(&zip_checkpoint(&[transposed]));
    let turned = weights::Weights::open(&file.path).unwrap();
    assert_eq!(turned.get("w").unwrap().data, [0.0, 2.0, 4.0, 1.0, 3.0, 5.0]);
}

#[test]
fn a_shared_prefix_of_data_parallel_training_is_removed() {
    let file = file(&zip_checkpoint(&[entry("module.a", &[1], &[1.0])]));
    assert!(weights::Weights::open(&file.path).unwrap().get("a").is_some());
}

/// The entries of the small network, all keys with something before them.
fn behind(prefix: &str) -> Vec<Entry> {
    let key = |entry: Entry| Entry { key: format!("{prefix}{}", entry.key).leak(), ..entry };
    entries().into_iter().map(key).collect()
}

#[test]
fn the_one_prefix_that_makes_all_keys_fit_is_left_out_and_said() {
    assert_eq!(load(&zip_checkpoint(&entries()), &mut small()).unwrap().prefix, None);
    for prefix in ["model.", "backbone.", "encoder.", "state_dict.", "net.encoder.", "fc."] {
        for (format, write) in formats() {
            let mut module = small();
            let report = load(&write(&behind(prefix)), &mut module).unwrap();
            assert_eq!(report.prefix.as_deref(), Some(prefix), "{format}");
            assert!(report.to_string().contains(&format!("begin with `{prefix}`")), "{report}");
            assert!((output(&module) - 9.0).abs() < 1e-4, "{format}");
        }
    }
    let mut module = small();
    let report = load(&zip_checkpoint(&behind("module.model.")), &mut module).unwrap();
    assert_eq!(report.prefix.as_deref(), Some("model."));
}

#[test]
fn where_no_prefix_helps_the_nearest_miss_is_named() {
    let mut other = behind("model.");
    other.remove(1);
    let err = load(&zip_checkpoint(&other), &mut small()).unwrap_err();
    let Error::Weights { mismatch, .. } = &err else { panic!("{err}") };
    assert_eq!(
        (mismatch.missing.as_slice(), mismatch.unexpected.len()),
        (["fc.bias".to_owned()].as_slice(), 0)
    );
    // Not all keys begin with it: nothing is left out, and nothing dropped.
    let mut mixed = behind("model.");
    mixed.push(entry("loss.weight", &[1], &[0.0]));
    assert!(matches!(load(&zip_checkpoint(&mixed), &mut small()), Err(Error::Weights { .. })));
    let path = file(&zip_checkpoint(&behind("a.b.")));
    let open = || weights::Weights::open(&path.path);
    let twice = weights::fit(open, |it| {
        if it.get("a.b.fc.bias").is_none() { Ok(()) } else { it.apply(&mut small()).map(drop) }
    });
    let err = twice.unwrap_err().to_string();
    assert!(err.ends_with("keys: fit without `a.` and without `a.b.`"), "{err}");
}

#[test]
fn another_models_checkpoint_is_refused_with_every_key() {
    let mut other = entries();
    other[0] = entry("fc.weight", &[2, 2], &[0.0; 4]);
    other[1].key = "fc.biases";
    other.push(entry("head.weight", &[1], &[0.0]));
    for (format, write) in formats() {
        let mut module = small();
        let err = load(&write(&other), &mut module).unwrap_err();
        let Error::Weights { mismatch, .. } = &err else { panic!("{format}: {err}") };
        assert_eq!(mismatch.missing, ["fc.bias"], "{format}");
        assert_eq!(mismatch.unexpected, ["fc.biases", "head.weight"], "{format}");
        assert_eq!(mismatch.shapes, [("fc.weight".to_owned(), vec![1, 2], vec![2, 2])]);
        let message = err.to_string();
        assert!(message.contains("1 missing: fc.bias; 2 unexpected: fc.biases, head.weight"));
    }
}

#[test]
fn what_is_not_finite_is_refused_by_key_and_place() {
    for value in [f32::NAN, f32::INFINITY] {
        let mut bad = entries();
        bad[0].data[1] = value;
        for (format, write) in formats() {
            let message = refusal(&write(&bad));
            assert!(message.contains("fc.weight: value 1 is "), "{format}: {message}");
        }
    }
}

#[test]
fn renames_drop_keys_and_collide_loudly() {
    let file = file(&zip_checkpoint(&entries()));
    let open = || weights::Weights::open(&file.path).unwrap();
    let kept = open().renamed(&[(r"^norm\..*", ""), ("^fc", "head")]).unwrap();
    assert_eq!(kept.iter().map(|(key, _)| key).collect::<Vec<_>>(), ["head.bias", "head.weight"]);
    let collision = open().renamed(&[("^(fc|norm)", "x")]).unwrap_err().to_string();
    assert!(collision.contains("another key is renamed to `x."), "{collision}");
    assert!(matches!(open().renamed(&[("(", "")]), Err(Error::Pattern { .. })));
}

#[test]
fn hostile_pickles_are_refused_and_never_run() {
    let marker = std::env::temp_dir().join(format!("vpr-nets-hostile-{}", std::process::id()));
    let command = format!("touch {}", marker.display());
    let mut pickle = b"\x80\x02cposix\nsystem\n(X".to_vec();
    pickle.extend(u32::try_from(command.len()).unwrap().to_le_bytes());
    pickle.extend(command.as_bytes());
    pickle.extend(b"tR.");
    let message = refusal(&zip_of(&pickle, &[]));
    assert!(message.contains("`posix.system` is not on the list"), "{message}");
    assert!(!marker.exists());
}

#[test]
fn claims_beyond_the_file_are_refused_before_anything_is_allocated() {
    // A tensor with more elements than its storage, by stride 0.
    let mut wide = entry("w", &[200, 200], &[1.0]);
    wide.strides = vec![0, 0];
    assert!(refusal(&zip_checkpoint(&[wide])).contains("exceeds its storage"));
    // A storage that says it has 200 elements, but has one.
    let claimed = [Entry { data: vec![0.0; 200], ..entry("w", &[200], &[]) }];
    let pickle = state_dict(&claimed, false);
    let message = refusal(&zip_of(&pickle, &[entry("w", &[1], &[1.0])]));
    assert!(message.contains("200 elements has only 4 bytes"), "{message}");
    // A safetensors header of 2^60 bytes.
    let message = refusal(&[&(1_u64 << 60).to_le_bytes()[..], b"{}"].concat());
    assert!(message.contains("neither a checkpoint"), "{message}");
}

#[test]
fn truncated_files_are_refused_at_every_length() {
    for (format, write) in formats() {
        let bytes = write(&entries());
        for length in 0..bytes.len() {
            // Legacy files keep their last storage for the last key.
            let message = load(&bytes[..length], &mut small()).err();
            assert!(message.is_some(), "{format} of {length} bytes");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn flipped_bits_never_panic(format in 0_usize..3, flips in prop::collection::vec(any::<usize>(), 1..4)) {
        let mut bytes = formats()[format].1(&entries());
        for flip in flips {
            let bit = flip % (8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let _ = load(&bytes, &mut small());
    }
}

#[test]
fn empty_and_foreign_files_are_refused() {
    for bytes in [&b""[..], b"PK\x03\x04", b"\x93NUMPY", b"{}", b"\xff\xd8\xff\xe0"] {
        refusal(bytes);
    }
    let missing = weights::load(&mut small(), "no/such.pth".as_ref(), &[]).unwrap_err();
    assert!(missing.to_string().contains("no/such.pth"), "{missing}");
}

/// What `data/golden/scikit/make.py` writes: arrays as scikit-learn has them, in f32.
fn scikit(name: &str) -> weights::Weights {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/scikit");
    weights::Weights::open(&folder.join(name)).unwrap()
}

#[test]
fn arrays_of_estimators_are_tensors_beside_the_weights() {
    let arrays = scikit("arrays.safetensors");
    for name in ["ap-gem.pt", "legacy.pt"] {
        let checkpoint = scikit(name);
        for part in ["mean", "components", "explained_variance"] {
            let key = format!("pca.Landmarks_clean.{part}_");
            assert_eq!(checkpoint.get(&key), arrays.get(part), "{name}: {key}");
        }
        // The prefix of the weights is left out as without estimators.
        assert_eq!(checkpoint.get("conv1.weight").unwrap().data, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(checkpoint.get("adpool.p").unwrap().data, [3.0]);
    }
    for protocol in [0, 2, 4] {
        let vocabulary = scikit(&format!("vocabulary-{protocol}.pkl"));
        let words = vocabulary.get("400.256.conv3.cluster_centers_");
        assert_eq!(words, arrays.get("cluster_centers"), "protocol {protocol}");
    }
}
