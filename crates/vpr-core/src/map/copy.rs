//! Copying maps on disk: several into one, or one into other row types.

use std::path::Path;

use ndarray::ArrayView2;

use super::{MapFile, MapWriter, OpenMap, RowType, layout};
use crate::{Error, Result, knn::RowSource as _};

/// Writes several maps, one after the other, as one file; rows are copied as they are stored.
///
/// Needs memory for one block of rows and for what is small per image. Returns the number of rows.
///
/// # Errors
///
/// Those of [`MapWriter`], [`Error::Parameter`] if the maps differ in row type, encoder, metric or
/// coordinate system.
pub fn merge(maps: &[OpenMap], target: &Path) -> Result<usize> {
    let first = maps.first().ok_or(Error::Empty("maps to merge"))?;
    let files: Vec<&MapFile> = maps.iter().flat_map(OpenMap::segments).collect();
    for file in &files {
        let same = file.row_type() == first.row_type() && *file.about() == *first.about();
        if !same {
            return Err(Error::Parameter {
                name: "maps",
                value: file.path().display().to_string(),
                reason: "must have the row type and the description of the first",
            });
        }
    }
    let about = first.about().clone();
    let mut writer = MapWriter::create(target, first.dim(), first.row_type(), about)?;
    for file in files {
        let (poses, names) = (file.poses()?, file.names()?);
        writer.begin(file.len(), poses.as_ref(), names.as_ref())?;
        // Anchors are rows of their own file.
        writer.add_origins(file.origins()?.as_ref(), file.len(), writer.len())?;
        let per_block = layout::rows_per_block(file.dim() * file.row_type().size());
        for start in (0..file.len()).step_by(per_block) {
            let rows = start..(start + per_block).min(file.len());
            file.with_stored(rows, |bytes, scales| writer.push_stored(bytes, scales))?;
        }
    }
    let n_rows = writer.len();
    writer.finish()?;
    Ok(n_rows)
}

/// Writes a map as one file with rows stored in another way; returns the number of rows.
///
/// Needs memory for one block of rows and for what is small per image.
///
/// # Errors
///
/// Those of [`MapWriter`] and of reading the map.
///
/// # Panics
///
/// Never: blocks are whole rows.
pub fn copy_as(map: &OpenMap, row_type: RowType, target: &Path) -> Result<usize> {
    let mut writer = MapWriter::create(target, map.dim(), row_type, map.about().clone())?;
    writer.begin(map.len(), map.poses()?.as_ref(), map.names()?.as_ref())?;
    writer.add_origins(map.origins()?.as_ref(), map.len(), 0)?;
    let per_block = layout::rows_per_block(map.dim() * RowType::F32.size());
    let mut scratch = Vec::new();
    for start in (0..map.len()).step_by(per_block) {
        let rows = start..(start + per_block).min(map.len());
        let shape = (rows.len(), map.dim());
        let values = map.block(rows, &mut scratch)?;
        let values = ArrayView2::from_shape(shape, values).expect("a block of whole rows");
        writer.push_rows(values)?;
    }
    writer.finish()?;
    Ok(map.len())
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::map::{About, Opening};

    #[test]
    fn halves_come_back_as_the_same_halves() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let mut writer = MapWriter::create(&path("a"), 3, RowType::F32, About::default()).unwrap();
        let rows = Array2::from_shape_fn((9, 3), |(row, column)| (row * 3 + column) as f32 * 0.1);
        writer.append(rows.view(), None, None).unwrap();
        writer.finish().unwrap();
        let open = |name: &str| OpenMap::open(&path(name), Opening::default()).unwrap();
        assert_eq!(copy_as(&open("a"), RowType::F16, &path("b")).unwrap(), 9);
        copy_as(&open("b"), RowType::F32, &path("c")).unwrap();
        assert_eq!(open("b").descriptors().unwrap(), open("c").descriptors().unwrap());
        let error = &open("c").descriptors().unwrap().into_inner() - &rows;
        assert!(error.iter().all(|error| error.abs() < 1.5e-3), "{error}");
    }
}
