//! Several methods on the same queries: techniques, files of descriptors, files of scores.

use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use vpr_core::{GroundTruth, Provenance};

use super::{input::Input, input_args::InputArgs, retrieved::Retrieved};

/// Which methods, and on what.
pub(super) struct Several<'a> {
    /// Each as `[LABEL=]METHOD`.
    pub(super) methods: &'a [String],
    pub(super) input: &'a InputArgs,
    pub(super) scores_are_distances: bool,
    /// How many references are kept for every query.
    pub(super) k: usize,
}

/// What every method found, by name, with the one truth.
pub(super) type FoundBySeveral = (Vec<(String, Retrieved)>, GroundTruth, Provenance);

/// What a method is.
enum Spec<'a> {
    Technique(&'a str),
    Descriptors(&'a str, &'a str),
    Scores(&'a str),
}

/// Refuses the flags by which `bench evaluate` names its one method.
pub(super) fn refuse_files(input: &InputArgs) -> anyhow::Result<()> {
    let files = [&input.database_descriptors, &input.similarities, &input.distances];
    ensure!(
        files.iter().all(|it| it.is_none()),
        "files go as methods here: QUERIES,REFERENCES or SIMILARITIES"
    );
    ensure!(!input.no_labels, "`no-labels`: nothing can be compared without a truth");
    Ok(())
}

impl Several<'_> {
    /// What every method finds; descriptors and similarities are kept of the first only.
    pub(super) fn retrieve(&self) -> anyhow::Result<FoundBySeveral> {
        let source = self.input.truth.source();
        let radius = self.input.truth.positive_dist_threshold;
        let (mut images, mut truth) = (None, None);
        let mut provenance = Provenance::Measured;
        if self.input.has_images() {
            let input = Input::open(self.input)?;
            let known = Some(input.truth(source.as_ref(), radius)?);
            let (input, known) =
                if self.input.skip_bad { input.without_bad(known)? } else { (input, known) };
            provenance = input.provenance;
            (images, truth) = (Some(input), known);
        }
        let mut found: Vec<(String, Retrieved)> = Vec::new();
        for method in self.methods {
            let (label, spec) = spec(method);
            ensure!(
                found.iter().all(|(name, _)| name != label),
                "two methods are called `{label}`"
            );
            let retrieved = match &spec {
                Spec::Technique(name) => {
                    let Some(input) = images.clone() else {
                        bail!(
                            "`{name}` is no file, and as a technique it needs images: give --dataset, or \
                             --database-folder and --queries-folder"
                        );
                    };
                    input.retrieve(self.input, name, self.k)?
                }
                Spec::Descriptors(..) | Spec::Scores(_) => {
                    let flags = self.flags_of(&spec, truth.is_some());
                    let input = Input::open(&flags)?;
                    if truth.is_none() {
                        truth = Some(input.truth(source.as_ref(), radius)?);
                    }
                    input.retrieve(&flags, label, self.k)?
                }
            };
            let known = truth.as_ref().context("no truth")?;
            fits(method, &retrieved, known)?;
            let retrieved = match (&images, &spec) {
                (Some(images), Spec::Descriptors(..) | Spec::Scores(_)) => Retrieved {
                    queries: retrieved.queries.of_images(&images.queries, method)?,
                    references: retrieved.references.of_images(&images.references, method)?,
                    ..retrieved
                },
                _ => retrieved,
            };
            let is_first = found.is_empty();
            let retrieved = Retrieved {
                similarities: retrieved.similarities.filter(|_| is_first),
                descriptors: retrieved.descriptors.filter(|_| is_first),
                ..retrieved
            };
            found.push((label.to_owned(), retrieved));
        }
        let truth = truth.context("no truth")?;
        Ok((found, truth, provenance))
    }

    /// The flags with which `bench evaluate` would open the files of a method.
    fn flags_of(&self, spec: &Spec<'_>, has_truth: bool) -> InputArgs {
        let mut flags = self.input.clone();
        (flags.dataset, flags.queries_folder, flags.database_folder) = (None, None, None);
        flags.no_labels = has_truth;
        match *spec {
            Spec::Technique(_) => {}
            Spec::Descriptors(queries, references) => {
                flags.queries_descriptors = Some(queries.into());
                flags.database_descriptors = Some(references.into());
            }
            Spec::Scores(path) if self.scores_are_distances => flags.distances = Some(path.into()),
            Spec::Scores(path) => flags.similarities = Some(path.into()),
        }
        flags
    }
}

fn fits(method: &str, found: &Retrieved, truth: &GroundTruth) -> anyhow::Result<()> {
    let (queries, references) = (found.queries.len(), found.references.len());
    let (n, m) = (truth.len(), truth.n_references());
    ensure!(
        (queries, references) == (n, m),
        "`{method}` has {queries} queries and {references} references; the others have {n} and {m}"
    );
    Ok(())
}

/// The label of a method, and what it is.
fn spec(method: &str) -> (&str, Spec<'_>) {
    let (label, content) = match method.split_once('=') {
        Some((label, content)) if !Path::new(method).is_file() => (label, content),
        _ => (method, method),
    };
    let spec = match content.split_once(',') {
        _ if Path::new(content).is_file() => Spec::Scores(content),
        Some((queries, references)) => Spec::Descriptors(queries, references),
        None => Spec::Technique(content),
    };
    (label, spec)
}
