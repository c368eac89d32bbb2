//! What map files say of the lengths of their rows.

use super::{MapFile, OpenMap, layout};
use crate::{Error, Result, knn::RowLengths};

impl MapFile {
    /// The lengths of the shortest and the longest row, as they were given to the writer; `None`
    /// without a row, and in files of writers that did not say.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if what is said cannot be understood.
    pub fn row_lengths(&self) -> Result<Option<RowLengths>> {
        let said = self.header().metadata.get(layout::ROW_LENGTHS);
        let place = || format!("metadata `{}`", layout::ROW_LENGTHS);
        said.map(|text| text.parse())
            .transpose()
            .map_err(|reason: String| Error::format(self.path(), place(), reason))
    }
}

impl OpenMap {
    /// The lengths of the shortest and the longest row of all segments; `None` if one does not say.
    ///
    /// # Errors
    ///
    /// Those of [`MapFile::row_lengths`].
    pub fn row_lengths(&self) -> Result<Option<RowLengths>> {
        let mut all = None;
        for file in self.segments().iter().filter(|it| !it.is_empty()) {
            match file.row_lengths()? {
                None => return Ok(None),
                some => all = RowLengths::and(all, some),
            }
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;
    use crate::map::{About, GrowingMap, MapWriter, Opening, RowType, copy_as, merge};

    #[test]
    fn every_writer_says_how_long_its_rows_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let open = |name: &str| OpenMap::open(&path(name), Opening::default()).unwrap();
        let unit = array![[1.0_f32, 0.0], [0.6, 0.8]];
        let long = array![[3.0_f32, 4.0], [0.0, 2.0]];
        let write = |name: &str, rows: &Array2<f32>, row_type| {
            let mut writer = MapWriter::create(&path(name), 2, row_type, About::default()).unwrap();
            writer.append(rows.view(), None, None).unwrap();
            writer.finish().unwrap();
        };
        write("long", &long, RowType::F32);
        let lengths = open("long").row_lengths().unwrap();
        assert_eq!(lengths, Some(RowLengths { shortest: 2.0, longest: 5.0 }));
        for (name, row_type) in [("f32", RowType::F32), ("f16", RowType::F16), ("i8", RowType::I8)]
        {
            write(name, &unit, row_type);
            assert!(open(name).row_lengths().unwrap().unwrap().is_unit(), "{name}");
        }
        merge(&[open("long"), open("f32")], &path("merged")).unwrap();
        let merged = open("merged").row_lengths().unwrap().unwrap();
        assert!(merged.shortest < 1.001 && merged.longest == 5.0, "{merged}");
        copy_as(&open("merged"), RowType::F16, &path("copied")).unwrap();
        assert_eq!(open("copied").row_lengths().unwrap().unwrap().longest, 5.0);
        let mut growing = GrowingMap::open(&path("grown"), RowType::F32, About::default()).unwrap();
        growing.append(long.view(), None, None).unwrap();
        growing.append(unit.view(), None, None).unwrap();
        drop(growing);
        assert_eq!(open("grown").row_lengths().unwrap().unwrap().longest, 5.0);
    }
}
