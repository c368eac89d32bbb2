//! Truths in every form give the same lists; what is ambiguous, cut or of other images is refused.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod files;

use std::{fs, path::Path, path::PathBuf};

use files::{LISTS, QUERIES, REFERENCES, integers, npy, objects};
use vpr_core::{GroundTruth, Result};
use vpr_data::{
    exchange::Example,
    truth::{
        FORMATS, Form, Found, Labels, Reading, Rows, Scale, Side, Sides, Source, read, read_scores,
    },
};

fn expected() -> GroundTruth {
    let lists = LISTS.map(|list| list.iter().map(|&it| usize::try_from(it).unwrap()).collect());
    GroundTruth::from_lists(lists.to_vec(), REFERENCES.len()).unwrap()
}

/// Images that lie in folders.
fn sides() -> Sides {
    let side = |folder: &str, names: &[&str]| {
        let images: Vec<PathBuf> = names.iter().map(|name| Path::new("data").join(name)).collect();
        Side::images(&Path::new("data").join(folder), &images)
    };
    Sides { queries: side("queries", &QUERIES), references: side("database", &REFERENCES) }
}

fn numbered(n_queries: usize, n_references: usize) -> Sides {
    Sides { queries: Side::numbered(n_queries), references: Side::numbered(n_references) }
}

/// The source that flags name, as programs parse them.
fn source(folder: &Path, flags: &[String]) -> Source {
    let value = |flag: &str| {
        let at = flags.iter().position(|it| it == flag)?;
        flags.get(at + 1).cloned()
    };
    let path = |flag: &str| value(flag).map(|file| folder.join(file));
    if let Some(file) = path("--ground-truth") {
        return Source::File(file, Reading { key: value("--truth-key"), ..Reading::default() });
    }
    match path("--labels").unwrap() {
        path if path.ends_with("folders") => Source::Labels(Labels::Folders),
        file => Source::Labels(Labels::File {
            path: file,
            queries: path("--queries-labels"),
            column: value("--label-column"),
        }),
    }
}

#[test]
fn every_form_gives_the_same_lists() {
    let folder = tempfile::tempdir().unwrap();
    for case in files::write_all(folder.path()) {
        let source = source(folder.path(), &case.flags);
        let found = source.truth(&sides()).unwrap_or_else(|err| panic!("{}: {err}", case.name));
        assert_eq!(found.truth, expected(), "{}", case.name);
        if !case.by_name && !case.by_folder {
            assert_eq!(source.truth(&numbered(3, 4)).unwrap().truth, expected(), "{}", case.name);
        }
    }
}

#[test]
fn the_examples_of_the_page_are_read() {
    let mut n_read = 0;
    for format in FORMATS {
        let Example::Text { path, text } = format.example else { continue };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(path);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, text).unwrap();
        let labels = |queries, column| Labels::File { path: file.clone(), queries, column };
        let images = |folder: &str, n: usize| (0..n).map(|i| format!("{folder}/{i}.jpg")).collect();
        let named = Sides {
            queries: Side::named(images("queries", 3)),
            references: Side::named(images("database", 4)),
        };
        let found = match format.name {
            "labels" => labels(None, None).truth(&named),
            "labels in order" => {
                let queries = folder.path().join("queries.txt");
                fs::write(&queries, "hall\nstairs\nattic\n").unwrap();
                labels(Some(queries), None).truth(&numbered(3, 4))
            }
            "folders" => Labels::Folders.truth(&sides()),
            _ => read(&file, &Reading::default(), &numbered(3, 4)),
        };
        assert_eq!(found.unwrap().truth, expected(), "{}", format.name);
        n_read += 1;
    }
    assert_eq!(n_read, 8);
}

/// The truth in these bytes, for so many images without names.
fn found(file: &str, bytes: &[u8], reading: Reading, n: [usize; 2]) -> Result<Found> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(file);
    fs::write(&path, bytes).unwrap();
    read(&path, &reading, &numbered(n[0], n[1]))
}

fn lists(file: &str, bytes: &[u8], reading: Reading, n: [usize; 2]) -> Vec<Vec<usize>> {
    let truth = found(file, bytes, reading, n).unwrap().truth;
    (0..truth.len()).map(|query| truth.correct(query).to_vec()).collect()
}

fn refusal(file: &str, bytes: &[u8], n: [usize; 2]) -> String {
    let err = found(file, bytes, Reading::default(), n).unwrap_err().to_string();
    assert!(err.contains(file) && !err.contains('\n'), "{err}");
    err
}

