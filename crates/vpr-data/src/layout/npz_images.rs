//! Two traverses as `uint8` arrays `n × height × width` in one archive, aligned by index: `summer`,
//! the map, and `winter`, the queries (Nordland 64×32).

use std::{fs, num::NonZeroUsize, path::Path};

use ndarray::{Array3, ArrayView2, Axis};

use vpr_core::{Error, Result};
use vpr_files::npy::npz;

/// Array of the map's images.
const REFERENCES: &str = "summer";
/// Array of the queries' images.
const QUERIES: &str = "winter";
/// Frames with a smaller standard deviation of grey levels are near-black: tunnels, credits.
const MIN_DEVIATION: f64 = 8.0;

/// The frames of two traverses, grey.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePairs {
    /// Index of every frame in the archive, ascending.
    pub frames: Vec<usize>,
    /// The map, `n × height × width`.
    pub references: Array3<u8>,
    /// The queries, `n × height × width`.
    pub queries: Array3<u8>,
}

impl FramePairs {
    /// The frames that are not near-black in either traverse, from the one archive in `folder`.
    ///
    /// `stretch` keeps the first of these up to, not including, the second, counted after the
    /// near-black ones are left out; `every` keeps one of this many of the rest.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] or [`Error::Format`] if there is not one archive, an array is missing or of
    /// another type, the two differ in shape, or the stretch ends past the frames.
    pub fn read(
        folder: &Path,
        stretch: Option<(usize, usize)>,
        every: Option<NonZeroUsize>,
    ) -> Result<Self> {
        let path = archive(folder)?;
        let references: Array3<u8> = npz::read(&path, REFERENCES)?;
        let queries: Array3<u8> = npz::read(&path, QUERIES)?;
        if references.dim() != queries.dim() {
            let reason = format!("{:?}, but {REFERENCES} is {:?}", queries.dim(), references.dim());
            return Err(Error::format(path, QUERIES, reason));
        }
        let is_bright = |frame: &usize| {
            [&references, &queries]
                .iter()
                .all(|array| deviation(array.index_axis(Axis(0), *frame)) >= MIN_DEVIATION)
        };
        let mut frames: Vec<usize> = (0..references.dim().0).filter(is_bright).collect();
        if let Some((first, end)) = stretch {
            if first >= end || end > frames.len() {
                let reason = format!("{first} to {end} is not within {} frames", frames.len());
                return Err(Error::format(path, "frames", reason));
            }
            frames = frames[first..end].to_vec();
        }
        frames = frames.into_iter().step_by(every.map_or(1, NonZeroUsize::get)).collect();
        let references = references.select(Axis(0), &frames);
        let queries = queries.select(Axis(0), &frames);
        Ok(Self { frames, references, queries })
    }
}

fn archive(folder: &Path) -> Result<std::path::PathBuf> {
    let mut archives: Vec<_> = fs::read_dir(folder)
        .map_err(Error::io(folder))?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "npz"))
        .collect();
    match (archives.pop(), archives.is_empty()) {
        (Some(path), true) => Ok(path),
        _ => Err(Error::format(folder, "archive", "does not have exactly one .npz file")),
    }
}

/// Standard deviation of the grey levels.
fn deviation(image: ArrayView2<'_, u8>) -> f64 {
    let n = image.len().max(1) as f64;
    let mean = image.iter().map(|&level| f64::from(level)).sum::<f64>() / n;
    let square = image.iter().map(|&level| (f64::from(level) - mean).powi(2)).sum::<f64>() / n;
    square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, arrays: &[(&str, Array3<u8>)]) {
        let file = fs::File::create(folder.join("frames.npz")).unwrap();
        let mut archive = npz::Writer::new(file);
        for (name, array) in arrays {
            let levels = array.iter().map(|&level| [level]);
            archive.add(name, "|u1", array.shape(), levels).unwrap();
        }
        archive.finish().unwrap();
    }

    /// Five frames of a checkerboard; `dark` ones are black.
    fn traverse(dark: &[usize]) -> Array3<u8> {
        Array3::from_shape_fn((5, 2, 4), |(frame, row, column)| {
            if dark.contains(&frame) || (row + column) % 2 == 0 {
                0
            } else {
                u8::try_from(100 + frame).unwrap()
            }
        })
    }

    #[test]
    fn frames_that_are_dark_in_either_traverse_are_left_out_of_both() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &[("summer", traverse(&[1])), ("winter", traverse(&[3]))]);
        let pairs = FramePairs::read(folder.path(), None, None).unwrap();
        assert_eq!(pairs.frames, [0, 2, 4]);
        assert_eq!(pairs.references[[1, 0, 1]], 102);
        assert_eq!(pairs.references, pairs.queries);
        let pairs = FramePairs::read(folder.path(), Some((1, 3)), None).unwrap();
        assert_eq!(pairs.frames, [2, 4]);
        let pairs = FramePairs::read(folder.path(), None, NonZeroUsize::new(2)).unwrap();
        assert_eq!(pairs.frames, [0, 4]);
        let err = FramePairs::read(folder.path(), Some((1, 4)), None).unwrap_err().to_string();
        assert!(err.contains("not within 3 frames"), "{err}");
    }

    #[test]
    fn a_missing_array_and_another_shape_are_named() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &[("summer", traverse(&[]))]);
        assert!(
            FramePairs::read(folder.path(), None, None).unwrap_err().to_string().contains("winter")
        );
        let shorter = traverse(&[]).slice_move(ndarray::s![..4, .., ..]);
        write(
            folder.path(),
            &[("summer", traverse(&[])), ("winter", shorter.as_standard_layout().to_owned())],
        );
        assert!(
            FramePairs::read(folder.path(), None, None).unwrap_err().to_string().contains("winter")
        );
        assert!(FramePairs::read(Path::new("/nowhere"), None, None).is_err());
    }
}
