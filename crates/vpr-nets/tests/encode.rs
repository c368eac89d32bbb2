//! Image files become descriptors and maps: in order, on any number of threads, after interruptions.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use burn::tensor::Tensor;
use vpr_core::{
    PlanarPosition, Poses,
    knn::Metric,
    map::{OpenMap, Opening, RowType},
};
use vpr_nets::{
    Result,
    encode::{
        Channels, Encoder, Images, Interpolation, Options, Preprocessing, Size, batch_leak,
        encode_each, encode_files, encode_images, encode_to_map, registry::Matching,
    },
};
use vpr_vision::image::{ImageSize, decode, from_pixels};

/// Mean of every channel; with `leaks`, less the mean of the batch.
struct Means {
    preprocessing: Preprocessing,
    leaks: bool,
    matching: Matching,
    calls: AtomicUsize,
}

impl Means {
    fn new(size: Size) -> Self {
        let preprocessing = Preprocessing { size, ..Preprocessing::image_net(8, 8) };
        let matching = Matching::Euclidean;
        Self { preprocessing, leaks: false, matching, calls: AtomicUsize::new(0) }
    }
}

impl Encoder for Means {
    fn name(&self) -> &'static str {
        "means"
    }

    fn dimension(&self) -> usize {
        3
    }

    fn preprocessing(&self) -> &Preprocessing {
        &self.preprocessing
    }

    fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        let means = images.mean_dim(3).mean_dim(2).flatten::<2>(1, 3);
        if self.leaks { means.clone() - means.mean_dim(0) * 0.5 } else { means }
    }

    fn batch_dependent(&self) -> bool {
        self.leaks
    }

    fn matching(&self) -> Matching {
        self.matching
    }

    fn weights_digest(&self) -> Option<&'static str> {
        Some("sha256:0123")
    }
}

fn png(path: &Path, width: u32, height: u32, seed: u8) {
    let image = image::RgbImage::from_fn(width, height, |x, y| {
        image::Rgb([x, y, x + y].map(|it| u8::try_from(it % 100).unwrap() + seed))
    });
    image.save(path).unwrap();
}

/// A folder of `n` images.
fn folder(n: usize) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<_> = (0..n).map(|i| folder.path().join(format!("{i:03}.png"))).collect();
    for (i, path) in paths.iter().enumerate() {
        png(path, 20, 12, u8::try_from(i).unwrap());
    }
    (folder, paths)
}

fn fixed() -> Means {
    Means::new(Size::Fixed { height: 8, width: 8 })
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let (_folder, paths) = folder(23);
    let of = |threads, batch_size| {
        let options = Options { threads: Some(threads), batch_size, skip_bad: false };
        let mut seen = Vec::new();
        let rows = encode_files(&fixed(), &paths, &options, &mut |n| seen.push(n)).unwrap();
        assert_eq!(seen.last(), Some(&23));
        assert!(seen.is_sorted());
        rows
    };
    let expected = of(1, 4);
    assert_eq!((expected.len(), expected.dim()), (23, 3));
    for threads in [2, 5] {
        assert_eq!(of(threads, 4), expected, "{threads} threads");
    }
    let images: Vec<_> = paths.iter().map(|path| decode(path).unwrap()).collect();
    let options = Options { batch_size: 4, ..Options::default() };
    assert_eq!(encode_images(&fixed(), &images, &options).unwrap(), expected);
}

#[test]
fn a_corrupt_image_stops_with_its_path_or_is_listed() {
    let (folder, mut paths) = folder(6);
    fs::write(&paths[2], b"\x89PNG\r\n\x1a\n and then nothing").unwrap();
    paths[4] = folder.path().join("missing.png");
    let options = Options { batch_size: 2, ..Options::default() };
    let err = encode_files(&fixed(), &paths, &options, &mut |_| ()).unwrap_err();
    assert!(err.to_string().contains("002.png: "), "{err}");

    let options = Options { skip_bad: true, ..options };
    let (mut kept, mut skipped) = (Vec::new(), Vec::new());
    encode_each(&fixed(), &paths, &options, &mut |batch| {
        assert_eq!(batch.rows.nrows(), batch.kept.len());
        kept.extend(batch.kept);
        skipped.extend(batch.skipped.into_iter().map(|(index, err)| (index, err.to_string())));
        Ok(())
    })
    .unwrap();
    assert_eq!(kept, [0, 1, 3, 5]);
    assert!(skipped[0].0 == 2 && skipped[0].1.contains("002.png"), "{skipped:?}");
    assert!(skipped[1].0 == 4 && skipped[1].1.contains("missing.png"), "{skipped:?}");
}