fn form(form: Form) -> Reading {
    Reading { form: Some(form), ..Reading::default() }
}

#[test]
fn a_truth_with_fewer_queries_than_the_dataset_names_both_counts() {
    let cut = [&[0_i64, 1][..], &[2]];
    for (file, bytes) in [
        ("a.npy", files::vpr_bench(&cut)),
        ("a.npy", objects(&[2], &[b"(I0\nI1\nl".to_vec(), b"(I2\nl".to_vec()])),
        ("a.npy", integers(&[2, 3], &[0, 1, -1, 2, -1, -1])),
        ("a.npy", integers(&[2, 1], &[0, 2])),
        ("a.npy", integers(&[2, 2], &[0, 1, 2, 3])),
        ("a.npy", npy("|b1", false, &[2, 4], &[1, 1, 0, 0, 0, 0, 1, 0])),
        ("a.json", b"[[0, 1], [2]]".to_vec()),
        ("a.txt", b"0 1\n2\n".to_vec()),
        ("a.txt", b"1 1 0 0\n0 0 1 0\n".to_vec()),
    ] {
        let err = refusal(file, &bytes, [3, 4]);
        assert!(err.contains('2') && err.contains("there are 3 queries"), "{err}");
    }
    // Of pairs nobody knows whether some are missing: it is said which queries have none.
    let notes = found("a.txt", b"0 0\n0 1\n", Reading::default(), [3, 4]).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("2 of 3 queries are in no pair")), "{notes:?}");
}

#[test]
fn two_columns_are_what_they_can_be() {
    // Neither is 4 a query of three.
    let array = integers(&[3, 2], &[0, 1, 2, -1, 4, 5]);
    let read = |bytes: &[u8]| lists("a.npy", bytes, Reading::default(), [3, 6]);
    assert_eq!(read(&array), [vec![0, 1], vec![2], vec![4, 5]]);
    // A reference twice is none of a list.
    assert_eq!(read(&integers(&[3, 2], &[0, 0, 1, 2, 2, 4])), [vec![0], vec![2], vec![4]]);
    // Both, and they differ.
    let both = integers(&[3, 2], &[0, 1, 1, 2, 2, 3]);
    let err = refusal("a.npy", &both, [3, 6]);
    assert!(err.contains("could be pairs or lists") && err.contains("--truth-form"), "{err}");
    let read = |form: Reading| lists("a.npy", &both, form, [3, 6]);
    assert_eq!(read(form(Form::Lists)), [vec![0, 1], vec![1, 2], vec![2, 3]]);
    assert_eq!(read(form(Form::Pairs)), [vec![1], vec![2], vec![3]]);
    // In text pairs are usual, so they are read, and that is said.
    let text = found("a.txt", b"0 1\n1 2\n2 3\n", Reading::default(), [3, 6]).unwrap();
    assert_eq!(text.truth.correct(1), [2]);
    assert!(text.notes[0].contains("--truth-form lists"), "{:?}", text.notes);
    let err = refusal("a.txt", b"0 1 5\n1 2\n2 3\n", [3, 6]);
    assert!(err.contains("could be pairs or lists"), "{err}");
    assert_eq!(
        lists("a.txt", b"0 1 5\n1 2\n2 3\n", form(Form::Pairs), [3, 6]),
        [vec![1, 5], vec![2], vec![3]]
    );
}

#[test]
fn zeros_and_ones_of_two_references_could_be_anything() {
    let err = refusal("a.npy", &integers(&[3, 2], &[0, 1, 1, 0, 0, 1]), [3, 2]);
    assert!(err.contains("could be matrix or lists"), "{err}");
    let read = |reading| lists("a.npy", &integers(&[2, 2], &[0, 1, 1, 0]), reading, [2, 2]);
    assert_eq!(read(form(Form::Matrix)), [vec![1], vec![0]]);
    assert_eq!(read(form(Form::Lists)), [vec![0, 1], vec![0, 1]]);
    // One reference each: as a matrix and as lists the same.
    assert_eq!(
        lists("a.npy", &integers(&[2, 1], &[0, 0]), form(Form::Lists), [2, 1]),
        [vec![0], vec![0]]
    );
}

