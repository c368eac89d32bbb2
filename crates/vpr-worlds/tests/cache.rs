//! Same bytes on any number of threads, and nothing half-written is ever opened.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, path::Path};

use vpr_worlds::{Recipe, Scenery, Side, World, recipe_with};

fn small(name: &str) -> Recipe {
    let settings = [
        ("places", "4"),
        ("camera.width", "64"),
        ("camera.height", "48"),
        ("camera.focal", "46.0"),
        ("depth", "true"),
        ("overlap", "true"),
        ("queries.condition.occlusion", "0.25"),
    ];
    recipe_with(name, &settings).unwrap()
}

fn stamp(world: &World) -> String {
    fs::read_to_string(world.folder.join("world.json")).unwrap()
}

fn render(recipe: &Recipe, cache: &Path) -> World {
    World::open(recipe, cache, &|| {}).unwrap()
}

#[test]
fn one_thread_and_five_give_the_same_bytes() {
    for name in ["street", "rail", "campus", "rooms", "archive", "light-stage-lights"] {
        let recipe = small(name);
        let stamps = [1, 5].map(|n| {
            let cache = tempfile::tempdir().unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| stamp(&render(&recipe, cache.path())))
        });
        assert_eq!(stamps[0], stamps[1], "{name}");
        assert!(stamps[0].contains("\"label\": \"generated\""));
    }
}

#[test]
fn a_second_opening_renders_nothing() {
    let cache = tempfile::tempdir().unwrap();
    let recipe = small("street");
    let first = render(&recipe, cache.path());
    let again = World::open(&recipe, cache.path(), &|| panic!("rendered again")).unwrap();
    assert_eq!(first.dataset, again.dataset);
    assert_eq!(again.overlap().unwrap().dim(), (4, 4));
}

#[test]
fn a_damaged_world_is_rendered_again() {
    let cache = tempfile::tempdir().unwrap();
    let recipe = small("campus");
    let world = render(&recipe, cache.path());
    let before = stamp(&world);
    let image = &world.dataset.references[2];
    let damages: [&dyn Fn(); 4] = [
        &|| fs::remove_file(image).unwrap(),
        &|| fs::write(image, &fs::read(image).unwrap()[..100]).unwrap(),
        &|| fs::remove_file(world.folder.join("world.json")).unwrap(),
        &|| fs::write(world.folder.join("ref/0000099.jpg"), "more").unwrap(),
    ];
    for damage in damages {
        damage();
        assert_eq!(stamp(&render(&recipe, cache.path())), before);
        assert!(!world.folder.join("ref/0000099.jpg").exists());
    }
}

#[test]
fn a_render_that_fails_leaves_nothing_to_trust() {
    let cache = tempfile::tempdir().unwrap();
    let recipe = small("street");
    // The cache is a file: nothing can be written.
    let file = cache.path().join("file");
    fs::write(&file, "").unwrap();
    let err = World::open(&recipe, &file, &|| {}).unwrap_err().to_string();
    assert!(err.contains("file"), "{err}");
    // A render that is killed leaves its temporary folder; it has another name and no stamp.
    let inner = cache.path().join("killed");
    let died = std::panic::catch_unwind(|| World::open(&recipe, &inner, &|| panic!("killed")));
    assert!(died.is_err());
    let named = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
    let left: Vec<String> =
        fs::read_dir(&inner).unwrap().map(|entry| named(entry.unwrap())).collect();
    assert!(left.iter().all(|name| name.starts_with(".partial-")), "{left:?}");
    assert_eq!(render(&recipe, &inner).dataset.queries.len(), 4);
}

#[test]
fn every_layout_is_read_by_the_reader_of_real_data() {
    let cache = tempfile::tempdir().unwrap();
    for (name, first) in
        [("street", "@"), ("campus", "0000000.jpg"), ("escalator", "frame-000000.color.png")]
    {
        let world = render(&small(name), cache.path());
        let file = world.dataset.queries[0].file_name().unwrap().to_string_lossy().into_owned();
        assert!(file.starts_with(first), "{file}");
        assert_eq!(world.dataset.truth.n_references(), 4);
        assert!((0..4).all(|query| !world.dataset.truth.is_new_place(query)), "{name}");
    }
}

#[test]
fn new_places_have_nothing_correct() {
    let cache = tempfile::tempdir().unwrap();
    let mut recipe = small("street-new-places");
    recipe.new_places = 3;
    let truth = render(&recipe, cache.path()).dataset.truth;
    assert_eq!((truth.len(), truth.n_known()), (7, 4));
    assert!((4..7).all(|query| truth.is_new_place(query)));
}

#[test]
fn new_places_come_on_request_in_every_family() {
    let radius = [("layout", "\"seven-scenes\""), ("tolerance", "{ radius_m = 5.0 }")];
    for name in ["street", "street-st-lucia", "rail", "campus", "corridor", "seven-scenes-heads"] {
        let mut settings = radius.to_vec();
        settings.extend([("places", "6"), ("query_every", "1"), ("new_places", "4")]);
        settings.extend([("camera", "{ width = 16, height = 16, focal = 12.0 }")]);
        let scenery = Scenery::new(&recipe_with(name, &settings).unwrap()).unwrap();
        let truth = scenery.ground_truth();
        assert_eq!((truth.len(), truth.n_known()), (10, 6), "{name}");
        for query in 6..10 {
            assert_eq!(scenery.place(Side::Queries, query), None);
            assert!(truth.is_new_place(query), "{name}, query {query}");
        }
    }
    let err = recipe_with("multi-lane", &[("new_places", "1")]).unwrap_err().to_string();
    assert!(err.contains("new_places"), "{err}");
}

#[test]
fn overlap_is_full_at_the_same_pose_and_falls_along_the_route() {
    let cache = tempfile::tempdir().unwrap();
    let mut recipe = small("street");
    recipe.layout = vpr_worlds::Layout::VprBench;
    recipe.tolerance = vpr_worlds::Tolerance::Frames(1);
    recipe.queries = recipe.references;
    recipe.references.condition.traffic = 0.0;
    recipe.queries.condition.traffic = 0.0;
    let overlap = render(&recipe, cache.path()).overlap().unwrap();
    for place in 0..4 {
        assert!(overlap[(place, place)] > 0.95, "{overlap}");
    }
    assert!(overlap[(0, 0)] > overlap[(0, 1)] && overlap[(0, 1)] > overlap[(0, 3)], "{overlap}");
}
