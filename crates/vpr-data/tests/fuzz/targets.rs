//! The parsers, how each is called, and the sound files that damage starts from.

use std::{
    fs,
    path::{Path, PathBuf},
};

use ndarray::Array2;
use vpr_core::{
    Descriptors, Error, PlanarPosition, Pose, Poses,
    knn::{Pca, PcaParams},
    map::{About, Coordinates, GrowingMap, RowType, UtmZone, verify},
};
use vpr_data::{
    exchange::{self, Format, PairList, Pairs, Parts},
    layout::{
        pose_csv::PoseTable,
        vpr_bench::{GroundTruthFile, PublishedMatches, read_areas, read_curves},
    },
    manifest::Manifest,
};
use vpr_files::{caffe, mat::MatFile, npy, pickle};

/// One parser.
pub(crate) struct Target {
    /// Also the name of its folder in the corpus.
    pub(crate) name: &'static str,
    /// The damaged file, relative to the folder of the test.
    pub(crate) file: &'static str,
    /// Reads the file in that folder; every problem it finds.
    pub(crate) read: fn(&Path) -> Vec<Error>,
    /// Whether no truncation and no flipped bit may go unnoticed.
    pub(crate) notices_all: bool,
    /// Whether no truncation may go unnoticed, since the format says how long a file is.
    pub(crate) notices_cuts: bool,
}

/// A target that reads the file `file` of a format.
macro_rules! file_target {
    ($name:literal, $file:literal, $format:expr) => {
        Target {
            name: $name,
            file: $file,
            read: |folder| exchange::problems($format, &folder.join($file)),
            notices_all: false,
            notices_cuts: false,
        }
    };
}

/// A target that reads the file `file` by one function.
macro_rules! read_target {
    ($name:literal, $file:literal, $read:expr) => {
        Target {
            name: $name,
            file: $file,
            read: |folder| ($read)(&folder.join($file)).err().into_iter().collect(),
            notices_all: false,
            notices_cuts: false,
        }
    };
}

/// A target that reads the folder that `file` lies in.
macro_rules! folder_target {
    ($name:literal, $file:literal, $format:expr) => {
        Target {
            name: $name,
            file: $file,
            read: |folder| exchange::problems($format, folder),
            notices_all: false,
            notices_cuts: false,
        }
    };
}

/// A target that reads the file `file` by one function of `vpr-files`.
macro_rules! file_of_weights {
    ($name:literal, $file:literal, $read:expr) => {
        read_target!($name, $file, |path: &Path| -> vpr_core::Result<()> {
            let read: vpr_files::Result<_> = ($read)(path);
            read.map(|_| ()).map_err(Into::into)
        })
    };
}

