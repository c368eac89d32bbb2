//! What `bench evaluate` compares: images, descriptors, or scores that somebody computed.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use rayon::prelude::*;
use vpr_core::{Descriptors, GroundTruth, Provenance, Similarities};
use vpr_data::truth::{Scale, Sides, Source, read_scores};
use vpr_report::cli::{self, Bar};
use vpr_study::Sources;
use vpr_vision::image;

use super::{
    input_args::InputArgs,
    named::{Named, say},
    retrieved::{Retrieved, nearest},
};

/// Two sides, and what is known of them.
#[derive(Clone)]
pub(super) struct Input {
    pub(super) queries: Named,
    pub(super) references: Named,
    content: Content,
    /// The truth that came with them.
    truth: Option<GroundTruth>,
    /// Whether the images are real or drawn.
    pub(super) provenance: Provenance,
}

/// What is compared.
#[derive(Clone)]
enum Content {
    /// Image files, which a technique has to describe.
    Images,
    /// A row per image.
    Rows([Descriptors; 2]),
    /// Every query with every reference.
    Scores(Similarities),
}

impl Input {
    /// What the flags name.
    pub(super) fn open(args: &InputArgs) -> anyhow::Result<Self> {
        if let Some(id) = &args.dataset {
            return Self::dataset(args, id);
        }
        let poses = [args.queries_poses.as_deref(), args.database_poses.as_deref()];
        let (reading, needs) = (args.reading, args.needs_positions());
        if let (Some(queries), Some(references)) = (&args.queries_folder, &args.database_folder) {
            let queries = Named::folder(queries, poses[0], reading.poses, needs)?;
            let references = Named::folder(references, poses[1], reading.poses, needs)?;
            return Ok(Self::new(queries, references, Content::Images));
        }
        if let (Some(queries), Some(references)) =
            (&args.queries_descriptors, &args.database_descriptors)
        {
            let (queries, query_rows) = Named::rows(queries, poses[0], reading, needs)?;
            let (references, reference_rows) = Named::rows(references, poses[1], reading, needs)?;
            let content = Content::Rows([query_rows, reference_rows]);
            return Ok(Self::new(queries, references, content));
        }
        let (path, scale) = match (&args.similarities, &args.distances) {
            (Some(path), _) => (path, Scale::Similarities),
            (_, Some(path)) => (path, Scale::Distances),
            _ => bail!(
                "give --dataset, --database-folder and --queries-folder, --database-descriptors and \
                 --queries-descriptors, --similarities or --distances"
            ),
        };
        let scores = read_scores(path, scale)?;
        let scores = if args.scores_transposed { scores.swapped() } else { scores };
        let with = |n: usize, poses: Option<&Path>| {
            Named::with_poses(n, poses, reading.poses).with_context(|| scores_have(path, &scores))
        };
        let queries = with(scores.n_queries(), poses[0])?;
        let references = with(scores.n_references(), poses[1])?;
        Ok(Self::new(queries, references, Content::Scores(scores)))
    }

    fn new(queries: Named, references: Named, content: Content) -> Self {
        Self { queries, references, content, truth: None, provenance: Provenance::Measured }
    }

    fn dataset(args: &InputArgs, id: &str) -> anyhow::Result<Self> {
        let bar = Bar::default();
        let folders = args.data.folders();
        let folders = folders.iter().map(PathBuf::as_path);
        let cache = args.data.cache();
        let sources = Sources::new(folders, &cache, &bar);
        let Some(dataset) = sources.images(id)? else { bail!(sources.why_absent(id, "images")?) };
        let (query_poses, reference_poses) = dataset.poses.clone().unzip();
        let place = Path::new(id);
        let queries = Named::images(dataset.queries.clone(), query_poses, place);
        let references = Named::images(dataset.references.clone(), reference_poses, place);
        let (truth, provenance) = (Some(dataset.truth.clone()), dataset.provenance);
        Ok(Self { truth, provenance, ..Self::new(queries, references, Content::Images) })
    }

