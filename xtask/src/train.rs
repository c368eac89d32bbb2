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
    /// `data/models/boq-default.safetensors`
    BoqDefault,
    /// `data/models/salad-default.safetensors`
    SaladDefault,
    /// `crates/vpr-vision/models/dense-vlad.safetensors`
    DenseVlad,
    /// `crates/vpr-vision/models/hog-vlad.safetensors`
    HogVlad,
    /// `data/models/btl-default.safetensors`
    Btl,
    /// `data/models/stun-default.safetensors`
    Stun,
    /// The default network's trunk under the triplet loss of chapter 6
    CoprEncoderTriplet,
    /// The same under the loss of relative poses
    CoprEncoderRelative,
    /// The same under the distance loss
    CoprEncoderDistance,
    /// H of the default network, trained on the queries of generated rooms as in the thesis
    CoprDefault,
    /// H of the encoder under the triplet loss
    CoprTriplet,
    /// H of the encoder under the loss of relative poses
    CoprRelative,
    /// H of the encoder under the distance loss
    CoprDistance,
    /// H of the default network, trained on sequences that are neither in the maps nor queries
    CoprDefaultHeldOut,
    /// The same of the encoder under the triplet loss
    CoprTripletHeldOut,
    /// The same of the encoder under the loss of relative poses
    CoprRelativeHeldOut,
    /// The same of the encoder under the distance loss
    CoprDistanceHeldOut,
    /// The same of the default network, without three of the rooms
    CoprDefaultTransfer,
    /// Poses between two descriptors of the default network, by sequences that are held out
    CoprDefaultPoseHeldOut,
    /// The same by one linear map, as released
    CoprDefaultPosePublishedHeldOut,
    /// The same of the encoder under the loss of relative poses
    CoprRelativePoseHeldOut,
    /// And by one linear map
    CoprRelativePosePublishedHeldOut,
    /// H of a street, trained on other streets
    CoprShopFacade,
    /// H of an escalator, trained on other escalators
    CoprEscalator,
    /// `data/models/rsf-rail.safetensors` and what it is held against in chapter 4
    RsfRail,
    /// `data/models/rsf-archive.safetensors` and what it is held against
    RsfArchive,
    /// `data/models/rsf-street.safetensors` and what it is held against
    RsfStreet,
    /// `data/models/rsf-eynsham.safetensors` and what it is held against
    RsfEynsham,
    /// `data/models/rsf-boq-rail.safetensors` and that of SALAD
    RsfHeadsRail,
    /// `data/models/rsf-boq-archive.safetensors` and that of SALAD
    RsfHeadsArchive,
}

/// `copr train encoder` as the committed weights were made; the loss follows.
const ENCODER: &[&str] =
    &["train", "encoder", "--experiment", "experiments/table-6.4.toml", "--loss"];

/// `copr train regressor` as the committed weights were made, with as many steps for every encoder;
/// its name follows.
const ROOMS: &[&str] = &[
    "train",
    "regressor",
    "--experiment",
    "experiments/table-6.4.toml",
    "--near",
    "0.8,45",
    "--at-most",
    "20000",
    "--steps",
    "1300",
    "--halved-every",
    "650",
    "--validated-every",
    "325",
    "--encoder",
];

/// The same for a place that its H never sees; the place and how far pairs reach follow.
const PLACE: &[&str] = &[
    "train",
    "regressor",
    "--experiment",
    "experiments/table-6.2.toml",
    "--steps",
    "2600",
    "--halved-every",
    "1300",
    "--validated-every",
    "650",
    "--place",
];

/// Rooms of which the H of transfer sees nothing, and where it goes.
const TRANSFER: &[&str] = &[
    "default",
    "--held-out",
    "--without",
    "pumpkin,redkitchen,stairs",
    "--output",
    "data/models/copr-default-transfer.safetensors",
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

/// The same of the heads on the default network's trunk.
const RSF_HEADS: [&str; 4] =
    ["train", "--experiment", "experiments/table-4.3-heads.toml", "--place"];

/// `default-encoder head` as a committed head was made.
fn head(name: &'static str, output: &'static str) -> Vec<&'static str> {
    vec!["head", name, "--output", output]
}

const BOQ: &str = "data/models/boq-default.safetensors";
const SALAD: &str = "data/models/salad-default.safetensors";
const DENSE_VLAD: &str = "crates/vpr-vision/models/dense-vlad.safetensors";
const HOG_VLAD: &str = "crates/vpr-vision/models/hog-vlad.safetensors";

/// `bench train` as a committed vocabulary was made.
fn vocabulary(name: &'static str, output: &'static str) -> Vec<&'static str> {
    vec!["train", name, "--output", output]
}

