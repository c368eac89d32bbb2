//! Stub.
use serde::{Deserialize, Serialize};
use super::Plan;
use crate::{recipe::{Recipe, Refusal}, seed::Seed};
/// Stub.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stage {}
impl Stage {
    pub(crate) fn check(&self) -> Result<(), Refusal> { Ok(()) }
    pub(crate) fn plan(&self, _recipe: &Recipe, _seed: Seed) -> Plan { unimplemented!() }
}
