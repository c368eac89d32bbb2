//! Results that are kept on disk: one key, one cache.

use std::{
    fs,
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use vpr_core::{
    Descriptors, Error, Result,
    map::{About, MapWriter, OpenMap, Opening, RowType, image_list_digest},
};
use vpr_files::npy;

/// A folder of descriptors and inlier counts, each under a digest of all that it depends on.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// The store in this folder, which is made when something is kept.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// Digest of a method and the images it was applied to: their number, paths, lengths and times
    /// of change, in order; and of the versions of what computes it.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] for an image that is not there.
    pub fn key<'a>(method: &str, sides: impl IntoIterator<Item = &'a [PathBuf]>) -> Result<String> {
        #[cfg(feature = "networks")]
        let nets = vpr_nets::NUMERICS;
        #[cfg(not(feature = "networks"))]
        let nets = "none";
        let versions = format!("nets {nets} vision {}", vpr_vision::NUMERICS);
        let mut lines = vec![method.to_owned(), versions];
        for side in sides {
            lines.push(format!("{} images", side.len()));
            for path in side {
                let metadata = fs::metadata(path).map_err(Error::io(path))?;
                let changed = metadata.modified().map_err(Error::io(path))?;
                let nanos = changed.duration_since(UNIX_EPOCH).map_or(0, |it| it.as_nanos());
                lines.push(format!("{} {} {nanos}", path.display(), metadata.len()));
            }
        }
        let digest = image_list_digest(&lines);
        let hex = digest.strip_prefix("sha256:").unwrap_or(&digest);
        Ok(hex.chars().take(32).collect())
    }

    /// Descriptors under a key, or those that `make` gives, which are then kept.
    ///
    /// # Errors
    ///
    /// Those of `make`; [`Error::Io`] if the folder cannot be written.
    pub fn descriptors(
        &self,
        key: &str,
        about: &About,
        make: impl FnOnce() -> Result<Descriptors>,
    ) -> Result<Descriptors> {
        let path = self.path("descriptors", &format!("{key}.safetensors"))?;
        // What is not whole is not believed, whatever is wrong with it: it is made again.
        if let Ok(kept) = OpenMap::open(&path, Opening::default()).and_then(|map| map.descriptors())
        {
            return Ok(kept);
        }
        let descriptors = make()?;
        let dim = descriptors.dim();
        let mut writer = MapWriter::create(&path, dim, RowType::F32, about.clone())?;
        writer.append(descriptors.view(), None, None)?;
        writer.finish()?;
        Ok(descriptors)
    }

    /// Counts under a key, `n` of them, or those that `make` gives, which are then kept.
    ///
    /// # Errors
    ///
    /// Those of `make`; [`Error::Io`] if the folder cannot be written.
    pub fn counts(
        &self,
        key: &str,
        n: usize,
        make: impl FnOnce() -> Result<Vec<usize>>,
    ) -> Result<Vec<usize>> {
        let path = self.path("inliers", &format!("{key}.npy"))?;
        if let Some(kept) = kept_counts(&path, n) {
            return Ok(kept);
        }
        let counts = make()?;
        let stored: Vec<i64> =
            counts.iter().map(|&count| i64::try_from(count).unwrap_or(i64::MAX)).collect();
        npy::write_i64(&path, &stored)?;
        Ok(counts)
    }

    fn path(&self, kind: &str, file: &str) -> Result<PathBuf> {
        let folder = self.folder.join(kind);
        fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
        Ok(folder.join(file))
    }
}

/// Counts as they were kept, if there are as many as asked for and all make sense.
fn kept_counts(path: &Path, n: usize) -> Option<Vec<usize>> {
    let stored = npy::read_i64(path).ok().filter(|stored| stored.len() == n)?;
    stored.iter().map(|&count| usize::try_from(count).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_tells_lists_that_share_their_first_images_apart() {
        let folder = tempfile::tempdir().unwrap();
        let images: Vec<PathBuf> =
            ["a", "b", "c"].map(|name| folder.path().join(name)).into_iter().collect();
        for path in &images {
            fs::write(path, b"x").unwrap();
        }
        let key = |method: &str, queries: &[PathBuf], references: &[PathBuf]| {
            Store::key(method, [queries, references]).unwrap()
        };
        let first = key("m", &images[..1], &images[1..]);
        assert_eq!(first, key("m", &images[..1], &images[1..]));
        assert_ne!(first, key("m", &images[..1], &images[1..2]));
        assert_ne!(first, key("m", &images[..2], &images[2..]));
        assert_ne!(first, key("other", &images[..1], &images[1..]));
        fs::write(&images[2], b"another picture").unwrap();
        assert_ne!(first, key("m", &images[..1], &images[1..]));
        let gone = [folder.path().join("gone")];
        assert!(Store::key("m", [&gone[..]]).unwrap_err().to_string().contains("gone"));
    }

    #[test]
    fn a_damaged_file_is_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        let counts = |made: usize| store.counts("k", 2, || Ok(vec![made; 2])).unwrap();
        assert_eq!(counts(3), [3, 3]);
        assert_eq!(counts(4), [3, 3]);
        let path = folder.path().join("inliers/k.npy");
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        assert_eq!(counts(5), [5, 5]);
    }
}