#[test]
fn images_of_one_pixel_and_of_any_shape_are_encoded() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = [(1, 1), (1, 300), (300, 1), (2, 2)];
    let paths: Vec<_> = sizes
        .iter()
        .map(|&(width, height)| {
            let path = folder.path().join(format!("{width}x{height}.png"));
            png(&path, width, height, 7);
            path
        })
        .collect();
    for size in [Size::Fixed { height: 8, width: 8 }, Size::Native, Size::ShorterSide(4)] {
        let encoder = Means::new(size);
        let rows = encode_files(&encoder, &paths, &Options::default(), &mut |_| ()).unwrap();
        assert_eq!(rows.len(), 4, "{size:?}");
    }
    let together = Options { batch_size: 4, ..Options::default() };
    let err = encode_files(&Means::new(Size::Native), &paths, &together, &mut |_| ()).unwrap_err();
    assert!(err.to_string().contains("different sizes in one batch"), "{err}");
    let huge = Means::new(Size::ShorterSide(1 << 20));
    let err = encode_files(&huge, &paths, &Options::default(), &mut |_| ()).unwrap_err();
    assert!(err.to_string().contains("1x1.png"), "{err}");
}

#[test]
fn a_batch_of_none_is_refused() {
    let (_folder, paths) = folder(1);
    let options = Options { batch_size: 0, ..Options::default() };
    assert!(encode_files(&fixed(), &paths, &options, &mut |_| ()).is_err());
}

/// Values by hand: 8-bit gray 10 and 250 side by side, and both channels orders.
#[test]
fn preprocessing_is_what_it_says() {
    let image =
        from_pixels::<3>(ImageSize { width: 2, height: 1 }, vec![10, 20, 30, 250, 240, 230]);
    let plain = Preprocessing {
        size: Size::Native,
        interpolation: Interpolation::Bilinear,
        channels: Channels::Rgb,
        equalize: false,
        scale: 1.0,
        mean: [10.0, 0.0, 0.0],
        std: [2.0, 1.0, 1.0],
        resize_after_normalize: false,
    };
    let (values, size) = plain.apply(&image).unwrap();
    assert_eq!((size.width, size.height), (2, 1));
    assert_eq!(values, [0.0, 120.0, 20.0, 240.0, 30.0, 230.0]);
    let bgr = Preprocessing { channels: Channels::Bgr, ..plain.clone() };
    assert_eq!(bgr.apply(&image).unwrap().0, [10.0, 110.0, 20.0, 240.0, 10.0, 250.0]);
    let gray =
        Preprocessing { channels: Channels::Gray, mean: [0.0; 3], std: [1.0; 3], ..plain.clone() };
    // 0.299 · 10 + 0.587 · 20 + 0.114 · 30 = 18.15, and 241.85
    assert_eq!(gray.apply(&image).unwrap().0, [18.0, 242.0]);
    // One pixel of both, filtered: 130 exactly, 129.5 or 130 with 8 bits in between.
    let one = Preprocessing { size: Size::Fixed { height: 1, width: 1 }, ..gray };
    assert_eq!(one.apply(&image).unwrap().0, [130.0]);
}

