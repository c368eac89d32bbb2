//! `bench audit`: what may be wrong with a ground truth, and what follows from its radius.

use std::{fmt::Write as _, path::PathBuf};

use bench::audit;
use vpr_core::GroundTruth;
use vpr_data::truth::Source;
use vpr_report::cli::{self, Bar, Outcome};
use vpr_study::{
    Sources,
    verification::{LocalMethod, Matches, Verified},
};

use super::{
    input_args::InputArgs,
    retrieved::Retrieved,
    several::{FoundBySeveral, Several, refuse_files},
};

/// Which dataset, by which methods, and what is looked at.
#[derive(clap::Args)]
pub(crate) struct AuditArgs {
    /// Methods, each as in `bench compare`; the first decides what is verified, all are ranked at
    /// every radius
    #[arg(default_value = "hog", num_args = 1.., value_name = "METHOD")]
    methods: Vec<String>,
    #[command(flatten)]
    input: InputArgs,
    /// Files of scores are distances; lower is nearer
    #[arg(long)]
    scores_are_distances: bool,
    /// Verify at most this many of the wrong matches, the surest; 0 for none
    #[arg(long, default_value_t = 500, value_name = "N")]
    verify: usize,
    /// A wrong match looks right with at least this many inliers of SIFT and a homography, if a
    /// correct reference has fewer; of 521 random pairs of three real datasets none had more than 4
    #[arg(long, default_value_t = 10, value_name = "N")]
    inliers: usize,
    /// Radii at which methods are ranked, in metres
    #[arg(long, num_args = 1.., default_values_t = [1.0, 2.0, 5.0, 10.0, 25.0, 50.0], value_name = "M")]
    radii: Vec<f64>,
    /// Angles between the orientations of two cameras at which methods are ranked besides, at every
    /// radius, in degrees; poses must have an orientation
    #[arg(long, num_args = 1.., value_name = "DEG")]
    angles: Vec<f64>,
    /// Write every finding, as CSV: what, query, reference, number
    #[arg(long, value_name = "FILE")]
    findings: Option<PathBuf>,
}

/// How many correct references are searched for the one that is ranked first.
const DEPTH: usize = 100;

/// What was found, in words and line by line.
#[derive(Default)]
struct Findings {
    text: String,
    rows: Vec<[String; 4]>,
}

pub(crate) fn run(args: &AuditArgs) -> anyhow::Result<Outcome> {
    args.input.start_threads()?;
    refuse_files(&args.input)?;
    if let Some(path) = &args.findings {
        cli::check_out(path)?;
    }
    let several = Several {
        methods: &args.methods,
        input: &args.input,
        scores_are_distances: args.scores_are_distances,
        k: DEPTH,
    };
    let (found, truth, _): FoundBySeveral = several.retrieve()?;
    let (name, first) = &found[0];
    let mut findings = Findings::default();
    // Writing to a string cannot fail, here and below.
    let (n, m) = (truth.len(), truth.n_references());
    let _ = writeln!(findings.text, "{n} queries, {m} references; best matches by {name}");
    findings.without_positives(first, &truth);
    findings.never_nearest(first, &truth);
    findings.duplicates(first);
    findings.suspects(args, first, &truth)?;
    findings.radii(args, &found)?;
    cli::print(&findings.text)?;
    if let Some(path) = &args.findings {
        vpr_files::replace(path, findings.csv().as_bytes())?;
    }
    Ok(Outcome::Success)
}

impl Findings {
    fn push(&mut self, what: &str, query: &str, reference: &str, number: String) {
        self.rows.push([what.to_owned(), query.to_owned(), reference.to_owned(), number]);
    }

    fn without_positives(&mut self, found: &Retrieved, truth: &GroundTruth) {
        let queries = audit::without_positives(truth);
        let _ = writeln!(self.text, "queries without a correct reference: {}", queries.len());
        for query in queries {
            self.push("no positive", &query_name(found, query), "", String::new());
        }
    }

    fn never_nearest(&mut self, found: &Retrieved, truth: &GroundTruth) {
        let references = audit::never_nearest(&found.ranking, truth.n_references());
        let _ =
            writeln!(self.text, "references that are nearest to no query: {}", references.len());
        for reference in references {
            self.push("never nearest", "", &reference_name(found, reference), String::new());
        }
    }

