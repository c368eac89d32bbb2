//! Things that several families build with: houses, trees, cars, people, lamps, furniture.

mod house;
mod street_things;
mod tree;

pub(crate) use house::{Lot, Style, house};
pub(crate) use street_things::{StreetKit, hide_behind};
pub(crate) use tree::{Grove, Species};
