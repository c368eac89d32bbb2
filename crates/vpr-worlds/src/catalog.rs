//! The recipes that ship with the crate, by name.

use std::path::Path;

use vpr_core::Error;

use crate::recipe::Recipe;

macro_rules! embedded {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../recipes/", $name, ".toml")))),*]
    };
}

/// Name and text of every recipe.
const RECIPES: [(&str, &str); N_RECIPES] = embedded![
    "street",
    "street-aliased",
    "street-night",
    "street-snow",
    "street-fog",
    "street-grey",
    "street-new-places",
    "street-pittsburgh",
    "street-san-francisco",
    "street-st-lucia",
    "street-eynsham",
    "street-msls",
    "rail-nordland",
    "street-tokyo",
    "street-seasons",
    "street-holidays",
    "train-city",
    "rail",
    "campus",
    "campus-dusk",
    "campus-essex",
    "campus-fog",
    "corridor",
    "rooms",
    "living-room",
    "escalator",
    "shop-facade",
    "archive",
    "light-stage",
    "light-stage-viewpoints",
    "light-stage-lights",
    "multi-lane",
    "multi-illumination",
    "seven-scenes-chess",
    "seven-scenes-fire",
    "seven-scenes-heads",
    "seven-scenes-office",
    "seven-scenes-pumpkin",
    "seven-scenes-redkitchen",
    "seven-scenes-stairs",
];
const N_RECIPES: usize = 40;

/// Names of the recipes that ship with this crate, without `world/`.
#[must_use]
pub fn names() -> Vec<&'static str> {
    RECIPES.iter().map(|(name, _)| *name).collect()
}

/// The recipe called `name`, with or without `world/` before it.
///
/// # Errors
///
/// [`Error::Unknown`] with all names.
pub fn recipe(name: &str) -> vpr_core::Result<Recipe> {
    recipe_with(name, &[])
}

/// The recipe called `name` with some keys set, as `("queries.condition.darkness", "0.5")`: a path
/// of keys and a value as TOML writes it.
///
/// # Errors
///
/// [`Error::Unknown`] with all names; [`Error::Format`] for a key that does not exist or a value
/// out of its range.
pub fn recipe_with(name: &str, settings: &[(&str, &str)]) -> vpr_core::Result<Recipe> {
    let short = name.strip_prefix("world/").unwrap_or(name);
    let Some((_, text)) = RECIPES.iter().find(|(known, _)| *known == short) else {
        let known = names().join(", ");
        return Err(Error::Unknown { kind: "world", name: name.to_owned(), known });
    };
    let path = format!("world/{short}");
    Recipe::parse_with(text, Path::new(&path), settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_recipe_is_valid_and_named_like_its_file() {
        for name in names() {
            let recipe = recipe(name).unwrap_or_else(|err| panic!("{err}"));
            assert_eq!(recipe.name, name);
            assert!(!recipe.counterpart.is_empty());
        }
    }

    #[test]
    fn nonsense_is_refused_with_the_name_of_the_key() {
        for (key, value) in [
            ("places", "-3"),
            ("places", "1000000000"),
            ("camera.width", "0"),
            ("queries.condition.darkness", "1.5"),
            ("queries.condition.snow", "nan"),
            ("street.spacing_m", "-1.0"),
            ("street.avenus", "2"),
            ("queries.conditions.snow", "1"),
        ] {
            let err = recipe_with("street", &[(key, value)]).unwrap_err().to_string();
            let last = key
                .rsplit('.')
                .find(|part| !["snow"].contains(part) || key.contains("condition."))
                .unwrap();
            assert!(err.contains(last), "{key} = {value}: {err}");
        }
        let frames = [("tolerance", "{ frames = 1 }")];
        let err = recipe_with("street", &frames).unwrap_err().to_string();
        assert!(err.contains("tolerance.frames"), "{err}");
        let err = recipe_with("street", &[("rail.woods", "0.5")]).unwrap_err().to_string();
        assert!(err.contains("2 families"), "{err}");
        assert!(recipe("strete").unwrap_err().to_string().contains("known: street,"));
    }

    #[test]
    fn a_set_key_is_the_only_one_that_changes() {
        let plain = recipe("street").unwrap();
        let mut dark =
            recipe_with("world/street", &[("queries.condition.darkness", "0.7")]).unwrap();
        assert!((dark.queries.condition.darkness - 0.7).abs() < 1e-12);
        dark.queries.condition.darkness = plain.queries.condition.darkness;
        assert_eq!(plain, dark);
    }
}
