//! Things that several families build with: houses, trees, cars, people, lamps, furniture, toys.

mod furniture;
mod house;
mod street_things;
mod toys;
mod tree;

pub(crate) use furniture::{Furnisher, Room, shell};
pub(crate) use house::{Lot, Style, house};
pub(crate) use street_things::{INDOORS, OUTDOORS, StreetKit, hide_behind};
pub(crate) use toys::toy_town;
pub(crate) use tree::{Grove, Species};
