//! The flags that say which references are correct, the same in all programs. Behind `cli`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use vpr_data::truth::{Form, Labels, Reading, Rows, Source};

/// A truth from a file, from labels or by index; instead of positions.
#[derive(Args, Clone, Debug)]
pub struct TruthArgs {
    /// Which references are correct, instead of positions: lists, pairs or a matrix as .npy, .npz,
    /// .pkl, .json, .csv or .txt (docs/formats.md)
    #[arg(long, alias = "ground_truth", value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// Which array of an .npz, or entry of a dictionary, is the truth
    #[arg(long, value_name = "NAME", requires = "ground_truth")]
    truth_key: Option<String>,
    /// What rows of numbers are, where they could be several things
    #[arg(long, value_enum, value_name = "FORM", requires = "ground_truth")]
    truth_form: Option<FormArg>,
    /// What the rows of a square matrix are
    #[arg(long, value_enum, value_name = "SIDE", requires = "ground_truth")]
    truth_rows: Option<RowsArg>,
    /// Labelled places, instead of positions: a table of names and labels, a label per line, or
    /// `folders`, where images of one place lie in one folder; a reference is correct if its label
    /// is that of the query
    #[arg(long, value_name = "FILE|folders", conflicts_with = "ground_truth")]
    labels: Option<PathBuf>,
    /// The labels of the queries, if `--labels` has those of the references only
    #[arg(long, value_name = "FILE", requires = "labels")]
    queries_labels: Option<PathBuf>,
    /// Title of the column of labels, if it is not `label`, `class`, `place`, `floor`, `room`
    #[arg(long, value_name = "TITLE", requires = "labels")]
    label_column: Option<String>,
    /// A reference is correct if its index is that of the query, give or take N: two traverses that
    /// are aligned frame by frame
    #[arg(long, value_name = "N", conflicts_with_all = ["ground_truth", "labels"])]
    same_index: Option<usize>,
    /// A reference is correct within this many metres, the limit included
    #[arg(long, alias = "positive_dist_threshold", default_value_t = RADIUS_M, value_name = "M")]
    pub positive_dist_threshold: f64,
}

/// How near a correct reference is, in metres, as VPR-methods-evaluation has it.
const RADIUS_M: f64 = 25.0;

/// What `--labels` is called with where there is no file.
const FOLDERS: &str = "folders";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FormArg {
    /// A row per query with its references, filled up with -1
    Lists,
    /// Rows of a query and a reference
    Pairs,
    /// Zeros and ones, queries × references or the transpose
    Matrix,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum RowsArg {
    /// One row per query
    Queries,
    /// One row per reference
    References,
}

impl TruthArgs {
    /// Where the truth is from, if it is not positions.
    #[must_use]
    pub fn source(&self) -> Option<Source> {
        if let Some(path) = &self.ground_truth {
            let form = self.truth_form.map(|form| match form {
                FormArg::Lists => Form::Lists,
                FormArg::Pairs => Form::Pairs,
                FormArg::Matrix => Form::Matrix,
            });
            let rows = self.truth_rows.map(|rows| match rows {
                RowsArg::Queries => Rows::Queries,
                RowsArg::References => Rows::References,
            });
            let (key, radius) = (self.truth_key.clone(), self.positive_dist_threshold);
            return Some(Source::File(path.clone(), Reading { key, form, rows, radius }));
        }
        if let Some(path) = &self.labels {
            let (queries, column) = (self.queries_labels.clone(), self.label_column.clone());
            // A file of this name wins, it can be written as `./folders`.
            let is_folders = path.as_os_str() == FOLDERS && queries.is_none() && !path.is_file();
            return Some(Source::Labels(if is_folders {
                Labels::Folders
            } else {
                Labels::File { path: path.clone(), queries, column }
            }));
        }
        self.same_index.map(Source::SameIndex)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        truth: TruthArgs,
    }

    fn source(arguments: &[&str]) -> Result<Option<Source>, String> {
        let parsed = Program::try_parse_from([&["program"], arguments].concat());
        parsed.map(|it| it.truth.source()).map_err(|err| err.to_string())
    }

    #[test]
    fn each_flag_is_one_source() {
        assert_eq!(source(&[]), Ok(None));
        assert_eq!(source(&["--same-index", "2"]), Ok(Some(Source::SameIndex(2))));
        assert_eq!(source(&["--labels", "folders"]), Ok(Some(Source::Labels(Labels::Folders))));
        let file = |path: &str, queries: Option<&str>, column: Option<&str>| {
            let (path, queries) = (path.into(), queries.map(PathBuf::from));
            let column = column.map(str::to_owned);
            Ok(Some(Source::Labels(Labels::File { path, queries, column })))
        };
        let flags = ["--labels", "a.csv", "--label-column", "floor"];
        assert_eq!(source(&flags), file("a.csv", None, Some("floor")));
        let flags = ["--labels", "a.txt", "--queries-labels", "b.txt"];
        assert_eq!(source(&flags), file("a.txt", Some("b.txt"), None));
        let flags = ["--ground-truth", "a.npz", "--truth-key", "GTsoft", "--truth-rows", "queries"];
        let reading = Reading {
            key: Some("GTsoft".to_owned()),
            rows: Some(Rows::Queries),
            ..Reading::default()
        };
        assert_eq!(source(&flags), Ok(Some(Source::File("a.npz".into(), reading))));
    }

    #[test]
    fn two_truths_are_one_too_many() {
        for flags in [
            ["--labels", "folders", "--same-index", "2"],
            ["--ground-truth", "a.npy", "--same-index", "2"],
            ["--ground-truth", "a.npy", "--labels", "folders"],
        ] {
            assert!(source(&flags).unwrap_err().contains("cannot be used with"), "{flags:?}");
        }
        assert!(source(&["--truth-key", "GTsoft"]).unwrap_err().contains("--ground-truth"));
    }
}
