//! `sue run`: one experiment file.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use image::{
    ExtendedColorType, ImageEncoder as _, RgbImage,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use sue::{
    corpus::Sources,
    study::{self, Context, Study},
};
use vpr_core::{
    cli::{self, Bar, DataArgs, Outcome, OutputArgs},
    dataset::DataRoots,
    experiment,
    map::replace,
};

/// Which experiment, from which data.
#[derive(clap::Args)]
pub(crate) struct RunArgs {
    /// Experiment file, such as `experiments/table-5.2.toml`
    experiment: PathBuf,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiment = experiment::load::<Study>(&args.experiment)?;
    if experiment.chapter != env!("CARGO_PKG_NAME") {
        anyhow::bail!("{}: belongs to `{}`", args.experiment.display(), experiment.chapter);
    }
    if !args.data.data.is_dir() {
        anyhow::bail!("{}: the data folder does not exist", args.data.data.display());
    }
    let roots = DataRoots::new([args.data.data.clone(), workspace_data(&args.experiment)]);
    let bar = Bar::default();
    let sources = Sources { roots: &roots, cache: &args.data.cache, observer: &bar };
    let context = Context { sources, timings: args.output.timings, seed: experiment.seed };
    let report = study::run(&experiment, context)?;
    let outcome = cli::finish(&experiment, &report.table, report.figure.as_ref(), &args.output)?;
    if let (Some(folder), Some(picture)) = (&args.output.write, &report.picture) {
        add_picture(folder, &experiment.id, picture)?;
    }
    Ok(outcome)
}

/// `data/` beside the folder of the experiment file: where the fixture lies.
fn workspace_data(experiment: &Path) -> PathBuf {
    let absolute = std::path::absolute(experiment).unwrap_or_else(|_| experiment.to_owned());
    absolute.ancestors().nth(2).unwrap_or(Path::new("")).join("data")
}

/// Writes the contact sheet beside the page and shows it there.
fn add_picture(folder: &Path, id: &str, picture: &RgbImage) -> anyhow::Result<()> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::NoFilter)
        .write_image(picture, picture.width(), picture.height(), ExtendedColorType::Rgb8)?;
    replace(&folder.join(format!("{id}.png")), &bytes)?;
    let page = folder.join(format!("{id}.md"));
    let text = std::fs::read_to_string(&page).with_context(|| page.display().to_string())?;
    // Behind the title, source and origins; before the numbers.
    let numbers = text.find("\n|").map_or(text.len(), |at| at + 1);
    let (head, body) = text.split_at(numbers);
    let legend = "Grey: query; green: correct reference; red: wrong reference.";
    replace(&page, format!("{head}![{id}]({id}.png)\n\n{legend}\n\n{body}").as_bytes())?;
    Ok(())
}