#[test]
fn square_matrices_say_how_they_are_read() {
    let lower = npy("|b1", false, &[2, 2], &[1, 0, 1, 1]);
    let found_of = |bytes: &[u8], rows| {
        found("a.npy", bytes, Reading { rows, ..Reading::default() }, [2, 2]).unwrap()
    };
    let guessed = found_of(&lower, None);
    assert_eq!((guessed.truth.correct(0), guessed.truth.correct(1)), (&[0][..], &[0, 1][..]));
    assert!(guessed.notes[0].contains("--truth-rows references"), "{:?}", guessed.notes);
    let turned = found_of(&lower, Some(Rows::References));
    assert_eq!((turned.truth.correct(0), turned.notes.len()), (&[0, 1][..], 0));
    assert!(found_of(&npy("|b1", false, &[2, 2], &[1, 0, 0, 1]), None).notes.is_empty());

    // The tutorial's matrices have the references as rows.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("GT.npz");
    files::archive(&path, &[("GThard", "|b1", &[2, 2], vec![1, 0, 1, 1])]);
    let found = read(&path, &Reading::default(), &numbered(2, 2)).unwrap();
    assert_eq!(found.truth, turned.truth);
    assert!(found.notes[0].contains("--truth-rows queries"), "{:?}", found.notes);
}

#[test]
fn the_keys_of_an_archive_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("GT.npz");
    let ones = || vec![1_u8; 12];
    let arrays: [(&str, &str, &[usize], Vec<u8>); 3] = [
        ("GThard", "|b1", &[4, 3], ones()),
        ("GTsoft", "|b1", &[4, 3], ones()),
        ("descriptors", "<f4", &[3, 1], vec![0, 0, 0, 63, 0, 0, 0, 63, 0, 0, 0, 63]),
    ];
    files::archive(&path, &arrays);
    let of = |key: Option<&str>, sides: &Sides| {
        let reading = Reading { key: key.map(str::to_owned), ..Reading::default() };
        read(&path, &reading, sides).map_err(|err| err.to_string())
    };
    let err = of(None, &numbered(3, 4)).unwrap_err();
    assert!(err.contains("GThard, GTsoft; choose one with `--truth-key`"), "{err}");
    assert!(of(Some("GTsoft"), &numbered(3, 4)).is_ok());
    let err = of(Some("GT"), &numbered(3, 4)).unwrap_err();
    assert!(err.contains("array `GT`: is not there; known: GThard, GTsoft, descriptors"), "{err}");
    let err = of(None, &numbered(5, 4)).unwrap_err();
    assert!(err.contains("none is a truth for 5 queries and 4 references: GThard"), "{err}");
    let err = of(Some("GTsoft"), &numbered(5, 4)).unwrap_err();
    assert!(err.contains("is 4 × 3, but there are 5 queries and 4 references"), "{err}");
    let err = found(
        "a.npy",
        &integers(&[1], &[0]),
        Reading { key: Some("x".into()), ..Reading::default() },
        [1, 1],
    );
    assert!(err.unwrap_err().to_string().contains("has no arrays by name"));
}

#[test]
fn rows_that_mean_nothing_are_named_by_place() {
    for (file, bytes, part) in [
        (
            "a.npy",
            integers(&[3, 3], &[0, -1, 1, 2, -1, -1, 3, -1, -1]),
            "row 0: -1 is not a reference",
        ),
        ("a.npy", integers(&[3, 1], &[0, -2, 1]), "row 1: -2 is not a reference"),
        (
            "a.npy",
            npy("<f8", false, &[3, 1], &[0.5_f64, 1.0, 2.0].map(f64::to_le_bytes).concat()),
            "no whole numbers",
        ),
        (
            "a.npy",
            npy("|b1", false, &[3, 5], &[0; 15]),
            "is 3 × 5, but there are 3 queries and 4 references",
        ),
        (
            "a.npy",
            objects(&[3], &[b"(I0\nl".to_vec(), b"S'x'\n".to_vec(), b"N".to_vec()]),
            "row 1: reference `x` is a name",
        ),
        ("a.csv", b"query,ref\n0,1\n7,2\n".to_vec(), "line 3: query 7: there are 3"),
        ("a.csv", b"query,ref\n0,1\n,2\n".to_vec(), "line 3: does not begin with one query"),
        ("a.csv", b"query,ref\n0,1\n1\n".to_vec(), "line 3: 1 values for 2 columns"),
        (
            "a.csv",
            b"query,score\n0,1\n".to_vec(),
            "the titles are `query,score`: expected `query` and",
        ),
        ("a.csv", b"a.jpg,b.jpg\n".to_vec(), "line 1: query `a.jpg` is a name, but the images"),
        ("a.txt", b"# nothing\n\n".to_vec(), "line 1: there is no line that says something"),
        ("a.txt", b"\xff\xfe".to_vec(), "byte 0: is not UTF-8 text"),
        ("a.json", b"{\"0\": [0".to_vec(), "line 1: "),
        ("a.json", b"3".to_vec(), "holds an int, neither lists nor a matrix"),
        ("a.pkl", b"(lp0\n".to_vec(), "byte "),
    ] {
        let err = refusal(file, &bytes, [3, 4]);
        assert!(err.contains(part), "`{part}` is not in: {err}");
    }
}

