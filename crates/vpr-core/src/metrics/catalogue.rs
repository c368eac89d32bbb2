//! Which metrics there are and what each is good for: thesis table 3.3, continued with ours.

use std::fmt;

use serde::Serialize;

/// What a metric is for and which functions compute it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MetricInfo {
    /// Short name for command lines and files.
    pub id: &'static str,
    /// Name as the thesis prints it.
    pub name: &'static str,
    /// Applications it suits best.
    pub usage: &'static [Usage],
    /// What comes out.
    pub output: Output,
    /// Whether it suits systems that survive false positives ("FP Allowed?").
    pub false_positives_allowed: bool,
    /// Who mostly uses it.
    pub audience: Audience,
    /// Whether it measures matching, computation or both.
    pub nature: Nature,
    /// Whether it is a row of thesis table 3.3; the other rows are ours.
    pub in_thesis: bool,
    /// The functions of [`metrics`](super) that compute it; none if it is a plain measurement.
    pub functions: &'static [&'static str],
}

impl MetricInfo {
    /// The usage as table 3.3 writes it: `PL+LC+IR`, with a star where false positives are fatal.
    #[must_use]
    pub fn usage_label(&self) -> String {
        let star = if self.false_positives_allowed { "" } else { "*" };
        let labels: Vec<String> = self.usage.iter().map(|usage| format!("{usage}{star}")).collect();
        labels.join("+")
    }
}

/// An application of place recognition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Usage {
    /// Place recognition is the only localisation (PL).
    PrimaryLocalisation,
    /// Drift correction in a SLAM pipeline (LC).
    LoopClosure,
    /// As many images of the place as possible (IR).
    ImageRetrieval,
}

/// The shape of a metric's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Output {
    /// One number.
    SingleValue,
    /// One number per N.
    NValues,
    /// One number per threshold or per distance.
    MultipleValues,
    /// One number, or one per platform.
    SingleOrMultipleValues,
}

/// A research community.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Audience {
    /// Robotics (RC).
    Robotics,
    /// Computer vision (CV).
    Vision,
    /// Both.
    Both,
}

/// What a metric measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Nature {
    /// Matching performance (MB).
    Matching,
    /// Computational intensity (CB).
    Computation,
    /// Both.
    Both,
}

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::PrimaryLocalisation => "PL",
            Self::LoopClosure => "LC",
            Self::ImageRetrieval => "IR",
        })
    }
}

impl fmt::Display for Output {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::SingleValue => "Single-value",
            Self::NValues => "N-values",
            Self::MultipleValues => "Multiple-values",
            Self::SingleOrMultipleValues => "Single/Multiple values",
        })
    }
}

impl fmt::Display for Audience {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Robotics => "RC",
            Self::Vision => "CV",
            Self::Both => "RC+CV",
        })
    }
}

impl fmt::Display for Nature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Matching => "MB",
            Self::Computation => "CB",
            Self::Both => "MB+CB",
        })
    }
}

const ANY: &[Usage] = &[Usage::PrimaryLocalisation, Usage::LoopClosure, Usage::ImageRetrieval];
const LOCALISATION: &[Usage] = &[Usage::PrimaryLocalisation, Usage::LoopClosure];

/// A matching metric of both communities with one value; the rows below say what differs.
const PLAIN: MetricInfo = MetricInfo {
    id: "",
    name: "",
    usage: ANY,
    output: Output::SingleValue,
    false_positives_allowed: true,
    audience: Audience::Both,
    nature: Nature::Matching,
    in_thesis: false,
    functions: &[],
};

/// A row of table 3.3.
const THESIS: MetricInfo = MetricInfo { in_thesis: true, ..PLAIN };

