//! `sue run`: experiment files.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use image::{
    ExtendedColorType, ImageEncoder as _, RgbImage,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use sue::{
    corpus::{Known, Sources},
    study::{self, Context, Study},
};
use vpr_core::{
    cli::{self, Bar, DataArgs, Outcome, OutputArgs},
    dataset::DataRoots,
    experiment::{self, Experiment},
    map::replace,
};

/// Which experiments, from which data.
#[derive(clap::Args)]
pub(crate) struct RunArgs {
    /// Experiment files, such as `experiments/table-5.2.toml`
    #[arg(required = true, value_name = "FILE")]
    experiments: Vec<PathBuf>,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments =
        args.experiments.iter().map(|path| load(path)).collect::<anyhow::Result<Vec<_>>>()?;
    if !args.data.data.is_dir() {
        anyhow::bail!("{}: the data folder does not exist", args.data.data.display());
    }
    let first = args.experiments.first().map_or(Path::new(""), PathBuf::as_path);
    let roots = DataRoots::new([args.data.data.clone(), workspace_data(first)]);
    let bar = Bar::default();
    let known = Known::default();
    let sources = Sources { roots: &roots, cache: &args.data.cache, observer: &bar, known: &known };
    let mut outcome = Outcome::Success;
    for experiment in &experiments {
        let context = Context { sources, timings: args.output.timings, seed: experiment.seed };
        let report = study::run(experiment, context)?;
        let figure = report.figure.as_ref();
        outcome = outcome.and(cli::finish(experiment, &report.table, figure, &args.output)?);
        if let (Some(folder), Some(picture)) = (&args.output.write, &report.picture) {
            add_picture(folder, &experiment.id, picture)?;
        }
    }
    Ok(outcome)
}

fn load(path: &Path) -> anyhow::Result<Experiment<Study>> {
    let experiment = experiment::load::<Study>(path)?;
    if experiment.chapter != env!("CARGO_PKG_NAME") {
        anyhow::bail!("{}: belongs to `{}`", path.display(), experiment.chapter);
    }
    Ok(experiment)
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
