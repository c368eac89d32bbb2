//! Nuisance dials: a world at rising numbers of its recipe.

use std::collections::BTreeMap;

use serde::Deserialize;
use vpr_core::{Error, Result};

/// A number of a recipe, or several that are one nuisance, turned up.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dial {
    /// What the page calls it, unit included.
    pub name: String,
    /// World at which it is turned, with the settings that stay.
    pub world: String,
    /// The recipe's keys, which all get the same value.
    pub keys: Vec<String>,
    /// Their values, rising.
    pub values: Vec<f64>,
    /// Keys that go with them, with their own value for each of those.
    #[serde(default)]
    pub beside: BTreeMap<String, Vec<f64>>,
}

impl Dial {
    /// The world at every value.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if a key beside has not one value for each of the dial's.
    pub fn worlds(&self) -> Result<Vec<String>> {
        if let Some((key, own)) = self.beside.iter().find(|(_, it)| it.len() != self.values.len()) {
            return Err(Error::Parameter {
                name: "beside",
                value: format!("{} values of `{key}` in dial `{}`", own.len(), self.name),
                reason: "must be as many as the dial has",
            });
        }
        Ok((0..self.values.len()).map(|index| self.at(index)).collect())
    }

    fn at(&self, index: usize) -> String {
        let joint = if self.world.contains('?') { '&' } else { '?' };
        let shared = self.keys.iter().map(|key| (key, self.values[index]));
        let own = self.beside.iter().map(|(key, values)| (key, values[index]));
        let settings: Vec<String> =
            shared.chain(own).map(|(key, value)| format!("{key}={value:?}")).collect();
        format!("{}{joint}{}", self.world, settings.join("&"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dial_names_the_world_it_turns() {
        let mut dial = Dial {
            name: "darkness".into(),
            world: "world/street".into(),
            keys: vec!["queries.condition.darkness".into()],
            values: vec![0.25, 1.0],
            beside: BTreeMap::new(),
        };
        assert_eq!(
            dial.worlds().unwrap(),
            [0.25, 1.0].map(|it| format!("world/street?queries.condition.darkness={it:?}"))
        );
        dial.world += "?places=9";
        dial.keys = vec!["a".into(), "b".into()];
        dial.beside = [("c".to_owned(), vec![9.0, 8.0])].into();
        assert_eq!(
            dial.worlds().unwrap(),
            [
                "world/street?places=9&a=0.25&b=0.25&c=9.0",
                "world/street?places=9&a=1.0&b=1.0&c=8.0"
            ]
        );
        dial.beside = [("c".to_owned(), vec![9.0])].into();
        let error = dial.worlds().unwrap_err().to_string();
        assert!(error.contains("darkness") && error.contains("`c`"), "{error}");
    }
}
