//! Encoders by name: those that every technique's name gives, and those that this chapter trains.

use std::{path::PathBuf, sync::Arc};

use vpr_nets::encode::by_name;
use vpr_study::{Network, Runner, Sources, technique::Found};

use crate::{Result, net::EncoderLoss};

/// Where `copr train encoder` puts an encoder.
#[must_use]
pub fn encoder_weights(loss: EncoderLoss) -> PathBuf {
    PathBuf::from(format!("models/copr-encoder-{}.safetensors", loss.name()))
}

/// An encoder by its name, or why it is not at hand: `triplet`, `relative` and `distance` are the
/// default network under the losses of thesis §6.2.3, every other name is that of a technique.
///
/// # Errors
///
/// [`vpr_core::Error::Unknown`] with the names there are; weights that are not those of the network.
pub(super) fn find(name: &str, sources: &Sources<'_>) -> Result<Found> {
    let Some(loss) = EncoderLoss::ALL.into_iter().find(|it| it.name() == name) else {
        return Ok(sources.find(name)?);
    };
    let file = encoder_weights(loss);
    let Some(path) = sources.locate(&file)? else {
        let file = file.display();
        return Ok(Found::Absent(format!("{file} is not at hand; `copr train encoder` makes it")));
    };
    let network = by_name("default", Some(&path), &sources.roots().roots)?;
    Ok(Found::Runs(Runner {
        name: name.to_owned(),
        column: "default network",
        encoder: name.to_owned(),
        technique: Arc::new(Network::new(network.into())),
    }))
}