/// The program of a network and what it is told.
fn command(network: Network) -> (&'static str, Vec<&'static str>) {
    let with = |words: &[&'static str], rest: &[&'static str]| [words, rest].concat();
    let rsf = |place| ("rsf", with(&RSF, &[place]));
    let heads = |place| ("rsf", with(&RSF_HEADS, &[place]));
    let encoder = |loss| ("copr", with(ENCODER, &[loss]));
    let regressor = |rest: &[&'static str]| ("copr", with(ROOMS, rest));
    let place = |rest: &[&'static str]| ("copr", with(PLACE, rest));
    match network {
        Network::DefaultEncoder => ("default-encoder", vec!["train"]),
        Network::BoqDefault => ("default-encoder", head("boq", BOQ)),
        Network::SaladDefault => ("default-encoder", head("salad", SALAD)),
        Network::DenseVlad => ("bench", vocabulary("dense-vlad", DENSE_VLAD)),
        Network::HogVlad => ("bench", vocabulary("hog-vlad", HOG_VLAD)),
        Network::Btl => ("sue", vec!["train", "btl"]),
        Network::Stun => ("sue", vec!["train", "stun"]),
        Network::CoprEncoderTriplet => encoder("triplet"),
        Network::CoprEncoderRelative => encoder("relative"),
        Network::CoprEncoderDistance => encoder("distance"),
        Network::CoprDefault => regressor(&["default"]),
        Network::CoprTriplet => regressor(&["triplet"]),
        Network::CoprRelative => regressor(&["relative"]),
        Network::CoprDistance => regressor(&["distance"]),
        Network::CoprDefaultHeldOut => regressor(&["default", "--held-out"]),
        Network::CoprTripletHeldOut => regressor(&["triplet", "--held-out"]),
        Network::CoprRelativeHeldOut => regressor(&["relative", "--held-out"]),
        Network::CoprDistanceHeldOut => regressor(&["distance", "--held-out"]),
        Network::CoprDefaultTransfer => regressor(TRANSFER),
        Network::CoprDefaultPoseHeldOut => regressor(&["default", "--held-out", "--gives", "pose"]),
        Network::CoprDefaultPosePublishedHeldOut => {
            regressor(&["default", "--held-out", "--gives", "pose-published"])
        }
        Network::CoprRelativePoseHeldOut => {
            regressor(&["relative", "--held-out", "--gives", "pose"])
        }
        Network::CoprRelativePosePublishedHeldOut => {
            regressor(&["relative", "--held-out", "--gives", "pose-published"])
        }
        Network::CoprShopFacade => place(&["shop-facade", "--near", "3,45"]),
        Network::CoprEscalator => place(&["escalator", "--near", "2.5,45"]),
        Network::RsfRail => rsf("rail"),
        Network::RsfArchive => rsf("archive"),
        Network::RsfStreet => rsf("street"),
        Network::RsfEynsham => rsf("eynsham"),
        Network::RsfHeadsRail => heads("rail"),
        Network::RsfHeadsArchive => heads("archive"),
    }
}

/// Words without the flags that `rest` gives other values.
fn replaced<'a>(words: &[&'a str], rest: &[OsString]) -> Vec<&'a str> {
    let is_given = |word: &str| word.starts_with("--") && rest.iter().any(|it| it == word);
    let mut kept = Vec::new();
    let mut words = words.iter().copied().peekable();
    while let Some(word) = words.next() {
        if is_given(word) {
            words.next_if(|value| !value.starts_with("--"));
        } else {
            kept.push(word);
        }
    }
    kept
}

/// Runs the program and passes its exit code on.
pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let (program, words) = command(args.network);
    let words = replaced(&words, &args.rest);
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn what_is_passed_on_takes_the_place_of_what_is_set() {
        let rest = ["--steps", "5", "--seed", "2"].map(OsString::from);
        let words = ["train", "--held-out", "--steps", "1300", "--encoder", "default"];
        assert_eq!(replaced(&words, &rest), ["train", "--held-out", "--encoder", "default"]);
        assert_eq!(replaced(&words, &[]), words);
    }

    /// Every file of weights of chapters 4 and 6 has a name under which it is trained again, and is
    /// small; in chapter 4 the name is that of its map.
    #[test]
    fn weights_of_chapters_4_and_6_have_a_training() {
        let (mut n, mut n_adapted) = (0, 0);
        for entry in fs::read_dir(workspace_root().unwrap().join("data/models")).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            let Some(stem) = name.strip_suffix(".safetensors") else { continue };
            if stem.starts_with("copr-") {
                let network = Network::from_str(stem, false).unwrap();
                assert_eq!(command(network).0, "copr");
                assert!(path.with_extension("log.csv").is_file(), "{name} has no log");
                assert!(fs::metadata(&path).unwrap().len() <= 4 << 20, "{name} is large");
                n += 1;
            } else if let Some(rest) = stem.strip_prefix("rsf-") {
                let of_head = ["boq-", "salad-"].iter().find_map(|it| rest.strip_prefix(it));
                let (kind, words) = match of_head {
                    Some(_) => ("rsf-heads", &RSF_HEADS[..]),
                    None => ("rsf", &RSF[..]),
                };
                let place = of_head.unwrap_or(rest).split('-').next().unwrap();
                let network = Network::from_str(&format!("{kind}-{place}"), false).unwrap();
                assert_eq!(command(network), ("rsf", [words, &[place]].concat()));
                let log = path.with_extension("log.csv");
                assert!(log.is_file() || rest.ends_with("-whitened"), "{name} has no log");
                n_adapted += 1;
            }
        }
        assert!(n >= 9 && n_adapted >= 16, "{n} and {n_adapted} files");
    }
}
