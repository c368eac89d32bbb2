//! HDF5 in a program that was built without it: refused by name.

use std::path::Path;

use super::{parts::Parts, report::Read};
use vpr_core::{Error, Result};

fn refusal(path: &Path) -> Error {
    let reason = "this program was built without HDF5; build it with the feature `hdf5`";
    Error::format(path, "file", reason)
}

pub(super) fn read(path: &Path) -> Read<Parts> {
    Err(vec![refusal(path)])
}

pub(super) fn write(path: &Path, _: &Parts) -> Result<()> {
    Err(refusal(path))
}
