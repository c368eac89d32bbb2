//! `rsf train`: the weights that experiment files of chapter 4 name, as they say how.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, bail, ensure};
use rsf::study::{Encoder, Place, Study};
use vpr_nets::weights::Precision;
use vpr_report::{
    cli::{self, Bar, DataArgs, Outcome},
    experiment,
};
use vpr_study::Sources;

use super::{adaptation::Adaptation, run::CHAPTER};

/// Whose weights.
#[derive(clap::Args)]
pub(crate) struct TrainArgs {
    /// Experiment files whose encoders say how they are adapted
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    experiment: Vec<PathBuf>,
    /// Key of the place whose references are learned from
    #[arg(long, value_name = "KEY")]
    place: String,
    /// Only weights whose path has this in it
    #[arg(long, value_name = "PART", default_value = "", hide_default_value = true)]
    only: String,
    /// Leave weights that are there as they are
    #[arg(long)]
    missing: bool,
    /// Folder that the paths of weights are in
    #[arg(long, value_name = "DIR", default_value = "data")]
    output: PathBuf,
    #[command(flatten)]
    data: DataArgs,
}

pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<Outcome> {
    let bar = Bar::default();
    let (folders, cache) = (args.data.folders(), args.data.cache());
    let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
    let mut done = BTreeSet::new();
    for path in &args.experiment {
        let experiment = experiment::load::<Study>(path)?;
        ensure!(experiment.chapter == CHAPTER, "{}: not of this chapter", path.display());
        let Study::Recalls { places, encoders, .. } = &experiment.study else { continue };
        let Some(place) = places.iter().find(|it| it.key == args.place) else { continue };
        for encoder in encoders {
            let Some(output) = of_place(encoder, place).filter(|it| it.contains(&args.only)) else {
                continue;
            };
            let output = args.output.join(output);
            if done.insert(output.clone()) && !(args.missing && output.is_file()) {
                adapt(encoder, place, &output, &sources)
                    .with_context(|| output.display().to_string())?;
            }
        }
    }
    if done.is_empty() {
        bail!("no encoder of these experiments is adapted to a place `{}`", args.place);
    }
    Ok(Outcome::Success)
}

/// The weights that an encoder has for a place of its own.
fn of_place(encoder: &Encoder, place: &Place) -> Option<String> {
    let is_adapted = encoder.tuned.is_some() || encoder.whitened.is_some();
    let weights = encoder.weights.as_ref().filter(|it| is_adapted && it.contains("{place}"))?;
    Some(weights.replace("{place}", &place.key))
}

fn adapt(
    encoder: &Encoder,
    place: &Place,
    output: &Path,
    sources: &Sources<'_>,
) -> anyhow::Result<()> {
    let Some(set) = place.references(sources)? else {
        bail!(sources.why_absent(&place.dataset, "images")?)
    };
    let set = if encoder.without_poses { set.without_poses() } else { set };
    let adaptation = Adaptation {
        name: &place.name,
        set: &set,
        method: &encoder.method,
        roots: &sources.roots().roots,
        weights: None,
        output,
        checkpoints: None,
        precision: Precision::Half,
        report: None,
    };
    cli::note(&format!("{} on {}", encoder.name, place.name));
    match (&encoder.tuned, &encoder.whitened) {
        (Some(settings), None) => adaptation.finetune(settings),
        (None, Some(whitening)) => adaptation.whiten(whitening),
        _ => bail!("`{}`: either `tuned` or `whitened`", encoder.name),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// The experiments that `cargo xtask train rsf-…` has say how each committed file comes about,
    /// and name no other.
    #[test]
    fn committed_weights_are_those_that_experiments_name() {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut named = BTreeSet::new();
        for id in ["table-4.3", "table-4.3-heads", "table-4.5", "table-4.6"] {
            let path = workspace.join("experiments").join(id).with_added_extension("toml");
            let experiment = experiment::load::<Study>(&path).unwrap();
            let Study::Recalls { places, encoders, .. } = &experiment.study else { continue };
            for place in places {
                named.extend(encoders.iter().filter_map(|encoder| of_place(encoder, place)));
            }
        }
        let mut there = BTreeSet::new();
        for entry in fs::read_dir(workspace.join("data/models")).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if name.starts_with("rsf-") && name.ends_with(".safetensors") {
                there.insert(format!("models/{name}"));
            }
        }
        assert_eq!(named, there);
    }
}