    /// Which references are correct: as the flags say, as the dataset does, or by distance.
    pub(super) fn truth(
        &self,
        source: Option<&Source>,
        radius: f64,
    ) -> anyhow::Result<GroundTruth> {
        if let Some(source) = source {
            let sides = Sides { queries: self.queries.side(), references: self.references.side() };
            let found = source.truth(&sides).map_err(|err| self.advised(err))?;
            say(&found.notes);
            return Ok(found.truth);
        }
        if let Some(truth) = &self.truth {
            return Ok(truth.clone());
        }
        let (queries, references) = (&self.queries, &self.references);
        let (Some(query_poses), Some(reference_poses)) = (&queries.poses, &references.poses) else {
            bail!(
                "no positions: give --database-poses and --queries-poses, --ground-truth, --labels, \
                 --same-index, or --no-labels"
            );
        };
        queries.check_comparable(references)?;
        Ok(GroundTruth::within_radius(query_poses, reference_poses, radius)?)
    }

    /// Adds what else may be wrong where the rows of a matrix are the queries by assumption.
    fn advised(&self, err: vpr_core::Error) -> anyhow::Error {
        let err = anyhow::Error::from(err);
        match &self.content {
            Content::Scores(scores) => {
                let (n, m) = (scores.n_queries(), scores.n_references());
                err.context(format!(
                    "the scores have {n} rows, taken for queries, and {m} columns; \
                     `--scores-transposed` if it is the other way round"
                ))
            }
            _ => err,
        }
    }

    /// Leaves out images that cannot be decoded, and says which; the truth is that of the others.
    pub(super) fn without_bad(
        self,
        truth: Option<GroundTruth>,
    ) -> anyhow::Result<(Self, Option<GroundTruth>)> {
        let Content::Images = self.content else { return Ok((self, truth)) };
        let bar = Bar::default();
        let queries = sound(&self.queries, "queries", &bar)?;
        let references = sound(&self.references, "references", &bar)?;
        let before = truth.as_ref().map(|truth| known(truth, &queries));
        let truth = truth.map(|truth| truth.selected(&queries, &references)).transpose()?;
        if let (Some(before), Some(truth)) = (before, &truth)
            && truth.n_known() < before
        {
            let n = before - truth.n_known();
            cli::note(&format!("{n} queries lost their last correct reference"));
        }
        let selected = Self {
            queries: self.queries.selected(&queries),
            references: self.references.selected(&references),
            ..self
        };
        Ok((selected, truth))
    }

    /// What is retrieved for every query.
    pub(super) fn retrieve(
        self,
        args: &InputArgs,
        method: &str,
        k: usize,
    ) -> anyhow::Result<Retrieved> {
        let Self { queries, references, content, .. } = self;
        match content {
            Content::Images => args.match_images(method, queries, references, k),
            Content::Rows([query_rows, reference_rows]) => {
                let found = nearest(queries, references, query_rows, reference_rows, k);
                let files = args.queries_descriptors.iter().chain(&args.database_descriptors);
                let files: Vec<_> = files.map(|it| it.display().to_string()).collect();
                found.with_context(|| files.join(" and "))
            }
            Content::Scores(scores) => Retrieved::of_scores([queries, references], scores, k),
        }
    }
}

fn scores_have(path: &Path, scores: &Similarities) -> String {
    let (n, m) = (scores.n_queries(), scores.n_references());
    let name = path.display();
    format!(
        "{name} has {n} rows, taken for queries, and {m} columns; `--scores-transposed` if it is the \
         other way round"
    )
}

/// How many of these queries have a correct reference.
fn known(truth: &GroundTruth, queries: &[usize]) -> usize {
    queries.iter().filter(|&&query| !truth.is_new_place(query)).count()
}

/// The images that can be decoded; the others are listed.
fn sound(side: &Named, what: &str, bar: &Bar) -> anyhow::Result<Vec<usize>> {
    use vpr_core::Observer as _;
    bar.start(what, side.len());
    let problems: Vec<Option<vpr_core::Error>> = side
        .names
        .par_iter()
        .map(|path| {
            let problem = image::decode(path).err();
            bar.step();
            problem
        })
        .collect();
    bar.end();
    for problem in problems.iter().flatten() {
        cli::note(&format!("skipped {problem}"));
    }
    let sound = problems.iter().enumerate().filter(|(_, problem)| problem.is_none());
    let sound: Vec<usize> = sound.map(|(index, _)| index).collect();
    if sound.is_empty() {
        bail!("none of the {} {what} can be decoded", side.len());
    }
    Ok(sound)
}
