//! `bench train`: the vocabularies that every clone has.

use std::path::PathBuf;

use anyhow::Context as _;
use bench::vocabulary::{Plan, Trained, Trial, train};
use vpr_report::cli::{self, Bar, DataArgs, Outcome};
use vpr_study::Sources;
use vpr_vision::{dense_sift::DenseSiftParams, vlad::Local};

/// Which vocabulary, on how much.
#[derive(clap::Args)]
pub(crate) struct TrainArgs {
    /// Which one
    #[arg(value_enum)]
    vocabulary: Kind,
    /// The file to write; what was tried lands beside it
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    /// Decides places, features and first words
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Places of each of 11 generated worlds, and of 6 others that choose the projection
    #[arg(long, default_value_t = 10)]
    places: usize,
    /// Width and height that images get before dense SIFT; the thesis has 640 480
    #[arg(long, num_args = 2, default_values_t = [320, 240], value_names = ["WIDTH", "HEIGHT"])]
    size: Vec<usize>,
    /// Distance of one dense SIFT descriptor to the next in pixels; the thesis has 2
    #[arg(long, default_value_t = 4)]
    step: usize,
    /// Numbers of components that are tried, beside no projection
    #[arg(long, num_args = 1.., value_delimiter = ',', value_name = "N")]
    components: Option<Vec<usize>>,
    #[command(flatten)]
    data: DataArgs,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Kind {
    /// Dense `RootSIFT` at four scales, 128 words
    DenseVlad,
    /// Blocks of HOG at three scales, 64 words
    HogVlad,
}

pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<Outcome> {
    let (bar, cache) = (Bar::default(), args.data.cache());
    let sources = Sources::new([], &cache, &bar);
    let (local, words, features_per_image, usual) = match args.vocabulary {
        Kind::DenseVlad => {
            let sift = DenseSiftParams { step: args.step, ..DenseSiftParams::default() };
            let size = [args.size[0], args.size[1]];
            (Local::RootSift { size, sift }, 128, 80, vec![32, 64, 112])
        }
        Kind::HogVlad => (Local::hog_vlad(), 64, 80, vec![64, 128]),
    };
    let components = args.components.clone().unwrap_or(usual);
    let (places, seed) = (args.places, args.seed);
    let plan = Plan { local, words, features_per_image, components, places, seed };
    let trained = train(&sources, &plan)?;
    let facts = [
        ("trained_on", format!("generated places, {places} of each of 11 worlds")),
        ("seed", seed.to_string()),
        ("licence", "MIT OR Apache-2.0".to_owned()),
    ];
    let bytes = trained.encoder.to_bytes(&facts)?;
    vpr_files::replace(&args.output, &bytes).context("writing the vocabulary")?;
    let log = args.output.with_extension("log.csv");
    vpr_files::replace(&log, table(&trained).as_bytes())?;
    cli::note(&format!("generated: {}, {} bytes", args.output.display(), bytes.len()));
    Ok(Outcome::Success)
}

/// Recall@1 of every projection on every place.
fn table(trained: &Trained) -> String {
    let head = format!("components,whitened,{},mean", trained.places.join(","));
    let line = |trial: &Trial| {
        let components = trial.components.map_or("none".to_owned(), |it| it.to_string());
        let recalls: Vec<_> = trial.recalls.iter().map(|it| format!("{it:.4}")).collect();
        let (whiten, mean) = (trial.whiten, trial.mean());
        format!("{components},{whiten},{},{mean:.4}", recalls.join(","))
    };
    let lines: Vec<String> = [head].into_iter().chain(trained.trials.iter().map(line)).collect();
    lines.join("\n") + "\n"
}
