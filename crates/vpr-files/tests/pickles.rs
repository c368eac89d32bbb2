//! Pickles of every protocol decode to the same; hostile ones are refused, whatever they hold.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::{fmt::Write as _, path::Path};

use proptest::prelude::*;
use vpr_files::pickle::{
    Elements, MAX_DEPTH, MAX_EXPANSION, Value, decode, decode_checkpoint, decode_estimators, read,
};

/// What `golden/pickles.py` writes.
fn golden() -> Value {
    let text = |text: &str| Value::Text(text.to_owned());
    let array = |shape: &[usize], elements| Value::Array { shape: shape.to_vec(), elements };
    let int = Value::Int;
    let objects =
        vec![int(0), Value::List(vec![int(0), int(1)]), int(1), Value::List(vec![int(-1)])];
    let plain = vec![
        Value::None,
        Value::Bool(true),
        Value::Bool(false),
        int(1),
        int(70000),
        int(-(1 << 40)),
        Value::Float(1.5),
        text("é€\n\\"),
        Value::Bytes(b"\x00\xff\n".to_vec()),
        Value::Tuple(vec![]),
        Value::Tuple(vec![int(1)]),
        Value::Tuple(vec![int(1), int(2), int(3)]),
    ];
    let empty = vec![Value::List(vec![]), Value::Dict(vec![]), Value::Bytes(vec![]), text("")];
    Value::Dict(vec![
        (text("c"), array(&[2, 3], Elements::F64(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]))),
        (text("fortran"), array(&[2, 3], Elements::F32(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]))),
        (text("big"), array(&[3], Elements::Int(vec![1, -2, 3]))),
        (text("flags"), array(&[2], Elements::Bool(vec![true, false]))),
        (text("objects"), array(&[2, 2], Elements::Object(objects))),
        (text("scalar"), Value::Float(0.1)),
        (text("count"), int(-7)),
        (text("plain"), Value::List(plain)),
        (text("empty"), Value::List(empty)),
    ])
}

