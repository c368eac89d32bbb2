//! Parts of a network by name, and which of them learn.

use burn::{module::Module, store::ModuleSnapshot};
use serde::Deserialize;

use super::low_rank::LowRank;
use crate::{Error, Result};

/// What lies before the last residual block of the trunk, and before all that comes after it.
const BEFORE_LAST_BLOCK: [&str; 4] =
    ["trunk.stem", "trunk.stages.0", "trunk.stages.1", "trunk.stages.2.enter"];
/// What burn calls the factors of an update.
const FACTORS: &str = ".lora.";

/// What of a network learns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Parts {
    /// All of it
    #[default]
    All,
    /// The last block of the trunk, its reduction and the head
    LastBlock,
    /// The matrices of these, by an update of low rank
    LowRank,
}

impl Parts {
    /// Its name in files and flags.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::LastBlock => "last-block",
            Self::LowRank => "low-rank",
        }
    }

    /// The network as it learns, and the parameters that stay. `frozen` are parts that stay besides;
    /// `rank` and `seed` are those of [`Self::LowRank`].
    pub(super) fn prepare<M: Module + ModuleSnapshot>(
        self,
        network: M,
        frozen: &[String],
        rank: usize,
        seed: u64,
    ) -> Result<(M, Vec<String>)> {
        check(&network, frozen)?;
        if self == Self::All {
            return Ok((network, frozen.to_vec()));
        }
        let before = BEFORE_LAST_BLOCK.map(str::to_owned);
        let stay = [&before[..], frozen].concat();
        check(&network, &stay)?;
        if self == Self::LastBlock {
            return Ok((network, stay));
        }
        let (all, stay) = (names(&network), parameters(&network, &stay));
        let learn = all.iter().filter(|it| !stay.contains(it)).cloned().collect();
        Ok((network.apply_reparameterization(LowRank::new(learn, rank, seed)), all))
    }
}

/// The network with its updates in its weights, without gradients.
pub(super) fn merged<M: Module>(network: &M) -> M {
    network.clone().valid().materialize()
}

/// Names of all parameters, as burn and files of weights have them but for the norms' `gamma` and
/// `beta`; factors of updates are none.
fn names<M: ModuleSnapshot>(network: &M) -> Vec<String> {
    let all = network.collect(None, None, false).into_iter().map(|it| it.name.clone());
    all.filter(|name| !name.contains(FACTORS)).collect()
}

fn is_in(parameter: &str, part: &str) -> bool {
    parameter.strip_prefix(part).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// The parameters of these parts.
pub(super) fn parameters<M: ModuleSnapshot>(network: &M, parts: &[String]) -> Vec<String> {
    let mut names = names(network);
    names.retain(|name| parts.iter().any(|part| is_in(name, part)));
    names
}

/// Whether every part exists.
pub(super) fn check<M: ModuleSnapshot>(network: &M, parts: &[String]) -> Result<()> {
    let names = names(network);
    match parts.iter().find(|part| !names.iter().any(|name| is_in(name, part))) {
        None => Ok(()),
        Some(part) => Err(Error::NoSuchPart { name: part.clone(), known: names.join(", ") }),
    }
}
