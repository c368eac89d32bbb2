//! `bench evaluate` with a network.

use std::path::PathBuf;

use vpr_core::{Descriptors, Error, Ranking};
use vpr_nets::encode::{
    Encoder, Options, encode_files, l1,
    registry::{Matching, Method},
};
use vpr_report::cli;
use vpr_study::technique::{hand_crafted_names, on_request_names};

use super::{
    encoder::EncoderArgs,
    named::Named,
    retrieved::{Retrieved, nearest},
};

/// The network that is asked for, and how it is run.
pub(super) struct Asked<'a> {
    pub(super) method: &'a str,
    pub(super) encoder: &'a EncoderArgs,
    /// The data folders, where its weights may lie.
    pub(super) data: &'a [PathBuf],
    pub(super) threads: Option<usize>,
}

/// Describes images by a network and retrieves by Euclidean distance, or as the network compares.
pub(super) fn retrieve(
    asked: &Asked<'_>,
    queries: Named,
    references: Named,
    k: usize,
) -> anyhow::Result<Retrieved> {
    let encoder = asked.encoder.open(asked.method, asked.data)?;
    let options = asked.encoder.options(asked.threads, false);
    let [query_rows, reference_rows] = encode(&*encoder, [&queries, &references], &options)?;
    if encoder.matching() == Matching::L1 {
        let similarities = l1::similarities(&query_rows, &reference_rows)?;
        let retrieved = Retrieved::of_scores([queries, references], similarities, k)?;
        return Ok(Retrieved { descriptors: Some((query_rows, reference_rows)), ..retrieved });
    }
    let alone = if encoder.batch_dependent() && options.batch_size > 1 {
        cli::note(&format!(
            "descriptors of `{}` depend on their batch: images are described one by one as well",
            encoder.name()
        ));
        let options = Options { batch_size: 1, ..options };
        let [query_rows, reference_rows] = encode(&*encoder, [&queries, &references], &options)?;
        let retrieval = vpr_core::retrieve(&query_rows, &reference_rows, k)?;
        Some(AsRef::<Ranking>::as_ref(&retrieval).clone())
    } else {
        None
    };
    let retrieved = nearest(queries, references, query_rows, reference_rows, k)?;
    Ok(Retrieved { alone, ..retrieved })
}

/// Before the work: whether there is such a network.
pub(super) fn check(method: &str, encoder: &EncoderArgs) -> anyhow::Result<()> {
    let found = Method::find(method, encoder.backbone.as_deref());
    found.map(drop).map_err(with_all_names)
}

/// Who asks for a method that there is not is told of those without a network too.
fn with_all_names(err: vpr_nets::Error) -> anyhow::Error {
    let kind = "method";
    match err {
        vpr_nets::Error::Core(Error::Unknown { kind: "method", name, known }) => {
            let others: Vec<&str> = hand_crafted_names().chain(on_request_names()).collect();
            Error::Unknown { kind, name, known: format!("{}, {known}", others.join(", ")) }.into()
        }
        other => other.into(),
    }
}

/// Descriptors of two sets of images.
fn encode(
    encoder: &dyn Encoder,
    sets: [&Named; 2],
    options: &Options,
) -> anyhow::Result<[Descriptors; 2]> {
    let bar = cli::progress(encoder.name(), sets.iter().map(|set| set.names.len()).sum());
    let each = |paths: &[PathBuf], before: usize| {
        encode_files(encoder, paths, options, &mut |done| {
            bar.set_position((before + done) as u64);
        })
    };
    let queries = each(&sets[0].names, 0)?;
    let references = each(&sets[1].names, sets[0].names.len())?;
    bar.finish_and_clear();
    Ok([queries, references])
}