fn golden_bytes(protocol: u8) -> Vec<u8> {
    let name = format!("tests/golden/pickles/protocol-{protocol}.pkl");
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

/// The message of a refusal.
fn refusal(bytes: &[u8]) -> String {
    decode(bytes).unwrap_err().to_string()
}

#[test]
fn every_protocol_holds_the_same() {
    for protocol in 0..=5 {
        assert_eq!(decode(&golden_bytes(protocol)).unwrap(), golden(), "protocol {protocol}");
    }
}

#[test]
fn functions_are_never_called() {
    let not_listed = |name: &str| format!("GLOBAL: `{name}` is not on the list of what is read");
    let system = b"cos\nsystem\n(S'true'\ntR.";
    assert_eq!(refusal(system), format!("byte 0: {}", not_listed("os.system")));
    let eval = b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93\x8c\x011\x85R.";
    assert_eq!(refusal(eval), format!("byte 18: {}", not_listed("builtins.eval")));
    // On the list, but with arguments that would make it dangerous elsewhere.
    let sneaky = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\ndtype\n(I0\ntS'b'\ntR.";
    assert_eq!(refusal(sneaky), "byte 61: REDUCE: unexpected arguments of Reconstruct");
    assert_eq!(refusal(b"(S'x'\nios\nsystem\n."), "byte 6: opcode 0x69 (INST) is not read");
    assert_eq!(refusal(b"P7\n."), "byte 0: opcode 0x50 (PERSID) is not read");
    assert_eq!(refusal(b"cnumpy\nndarray\n."), "byte 0: Ndarray is a function, not data");
    assert_eq!(refusal(b"cnumpy\nndarray\n)R."), "byte 16: REDUCE: numpy.ndarray is not called");
    assert_eq!(refusal(b"I1\n)R."), "byte 4: REDUCE: calls what is not a function");
}

#[test]
fn memo_bombs_do_not_expand() {
    // Each list holds the one before ten times: 10^19 objects from some 500 bytes.
    let mut bomb = b"(".to_vec();
    bomb.extend_from_slice(b"]q\x00");
    for level in 1..20_u8 {
        bomb.extend_from_slice(b"](");
        bomb.extend(std::iter::repeat_n([b'h', level - 1], 10).flatten());
        bomb.extend_from_slice(&[b'e', b'q', level]);
    }
    bomb.extend_from_slice(b"l.");
    let message = refusal(&bomb);
    let expected = format!("shared objects expand to more than {MAX_EXPANSION} times the pickle");
    assert!(message.ends_with(&expected), "{message}");

    // One long string, shared a thousand times.
    let mut bomb = [b"(T\x10\x27\x00\x00".as_slice(), &[b'x'; 10_000], b"q\x00"].concat();
    bomb.extend(std::iter::repeat_n([b'h', 0], 1000).flatten());
    bomb.extend_from_slice(b"l.");
    assert!(refusal(&bomb).ends_with(&expected));
}

#[test]
fn encoding_shared_text_again_and_again_is_refused() {
    let mut bomb = b"(c_codecs\nencode\nq\x00X\x10\x27\x00\x00".to_vec();
    bomb.extend_from_slice(&[b'x'; 10_000]);
    bomb.extend_from_slice(b"q\x01X\x06\x00\x00\x00latin1q\x02");
    for _ in 0..1000 {
        bomb.extend_from_slice(b"h\x00h\x01h\x02\x86R");
    }
    bomb.extend_from_slice(b"l.");
    let message = refusal(&bomb);
    assert!(message.ends_with("encodes shared strings to more than the pickle holds"), "{message}");
}

#[test]
fn depth_is_bounded_and_cycles_end() {
    let nested = |depth| [vec![b']'; depth], vec![b'a'; depth - 1], vec![b'.']].concat();
    assert!(decode(&nested(MAX_DEPTH)).is_ok());
    let expected = format!("nested more than {MAX_DEPTH} levels deep");
    assert!(refusal(&nested(MAX_DEPTH + 1)).ends_with(&expected));
    assert!(refusal(&nested(1_000_000)).ends_with(&expected));
    assert!(refusal(b"]q\x00h\x00a.").ends_with(&expected));
}

#[test]
fn lengths_are_held_against_what_is_there() {
    assert_eq!(refusal(b"T\xff\xff\xff\x7fx."), "byte 0: needs 2147483647 bytes, only 2 follow");
    assert_eq!(
        refusal(b"\x8e\xff\xff\xff\xff\xff\xff\xff\xff."),
        format!("byte 0: needs {} bytes, only 1 follow", u64::MAX)
    );
    assert_eq!(refusal(b"\x95\x09\0\0\0\0\0\0\0N."), "byte 0: FRAME: of 9 bytes, only 2 follow");
    assert_eq!(refusal(b""), "byte 0: needs 1 bytes, only 0 follow");
    assert_eq!(refusal(b"NN."), "byte 2: STOP: more than one object is left");
    assert_eq!(refusal(b"N.N"), "byte 1: STOP: 1 bytes follow");
    assert_eq!(refusal(b"\x80\x06N."), "byte 0: PROTO: protocol 6 is not known");
    assert_eq!(refusal(b"\x8a\x09123456789."), "byte 0: LONG: does not fit 64 bits");
    assert_eq!(refusal(b"g7\n."), "byte 0: GET: nothing was stored under 7");
    assert_eq!(refusal(b"(I1\nd."), "byte 4: a key without a value");
    assert_eq!(refusal(b"(N("), "byte 3: needs 1 bytes, only 0 follow");
    assert_eq!(refusal(b"N(0."), "byte 2: opcode 0x30 (POP or DUP) is not read");
    assert_eq!(refusal(b"N(R."), "byte 2: the stack is empty");
}

#[test]
fn an_array_has_as_many_bytes_as_its_shape_says() {
    let array = |shape: &str, n_bytes: usize| {
        let mut text = String::from(
            "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(",
        );
        write!(text, "{shape}tcnumpy\ndtype\n(S'f8'\nI0\nI1\ntR(I3\nS'<'\nNNNI-1\nI-1\nI0\ntb")
            .unwrap();
        write!(text, "I00\nS'{}'\ntb.", "x".repeat(n_bytes)).unwrap();
        decode(text.as_bytes())
    };
    assert!(array("I2\nI2\n", 32).is_ok());
    for lie in ["I2\nI3\n", "I4000000000\nI4000000000\n", "I-1\n", "I4611686018427387904\nI4\n"] {
        let err = array(lie, 32).unwrap_err().to_string();
        assert!(
            err.contains("cannot have 32 bytes") || err.contains("not a tuple of lengths"),
            "{err}"
        );
    }
}

#[test]
fn files_are_named_in_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.pkl");
    std::fs::write(&path, "cos\nsystem\n").unwrap();
    let message = read(&path).unwrap_err().to_string();
    assert!(message.contains("hostile.pkl: byte 0: GLOBAL: `os.system`"), "{message}");
    std::fs::remove_file(&path).unwrap();
    assert!(read(&path).unwrap_err().to_string().ends_with("hostile.pkl"));
}

/// Objects and bytes in a value, as [`MAX_EXPANSION`] counts them.
fn size(value: &Value) -> usize {
    1 + match value {
        Value::None | Value::Bool(_) | Value::Int(_) | Value::Float(_) => 0,
        Value::Bytes(bytes) => bytes.len(),
        Value::Text(text) => text.len(),
        Value::List(values) | Value::Tuple(values) => values.iter().map(size).sum(),
        Value::Dict(pairs) | Value::Record { fields: pairs, .. } => {
            pairs.iter().map(|(key, value)| size(key) + size(value)).sum()
        }
        Value::Tensor(tensor) => tensor.storage.len() + 2 * tensor.shape.len(),
        Value::Array { shape, elements } => {
            shape.len()
                + match elements {
                    Elements::Object(values) => values.iter().map(size).sum(),
                    elements => elements.len(),
                }
        }
    }
}

/// Whatever the bytes are: no panic, and no more than the bound.
fn assert_bounded(bytes: &[u8]) {
    if let Ok(value) = decode(bytes) {
        assert!(size(&value) <= 2 * (MAX_EXPANSION * bytes.len() + 64));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn truncated_pickles_are_refused(protocol in 0..6_u8, cut in 0.0..1.0) {
        let bytes = golden_bytes(protocol);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the length")]
        let len = (cut * bytes.len() as f64) as usize;
        prop_assert!(decode(&bytes[..len]).is_err());
    }

    #[test]
    fn flipped_bits_never_panic(protocol in 0..6_u8, flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8), 1..4)) {
        let mut bytes = golden_bytes(protocol);
        for (index, bit) in flips {
            *index.get_mut(&mut bytes) ^= 1_u8 << bit;
        }
        assert_bounded(&bytes);
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        assert_bounded(&bytes);
    }

    #[test]
    fn random_opcodes_never_panic(parts in prop::collection::vec(prop::sample::select(vec![
        b"(".as_slice(), b"N", b"]", b"}", b")", b"t", b"l", b"d", b"a", b"e", b"s", b"u", b"R", b"b",
        b"q\x00", b"h\x00", b"q\x01", b"h\x01", b"\x94", b"\x85", b"\x86", b"\x87", b"K\x02", b"I00\n",
        b"U\x01b", b"U\x02f8", b"U\x01<", b"C\x08abcdefgh", b"\x8c\x06latin1", b"cnumpy\nndarray\n",
        b"cnumpy\ndtype\n", b"cnumpy.core.multiarray\n_reconstruct\n", b"c_codecs\nencode\n",
        b"cnumpy.core.multiarray\nscalar\n", b"cnumpy.core.numeric\n_frombuffer\n",
    ]), 0..80)) {
        assert_bounded(&[parts.concat(), b".".to_vec()].concat());
    }
}