#[test]
fn sizes_follow_the_shorter_side_or_a_multiple() {
    let target = |size, width, height| {
        let preprocessing = Preprocessing { size, ..Preprocessing::image_net(8, 8) };
        let target = preprocessing.target(ImageSize { width, height });
        (target.width, target.height)
    };
    assert_eq!(target(Size::ShorterSide(480), 640, 480), (640, 480));
    assert_eq!(target(Size::ShorterSide(240), 1001, 500), (480, 240));
    assert_eq!(target(Size::ShorterSide(240), 500, 1001), (240, 480));
    assert_eq!(target(Size::NativeMultipleOf(14), 640, 480), (644, 476));
    assert_eq!(target(Size::NativeMultipleOf(14), 3, 20), (14, 14));
}

fn images(paths: &[PathBuf]) -> Images {
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let positions = (0..paths.len()).map(|i| PlanarPosition::new(i as f64, 0.0)).collect();
    Images {
        paths: paths.to_vec(),
        names: paths.iter().map(name).collect(),
        poses: Some(Poses::Planar(positions)),
        coordinates: None,
    }
}

fn to_map(encoder: &Means, images: &Images, target: &Path) -> Result<vpr_nets::encode::Written> {
    let options = Options { batch_size: 8, threads: Some(2), skip_bad: true };
    encode_to_map(encoder, images, &options, RowType::F32, target, &mut |_| ())
}

#[test]
fn a_map_says_how_it_was_made_and_leaves_out_what_cannot_be_read() {
    let (folder, paths) = folder(9);
    fs::write(&paths[3], b"no image").unwrap();
    let target = folder.path().join("map.safetensors");
    let written = to_map(&fixed(), &images(&paths), &target).unwrap();
    assert_eq!((written.n_rows, written.n_resumed), (8, 0));
    assert_eq!(written.skipped[0].0, "003.png");
    let map = OpenMap::open(&target, Opening::default()).unwrap();
    assert_eq!(map.about().encoder.as_deref(), Some("means"));
    assert_eq!(map.about().weights_digest.as_deref(), Some("sha256:0123"));
    assert_eq!(map.about().image_size.unwrap().to_string(), "8x8");
    assert_eq!(map.about().interpolation.as_deref(), Some("bilinear, antialiased"));
    assert_eq!(map.names().unwrap().unwrap().get(3), Some("004.png"));
    assert_eq!(map.poses().unwrap().unwrap().position(3).x, 4.0);
    let good: Vec<_> = paths.iter().filter(|path| !path.ends_with("003.png")).cloned().collect();
    let rows = encode_files(&fixed(), &good, &Options::default(), &mut |_| ()).unwrap();
    let difference = map.descriptors().unwrap().into_inner() - rows.into_inner();
    assert!(difference.iter().all(|it| it.abs() < 1e-5));
    assert!(!folder.path().join("map.safetensors.work").exists());
}

/// `bench map search` asks the map how its descriptors are compared.
#[test]
fn a_map_says_how_its_descriptors_are_compared() {
    let (folder, paths) = folder(2);
    for (matching, metric) in
        [(Matching::Euclidean, Metric::Euclidean), (Matching::L1, Metric::Manhattan)]
    {
        let target = folder.path().join("map.safetensors");
        let encoder = Means { matching, ..fixed() };
        to_map(&encoder, &images(&paths), &target).unwrap();
        let map = OpenMap::open(&target, Opening::default()).unwrap();
        assert_eq!(map.about().metric, Some(metric));
        drop(map);
        fs::remove_file(&target).unwrap();
    }
}

