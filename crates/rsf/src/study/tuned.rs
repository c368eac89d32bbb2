//! Networks other than the default one, fine-tuned while a table is made.

use std::path::PathBuf;

use vpr_core::map::BlockDigest;
use vpr_nets::{
    encode::{Start, Task, tune},
    model::Tunable,
    train::{Run, device},
    weights::Precision,
};
use vpr_study::Sources;

use crate::{
    ReferenceSet, Result,
    net::{Finetuning, Material, finetune, run_log},
};

/// The weights of a network of the registry after fine-tuning on a map, in the cache.
///
/// # Errors
///
/// Weights that are not at hand; those of [`finetune`].
pub(super) fn tuned_now(
    method: &str,
    settings: &Finetuning,
    set: &ReferenceSet,
    sources: &Sources<'_>,
) -> Result<PathBuf> {
    let now = Now { settings, set, sources };
    tune(method, None, &sources.roots().roots, &device(), now)?
}

struct Now<'a> {
    settings: &'a Finetuning,
    set: &'a ReferenceSet,
    sources: &'a Sources<'a>,
}

impl Task for Now<'_> {
    type Output = Result<PathBuf>;

    fn with<N: Tunable>(self, network: N, start: Start) -> Self::Output {
        let Self { settings, set, sources } = self;
        let Start { preprocessing, size, digest } = start;
        let material = Material::open_for(set, preprocessing, size)?;
        let facts = settings.facts(&material, &digest);
        let name = BlockDigest::of(format!("{facts:?}").as_bytes()).to_hex();
        let folder = sources.cache().join(format!("rsf-{name}"));
        let path = folder.join("adapted.safetensors");
        if path.is_file() {
            return Ok(path);
        }
        let mut run = Run::open(&folder, &facts, run_log(&folder.join("log.csv")))?;
        let tuned =
            finetune(settings, network, (set, &material), &mut run, &folder, |_, _, _| Ok(()))?;
        tuned.network.write(&path, &facts, Precision::Single)?;
        Ok(path)
    }
}
