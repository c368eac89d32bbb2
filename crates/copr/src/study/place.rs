//! A street or an escalator that is passed twice, side by side.

use serde::Deserialize;

/// A generated place whose map is made denser to the side.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Column in tables.
    pub name: String,
    /// What the weights of its H are called after.
    pub key: String,
    /// The generated dataset.
    pub world: String,
    /// What describes its images.
    pub encoder: String,
    /// Where the targets are.
    pub targets: Aside,
    /// Other generated places of its kind, which its H learns from; it is validated on the last.
    #[serde(default)]
    pub learn: Vec<String>,
}

/// Where targets lie beside a route.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Aside {
    /// Every image moved by these metres in its camera's axes: to the right, down, ahead.
    Lane([f64; 3]),
    /// The further views that the recipe renders, whose true images are a row of their own.
    Views {},
}