#[test]
fn what_points_past_the_references_is_dropped_and_counted() {
    let found = found("a.txt", b"0 9\n2\n-1\n", Reading::default(), [3, 4]).unwrap();
    assert_eq!(found.truth.correct(0), [0]);
    assert!(found.notes[0].contains("1 entries point past the 4 references"), "{:?}", found.notes);
}

#[test]
fn a_last_line_without_an_end_is_mentioned() {
    let notes = |text: &[u8]| found("a.txt", text, Reading::default(), [1, 9]).unwrap().notes;
    assert_eq!(notes(b"0 1 2\n"), [""; 0]);
    assert!(notes(b"0 1 2")[0].contains("may be cut off"));
}

/// Labels in a file, for the images of [`sides`].
fn labelled(text: &str, column: Option<&str>) -> Result<Found, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.csv");
    fs::write(&path, text).unwrap();
    let column = column.map(str::to_owned);
    let labels = Labels::File { path, queries: None, column };
    labels.truth(&sides()).map_err(|err| err.to_string())
}

#[test]
fn labels_are_joined_by_name_and_never_guessed() {
    let all = "queries/hall/a.jpg,x\nb,y\nattic/c.jpg,z\n0.jpg,x\n1.jpg,x\n2.jpg,y\n";
    let missing = labelled(all, None).unwrap_err();
    assert!(
        missing.contains("1 of 4 references have no label, such as `data/database/cellar/3.jpg`"),
        "{missing}"
    );
    let whole = format!("{all}3.jpg,w\n");
    assert_eq!(labelled(&whole, None).unwrap().truth, expected());
    let more = labelled(&format!("{whole}other.jpg,w\n"), None).unwrap();
    assert!(more.notes[0].contains("1 labels are of none of the images"), "{:?}", more.notes);
    let twice = labelled(&format!("{whole}hall/1.jpg,w\n"), None).unwrap_err();
    assert!(
        twice.contains("line 8: `data/database/hall/1.jpg` has the label `x` already"),
        "{twice}"
    );
    let empty = labelled("name,label\n0.jpg,\n", None).unwrap_err();
    assert!(empty.contains("line 2: `0.jpg` has no label"), "{empty}");
    let titles = labelled("name,year,floor_no\n0.jpg,1,2\n", None).unwrap_err();
    assert!(titles.contains("--label-column"), "{titles}");
    let titles = labelled("name,year,floor_no\n0.jpg,1,2\n", Some("flor")).unwrap_err();
    assert!(titles.contains("no column `flor`; the titles are `name,year,floor_no`"), "{titles}");
    let apart = whole.replace("jpg,x", "jpg,v").replacen("jpg,v", "jpg,u", 1).replace("b,y", "b,t");
    let apart = labelled(&apart, None).unwrap_err();
    assert!(apart.contains("no reference has the label of a query: `u` among queries"), "{apart}");
}

#[test]
fn folders_name_places_only_where_there_are_several() {
    let of = |queries: &[&str], references: &[&str]| {
        let side = |folder: &str, names: &[&str]| {
            let images: Vec<PathBuf> =
                names.iter().map(|name| Path::new(folder).join(name)).collect();
            Side::images(folder.as_ref(), &images)
        };
        let sides = Sides { queries: side("q", queries), references: side("db", references) };
        Labels::Folders.truth(&sides).map_err(|err| err.to_string())
    };
    let truth = of(&["a/x.jpg", "b/1/y.jpg"], &["b/7/x.jpg", "a/1.jpg"]).unwrap().truth;
    assert_eq!((truth.correct(0), truth.correct(1)), (&[1][..], &[0][..]));
    let err = of(&["x.jpg"], &["a/1.jpg"]).unwrap_err();
    assert!(err.contains("q/x.jpg: labels: lies in no folder of a place"), "{err}");
    let err = of(&["images/a/x.jpg"], &["images/b/1.jpg"]).unwrap_err();
    assert!(err.contains("all images lie below `images`"), "{err}");
    let nameless = Labels::Folders.truth(&numbered(1, 1)).unwrap_err().to_string();
    assert!(nameless.contains("the images have no names"), "{nameless}");
}