#[test]
fn interrupted_work_goes_on_where_it_stopped() {
    let (folder, paths) = folder(5);
    // 600 references of five files, so that there are segments.
    let many: Vec<_> = (0..600).map(|i| paths[i % 5].clone()).collect();
    let mut all = images(&many);
    all.names = (0..600).map(|i| format!("{i}")).collect();
    let target = folder.path().join("map.safetensors");
    let mut first = Vec::new();
    {
        // The 560th image is missing, and stops a run that may not skip.
        let mut broken = all.clone();
        broken.paths[560] = folder.path().join("missing.png");
        let options = Options { batch_size: 8, threads: Some(2), skip_bad: false };
        let encoder = fixed();
        let stopped = encode_to_map(&encoder, &broken, &options, RowType::F32, &target, &mut |n| {
            first.push(n);
        });
        assert!(stopped.unwrap_err().to_string().contains("missing.png"));
        assert!(!target.exists());
    }
    let encoder = fixed();
    let written = to_map(&encoder, &all, &target).unwrap();
    assert_eq!((written.n_rows, written.n_resumed), (600, 512));
    assert_eq!(encoder.calls.load(Ordering::Relaxed), 11, "88 images in batches of 8");
    let whole = folder.path().join("whole.safetensors");
    to_map(&fixed(), &all, &whole).unwrap();
    let open = |path: &Path| OpenMap::open(path, Opening::default()).unwrap();
    assert_eq!(open(&target).descriptors().unwrap(), open(&whole).descriptors().unwrap());
    assert_eq!(open(&target).names().unwrap(), open(&whole).names().unwrap());
}

#[test]
fn work_of_another_encoder_or_on_other_images_is_not_continued() {
    let (folder, paths) = folder(5);
    let many: Vec<_> = (0..300).map(|i| paths[i % 5].clone()).collect();
    let mut all = images(&many);
    all.names = (0..300).map(|i| format!("{i}")).collect();
    let target = folder.path().join("map.safetensors");
    let mut broken = all.clone();
    broken.paths[299] = folder.path().join("missing.png");
    let options = Options { threads: Some(1), ..Options::default() };
    let stop = |encoder: &Means, images: &Images| {
        encode_to_map(encoder, images, &options, RowType::F32, &target, &mut |_| ()).unwrap_err()
    };
    stop(&fixed(), &broken);
    let other_size = Means::new(Size::Fixed { height: 16, width: 16 });
    assert!(stop(&other_size, &all).to_string().contains("work of another run"));
    let mut renamed = all.clone();
    renamed.names.iter_mut().for_each(|name| name.insert(0, 'x'));
    assert!(stop(&fixed(), &renamed).to_string().contains("work on other images"));
}

#[test]
fn a_replaced_image_is_refused_by_name_and_its_old_row_not_kept() {
    let (folder, one) = folder(1);
    let paths: Vec<_> = (0..300).map(|i| folder.path().join(format!("{i:03}.png"))).collect();
    for path in &paths[1..] {
        fs::copy(&one[0], path).unwrap();
    }
    let all = images(&paths);
    let target = folder.path().join("map.safetensors");
    let last = fs::read(&paths[299]).unwrap();
    fs::write(&paths[299], b"not yet there").unwrap();
    let options = Options { threads: Some(1), ..Options::default() };
    let run = || encode_to_map(&fixed(), &all, &options, RowType::F32, &target, &mut |_| ());
    assert!(run().unwrap_err().to_string().contains("299.png"));
    // The last one was not described yet and may change; the seventh was.
    fs::write(&paths[299], last).unwrap();
    let seventh = fs::read(&paths[7]).unwrap();
    png(&paths[7], 24, 12, 90);
    let err = run().unwrap_err().to_string();
    assert!(err.contains("007.png: image: has changed since an earlier run"), "{err}");
    assert!(err.contains("map.safetensors.work to describe all images anew"), "{err}");
    assert!(!target.exists());
    fs::write(&paths[7], seventh).unwrap();
    assert!(run().is_err(), "the same bytes at another time are not known to be the same");
    fs::remove_dir_all(folder.path().join("map.safetensors.work")).unwrap();
    assert_eq!(run().unwrap().n_resumed, 0);
}

#[test]
fn descriptors_that_depend_on_their_batch_are_found() {
    let (_folder, paths) = folder(12);
    let options = Options { batch_size: 4, ..Options::default() };
    let leak = |leaks| batch_leak(&Means { leaks, ..fixed() }, &paths, &options, 1).unwrap();
    assert!(!leak(false).is_dependent(), "{:?}", leak(false));
    let found = leak(true);
    assert!(found.is_dependent() && found.against_shuffled > 0.01, "{found:?}");
}
