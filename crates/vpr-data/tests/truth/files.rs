//! One truth, written in every way: three queries and four references, of which query 0 has 0 and 1,
//! query 1 has 2, and query 2 has none. Also used by the tests of the programs.

use std::{fs, path::Path};

use vpr_files::npy::npz;

/// The references of every query.
pub(crate) const LISTS: [&[i64]; 3] = [&[0, 1], &[2], &[]];
/// Names of the queries' images, as the tests of programs call them.
pub(crate) const QUERIES: [&str; 3] =
    ["queries/hall/a.jpg", "queries/stairs/b.jpg", "queries/attic/c.jpg"];
/// Names of the references' images.
pub(crate) const REFERENCES: [&str; 4] = [
    "database/hall/0.jpg",
    "database/hall/1.jpg",
    "database/stairs/2.jpg",
    "database/cellar/3.jpg",
];
/// Where the queries are: 25 m around each are the references of the truth.
pub(crate) const QUERY_EASTINGS: [f64; 3] = [0.0, 1000.0, 5000.0];
/// Where the references are.
pub(crate) const REFERENCE_EASTINGS: [f64; 4] = [5.0, 10.0, 1001.0, 9000.0];

/// A way to say it.
pub(crate) struct Case {
    /// What is said, for messages.
    pub(crate) name: &'static str,
    /// The flags; files are named relative to the folder.
    pub(crate) flags: Vec<String>,
    /// Whether images need names.
    pub(crate) by_name: bool,
    /// Whether images need to lie in folders of places.
    pub(crate) by_folder: bool,
}

