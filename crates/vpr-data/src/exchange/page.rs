//! `docs/formats.md`: every format with an example, who takes it, and what is refused by design.

use std::fmt::Write as _;

use Example::{Python, Shell, Text};

use super::format::{Format, Kind};

/// A format, or a kind of ground truth, as the page shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// What it is called, on the command line where it has a name there.
    pub name: &'static str,
    /// What it holds, and by what a file shows that it is one.
    pub about: &'static str,
    /// What a file looks like.
    pub example: Example,
    /// Which programs take it.
    pub taken_by: &'static str,
    /// What is refused by design, or left out.
    pub refused: &'static str,
}

/// What a file looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Example {
    /// The text of a file, and its path.
    Text {
        /// Where it lies.
        path: &'static str,
        /// What is in it.
        text: &'static str,
    },
    /// A line of Python that writes one.
    Python(&'static str),
    /// A command that writes one.
    Shell(&'static str),
}

const POSES: &str = "`bench evaluate --database-poses --queries-poses`, `bench map build --poses`, \
    `bench map convert`, `bench encode --poses`, `sue --map-poses --query-poses`";
const DESCRIPTORS: &str = "`bench evaluate --database-descriptors --queries-descriptors`, \
    `bench map build --descriptors`, `bench map search --queries`, `bench map convert`, \
    `sue --map --queries`; as poses wherever these are taken, if it has any";
const PAIRS: &str = "`bench map search --out`, `bench map convert`";

/// Where the page has ground truths.
const TRUTHS: (&str, &str) = ("<!-- ground truths -->", "<!-- /ground truths -->");

/// What is said of every format: what it holds and how it shows, an example, what is refused.
const SAID: [(Format, &str, Example, &str); Format::ALL.len()] = [
    (
        Format::Map,
        "Our own: descriptors, poses, names and what is known of the encoder, in one file or \
         a growing folder. Known by what is in it.",
        Python("bench map build --descriptors d.npy --poses poses.csv map.safetensors  # a shell"),
        "A file whose digests do not hold.",
    ),
    (
        Format::Npy,
        "Descriptors, one row each, any numbers. `d.csv` beside `d.npy` has names and poses, \
         unless poses are named; a CSV that is no table of poses is only mentioned. `.npy`.",
        Python("np.save(\"d.npy\", rows)"),
        "Truth values, objects. bfloat16, which NumPy writes as bytes without a type.",
    ),
    (
        Format::Npz,
        "`descriptors`, or the only matrix of numbers; `positions` (n × 2 or n × 3), \
         `orientations` (wxyz, world from camera), `names` (`<U`, `|S`, or strings as \
         objects). Other arrays are named. `.npz`.",
        Python("np.savez(\"d.npz\", descriptors=rows, names=np.array([\"a.jpg\", \"b.jpg\"]))"),
        "Names or positions of which a part is missing.",
    ),
    (
        Format::Safetensors,
        "The tensor `descriptors`, or the only matrix: floats of 16 to 64 bits, bfloat16, \
         integers; `positions`, `orientations`. `.safetensors`.",
        Python("save_file({\"descriptors\": rows}, \"d.safetensors\")"),
        "Truth values and eight-bit floats.",
    ),
    (
        Format::HlocH5,
        "HDF5 with a group per image and in it `global_descriptor`, of any numbers; groups \
         without one are counted. `.h5`, `.hdf5`.",
        Python("h5[\"db/a.jpg/global_descriptor\"] = row"),
        "Names with an empty part. Poses have no place in it.",
    ),
    (
        Format::HlocPairs,
        "`query reference` per line, nearest first. Named by `--from` or `--to`.",
        Text { path: "pairs.txt", text: "q/1.jpg db/a.jpg\nq/1.jpg db/b.jpg\n" },
        "Names with blanks: hloc itself cannot read them.",
    ),
    (
        Format::HlocPoses,
        "`name qw qx qy qz tx ty tz`, and perhaps a focal length: camera from world, the \
         camera stands at −Rᵀt. Named by `--poses-format`.",
        Text { path: "poses.txt", text: "a.jpg 1 0 0 0 -1 -2 -3\nb.jpg 1 0 0 0 -1 -2 -4 525.0\n" },
        "Names with blanks.",
    ),
    (
        Format::Colmap,
        "A reconstruction's `images.txt` or `images.bin`, or its folder: camera from world, \
         the camera stands at −Rᵀt. Below each image stands a line of points, if empty.",
        Text {
            path: "images.txt",
            text: "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n\
                   1 1 0 0 0 -1 -2 -3 1 a.jpg\n\n2 1 0 0 0 -1 -2 -4 1 b.jpg\n10.5 20.5 -1\n",
        },
        "Files without the lines of points. Names with blanks, on writing text.",
    ),
    (
        Format::VprEval,
        "A log folder of VPR-methods-evaluation: `database_descriptors.npy` and \
         `preds/000.txt`.",
        Text {
            path: "preds/000.txt",
            text: "Query path:\nq/1.jpg\n\nPredictions paths:\ndb/a.jpg\ndb/b.jpg\n",
        },
        "A query in two files.",
    ),
    (
        Format::VprEvalQueries,
        "`queries_descriptors.npy` of such a folder. Named by `--from`.",
        Python("np.save(\"logs/run/queries_descriptors.npy\", rows)"),
        "As `npy`.",
    ),
    (
        Format::Kapture,
        "The folder above `sensors/`: `trajectories.txt` (device from world), `rigs.txt` \
         (device from rig, rigs in rigs too), `records_camera.txt` (names). Images without a \
         pose are counted.",
        Text {
            path: "sensors/trajectories.txt",
            text: "# timestamp, device_id, qw, qx, qy, qz, tx, ty, tz\n\
                   0, cam, 1, 0, 0, 0, -1, -2, -3\n",
        },
        "Two poses of one device at one time, or of one image by rig and by itself that \
         differ. Names with commas.",
    ),
    (
        Format::Tum,
        "`timestamp tx ty tz qx qy qz qw` per line: world from camera, unless \
         `--pose-direction` says otherwise. Names are the time stamps. `.tum`.",
        Text {
            path: "groundtruth.tum",
            text: "# timestamp tx ty tz qx qy qz qw\n1305031102.1758 1 2 3 0 0 0 1\n",
        },
        "A time stamp twice.",
    ),
    (
        Format::Kitti,
        "Twelve numbers per line, the rows of a 3 × 4 matrix: world from camera. There are no \
         names. `.kitti`.",
        Text { path: "poses.kitti", text: "1 0 0 1 0 1 0 2 0 0 1 3\n" },
        "Matrices that do not turn.",
    ),
    (
        Format::SevenScenes,
        "The folder of a sequence: `frame-000000.pose.txt`, a 4 × 4 matrix, world from \
         camera, in metres.",
        Text { path: "frame-000000.pose.txt", text: "1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n" },
        "Two images of one frame.",
    ),
    (
        Format::LatLon,
        "A table as `csv`, of `lat` and `lon` in degrees (WGS 84), to metres in one UTM zone: \
         the one all lie in, or that of `--zone 30N`, or of most by `--zone auto`; how much \
         that stretches is said.",
        Text { path: "gps.csv", text: "image;lat;lon\na.jpg;52.0116;4.3571\n" },
        "Positions in several zones without `--zone`; positions more than 30° away.",
    ),
    (
        Format::PoseCsv,
        "A table whose columns are known by their titles, in any order and case: names \
         (`name`, `image`, `filename`, `key`, `timestamp` …), `easting`, `northing` or `x`, \
         `y` and perhaps `z` (also `tx`, `utm_east`, `p_RS_R_x [m]` …), `qw` `qx` `qy` `qz`, \
         world from camera unless `--pose-direction` says otherwise, or `lat`, `lon`. \
         Commas, semicolons, tabs or blanks; `#` comments, of which the last may be the \
         header, as in EuRoC's files; other columns are named. Also called `euroc` and \
         `mapillary`. `.csv`, `.tsv`.",
        Text {
            path: "postprocessed.csv",
            text: ",key,easting,northing,night\n0,aaa-1,349000.5,6173000.25,False\n",
        },
        "Part of a quaternion, two positions, a name twice, decimal commas, several zones in \
         a column `zone`.",
    ),
    (
        Format::UtmNames,
        "Names `@easting@northing@zone@band@…@.jpg`: a folder of such images, or a list. Bands \
         C to M are one zone in the south, N to X one in the north.",
        Text {
            path: "names.txt",
            text: "@0549678.37@4180874.60@10@S@037.77386@-122.43590@bZ1@@@@@@201311@@.jpg\n",
        },
        "Images in several zones without `--zone`.",
    ),
];

/// What the page says of every format, in the order of [`Format::ALL`].
pub fn entries() -> impl Iterator<Item = Entry> {
    SAID.into_iter().map(|(format, about, example, refused)| {
        let taken_by = match format.kind() {
            Kind::Poses => POSES,
            Kind::Descriptors => DESCRIPTORS,
            Kind::Pairs => PAIRS,
            Kind::DescriptorsAndPairs => {
                "descriptors and predictions: all of `npy` and `hloc-pairs` together"
            }
        };
        Entry { name: format.name(), about, example, taken_by, refused }
    })
}

/// The page: formats of images and pairs, then ground truths.
#[must_use]
pub fn page(formats: &[Entry], truths: &[Entry]) -> String {
    let mut page = String::from(
        "# Formats\n\n\
         *See also:* [README](../README.md), [decisions](decisions.md).\n\n\
         Generated from `crates/vpr-data/src/exchange/page.rs`; a test compares. What a file says is \
         read or refused, never skipped in silence: what is not used, rounded or left out is said on \
         stderr. Names join descriptors and poses where both have them; a name in two rows is refused. \
         Positions are metres; orientations here are those of the camera in the world.\n\n\
         The same flags everywhere: `--from` names the format of descriptors, `--poses-format` that of \
         poses, where their names do not say it; `--zone` puts positions of several UTM zones into one; \
         `--pose-direction` says which way tables and TUM trajectories go: `world-from-camera`, \
         `camera-from-world`, or `camera-from-world-rotation`, for files whose position is the \
         camera's while their quaternion turns the world's axes into the camera's.\n\n\
         Images: folders are listed as deep as they lie, links followed; hidden files and what is no \
         `.jpg`, `.jpeg` or `.png` is not looked at.\n",
    );
    section(&mut page, "Descriptors, poses, pairs", formats);
    let (open, close) = TRUTHS;
    let _ = write!(page, "\n{open}\n");
    if !truths.is_empty() {
        section(&mut page, "Ground truths", truths);
    }
    let _ = writeln!(page, "{close}");
    page
}

fn section(page: &mut String, title: &str, entries: &[Entry]) {
    let _ = writeln!(page, "\n## {title}");
    for Entry { name, about, example, taken_by, refused } in entries {
        let _ = write!(page, "\n### `{name}`\n\n{about}\n\n");
        let _ = match example {
            Text { path, text } => {
                write!(page, "`{path}`:\n\n```text\n{}\n```\n", text.trim_end())
            }
            Python(line) => write!(page, "```python\n{line}\n```\n"),
            Shell(line) => write!(page, "```sh\n{line}\n```\n"),
        };
        let _ = write!(page, "\nTaken by: {taken_by}.\n\nRefused: {refused}\n");
    }
}
