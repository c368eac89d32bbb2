//! Runs an encoder over images: workers that each decode, resize and forward one batch at a time.

use std::{
    collections::BTreeMap,
    ops::Range,
    path::{Path, PathBuf},
    sync::{
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc,
    },
};

use burn::tensor::{Tensor, TensorData};
use ndarray::Array2;
use vpr_core::{Descriptors, Error};
use vpr_vision::image::{self, ImageSize, RgbImage};

use super::Encoder;
use crate::{Result, device::read};

/// How images are run through an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Images per forward pass; those of one batch must get one size.
    pub batch_size: usize,
    /// Batches at a time, each on one thread of its own; all processors if `None`.
    ///
    /// Descriptors are the same for any number.
    pub threads: Option<usize>,
    /// Leave out images that cannot be read instead of stopping at the first.
    pub skip_bad: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { batch_size: 1, threads: None, skip_bad: false }
    }
}

/// One batch, encoded.
#[derive(Debug)]
pub struct Encoded {
    /// Which images the batch is of.
    pub images: Range<usize>,
    /// Indices of the images that could be read, in order; one row each.
    pub kept: Vec<usize>,
    /// Their descriptors, `n × dimension`.
    pub rows: Array2<f32>,
    /// The images that could not be read, with the reason.
    pub skipped: Vec<(usize, crate::Error)>,
}

/// Encodes image files; `done` is called with the number of images done, in order.
///
/// # Errors
///
/// The first file, in order, that cannot be read or decoded, by its path; bad options;
/// [`Error::NotFinite`] if the network gives a NaN. `skip_bad` makes no difference here: rows
/// would no longer match the files; use [`encode_each`].
pub fn encode_files(
    encoder: &dyn Encoder,
    paths: &[PathBuf],
    options: &Options,
    done: &mut dyn FnMut(usize),
) -> Result<Descriptors> {
    let options = Options { skip_bad: false, ..*options };
    collect(encoder, paths.len(), |sink| {
        encode_each(encoder, paths, &options, &mut |batch| {
            done(batch.images.end);
            sink(batch)
        })
    })
}

/// Encodes images in memory.
///
/// # Errors
///
/// As [`encode_files`]; images are named by their index.
pub fn encode_images(
    encoder: &dyn Encoder,
    images: &[RgbImage],
    options: &Options,
) -> Result<Descriptors> {
    collect(encoder, images.len(), |sink| {
        let input = |index: usize| encoder.preprocessing().apply(&images[index]);
        run(encoder, images.len(), options, &input, sink)
    })
}

/// Encodes image files and hands every batch to `sink` in order, as soon as it is ready.
///
/// # Errors
///
/// As [`encode_files`], and what `sink` returns; with `skip_bad`, files that cannot be decoded are
/// listed in [`Encoded::skipped`].
pub fn encode_each(
    encoder: &dyn Encoder,
    paths: &[PathBuf],
    options: &Options,
    sink: &mut dyn FnMut(Encoded) -> Result<()>,
) -> Result<()> {
    let input = |index: usize| file_input(encoder, &paths[index]);
    run(encoder, paths.len(), options, &input, sink)
}

fn file_input(encoder: &dyn Encoder, path: &Path) -> Result<(Vec<f32>, ImageSize)> {
    let image = image::decode(path)?;
    encoder.preprocessing().apply(&image).map_err(|err| match err {
        crate::Error::Core(err) => err.in_file(path).into(),
        other => other,
    })
}

/// The descriptors of all batches that `encode` hands over.
fn collect(
    encoder: &dyn Encoder,
    n_images: usize,
    encode: impl FnOnce(&mut dyn FnMut(Encoded) -> Result<()>) -> Result<()>,
) -> Result<Descriptors> {
    let mut values = Vec::with_capacity(n_images * encoder.dimension());
    encode(&mut |batch| {
        values.extend(batch.rows.iter());
        Ok(())
    })?;
    let rows = Array2::from_shape_vec((n_images, encoder.dimension()), values)
        .map_err(|err| crate::Error::format("descriptors", "shape", err.to_string()))?;
    Ok(Descriptors::new(rows)?)
}