    fn duplicates(&mut self, found: &Retrieved) {
        let Some((queries, references)) = &found.descriptors else {
            self.text += "duplicates: not looked for, since there is not one vector per image\n";
            return;
        };
        let groups = audit::duplicates(references, queries);
        let (n, m) = (groups.iter().map(Vec::len).sum::<usize>(), references.len());
        let groups_text = groups.len();
        let _ = writeln!(self.text, "images with equal descriptors: {n} in {groups_text} groups");
        for (group, images) in groups.iter().enumerate() {
            for &image in images {
                let number = group.to_string();
                if image < m {
                    self.push("duplicate", "", &reference_name(found, image), number);
                } else {
                    self.push("duplicate", &query_name(found, image - m), "", number);
                }
            }
        }
    }

    /// Wrong matches that geometric verification finds right.
    fn suspects(
        &mut self,
        args: &AuditArgs,
        found: &Retrieved,
        truth: &GroundTruth,
    ) -> anyhow::Result<()> {
        let doubts = audit::doubts(&found.ranking, &found.confidence, truth)?;
        let (wrong, looked_at) = (doubts.len(), doubts.len().min(args.verify));
        if !args.input.has_images() || looked_at == 0 {
            let _ = writeln!(self.text, "wrong best matches: {wrong}, none verified");
            return Ok(());
        }
        let doubts = &doubts[..looked_at];
        let (queries, best): (Vec<PathBuf>, Vec<usize>) = audit::pairs(doubts)
            .into_iter()
            .map(|(query, reference)| (found.queries.names[query].clone(), reference))
            .unzip();
        let bar = Bar::default();
        let folders = args.input.data.folders();
        let cache = args.input.data.cache();
        let sources = Sources::new(folders.iter().map(PathBuf::as_path), &cache, &bar);
        let matches =
            Matches { queries: &queries, references: &found.references.names, best: &best };
        let counts = match sources.inlier_counts("wrong matches", matches, LocalMethod::Sift)? {
            Verified::Counts(counts) => counts,
            Verified::NotAtHand(why) => anyhow::bail!("SIFT: {why}"),
        };
        let suspects = audit::suspects(doubts, &counts, args.inliers);
        let n = suspects.len();
        let _ = writeln!(
            self.text,
            "wrong best matches: {wrong}, of the {looked_at} surest look right: {n} (SIFT, {} inliers or more)",
            args.inliers
        );
        for it in suspects {
            let (query, reference) = (query_name(found, it.query), reference_name(found, it.found));
            let _ = writeln!(self.text, "  {query} {reference} {} inliers", it.inliers);
            self.push("looks right", &query, &reference, it.inliers.to_string());
        }
        Ok(())
    }

    /// R@1 of all methods at every radius and angle, and which methods change places.
    fn radii(&mut self, args: &AuditArgs, found: &[(String, Retrieved)]) -> anyhow::Result<()> {
        let first = &found[0].1;
        let poses = (&first.queries.poses, &first.references.poses);
        let (Some(queries), Some(references)) = poses else {
            self.text += "radii: not looked at, since there are no positions\n";
            return Ok(());
        };
        let rankings: Vec<_> = found.iter().map(|(_, it)| &it.ranking).collect();
        let angles = || [None].into_iter().chain(args.angles.iter().copied().map(Some));
        let limits: Vec<_> = args
            .radii
            .iter()
            .flat_map(|&radius| angles().map(move |angle| audit::Limits { radius, angle }))
            .collect();
        let at = audit::at_limits(&rankings, queries, references, &limits)?;
        for it in &at {
            let recall = found.iter().zip(&it.recall);
            let recall: Vec<String> =
                recall.map(|((name, _), value)| format!("{name} {:.1}", 100.0 * value)).collect();
            let (limits, known) = (it.limits, it.n_known);
            let _ =
                writeln!(self.text, "within {limits}: {known} known, R@1: {}", recall.join(", "));
        }
        for (a, b, one, other) in audit::reversals(&at) {
            let (a, b) = (&found[a].0, &found[b].0);
            let _ = writeln!(
                self.text,
                "{a} is better than {b} within {one}, and worse within {other}"
            );
            self.push("reversal", a, b, format!("{one}; {other}"));
        }
        if let Some(source) = args.input.truth.source().filter(|it| matches!(it, Source::File(..)))
        {
            let _ = writeln!(self.text, "radii are those of positions, not of the truth: {source}");
        }
        Ok(())
    }

    fn csv(&self) -> String {
        let mut text = "finding,query,reference,number\n".to_owned();
        for row in &self.rows {
            let fields: Vec<String> = row.iter().map(|it| super::compared::quoted(it)).collect();
            text += &(fields.join(",") + "\n");
        }
        text
    }
}

fn query_name(found: &Retrieved, query: usize) -> String {
    found.queries.names[query].display().to_string()
}

fn reference_name(found: &Retrieved, reference: usize) -> String {
    found.references.names[reference].display().to_string()
}