/// All metrics: the eleven rows of thesis table 3.3 in its order, then ours.
pub const CATALOGUE: &[MetricInfo] = &[
    MetricInfo {
        id: "auc-pr",
        name: "AUC-PR",
        functions: &["auc_pr", "precision_recall_curve"],
        ..THESIS
    },
    MetricInfo {
        id: "extended-precision",
        name: "Extended Precision",
        usage: LOCALISATION,
        false_positives_allowed: false,
        audience: Audience::Robotics,
        functions: &["extended_precision"],
        ..THESIS
    },
    MetricInfo {
        id: "recall-at-100-precision",
        name: "Recall@100%Precision",
        usage: LOCALISATION,
        false_positives_allowed: false,
        audience: Audience::Robotics,
        functions: &["recall_at_precision"],
        ..THESIS
    },
    MetricInfo {
        id: "recall-rate",
        name: "RecallRate@N",
        output: Output::NValues,
        functions: &["recall_at", "recall_curve"],
        ..THESIS
    },
    MetricInfo {
        id: "recall-at-reduced-precision",
        name: "Recall@ReducedPrecision",
        functions: &["recall_at_precision"],
        ..THESIS
    },
    MetricInfo {
        id: "map",
        name: "mean-Average-Precision",
        usage: &[Usage::ImageRetrieval],
        audience: Audience::Vision,
        functions: &["mean_average_precision"],
        ..THESIS
    },
    MetricInfo {
        id: "f1",
        name: "F1-Score",
        usage: LOCALISATION,
        output: Output::MultipleValues,
        functions: &["f1_curve", "f1_max"],
        ..THESIS
    },
    MetricInfo {
        id: "encoding-time",
        name: "Encoding Time",
        usage: LOCALISATION,
        audience: Audience::Robotics,
        nature: Nature::Computation,
        ..THESIS
    },
    MetricInfo {
        id: "matching-time",
        name: "Matching Time",
        nature: Nature::Computation,
        ..THESIS
    },
    MetricInfo {
        id: "pcu",
        name: "PCU",
        usage: LOCALISATION,
        audience: Audience::Robotics,
        nature: Nature::Both,
        functions: &["pcu", "precision_at_full_recall"],
        ..THESIS
    },
    MetricInfo {
        id: "rmf",
        name: "RMF",
        usage: LOCALISATION,
        output: Output::SingleOrMultipleValues,
        audience: Audience::Robotics,
        nature: Nature::Both,
        functions: &["rmf"],
        ..THESIS
    },
    MetricInfo {
        id: "auc-roc",
        name: "AUC-ROC",
        usage: &[Usage::LoopClosure],
        audience: Audience::Robotics,
        functions: &["auc_roc", "roc_curve", "roc_positives"],
        ..PLAIN
    },
    MetricInfo {
        id: "average-precision",
        name: "Average Precision",
        functions: &["average_precision"],
        ..PLAIN
    },
    MetricInfo { id: "accuracy", name: "Accuracy", functions: &["accuracy"], ..PLAIN },
    MetricInfo {
        id: "aurc",
        name: "AURC, excess AURC",
        usage: LOCALISATION,
        audience: Audience::Robotics,
        functions: &["aurc", "excess_aurc", "risk_coverage_curve", "base_risk"],
        ..PLAIN
    },
    MetricInfo {
        id: "true-positive-spacing",
        name: "True-positive distribution",
        usage: LOCALISATION,
        output: Output::MultipleValues,
        audience: Audience::Robotics,
        functions: &["true_positive_spacing"],
        ..PLAIN
    },
    MetricInfo {
        id: "retrieval-time",
        name: "Retrieval time",
        nature: Nature::Computation,
        functions: &["retrieval_time"],
        ..PLAIN
    },
    MetricInfo {
        id: "platform-speed",
        name: "Platform speed",
        usage: LOCALISATION,
        audience: Audience::Robotics,
        nature: Nature::Computation,
        functions: &["speed_limit", "required_fps"],
        ..PLAIN
    },
    MetricInfo {
        id: "abc",
        name: "Area between curves",
        usage: LOCALISATION,
        functions: &["area_between_curves"],
        ..PLAIN
    },
    MetricInfo {
        id: "descriptor-size",
        name: "Descriptor size",
        nature: Nature::Computation,
        ..PLAIN
    },
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The source of every file that holds metrics.
    const SOURCES: &[&str] = &[
        include_str!("average.rs"),
        include_str!("curve.rs"),
        include_str!("economy.rs"),
        include_str!("invariance.rs"),
        include_str!("operating_point.rs"),
        include_str!("platform.rs"),
        include_str!("recall.rs"),
        include_str!("roc.rs"),
        include_str!("selective.rs"),
        include_str!("spacing.rs"),
    ];

    #[test]
    fn the_thesis_rows_read_as_in_table_3_3() {
        let rows: Vec<String> = CATALOGUE
            .iter()
            .filter(|metric| metric.in_thesis)
            .map(|metric| {
                let allowed = if metric.false_positives_allowed { "Yes" } else { "No" };
                let MetricInfo { name, output, audience, nature, .. } = metric;
                format!("{name} {} {output} {allowed} {audience} {nature}", metric.usage_label())
            })
            .collect();
        let thesis = [
            "AUC-PR PL+LC+IR Single-value Yes RC+CV MB",
            "Extended Precision PL*+LC* Single-value No RC MB",
            "Recall@100%Precision PL*+LC* Single-value No RC MB",
            "RecallRate@N PL+LC+IR N-values Yes RC+CV MB",
            "Recall@ReducedPrecision PL+LC+IR Single-value Yes RC+CV MB",
            "mean-Average-Precision IR Single-value Yes CV MB",
            "F1-Score PL+LC Multiple-values Yes RC+CV MB",
            "Encoding Time PL+LC Single-value Yes RC CB",
            "Matching Time PL+LC+IR Single-value Yes RC+CV CB",
            "PCU PL+LC Single-value Yes RC MB+CB",
            "RMF PL+LC Single/Multiple values Yes RC MB+CB",
        ];
        assert_eq!(rows, thesis);
    }

    #[test]
    fn every_function_exists_and_every_id_is_its_own() {
        for name in CATALOGUE.iter().flat_map(|metric| metric.functions) {
            let declaration = format!("\npub fn {name}(");
            assert!(SOURCES.iter().any(|source| source.contains(&declaration)), "{name}");
        }
        let ids: BTreeSet<&str> = CATALOGUE.iter().map(|metric| metric.id).collect();
        assert_eq!(ids.len(), CATALOGUE.len());
    }
}