pub(crate) const TARGETS: &[Target] = &[
    Target {
        name: "map",
        file: "map.safetensors",
        read: |folder| {
            let path = folder.join("map.safetensors");
            let read = exchange::read(Format::Map, &path).err();
            let mut problems = verify(&path);
            assert!(read.is_none() || !problems.is_empty(), "{read:?} is no problem for verify");
            problems.extend(read);
            problems
        },
        notices_all: true,
        notices_cuts: true,
    },
    Target {
        name: "manifest",
        file: "manifest.json",
        read: |folder| exchange::problems(Format::Map, folder),
        notices_all: false,
        notices_cuts: false,
    },
    Target {
        notices_cuts: true,
        ..file_target!("safetensors", "a.safetensors", Format::Safetensors)
    },
    Target { notices_cuts: true, ..file_target!("npz", "a.npz", Format::Npz) },
    file_target!("hloc-h5", "a.h5", Format::HlocH5),
    file_target!("hloc-pairs", "a.txt", Format::HlocPairs),
    file_target!("hloc-poses", "a.txt", Format::HlocPoses),
    file_target!("tum", "a.txt", Format::Tum),
    file_target!("kitti", "a.txt", Format::Kitti),
    file_target!("latlon", "a.csv", Format::LatLon),
    file_target!("csv", "a.csv", Format::PoseCsv),
    file_target!("utm-names", "a.txt", Format::UtmNames),
    folder_target!("7scenes", "frame-000000.pose.txt", Format::SevenScenes),
    folder_target!("kapture-trajectories", "sensors/trajectories.txt", Format::Kapture),
    Target {
        name: "kapture-rigs",
        file: "sensors/rigs.txt",
        read: |folder| beside_trajectories(folder),
        notices_all: false,
        notices_cuts: false,
    },
    Target {
        name: "kapture-records",
        file: "sensors/records_camera.txt",
        read: |folder| beside_trajectories(folder),
        notices_all: false,
        notices_cuts: false,
    },
    file_target!("colmap-text", "images.txt", Format::Colmap),
    Target { notices_cuts: true, ..file_target!("colmap-binary", "images.bin", Format::Colmap) },
    Target {
        notices_cuts: true,
        ..folder_target!("vpr-eval", "database_descriptors.npy", Format::VprEval)
    },
    Target {
        name: "vpr-eval-preds",
        file: "preds/000.txt",
        read: |folder| exchange::read_pairs(Format::VprEval, folder).err().into_iter().collect(),
        notices_all: false,
        notices_cuts: false,
    },
    Target { notices_cuts: true, ..file_target!("npy", "a.npy", Format::Npy) },
    read_target!("pca", "a.json", Pca::open),
    read_target!("dataset-manifest", "a.toml", Manifest::read),
    read_target!("pose-table", "a.csv", PoseTable::read),
    read_target!("vpr-bench-matches", "a.npy", PublishedMatches::read),
    read_target!("vpr-bench-truth", "a.npy", |path: &Path| {
        GroundTruthFile::read(path)?.truth(10)
    }),
    read_target!("vpr-bench-curves", "a.pickle", read_curves),
    read_target!("vpr-bench-areas", "a.pickle", read_areas),
    file_of_weights!("caffemodel", "a.caffemodel", caffe::read_model),
    file_of_weights!("binaryproto", "a.binaryproto", caffe::read_blob),
    file_of_weights!("estimators", "a.pkl", |path: &Path| {
        let bytes = fs::read(path).map_err(vpr_files::Error::io(path))?;
        pickle::decode_estimators(&bytes).map_err(|refusal| refusal.in_file(path, 0))
    }),
    file_of_weights!("mat", "a.mat", |path: &Path| {
        let file = MatFile::open(path)?;
        let numbers = |name| file.array_named(name).map(|array| array.to_f64s());
        Ok(file.names().filter_map(numbers).fold(0, |n, numbers| n + numbers.len()))
    }),
    Target {
        name: "npy-objects",
        file: "a.npy",
        read: |folder| {
            npy::read_objects(&folder.join("a.npy")).err().map(Into::into).into_iter().collect()
        },
        notices_all: false,
        notices_cuts: false,
    },
    Target {
        name: "pickle",
        file: "a.pickle",
        read: |folder| {
            pickle::read(&folder.join("a.pickle")).err().map(Into::into).into_iter().collect()
        },
        notices_all: false,
        notices_cuts: false,
    },
];

/// What kapture's other files say of a trajectory of two rigs.
fn beside_trajectories(folder: &Path) -> Vec<Error> {
    let trajectories = "0, rig, 1, 0, 0, 0, 1, 2, 3\n1, car, 0.6, 0, 0, 0.8, 1, 2, 3\n";
    fs::write(folder.join("sensors/trajectories.txt"), trajectories).unwrap();
    exchange::problems(Format::Kapture, folder)
}

/// Texts as other programs write them, by target and name.
const TEXTS: [(&str, &str, &str); 9] = [
    (
        "kapture-rigs",
        "sound",
        "# rig_id, sensor_id, qw, qx, qy, qz, tx, ty, tz\nrig, cam, 1, 0, 0, 0, 0, 0, -0.5\n\
         car, rig, 0.6, 0, 0.8, 0, 1, 0, 0\ncar, lidar, , , , , , ,\n",
    ),
    ("kapture-records", "sound", "0, rig, a.jpg\n1, car, b.jpg\n2, car, c.jpg\n"),
    (
        "colmap-text",
        "sound-points",
        "# two images\n1 0.6 0 0 0.8 -1 2.5 3 1 db/a b.jpg\n10.5 20.25 -1 3 4 17\n\
         2 1 0 0 0 0 0 1 1 b.jpg\n\n",
    ),
    (
        "csv",
        "sound-euroc",
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], \
         q_RS_z [], v_RS_R_x [m s^-1]\n1403636580838555648,4.6,-1.8,0.8,0.6,0,0,0.8,0.1\n\
         1403636580843555584,4.7,-1.8,0.9,0,0.6,0.8,0,0.1\n",
    ),
    (
        "csv",
        "sound-mapillary",
        ",key,easting,northing,unique_cluster,night\r\n0,aaa-1,349000.5,6173000.25,1,False\r\n\
         1,bbb_2,349010.5,6173001.25,1,False\r\n",
    ),
    (
        "csv",
        "sound-semicolons",
        "\u{feff}# of a survey\nZone;Y;X;Image\n18T;4427750;480000;\"a; \"\"b\"\".jpg\"\n\
         18T;4427760;480000;c.jpg\n",
    ),
    ("csv", "sound-blanks", "# timestamp tx ty tz\n1.5 1 2 3\n# 2.5 1 2 3\n3.5\t4 5 6\n"),
    ("latlon", "sound-titles", "Longitude\tLatitude\tFilename\n4.3571\t52.0116\ta.jpg\n"),
    (
        "utm-names",
        "sound-bands",
        "@0480000.00@4427750.00@18@S@@@0@@@@@@@@.jpg\n@0480000.00@4427760.00@18@T@@@1@@@@@@@@.jpg\n",
    ),
];

