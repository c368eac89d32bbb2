//! What is said of numbers that were not f32 in their file.

use std::path::Path;

/// What is said of descriptors of this type, by `NumPy`'s name, which are f32 here; `None` where
/// nothing is lost by that.
pub(super) fn note(path: &Path, what: Option<&str>, stored: &str) -> Option<String> {
    let is_kept = matches!(
        stored,
        "float32" | "float16" | "bfloat16" | "int8" | "uint8" | "int16" | "uint16"
    );
    let what = what.map_or_else(|| "descriptors".to_owned(), |name| format!("`{name}`"));
    (!is_kept).then(|| format!("{}: {what} are {stored}, rounded to float32", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_lost_is_said() {
        let note = |stored| note(Path::new("a.npy"), None, stored);
        assert_eq!(note("float16"), None);
        assert_eq!(note("float64").unwrap(), "a.npy: descriptors are float64, rounded to float32");
    }
}
