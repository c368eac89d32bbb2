//! Encodes images straight into a map file; interrupted work goes on where it stopped.

use std::{
    collections::HashMap,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use ndarray::Array2;
use vpr_core::{
    Error, Poses,
    knn::Metric,
    map::{About, Coordinates, GrowingMap, ImageSize, Names, OpenMap, Opening, RowType, merge},
};

use super::{Encoder, Interpolation, Options, Size, encode_each, registry::Matching, stamps};
use crate::Result;

/// The images that a map is made of.
#[derive(Clone, Debug, Default)]
pub struct Images {
    /// Their files.
    pub paths: Vec<PathBuf>,
    /// What they are called in the map, each name once.
    pub names: Vec<String>,
    /// Their poses, if known.
    pub poses: Option<Poses>,
    /// What the numbers of the poses mean.
    pub coordinates: Option<Coordinates>,
}

/// What [`encode_to_map`] did.
#[derive(Debug, Default)]
pub struct Written {
    /// References in the map.
    pub n_rows: usize,
    /// How many of them an earlier, interrupted run had encoded.
    pub n_resumed: usize,
    /// Images that could not be read, with the reason if this run tried them.
    pub skipped: Vec<(String, Option<crate::Error>)>,
}

/// Images per segment: what an interruption costs at most.
const SEGMENT: usize = 256;

/// Encodes images into the map file `target`; `done` is called with the number of images done.
///
/// Until all are encoded, work is kept in the folder `<target>.work`, in segments of 256 images.
/// Called again with the same encoder and images, it goes on behind the last segment. The folder
/// keeps length and time of change of every image: one that was replaced since it was described is
/// refused by name. The map says encoder, digest of its weights, size of the images and
/// interpolation.
///
/// # Errors
///
/// As [`encode_each`]; [`Error::Mismatch`] if names or poses are not as many as images;
/// [`Error::Format`] if the folder is of another encoder, of other images or of images that have
/// changed; [`Error::Io`].
pub fn encode_to_map(
    encoder: &dyn Encoder,
    images: &Images,
    options: &Options,
    row_type: RowType,
    target: &Path,
    done: &mut dyn FnMut(usize),
) -> Result<Written> {
    check(images)?;
    let work = work_folder(target);
    let about = about(encoder, images.coordinates);
    let mut map = GrowingMap::open(&work, row_type, about).map_err(|err| match err {
        Error::Parameter { .. } => {
            let reason = format!("work of another run, delete it or choose another map: {err}");
            Error::format(&work, "folder", reason)
        }
        err => err,
    })?;
    let earlier = earlier(&work, images)?;
    stamps::check(&work, images, earlier.n_tried)?;
    stamps::write(&work, images)?;
    done(earlier.n_tried);
    let mut written = Written { n_resumed: earlier.n_rows, ..Written::default() };
    written.skipped.extend(earlier.skipped.into_iter().map(|name| (name, None)));
    let mut buffer = Buffer { offset: earlier.n_tried, ..Buffer::default() };
    encode_each(encoder, &images.paths[earlier.n_tried..], options, &mut |batch| {
        let skipped = batch
            .skipped
            .into_iter()
            .map(|(index, err)| (images.names[earlier.n_tried + index].clone(), Some(err)));
        written.skipped.extend(skipped);
        buffer.kept.extend(batch.kept.iter().map(|index| buffer.offset + index));
        buffer.values.extend(batch.rows.iter());
        if buffer.kept.len() >= SEGMENT {
            buffer.flush(&mut map, images, encoder.dimension())?;
        }
        done(earlier.n_tried + batch.images.end);
        Ok(())
    })?;
    buffer.flush(&mut map, images, encoder.dimension())?;
    if map.is_empty() {
        return Err(Error::Empty("images that could be encoded").into());
    }
    drop(map);
    let maps = [OpenMap::open(&work, Opening::default())?];
    written.n_rows = merge(&maps, target)?;
    drop(maps);
    fs::remove_dir_all(&work).map_err(Error::io(&work))?;
    Ok(written)
}

/// Rows that wait for their segment to be full.
#[derive(Default)]
struct Buffer {
    offset: usize,
    kept: Vec<usize>,
    values: Vec<f32>,
}

impl Buffer {
    fn flush(&mut self, map: &mut GrowingMap, images: &Images, dim: usize) -> Result<()> {
        if self.kept.is_empty() {
            return Ok(());
        }
        let values = std::mem::take(&mut self.values);
        let rows = Array2::from_shape_vec((self.kept.len(), dim), values)
            .map_err(|err| crate::Error::format("descriptors", "shape", err.to_string()))?;
        let mut names = Names::default();
        self.kept.iter().for_each(|&index| names.push(&images.names[index]));
        let poses = images.poses.as_ref().map(|poses| poses.select(&self.kept));
        map.append(rows.view(), poses.as_ref(), Some(&names))?;
        self.kept.clear();
        Ok(())
    }
}

/// What an earlier run has done.
#[derive(Default)]
struct Earlier {
    n_rows: usize,
    /// Images up to the last one that is in the map.
    n_tried: usize,
    skipped: Vec<String>,
}

fn earlier(work: &Path, images: &Images) -> Result<Earlier> {
    let map = OpenMap::open(work, Opening::default());
    // A growing map without segments has nothing to open.
    let Ok(map) = map else { return Ok(Earlier::default()) };
    let names = map.names()?.unwrap_or_default();
    let mut earlier = Earlier { n_rows: names.len(), ..Earlier::default() };
    let index_of: HashMap<&str, usize> = images.names.iter().map(String::as_str).zip(0..).collect();
    for name in names.iter() {
        match index_of.get(name) {
            Some(&index) if index >= earlier.n_tried => {
                earlier.skipped.extend_from_slice(&images.names[earlier.n_tried..index]);
                earlier.n_tried = index + 1;
            }
            _ => {
                let reason = "work on other images, delete it or choose another map";
                return Err(crate::Error::format(work, format!("`{name}`"), reason));
            }
        }
    }
    Ok(earlier)
}

fn check(images: &Images) -> Result<()> {
    let expected = images.paths.len();
    let poses = images.poses.as_ref().map_or(expected, Poses::len);
    for (what, actual) in [("names of images", images.names.len()), ("poses of images", poses)] {
        if actual != expected {
            return Err(Error::Mismatch { what, expected, actual }.into());
        }
    }
    if expected == 0 { Err(Error::Empty("images to encode").into()) } else { Ok(()) }
}

fn work_folder(target: &Path) -> PathBuf {
    let mut name: OsString = target.file_name().unwrap_or_default().to_owned();
    name.push(".work");
    target.with_file_name(name)
}

/// What the map says about itself.
fn about(encoder: &dyn Encoder, coordinates: Option<Coordinates>) -> About {
    let preprocessing = encoder.preprocessing();
    let image_size = match preprocessing.size {
        Size::Fixed { height, width } => u32::try_from(width)
            .ok()
            .zip(u32::try_from(height).ok())
            .map(|(width, height)| ImageSize { width, height }),
        Size::ShorterSide(_) | Size::Native | Size::NativeMultipleOf(_) => None,
    };
    let filter = match preprocessing.interpolation {
        Interpolation::BilinearOpenCv => "bilinear, OpenCV",
        Interpolation::BicubicOpenCv => "bicubic, OpenCV",
        Interpolation::Bilinear => "bilinear, antialiased",
        Interpolation::Bicubic => "bicubic, antialiased",
        Interpolation::Nearest => "nearest",
    };
    let order = if preprocessing.resize_after_normalize { ", after normalisation" } else { "" };
    About {
        encoder: Some(encoder.name().to_owned()),
        weights_digest: encoder.weights_digest().map(str::to_owned),
        image_size,
        interpolation: Some(format!("{filter}{order}")),
        metric: Some(match encoder.matching() {
            Matching::Euclidean => Metric::Euclidean,
            Matching::L1 => Metric::Manhattan,
        }),
        coordinates,
    }
}