/// A `.npy` file of these bytes.
fn array(descr: &str, shape: &str, body: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", length.as_slice(), header.as_bytes(), body].concat()
}

/// What other programs write: texts, numbers of other types, and names as texts.
fn write_foreign_seeds(seed: &dyn Fn(&str, &str, &[u8])) {
    for (target, name, text) in TEXTS {
        seed(target, name, text.as_bytes());
    }
    let doubles: Vec<u8> = (0..6).flat_map(|it| (f64::from(it) * 0.1).to_le_bytes()).collect();
    seed("npy", "sound-f64", &array("<f8", "(3, 2)", &doubles));
    let halves: Vec<u8> = (0..6_u16).flat_map(|it| (0x3c00 + it).to_le_bytes()).collect();
    seed("npy", "sound-f16", &array(">f2", "(2, 3)", &halves));
    let mut archive = npy::npz::Writer::new(std::io::Cursor::new(Vec::new()));
    let bytes = |body: &[u8]| body.iter().map(|&byte| [byte]).collect::<Vec<_>>().into_iter();
    archive.add("descriptors", "<f2", &[2, 3], bytes(&halves)).unwrap();
    let names = "a.jpgé.jpg".chars().flat_map(|it| u32::from(it).to_le_bytes()).collect::<Vec<_>>();
    archive.add("names", "<U5", &[2], bytes(&names)).unwrap();
    archive.add("labels", "|S1", &[2], bytes(b"ab")).unwrap();
    seed("npz", "sound-texts", &archive.finish().unwrap().into_inner());
    let header = r#"{"x":{"dtype":"BF16","shape":[3,2],"data_offsets":[0,12]}}"#;
    let length = (header.len() as u64).to_le_bytes();
    seed("safetensors", "sound-bf16", &[&length, header.as_bytes(), &halves].concat());
}

fn parts(n: usize) -> Parts {
    let pose = |row: usize| {
        let turn = [0.1, 0.2, row as f64].into();
        Pose::new([row as f64, -2.5, 0.25].into(), turn)
    };
    let descriptors =
        Array2::from_shape_fn((n, 5), |(row, column)| (row * 5 + column) as f32 * 0.1);
    Parts {
        names: Some((0..n).map(|row| format!("db/frame-{row:06}.color.png")).collect()),
        descriptors: Some(Descriptors::new(descriptors).unwrap()),
        poses: Some(Poses::SixDof((0..n).map(pose).collect())),
        about: About { encoder: Some("HOG".to_owned()), ..About::default() },
        ..Parts::default()
    }
}

/// A small projection, saved in this folder.
fn pca(folder: &Path) -> PathBuf {
    let params = PcaParams { n_components: 2, whiten: true };
    let rows = Array2::from_shape_fn((9, 3), |(row, column)| ((row * 7 + column * 3) % 5) as f32);
    let path = folder.join("pca");
    Pca::fit(&Descriptors::new(rows).unwrap(), &params).unwrap().save(&path).unwrap();
    path
}

/// Writes what holds references per query.
fn write_pair_seeds(folder: &Path, seed: &dyn Fn(&str, &str, &Path)) {
    let list = |query: &str| PairList {
        query: query.to_owned(),
        references: vec!["db/1.jpg".to_owned(), "db/2.jpg".to_owned()],
    };
    let pairs = Pairs { lists: vec![list("q/1.jpg"), list("q/2.jpg")] };
    exchange::write_pairs(Format::VprEval, &folder.join("eval"), &pairs).unwrap();
    seed("vpr-eval-preds", "sound", &folder.join("eval/preds/000.txt"));
    exchange::write_pairs(Format::HlocPairs, &folder.join("pairs"), &pairs).unwrap();
    seed("hloc-pairs", "sound", &folder.join("pairs"));
}

