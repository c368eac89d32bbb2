//! Keys of a recipe set from outside: paths of keys and values as TOML writes them.

use std::path::Path;

use vpr_core::Error;

use super::Recipe;

impl Recipe {
    /// Reads a recipe and sets some of its keys; `path` is for messages.
    ///
    /// # Errors
    ///
    /// Those of [`Self::parse`]; [`Error::Format`] names a key whose value is not TOML or which
    /// does not lie in a table.
    pub(crate) fn parse_with(
        text: &str,
        path: &Path,
        settings: &[(&str, &str)],
    ) -> vpr_core::Result<Self> {
        if settings.is_empty() {
            return Self::parse(text, path);
        }
        let malformed = |place: &str, reason: &str| Error::format(path, place, reason);
        let mut root: toml::Table =
            toml::from_str(text).map_err(|cause| malformed("recipe", cause.message()))?;
        for (key, value) in settings {
            let parsed: toml::Table = toml::from_str(&format!("value = {value}"))
                .map_err(|cause| malformed(key, cause.message()))?;
            let mut parts: Vec<&str> = key.split('.').collect();
            let last = parts.pop().unwrap_or_default();
            let mut table = &mut root;
            for part in parts {
                let entry =
                    table.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
                table = entry.as_table_mut().ok_or_else(|| malformed(key, "is not in a table"))?;
            }
            table.insert(last.to_owned(), parsed["value"].clone());
        }
        let text =
            toml::to_string(&root).map_err(|cause| malformed("recipe", &cause.to_string()))?;
        Self::parse(&text, path)
    }
}
