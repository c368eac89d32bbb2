//! Datasets by name: generated ones, those of the manifest, and those that are not at hand.

#![allow(clippy::print_stdout, reason = "says which test needs data")]

use std::{
    env,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use vpr_core::{Observer, Poses, Provenance};
use vpr_data::{DataRoots, Dataset, Datasets};
use vpr_worlds::{Worlds, is_world, named_recipe};

/// Counts what it is told.
#[derive(Default)]
struct Count {
    starts: AtomicUsize,
    steps: AtomicUsize,
    ends: AtomicUsize,
}

impl Observer for Count {
    fn start(&self, _: &str, _: usize) {
        self.starts.fetch_add(1, Ordering::Relaxed);
    }
    fn step(&self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
    }
    fn end(&self) {
        self.ends.fetch_add(1, Ordering::Relaxed);
    }
}

impl Count {
    fn seen(&self) -> [usize; 3] {
        [&self.starts, &self.steps, &self.ends].map(|it| it.load(Ordering::Relaxed))
    }
}

fn own_roots() -> DataRoots {
    DataRoots::new([Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")])
}

fn real_roots(test: &str) -> Option<DataRoots> {
    let Some(data) = env::var_os("VPR_DATA") else {
        println!("skipped: {test}: VPR_DATA is not set");
        return None;
    };
    Some(DataRoots::new([PathBuf::from(data)]))
}

/// Opens a dataset by name.
fn open_named(
    id: &str,
    roots: &DataRoots,
    cache: &Path,
    observer: &dyn Observer,
) -> vpr_core::Result<Option<Dataset>> {
    Datasets::new(roots.clone(), cache, Worlds).open(id, observer)
}

#[test]
fn a_world_is_rendered_once_and_has_truth_and_full_poses() {
    let cache = tempfile::tempdir().unwrap();
    let id = "world/corridor?places=4&camera.width=64&camera.height=48";
    let (first, second) = (Count::default(), Count::default());
    let dataset = open_named(id, &own_roots(), cache.path(), &first).unwrap().unwrap();
    assert_eq!(first.seen(), [1, 8, 1]);
    assert_eq!((dataset.id.as_str(), dataset.provenance), (id, Provenance::Generated));
    assert_eq!((dataset.queries.len(), dataset.references.len()), (4, 4));
    assert!(dataset.truth.is_correct(3, 3) && !dataset.truth.is_correct(3, 0));
    let Some((Poses::SixDof(queries), Poses::SixDof(references))) = &dataset.poses else {
        panic!("{:?}", dataset.poses);
    };
    assert_eq!((queries.len(), references.len()), (4, 4));

    let again = open_named(id, &own_roots(), cache.path(), &second).unwrap().unwrap();
    assert_eq!(second.seen(), [0, 0, 0]);
    assert_eq!(again, dataset);
}

#[test]
fn names_with_settings_are_read_and_nonsense_is_refused_by_name() {
    assert!(is_world("world/rail") && !is_world("rail"));
    assert_eq!(named_recipe("world/rail?places=9").unwrap().places, 9);
    for (id, part) in [
        ("world/rail?places", "key=value"),
        ("world/rail?places=-1", "places"),
        ("world/rails", "known: "),
    ] {
        let err = open_named(id, &own_roots(), Path::new("nowhere"), &()).unwrap_err().to_string();
        assert!(err.contains(part), "{id}: {err}");
    }
}

#[test]
fn names_of_the_manifest_open_where_their_images_are() {
    let open = |id| open_named(id, &own_roots(), Path::new("nowhere"), &());
    let fixture = open("fixture").unwrap().unwrap();
    assert_eq!((fixture.queries.len(), fixture.provenance), (12, Provenance::Generated));
    for absent in ["spedtest", "redkitchen", "nordland-64x32", "fixture-invariance"] {
        assert_eq!(open(absent).unwrap(), None, "{absent}");
    }
    assert!(open("spedtets").unwrap_err().to_string().contains("known: "));
}

#[test]
fn a_real_room_has_poses_in_space_and_real_tracks_positions_along_them() {
    let Some(roots) = real_roots("real datasets by name") else { return };
    let cache = tempfile::tempdir().unwrap();
    let open = |id| open_named(id, &roots, cache.path(), &()).unwrap().unwrap();
    let kitchen = open("redkitchen");
    assert_eq!((kitchen.queries.len(), kitchen.references.len()), (500, 500));
    assert_eq!(kitchen.provenance, Provenance::Measured);
    let (Poses::SixDof(queries), Poses::SixDof(_)) = kitchen.poses.as_ref().unwrap() else {
        panic!("not full poses");
    };
    assert!(queries.iter().all(|pose| pose.translation.vector.norm() < 10.0));

    let track = open("nordland-64x32-stretch");
    assert_eq!((track.queries.len(), track.references.len()), (100, 100));
    let (queries, _) = track.poses.as_ref().unwrap();
    assert!((queries.position(10).x - 2_040.0).abs() < 1e-9);
    assert_eq!(image::open(&track.queries[0]).unwrap().to_luma8().dimensions(), (64, 32));
    // A damaged file is written again.
    let whole = std::fs::read(&track.queries[7]).unwrap();
    std::fs::write(&track.queries[7], &whole[..9]).unwrap();
    assert_eq!(open("nordland-64x32-stretch"), track);
    assert_eq!(std::fs::read(&track.queries[7]).unwrap(), whole);
}
