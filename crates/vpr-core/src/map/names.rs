//! The names of a map's images, in one piece of memory.

use std::collections::HashMap;

use crate::{Error, Result};

/// Image names, one per row of a map.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    text: String,
    ends: Vec<usize>,
}

impl Names {
    /// Number of names.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no name.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Adds the name of one more image.
    pub fn push(&mut self, name: &str) {
        self.text.push_str(name);
        self.ends.push(self.text.len());
    }

    /// The name of one image, if there are so many.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&str> {
        let end = *self.ends.get(index)?;
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        self.text.get(start..end)
    }

    /// All names in order.
    #[must_use]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &str> {
        (0..self.len()).map(|index| self.get(index).unwrap_or_default())
    }

    /// The names as one text and, for `n` names, `n + 1` offsets in bytes from 0 to its length.
    #[must_use]
    pub fn to_parts(&self) -> (&str, Vec<i64>) {
        let ends = self.ends.iter().map(|&end| i64::try_from(end).unwrap_or(i64::MAX));
        (&self.text, std::iter::once(0).chain(ends).collect())
    }

    /// Takes the names out of one text and its offsets.
    ///
    /// # Errors
    ///
    /// What is wrong with the text or the offsets.
    pub fn from_parts(text: Vec<u8>, offsets: &[i64]) -> Result<Self, String> {
        let text = String::from_utf8(text).map_err(|err| format!("names are no UTF-8: {err}"))?;
        let mut ends = Vec::with_capacity(offsets.len().saturating_sub(1));
        let mut start = 0;
        for (index, &offset) in offsets.iter().enumerate() {
            match usize::try_from(offset).ok() {
                Some(end) if end >= start && text.is_char_boundary(end) => start = end,
                _ => {
                    let len = text.len();
                    return Err(format!("offset {index} is {offset}, in {len} bytes of names"));
                }
            }
            if index == 0 && start != 0 {
                return Err(format!("the first offset is {start}, not 0"));
            }
            if index > 0 {
                ends.push(start);
            }
        }
        if start != text.len() {
            return Err(format!("names end at byte {start} of {}", text.len()));
        }
        Ok(Self { text, ends })
    }

    /// The first name that two images have, and the first two rows it stands in.
    #[must_use]
    pub fn repeated(&self) -> Option<(&str, [usize; 2])> {
        let mut row_of = HashMap::with_capacity(self.len());
        self.iter().zip(0..).find_map(|(name, row)| {
            let first = row_of.insert(name, row)?;
            Some((name, [first, row]))
        })
    }

    /// Checks that there are as many names as rows.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if not.
    pub fn check_len(&self, n_rows: usize) -> Result<()> {
        if self.len() == n_rows {
            Ok(())
        } else {
            let what = "image names, one per descriptor";
            Err(Error::Mismatch { what, expected: n_rows, actual: self.len() })
        }
    }
}

impl<S: AsRef<str>> FromIterator<S> for Names {
    fn from_iter<I: IntoIterator<Item = S>>(iter: I) -> Self {
        let mut names = Self::default();
        iter.into_iter().for_each(|name| names.push(name.as_ref()));
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_give_the_names_back() {
        let names: Names = ["a.jpg", "", "straße.png"].into_iter().collect();
        let (text, offsets) = names.to_parts();
        assert_eq!(offsets, [0, 5, 5, 16]);
        let back = Names::from_parts(text.as_bytes().to_vec(), &offsets).unwrap();
        assert_eq!(back, names);
        assert_eq!(back.get(2), Some("straße.png"));
    }

    #[test]
    fn a_repeated_name_is_found_with_its_rows() {
        let names = |names: &[&str]| names.iter().collect::<Names>();
        assert_eq!(names(&["a", "b", "c", "b", "a"]).repeated(), Some(("b", [1, 3])));
        assert_eq!(names(&["a", "A", "ab"]).repeated(), None);
    }

    #[test]
    fn wrong_offsets_are_named() {
        let wrong = |offsets: &[i64]| Names::from_parts(b"abc".to_vec(), offsets).unwrap_err();
        assert_eq!(wrong(&[0, 2, 1, 3]), "offset 2 is 1, in 3 bytes of names");
        assert_eq!(wrong(&[0, -1, 3]), "offset 1 is -1, in 3 bytes of names");
        assert_eq!(wrong(&[0, 4]), "offset 1 is 4, in 3 bytes of names");
        assert_eq!(wrong(&[1, 3]), "the first offset is 1, not 0");
        assert_eq!(wrong(&[0, 2]), "names end at byte 2 of 3");
    }
}
