//! `sue run`: experiment files.

use std::path::Path;

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
    cli::{self, Bar, Outcome, RunArgs},
    dataset::DataRoots,
    map::replace,
};

pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let experiments = args.open::<Study>(env!("CARGO_PKG_NAME"))?;
    let roots = DataRoots::new([args.data.data.clone(), args.workspace_data()]);
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
