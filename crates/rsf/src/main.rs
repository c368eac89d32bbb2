//! `rsf`: an encoder that has read its map, on the command line.

fn main() {}