/// Weights as others write them: the files that other readers were compared with.
fn write_weight_seeds(seed: &dyn Fn(&str, &str, &Path)) {
    let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vpr-files/tests/golden");
    for (target, name) in [
        ("caffemodel", "new.caffemodel"),
        ("caffemodel", "older.caffemodel"),
        ("binaryproto", "mean.binaryproto"),
        ("mat", "compressed.mat"),
        ("mat", "plain.mat"),
    ] {
        let stem = name.split('.').next().unwrap();
        seed(target, &format!("sound-{stem}"), &weights.join(name));
    }
    let estimators = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/scikit");
    for protocol in [0, 2, 4] {
        let name = format!("vocabulary-{protocol}.pkl");
        seed("estimators", &format!("sound-{protocol}"), &estimators.join(name));
    }
}

/// Writes one sound file of every format, and keeps what is there already.
pub(crate) fn write_seeds(corpus: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let seed = |target: &str, name: &str, file: &Path| {
        let place = corpus.join(target);
        fs::create_dir_all(&place).unwrap();
        fs::copy(file, place.join(name)).unwrap();
    };
    write_foreign_seeds(&|target, name, bytes| {
        let path = folder.path().join("bytes");
        fs::write(&path, bytes).unwrap();
        seed(target, name, &path);
    });
    let six_dof = parts(3);
    for (target, format, row_type) in [
        ("safetensors", Format::Safetensors, None),
        ("npz", Format::Npz, None),
        ("hloc-h5", Format::HlocH5, None),
        ("hloc-poses", Format::HlocPoses, None),
        ("tum", Format::Tum, None),
        ("kitti", Format::Kitti, None),
        ("csv", Format::PoseCsv, None),
        ("pose-table", Format::PoseCsv, None),
        ("npy", Format::Npy, None),
        ("map", Format::Map, Some(RowType::I8)),
        ("map", Format::Map, Some(RowType::F16)),
    ] {
        let path = folder.path().join("seed");
        let name = row_type.map_or("sound".to_owned(), |row_type| format!("sound-{row_type}"));
        match row_type {
            Some(row_type) => six_dof.write_map(&path, row_type).unwrap(),
            None => exchange::write(format, &path, &six_dof).unwrap(),
        }
        seed(target, &name, &path);
    }
    for (target, file) in [("colmap-text", "images.txt"), ("colmap-binary", "images.bin")] {
        exchange::write(Format::Colmap, &folder.path().join(file), &six_dof).unwrap();
        seed(target, "sound", &folder.path().join(file));
    }
    write_weight_seeds(&seed);
    seed("pca", "sound", &pca(folder.path()));
    let place = |name: &str| folder.path().join(name);
    exchange::write(Format::SevenScenes, &place("scene"), &parts(1)).unwrap();
    seed("7scenes", "sound", &place("scene/frame-000000.pose.txt"));
    exchange::write(Format::Kapture, &place("kapture"), &six_dof).unwrap();
    seed("kapture-trajectories", "sound", &place("kapture/sensors/trajectories.txt"));
    exchange::write(Format::VprEval, &place("eval"), &six_dof).unwrap();
    seed("vpr-eval", "sound", &place("eval/database_descriptors.npy"));
    write_pair_seeds(folder.path(), &seed);
    let zone = UtmZone { number: 32, south: false };
    let planar = vec![PlanarPosition::new(593_139.5, 5_763_197.8); 3];
    let about = About { coordinates: Some(Coordinates::Utm(zone)), ..About::default() };
    let planar = Parts { poses: Some(Poses::Planar(planar)), about, ..parts(3) };
    exchange::write(Format::LatLon, &place("latlon"), &planar).unwrap();
    seed("latlon", "sound", &place("latlon"));
    exchange::write(Format::UtmNames, &place("utm"), &planar).unwrap();
    seed("utm-names", "sound", &place("utm"));
    let mut map = GrowingMap::open(&place("growing"), RowType::F32, About::default()).unwrap();
    map.append(Array2::ones((2, 3)).view(), None, None).unwrap();
    seed("manifest", "sound", &place("growing/manifest.json"));
}