#[test]
fn the_same_index_is_a_truth() {
    let found = Source::SameIndex(1).truth(&numbered(3, 4)).unwrap();
    assert_eq!(found.truth, GroundTruth::within_frames(3, 4, 1));
    assert!(found.notes[0].contains("3 queries and 4 references"));
    assert!(Source::SameIndex(0).truth(&numbered(3, 3)).unwrap().notes.is_empty());
}

#[test]
fn positions_of_an_archive_have_a_radius() {
    let folder = tempfile::tempdir().unwrap();
    files::write_all(folder.path());
    let path = folder.path().join("utm.npz");
    let of = |radius, n: [usize; 2]| {
        read(&path, &Reading { radius, ..Reading::default() }, &numbered(n[0], n[1]))
    };
    assert_eq!(of(7.0, [3, 4]).unwrap().truth.correct(0), [0]);
    assert!(of(25.0, [3, 4]).unwrap().notes[0].contains("positions `utmQ` and `utmDb`"));
    let err = of(25.0, [5, 4]).unwrap_err().to_string();
    assert!(err.contains("array `utmQ`: has shape [3, 2], but there are 5 images"), "{err}");
    assert!(of(-1.0, [3, 4]).is_err());
}

#[test]
fn scores_are_read_in_every_type_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let values = [0.5_f64, 1.0, 0.25, 2.0, 0.0, 4.0];
    let single = [0.5_f32, 1.0, 0.25, 2.0, 0.0, 4.0];
    let half = [0x3800_u16, 0x3c00, 0x3400, 0x4000, 0, 0x4400];
    fs::write(path("d.npy"), npy("<f8", false, &[2, 3], &values.map(f64::to_le_bytes).concat()))
        .unwrap();
    fs::write(path("f.npy"), npy("<f4", false, &[2, 3], &single.map(f32::to_le_bytes).concat()))
        .unwrap();
    fs::write(path("h.npy"), npy("<f2", false, &[2, 3], &half.map(u16::to_le_bytes).concat()))
        .unwrap();
    fs::write(path("a.txt"), "0.5 1 0.25\n2 0 4e0\n").unwrap();
    fs::write(path("a.csv"), "0.5,1,0.25\n2,0,4\n").unwrap();
    files::archive(&path("a.npz"), &[("S", "<f8", &[2, 3], values.map(f64::to_le_bytes).concat())]);
    for name in ["d.npy", "f.npy", "h.npy", "a.txt", "a.csv", "a.npz"] {
        let scores = read_scores(&path(name), Scale::Similarities).unwrap();
        assert_eq!(scores.view().iter().copied().collect::<Vec<_>>(), values, "{name}");
        assert_eq!(scores.best().reference, [1, 2], "{name}");
        let distances = read_scores(&path(name), Scale::Distances).unwrap();
        assert_eq!(distances.best().reference, [2, 1], "{name}");
    }
    let refused = |name: &str, bytes: &[u8], scale| {
        fs::write(path(name), bytes).unwrap();
        let err = read_scores(&path(name), scale).unwrap_err().to_string();
        assert!(err.contains(name), "{err}");
        err
    };
    assert!(
        refused("b.txt", b"1 2\n3\n", Scale::Distances)
            .contains("line 2: 1 numbers, but the first line has 2")
    );
    assert!(
        refused("b.txt", b"1 2\n3 x\n", Scale::Distances).contains("line 2: `x` is not a number")
    );
    // 1 − cosine, rounded: below zero is as near as zero.
    fs::write(path("c.txt"), "1 2\n3 -1e-7\n").unwrap();
    assert_eq!(read_scores(&path("c.txt"), Scale::Distances).unwrap().best().reference, [0, 1]);
    assert!(refused("b.txt", b"1 NaN\n", Scale::Similarities).contains("column 1 is NaN"));
    assert!(refused("b.txt", b"\n", Scale::Similarities).contains("no similarities"));
    assert!(
        refused("b.npy", &integers(&[3], &[1, 2, 3]), Scale::Similarities)
            .contains("has shape [3]")
    );
    assert!(
        refused("b.npy", &npy("|b1", false, &[1, 1], &[1]), Scale::Similarities)
            .contains("holds no numbers")
    );
    files::archive(
        &path("two.npz"),
        &[("S", "|u1", &[1, 1], vec![1]), ("T", "|u1", &[1, 1], vec![1])],
    );
    let err = read_scores(&path("two.npz"), Scale::Similarities).unwrap_err().to_string();
    assert!(err.contains("expected one array, got S, T"), "{err}");
}