/// What `data/golden/scikit/make.py` writes.
fn vocabulary(protocol: u8) -> Vec<u8> {
    let name = format!("../../data/golden/scikit/vocabulary-{protocol}.pkl");
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

#[test]
fn estimators_are_records_of_their_fields_where_they_are_expected() {
    for protocol in [0, 2, 4] {
        let bytes = vocabulary(protocol);
        let mut value = decode_estimators(&bytes).unwrap();
        for key in [Value::Int(400), Value::Int(256), Value::Text("conv3".to_owned())] {
            let Value::Dict(mut entries) = value else { panic!("{value:?}") };
            assert_eq!((entries.len(), &entries[0].0), (1, &key), "protocol {protocol}");
            value = entries.remove(0).1;
        }
        let Value::Record { class, fields } = value else { panic!("{value:?}") };
        let field = |name: &str| &fields.iter().find(|it| it.0.as_text() == Some(name)).unwrap().1;
        assert_eq!((class.as_str(), field("n_clusters")), ("KMeans", &Value::Int(4)));
        let Value::Array { shape, elements } = field("cluster_centers_") else {
            panic!("an array")
        };
        assert_eq!((&shape[..], elements.len()), (&[4, 6][..], 24));
        assert!(decode(&bytes).unwrap_err().to_string().contains("not on the list"));
    }
}

#[test]
fn hostile_estimators_are_refused_with_their_offset() {
    const CLASS: &str = "csklearn.cluster._kmeans\nKMeans\n";
    let refused = |pickle: &str| decode_estimators(pickle.as_bytes()).unwrap_err().to_string();
    for (pickle, message) in [
        (
            "csklearn.pipeline\nPipeline\n.".to_owned(),
            "byte 0: GLOBAL: `sklearn.pipeline.Pipeline`",
        ),
        ("cos\nsystem\n(S'true'\ntR.".to_owned(), "byte 0: GLOBAL: `os.system`"),
        (format!("{CLASS}(S'x'\ntR."), "byte 39: REDUCE: KMeans is not called"),
        (format!("{CLASS}."), "is a function, not data"),
        (format!("ccopy_reg\n_reconstructor\n({CLASS}c__builtin__\nobject\nNtR."), "has no fields"),
        (
            format!("ccopy_reg\n_reconstructor\n({CLASS}c__builtin__\nobject\nI1\ntR."),
            "not an estimator",
        ),
        (
            format!("ccopy_reg\n_reconstructor\n({CLASS}c__builtin__\nobject\nNtR(lb."),
            "the fields of an estimator are not a dict",
        ),
        (
            format!("ccopy_reg\n_reconstructor\n({CLASS}c__builtin__\nobject\nNtR(db(db."),
            "the estimator has its fields already",
        ),
        (
            "ccopy_reg\n_reconstructor\n(cnumpy\nndarray\nc__builtin__\nobject\nNtR.".to_owned(),
            "not an estimator",
        ),
    ] {
        let actual = refused(&pickle);
        assert!(actual.starts_with("byte ") && actual.contains(message), "{pickle}: {actual}");
    }
    let made = [CLASS.as_bytes(), b"(I1\nt\x81."].concat();
    let made = decode_estimators(&made).unwrap_err().to_string();
    assert_eq!(made, "byte 37: NEWOBJ: a KMeans is made from arguments");
    // One that holds itself.
    let itself =
        format!("ccopy_reg\n_reconstructor\n({CLASS}c__builtin__\nobject\nNtRp0\n(S'a'\ng0\ndb.");
    assert!(refused(&itself).contains("nested more than"), "{}", refused(&itself));
    assert!(decode_checkpoint(itself.as_bytes()).is_err());
}

proptest! {
    /// Whatever is cut or flipped is refused or read, and nothing panics.
    #[test]
    fn damaged_estimators_never_panic(at in any::<prop::sample::Index>(), bit in 0_u8..8, cut: bool) {
        for protocol in [0, 2, 4] {
            let mut bytes = vocabulary(protocol);
            let at = at.index(bytes.len());
            if cut {
                bytes.truncate(at);
                prop_assert!(decode_estimators(&bytes).is_err());
            } else {
                bytes[at] ^= 1 << bit;
                let _ = decode_estimators(&bytes);
            }
        }
    }
}
