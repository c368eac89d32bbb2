//! Images that lie under the names of the map and of the queries, for a report to show.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use vpr_core::map::Names;
use vpr_report::cli::{Bar, DataArgs};
use vpr_study::{
    Sources,
    verification::{LocalMethod, Matches, Verified},
};

use super::input::Input;

/// Where the images of both sides are.
#[derive(clap::Args)]
pub(crate) struct PicturesArgs {
    /// Folder of the references' images, under their names in the map: the report shows them
    #[arg(long, requires = "report", value_name = "DIR")]
    map_images: Option<PathBuf>,
    /// Folder of the queries' images, under their names
    #[arg(long, requires = "report", value_name = "DIR")]
    query_images: Option<PathBuf>,
    /// Show the inliers of each best match: `sift`, `sift-fundamental`, `xfeat`, `disk`, …
    #[arg(long, requires_all = ["map_images", "query_images"], value_name = "NAME", value_parser = method)]
    verify: Option<LocalMethod>,
    #[command(flatten)]
    data: DataArgs,
}

/// Images of the two sides, as far as they were asked for.
pub(super) struct Pictures {
    /// One path per query; none without a folder.
    pub(super) queries: Option<Vec<PathBuf>>,
    /// One path per reference; none without a folder.
    pub(super) references: Option<Vec<PathBuf>>,
}

impl PicturesArgs {
    /// The images, before any work: both sides must have names.
    pub(super) fn open(&self, input: &Input) -> anyhow::Result<Pictures> {
        Ok(Pictures {
            queries: paths(self.query_images.as_deref(), input.query_names.as_ref(), "--queries")?,
            references: paths(self.map_images.as_deref(), input.names.as_ref(), "--map")?,
        })
    }

    /// Inliers of every query with its best reference, if asked for.
    pub(super) fn inliers(
        &self,
        pictures: &Pictures,
        best: &[usize],
    ) -> anyhow::Result<Option<Vec<usize>>> {
        let (Some(method), Some(queries), Some(references)) =
            (self.verify, &pictures.queries, &pictures.references)
        else {
            return Ok(None);
        };
        let (bar, folders) = (Bar::default(), self.data.folders());
        let sources = Sources::new(folders.iter().map(PathBuf::as_path), &self.data.cache(), &bar);
        let matches = Matches { queries, references, best };
        match sources.inlier_counts("the best matches", matches, method)? {
            Verified::Counts(counts) => Ok(Some(counts)),
            Verified::NotAtHand(why) => anyhow::bail!("{}: {why}", method.name()),
        }
    }
}

/// A local method by the name that experiments use.
fn method(text: &str) -> Result<LocalMethod, String> {
    serde_json::from_value(text.into()).map_err(|err| err.to_string())
}

fn paths(
    folder: Option<&Path>,
    names: Option<&Names>,
    flag: &str,
) -> anyhow::Result<Option<Vec<PathBuf>>> {
    let Some(folder) = folder else { return Ok(None) };
    ensure!(folder.is_dir(), "{}: is no folder of images", folder.display());
    let Some(names) = names else {
        anyhow::bail!(
            "{}: rows of {flag} have no names that images could lie under",
            folder.display()
        )
    };
    let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    if let Some(missing) = paths.first().filter(|_| paths.iter().all(|path| !path.is_file())) {
        anyhow::bail!(
            "{}: no image of {flag} lies there, {} for one",
            folder.display(),
            missing.display()
        );
    }
    Ok(Some(paths))
}