type Input<'a> = dyn Fn(usize) -> Result<(Vec<f32>, ImageSize)> + Sync + 'a;

/// Lets workers take batches in turn; hands them to `sink` in order.
fn run(
    encoder: &dyn Encoder,
    n_images: usize,
    options: &Options,
    input: &Input<'_>,
    sink: &mut dyn FnMut(Encoded) -> Result<()>,
) -> Result<()> {
    if options.batch_size == 0 {
        let reason = "a batch has at least one image";
        let value = "0".to_owned();
        return Err(Error::Parameter { name: "batch_size", value, reason }.into());
    }
    let n_batches = n_images.div_ceil(options.batch_size);
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let n_workers = options.threads.unwrap_or(all).clamp(1, n_batches.max(1));
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::sync_channel(2 * n_workers);
    std::thread::scope(|scope| {
        for _ in 0..n_workers {
            let sender = sender.clone();
            scope.spawn(|| {
                let sender = sender;
                let work = || {
                    loop {
                        let batch = next.fetch_add(1, Ordering::Relaxed);
                        if batch >= n_batches || stop.load(Ordering::Relaxed) {
                            return;
                        }
                        let start = batch * options.batch_size;
                        let images = start..(start + options.batch_size).min(n_images);
                        let result = encode_batch(encoder, images, options.skip_bad, input);
                        if sender.send((batch, result)).is_err() {
                            return;
                        }
                    }
                };
                // A pool of one thread, so that the forward pass does not share processors.
                match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
                    Ok(pool) => pool.install(work),
                    Err(_) => work(),
                }
            });
        }
        drop(sender);
        let result = in_order(&receiver, n_batches, sink);
        stop.store(true, Ordering::Relaxed);
        drop(receiver);
        result
    })
}

/// Hands batches to `sink` in order; stops at the first error, in order.
fn in_order(
    receiver: &mpsc::Receiver<(usize, Result<Encoded>)>,
    n_batches: usize,
    sink: &mut dyn FnMut(Encoded) -> Result<()>,
) -> Result<()> {
    let mut early = BTreeMap::new();
    for wanted in 0..n_batches {
        let encoded = loop {
            if let Some(encoded) = early.remove(&wanted) {
                break encoded;
            }
            let (batch, encoded) = receiver.recv().expect("a worker sends every batch it takes");
            early.insert(batch, encoded);
        };
        sink(encoded?)?;
    }
    Ok(())
}

fn encode_batch(
    encoder: &dyn Encoder,
    images: Range<usize>,
    skip_bad: bool,
    input: &Input<'_>,
) -> Result<Encoded> {
    let (mut kept, mut skipped, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut size = None;
    for index in images.clone() {
        match input(index) {
            Ok((input, input_size)) => {
                if *size.get_or_insert(input_size) != input_size {
                    let what = "images of different sizes in one batch; use batches of one";
                    let area = |size: ImageSize| size.width * size.height;
                    let expected = size.map_or(0, area);
                    return Err(Error::Mismatch { what, expected, actual: area(input_size) }.into());
                }
                values.extend(input);
                kept.push(index);
            }
            Err(err) if skip_bad => skipped.push((index, err)),
            Err(err) => return Err(err),
        }
    }
    let dimension = encoder.dimension();
    let Some(size) = size else {
        let rows = Array2::zeros((0, dimension));
        return Ok(Encoded { images, kept, rows, skipped });
    };
    encoder.accepts(size.height, size.width).map_err(|reason| {
        let value = format!("{}×{}", size.width, size.height);
        crate::Error::format(encoder.name(), value, reason)
    })?;
    let shape = [kept.len(), encoder.preprocessing().n_channels(), size.height, size.width];
    let device = encoder.device();
    let data = read(&device, || {
        let tensor = Tensor::<4>::from_data(TensorData::new(values, shape), &device);
        encoder.forward(tensor)
    })?;
    let values = data
        .try_into_vec::<f32>()
        .map_err(|err| crate::Error::format("descriptors", "type", format!("{err:?}")))?;
    let rows = Array2::from_shape_vec((kept.len(), dimension), values)
        .map_err(|err| crate::Error::format("descriptors", "shape", err.to_string()))?;
    Ok(Encoded { images, kept, rows, skipped })
}