/// A `.npy` file.
pub(crate) fn npy(descr: &str, fortran: bool, shape: &[usize], body: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let axes = shape.iter().map(|len| format!("{len}, ")).collect::<Vec<_>>().concat();
    let text = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': ({axes}), }}\n");
    let len = u16::try_from(text.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", len.as_slice(), text.as_bytes(), body].concat()
}

/// A `.npy` of 64-bit integers.
pub(crate) fn integers(shape: &[usize], values: &[i64]) -> Vec<u8> {
    let body: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    npy("<i8", false, shape, &body)
}

/// The pickle of an array, up to its data: protocol 0.
fn array_of(dtype: &str, order: &str, shape: &[usize]) -> String {
    let axes = shape.iter().map(|len| format!("I{len}\n")).collect::<Vec<_>>().concat();
    let alignment = if order == "|" { "I63\n" } else { "I0\n" };
    format!(
        "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n({axes}tcnumpy\n\
         dtype\n(S'{dtype}'\nI0\nI1\ntR(I3\nS'{order}'\nNNNI-1\nI-1\n{alignment}tbI00\n"
    )
}

/// The pickle of a list of integers.
fn list(values: &[i64]) -> Vec<u8> {
    let values = values.iter().map(|value| format!("I{value}\n")).collect::<Vec<_>>().concat();
    format!("({values}l").into_bytes()
}

/// The pickle of an array of 64-bit integers.
fn vector(values: &[i64]) -> Vec<u8> {
    let body: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let n = u8::try_from(body.len()).unwrap();
    [array_of("i8", "<", &[values.len()]).into_bytes(), vec![b'U', n], body, b"tb".to_vec()]
        .concat()
}

/// A `.npy` of objects.
pub(crate) fn objects(shape: &[usize], items: &[Vec<u8>]) -> Vec<u8> {
    let pickle =
        [array_of("O8", "|", shape).into_bytes(), b"(".to_vec(), items.concat(), b"ltb.".to_vec()];
    npy("|O", false, shape, &pickle.concat())
}

/// VPR-Bench's form: rows of a query and its references.
pub(crate) fn vpr_bench(lists: &[&[i64]]) -> Vec<u8> {
    let row = |(query, references): (usize, &&[i64])| {
        let references = if references.is_empty() { &[-1] } else { *references };
        [format!("I{query}\n").into_bytes(), list(references)]
    };
    let items: Vec<Vec<u8>> = lists.iter().enumerate().flat_map(row).collect();
    objects(&[lists.len(), 2], &items)
}

/// Truth values, row after row.
pub(crate) fn matrix(transposed: bool) -> Vec<u8> {
    let is = |query: usize, reference: usize| {
        u8::from(LISTS[query].iter().any(|&it| usize::try_from(it) == Ok(reference)))
    };
    if transposed {
        (0..12).map(|at| is(at % 3, at / 3)).collect()
    } else {
        (0..12).map(|at| is(at / 4, at % 4)).collect()
    }
}

/// An `.npz` of these arrays, each `descr`, shape and bytes.
pub(crate) fn archive(path: &Path, arrays: &[(&str, &str, &[usize], Vec<u8>)]) {
    let mut writer = npz::Writer::new(fs::File::create(path).unwrap());
    for (name, descr, shape, body) in arrays {
        writer.add(name, descr, shape, body.iter().map(|&byte| [byte])).unwrap();
    }
    writer.finish().unwrap();
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// The files of a folder, as they are written.
struct Cases<'a> {
    folder: &'a Path,
    cases: Vec<Case>,
}

/// Writes all files into a folder.
pub(crate) fn write_all(folder: &Path) -> Vec<Case> {
    let mut cases = Cases { folder, cases: Vec::new() };
    cases.objects();
    cases.arrays();
    cases.texts();
    cases.names();
    cases.archives();
    cases.labels();
    cases.cases
}

impl Cases<'_> {
    fn add(&mut self, name: &'static str, flags: &str, by: &str) {
        let flags = flags.split_whitespace().map(str::to_owned).collect();
        let (by_name, by_folder) = (by == "name", by == "folder");
        self.cases.push(Case { name, flags, by_name, by_folder });
    }

    fn write(&self, file: &str, bytes: &[u8]) {
        fs::write(self.folder.join(file), bytes).unwrap();
    }

    fn file(&mut self, name: &'static str, file: &str, bytes: &[u8]) {
        self.write(file, bytes);
        self.add(name, &format!("--ground-truth {file}"), "");
    }

    fn objects(&mut self) {
        self.file("VPR-Bench", "vpr_bench.npy", &vpr_bench(&LISTS));
        self.file("lists", "lists.npy", &objects(&[3], &LISTS.map(list)));
        self.file("arrays, as gsv-cities", "arrays.npy", &objects(&[3], &LISTS.map(vector)));
        let row = |query: usize| {
            [format!("(I{query}\n").into_bytes(), list(LISTS[query]), b"l".to_vec()].concat()
        };
        self.file("lists of query and references", "rows.npy", &objects(&[3], &[0, 1, 2].map(row)));
        let pickle = [b"(".to_vec(), LISTS.map(list).concat(), b"l.".to_vec()].concat();
        self.file("a pickle of lists", "lists.pkl", &pickle);
        let pickle = b"(dI0\n(I0\nI1\nlsI1\n(I2\nlsI2\n(lp0\ns.";
        self.file("a pickle of a dictionary", "dict.pkl", pickle);
        self.file("JSON lists", "lists.json", b"[[0, 1], [2], []]\n");
        self.file("JSON rows", "rows.json", b"[[0, [0, 1]], [1, [2]], [2, []]]\n");
        let matrix = b"[[1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]]\n";
        self.file("a JSON matrix", "matrix.json", matrix);
        self.file("a JSON dictionary", "dict.json", b"{\"0\": [0, 1], \"1\": [2]}\n");
    }

    fn arrays(&mut self) {
        let padded = [0, 1, -1, 2, -1, -1, -1, -1, -1];
        self.file("padded integers", "padded.npy", &integers(&[3, 3], &padded));
        let wide = [0.0, 1.0, -1.0, 2.0, -1.0, -1.0, -1.0, -1.0, -1.0];
        self.file("padded floats", "floats.npy", &npy("<f8", false, &[3, 3], &doubles(&wide)));
        let (rows, columns) = (matrix(false), matrix(true));
        self.file("truth values", "matrix.npy", &npy("|b1", false, &[3, 4], &rows));
        self.file("their transpose", "transposed.npy", &npy("|b1", false, &[4, 3], &columns));
        self.file("Fortran's order", "fortran.npy", &npy("|b1", true, &[3, 4], &columns));
        self.file("zeros and ones", "ones.npy", &npy("|u1", false, &[3, 4], &rows));
    }

    fn texts(&mut self) {
        self.file("pairs", "pairs.csv", b"query,reference\n0,0\n0,1\n1,2\n");
        let order = b"Ref_ID;Score;Query_ID\n0;.5;0\n1;.5;0\n2;.5;1\n";
        self.file("other titles in another order", "order.csv", order);
        let cells = b"query,references\n0,\"[0, 1]\"\n1,2\n2,\n";
        self.file("a list in a cell", "cells.csv", cells);
        self.file("no titles", "pairs.txt", b"# which is where\n0 0\n0 1\n1 2\n");
        self.file("a line per query", "lines.txt", b"0 1\n2\n-1\n");
        self.file("a matrix as text", "matrix.txt", b"1 1 0 0\n0 0 1 0\n0 0 0 0\n");
        let number = |value: &u8| format!("{value}.000000000000000000e+00");
        let line = |row: &[u8]| row.iter().map(number).collect::<Vec<_>>().join(" ") + "\n";
        let saved: Vec<String> = matrix(false).chunks(4).map(line).collect();
        self.file("numpy.savetxt", "savetxt.txt", saved.concat().as_bytes());
    }

    fn names(&mut self) {
        let pairs = [(0, 0), (0, 1), (1, 2)];
        let named = pairs.map(|(q, r)| format!("{},{}\n", QUERIES[q], REFERENCES[r]));
        self.write("named.csv", ("query,reference\n".to_owned() + &named.concat()).as_bytes());
        self.add("pairs by name", "--ground-truth named.csv", "name");
        let end = |name: &str| name.rsplit_once('/').unwrap().1.replace(".jpg", "");
        let ends = pairs.map(|(q, r)| format!("{} {}\n", end(QUERIES[q]), REFERENCES[r]));
        self.write("ends.txt", ends.concat().as_bytes());
        self.add("pairs by the ends of names", "--ground-truth ends.txt", "name");
    }

    fn archives(&mut self) {
        archive(&self.folder.join("one.npz"), &[("gt", "|b1", &[4, 3], matrix(true))]);
        self.add("an archive of one array", "--ground-truth one.npz", "");
        let arrays: [(&str, &str, &[usize], Vec<u8>); 3] = [
            ("GThard", "|b1", &[4, 3], vec![0; 12]),
            ("GTsoft", "|b1", &[4, 3], matrix(true)),
            ("times", "<f8", &[2], doubles(&[0.5, 1.5])),
        ];
        archive(&self.folder.join("GT.npz"), &arrays);
        self.add("an archive, by key", "--ground-truth GT.npz --truth-key GTsoft", "");
        let queries: Vec<f64> = QUERY_EASTINGS.iter().flat_map(|&x| [x, 0.0]).collect();
        let references: Vec<f64> = REFERENCE_EASTINGS.iter().copied().chain([0.0; 4]).collect();
        let arrays: [(&str, &str, &[usize], Vec<u8>); 2] = [
            ("utmQ", "<f8", &[3, 2], doubles(&queries)),
            ("utmDb", "<f8", &[2, 4], doubles(&references)),
        ];
        archive(&self.folder.join("utm.npz"), &arrays);
        let flags = "--ground-truth utm.npz --positive-dist-threshold 25";
        self.add("positions in an archive", flags, "");
    }

    fn labels(&mut self) {
        let places = ["hall", "stairs", "attic", "hall", "hall", "stairs", "cellar"];
        let images = QUERIES.iter().chain(&REFERENCES).zip(places);
        let lines: Vec<String> =
            images.map(|(name, place)| format!("{name},2011,{place}\n")).collect();
        self.write("labels.csv", ("Image,year,Floor\n".to_owned() + &lines.concat()).as_bytes());
        self.add("a table of labels", "--labels labels.csv", "name");
        self.add("a column of a table", "--labels labels.csv --label-column Floor", "name");
        self.write("queries.txt", b"hall\nstairs\nattic\n");
        self.write("references.txt", b"label\nhall\nhall\nstairs\ncellar\n");
        let flags = "--labels references.txt --queries-labels queries.txt";
        self.add("a label per line", flags, "");
        self.write("queries.npy", &integers(&[3], &[7, 9, 1]));
        self.write("references.npy", &integers(&[4], &[7, 7, 9, 0]));
        let flags = "--labels references.npy --queries-labels queries.npy";
        self.add("labels as numbers", flags, "");
        self.add("a folder per place", "--labels folders", "folder");
    }
}
