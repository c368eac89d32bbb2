//! What `bench evaluate` saves, laid out as VPR-methods-evaluation does.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;
use vpr_core::GroundTruth;
use vpr_files::npy;
use vpr_report::cli;

use super::{log_folder, retrieved::Retrieved};

/// What is saved, and where.
#[derive(Clone, Copy)]
pub(super) struct Saving<'a> {
    /// Predictions per query.
    pub(super) n_predictions: usize,
    /// Only those of queries whose best reference is wrong.
    pub(super) only_wrong: bool,
    /// Whether descriptors are saved.
    pub(super) descriptors: bool,
    /// Name of the folder below `logs/`.
    pub(super) log_dir: &'a str,
}

/// The folder of a run's results, made before the work: what cannot be saved there is known then.
pub(super) struct Place(PathBuf);

impl Place {
    /// Makes `logs/<log_dir>/<time>/`, if anything is to be saved.
    ///
    /// # Errors
    ///
    /// If it cannot be made, as where a file is called so.
    pub(super) fn create(saving: &Saving<'_>) -> anyhow::Result<Option<Self>> {
        if saving.n_predictions == 0 && !saving.descriptors {
            return Ok(None);
        }
        let folder = log_folder::create(&Path::new("logs").join(saving.log_dir))?;
        Ok(Some(Self(folder)))
    }

    /// Saves predictions, descriptors and these texts.
    pub(super) fn save(
        self,
        saving: &Saving<'_>,
        retrieved: &Retrieved,
        truth: Option<&GroundTruth>,
        files: &[(&str, String)],
    ) -> anyhow::Result<()> {
        let folder = &self.0;
        for (name, text) in files {
            vpr_files::replace(&folder.join(name), text.as_bytes())?;
        }
        if saving.descriptors {
            let (queries, references) = retrieved
                .descriptors
                .as_ref()
                .context("`save-descriptors`: there is not one vector per image")?;
            npy::write_f32(&folder.join("queries_descriptors.npy"), queries.view())?;
            npy::write_f32(&folder.join("database_descriptors.npy"), references.view())?;
        }
        if saving.n_predictions > 0 {
            let preds = folder.join("preds");
            fs::create_dir_all(&preds).with_context(|| preds.display().to_string())?;
            for query in 0..retrieved.queries.names.len() {
                let best = retrieved.ranking.indices(query)[0];
                let is_correct = truth.is_some_and(|truth| truth.is_correct(query, best));
                if saving.only_wrong && is_correct {
                    continue;
                }
                let path = preds.join(format!("{query:03}.txt"));
                let text = prediction(retrieved, truth, query, saving.n_predictions);
                vpr_files::replace(&path, text.as_bytes())?;
            }
        }
        cli::note(&format!("saved in {}", folder.display()));
        Ok(())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // A run that failed leaves no empty folder; one with results is not empty and stays.
        let _ = fs::remove_dir(&self.0);
    }
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
