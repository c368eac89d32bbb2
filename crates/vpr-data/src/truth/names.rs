//! Images by their names, however much of a path a file writes.

use std::collections::HashMap;

use crate::layout::vpr_bench::is_image;

/// Finds images by the end of their path, with or without its extension.
pub(super) struct NameIndex {
    /// `None` where several images end like this.
    of_ending: HashMap<String, Option<usize>>,
}

/// What a name means among the images of one side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// The path of one image is this or ends like it.
    Whole(usize),
    /// The path of one image ends like the end of this.
    End(usize),
    /// Several images are called so.
    Several,
    /// None is.
    None,
}

impl NameIndex {
    pub(super) fn new(names: &[String]) -> Self {
        let mut of_ending: HashMap<String, Option<usize>> = HashMap::new();
        let mut add = |ending: &str, index: usize| {
            of_ending
                .entry(ending.to_owned())
                .and_modify(|known| {
                    if *known != Some(index) {
                        *known = None;
                    }
                })
                .or_insert(Some(index));
        };
        for (index, name) in names.iter().enumerate() {
            let name = normal(name);
            for ending in endings(&name) {
                add(ending, index);
                if let Some(stem) = without_extension(ending) {
                    add(stem, index);
                }
            }
        }
        Self { of_ending }
    }

    /// The image that a file calls `name`.
    pub(super) fn find(&self, name: &str) -> Found {
        let name = normal(name);
        for (at, ending) in endings(&name).enumerate() {
            match self.of_ending.get(ending) {
                Some(Some(index)) if at == 0 => return Found::Whole(*index),
                Some(Some(index)) => return Found::End(*index),
                Some(None) => return Found::Several,
                None => {}
            }
        }
        Found::None
    }
}

/// Forward slashes, and nothing before the first folder.
fn normal(name: &str) -> String {
    let name = name.trim().replace('\\', "/");
    name.trim_start_matches("./").trim_start_matches('/').to_owned()
}

/// A path, then what is left of it without its first folder, and so on to the file's own name.
fn endings(name: &str) -> impl Iterator<Item = &str> {
    let starts = name.match_indices('/').map(|(at, _)| at + 1);
    std::iter::once(0).chain(starts).map(|start| &name[start..]).filter(|it| !it.is_empty())
}

fn without_extension(name: &str) -> Option<&str> {
    if is_image(name.as_ref()) { name.rsplit_once('.').map(|(stem, _)| stem) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_much_of_a_path_as_is_written_must_agree() {
        let names = ["data/db/a/1.jpg", "data/db/b/1.jpg", "data/db/2.png"].map(str::to_owned);
        let index = NameIndex::new(&names);
        for (name, found) in [
            ("data/db/b/1.jpg", Found::Whole(1)),
            ("b/1.jpg", Found::Whole(1)),
            ("b\\1.jpg", Found::Whole(1)),
            ("./a/1", Found::Whole(0)),
            ("/home/me/db/a/1.jpg", Found::End(0)),
            ("1.jpg", Found::Several),
            ("c/1.jpg", Found::Several),
            ("2.png", Found::Whole(2)),
            ("2.jpg", Found::None),
            ("", Found::None),
        ] {
            assert_eq!(index.find(name), found, "{name}");
        }
    }
}
