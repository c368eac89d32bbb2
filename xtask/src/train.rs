//! From a network's name to the program that trains it.

use std::{
    env,
    ffi::OsString,
    process::{Command, ExitCode},
};

use anyhow::Context;
use clap::ValueEnum;

use crate::reproduce::workspace_root;

/// Which network; what follows goes to its program.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The network
    network: Network,
    /// Passed on, such as `--seed 2 --steps 500`
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    rest: Vec<OsString>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Network {
    /// `crates/vpr-nets/models/default-encoder.safetensors`
    DefaultEncoder,
    /// `crates/vpr-vision/models/dense-vlad.safetensors`
    DenseVlad,
    /// `crates/vpr-vision/models/hog-vlad.safetensors`
    HogVlad,
    /// `data/models/btl-default.safetensors`
    Btl,
    /// `data/models/stun-default.safetensors`
    Stun,
    /// `data/models/copr-default.safetensors`
    CoprRegressor,
    /// `data/models/rsf-rail.safetensors` and what it is held against in chapter 4
    RsfRail,
    /// `data/models/rsf-archive.safetensors` and what it is held against
    RsfArchive,
    /// `data/models/rsf-street.safetensors` and what it is held against
    RsfStreet,
    /// `data/models/rsf-eynsham.safetensors` and what it is held against
    RsfEynsham,
}

/// `copr train regressor` as the committed weights were made.
const COPR: [&str; 12] = [
    "train",
    "regressor",
    "--experiment",
    "experiments/table-6.1.toml",
    "--near",
    "0.8,45",
    "--at-most",
    "40000",
    "--steps",
    "13000",
    "--halved-every",
    "4000",
];

/// `rsf train` with the experiments that say how; the place follows.
const RSF: [&str; 6] = [
    "train",
    "--experiment",
    "experiments/table-4.3.toml",
    "experiments/table-4.5.toml",
    "experiments/table-4.6.toml",
    "--place",
];

const DENSE_VLAD: &str = "crates/vpr-vision/models/dense-vlad.safetensors";
const HOG_VLAD: &str = "crates/vpr-vision/models/hog-vlad.safetensors";

/// `bench train` as a committed vocabulary was made.
fn vocabulary(name: &'static str, output: &'static str) -> Vec<&'static str> {
    vec!["train", name, "--output", output]
}

/// Runs the program and passes its exit code on.
pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let rsf = |place| ("rsf", [&RSF[..], &[place]].concat());
    let (program, words) = match args.network {
        Network::DefaultEncoder => ("default-encoder", vec!["train"]),
        Network::DenseVlad => ("bench", vocabulary("dense-vlad", DENSE_VLAD)),
        Network::HogVlad => ("bench", vocabulary("hog-vlad", HOG_VLAD)),
        Network::Btl => ("sue", vec!["train", "btl"]),
        Network::Stun => ("sue", vec!["train", "stun"]),
        Network::CoprRegressor => ("copr", COPR.to_vec()),
        Network::RsfRail => rsf("rail"),
        Network::RsfArchive => rsf("archive"),
        Network::RsfStreet => rsf("street"),
        Network::RsfEynsham => rsf("eynsham"),
    };
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .current_dir(workspace_root()?)
        .args(["run", "--quiet", "--bin", program, "--"])
        .args(words)
        .args(&args.rest)
        .status()
        .with_context(|| format!("running `{program}`"))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok()).map_or(2, |code| code.min(2));
    Ok(ExitCode::from(code))
}
