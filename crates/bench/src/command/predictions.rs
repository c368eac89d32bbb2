//! What `bench evaluate` saves, laid out as VPR-methods-evaluation does.

use std::{fmt::Write as _, fs, path::PathBuf};

use anyhow::Context;
use vpr_core::{GroundTruth, cli, npy};

use super::evaluate::{EvaluateArgs, Retrieved};

/// Saves predictions and descriptors below `logs/<log_dir>/<time>/`, if any are asked for.
pub(super) fn save(
    args: &EvaluateArgs,
    retrieved: &Retrieved,
    truth: Option<&GroundTruth>,
) -> anyhow::Result<()> {
    if args.num_preds_to_save == 0 && !args.save_descriptors {
        return Ok(());
    }
    let time = jiff::Timestamp::now().strftime("%Y-%m-%d_%H-%M-%S").to_string();
    let folder = PathBuf::from("logs").join(&args.log_dir).join(time);
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    if args.save_descriptors {
        let (queries, references) = retrieved
            .descriptors
            .as_ref()
            .context("`save-descriptors`: this method does not have one vector per image")?;
        npy::write_f32(&folder.join("queries_descriptors.npy"), queries.view())?;
        npy::write_f32(&folder.join("database_descriptors.npy"), references.view())?;
    }
    if args.num_preds_to_save > 0 {
        let preds = folder.join("preds");
        fs::create_dir_all(&preds).with_context(|| preds.display().to_string())?;
        for query in 0..retrieved.queries.names.len() {
            let best = retrieved.ranking.indices(query)[0];
            let is_correct = truth.is_some_and(|truth| truth.is_correct(query, best));
            if args.save_only_wrong_preds && is_correct {
                continue;
            }
            let path = preds.join(format!("{query:03}.txt"));
            let text = prediction(retrieved, truth, query, args.num_preds_to_save);
            fs::write(&path, text).with_context(|| path.display().to_string())?;
        }
    }
    cli::note(&format!("saved in {}", folder.display()));
    Ok(())
}

/// One query with its predictions and, if known, its correct references.
fn prediction(
    retrieved: &Retrieved,
    truth: Option<&GroundTruth>,
    query: usize,
    n: usize,
) -> String {
    let name = |index: &usize| retrieved.references.names[*index].display().to_string();
    let predicted: Vec<String> =
        retrieved.ranking.indices(query).iter().take(n).map(name).collect();
    let query_name = retrieved.queries.names[query].display();
    let mut text =
        format!("Query path:\n{query_name}\n\nPredictions paths:\n{}\n", predicted.join("\n"));
    if let Some(truth) = truth {
        let positives: Vec<String> = truth.correct(query).iter().map(name).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\nPositives paths:\n{}", positives.join("\n"));
    }
    text
}
