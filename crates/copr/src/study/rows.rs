//! Errors of localization as cells of a table.

use vpr_core::{Provenance, metrics::bootstrap::Interval};
use vpr_report::table::{Cell, Table};

use super::Context;
use crate::{PoseErrors, Result, WITHIN};

/// How the intervals of medians are found.
const BOOTSTRAP: &str = "bootstrap over queries";
/// How those of differences are found.
const PAIRED: &str = "paired bootstrap over queries";

/// Median translation error, metres.
pub(super) const MTE: &str = "MTE, m";
/// Median rotation error, degrees.
const MRE: &str = "MRE, °";
/// Difference of median translation errors.
const GAIN: &str = "MTE minus that of the sparse map, m";

/// What is left of that if rows are where others should be.
const OVER_SHUFFLED: &str = "MTE minus that with shuffled rows, m";
/// Difference of median rotation errors.
const TURN_GAIN: &str = "MRE minus that of the sparse map, °";

/// Which map was searched: what the rows of a scene are about.
pub(super) struct Row<'a> {
    /// The map, such as `sparse map`.
    pub(super) map: String,
    /// The scene.
    pub(super) column: &'a str,
    /// Where the numbers come from.
    pub(super) provenance: Provenance,
    /// What else tells it from others: encoder, paths; empty for real poses alone.
    pub(super) of: &'a str,
    /// The definition it follows, if there are two.
    pub(super) definition: Option<&'static str>,
    /// What a reader must know.
    pub(super) note: Option<String>,
}

impl Row<'_> {
    fn label(&self, metric: &str) -> String {
        let of = if self.of.is_empty() { String::new() } else { format!(" / {}", self.of) };
        format!("{metric}: {}{of}", self.map)
    }

    fn push(&self, table: &mut Table, metric: &str, interval: &Interval, n: usize, method: &str) {
        let cell =
            Cell::new(self.label(metric), self.column, interval.estimate, self.provenance, n);
        let cell = cell.within(interval.low, interval.high, method);
        let definition = self.definition.map(str::to_owned);
        table.push(Cell { definition, note: self.note.clone(), ..cell });
    }

    /// Both medians and the shares within [`WITHIN`].
    pub(super) fn push_errors(
        &self,
        table: &mut Table,
        errors: &PoseErrors,
        context: Context<'_>,
    ) -> Result<()> {
        let accuracy = errors.accuracy(&context.resampling())?;
        let n = errors.len();
        self.push(table, MTE, &accuracy.mte_m, n, BOOTSTRAP);
        self.push(table, MRE, &accuracy.mre_deg, n, BOOTSTRAP);
        for ((metres, degrees), share) in WITHIN.into_iter().zip(&accuracy.within) {
            self.push(table, &format!("share within {metres} m, {degrees}°"), share, n, "Wilson");
        }
        Ok(())
    }

    /// How much better than the sparse map.
    pub(super) fn push_gain(
        &self,
        table: &mut Table,
        errors: &PoseErrors,
        sparse: &PoseErrors,
        context: Context<'_>,
    ) -> Result<()> {
        let gain = errors.mte_against(sparse, &context.resampling())?;
        self.push(table, GAIN, &gain, errors.len(), PAIRED);
        Ok(())
    }

    /// How much less it turns than the sparse map, where targets have orientations of their own.
    pub(super) fn push_turn_gain(
        &self,
        table: &mut Table,
        errors: &PoseErrors,
        sparse: &PoseErrors,
        context: Context<'_>,
    ) -> Result<()> {
        let gain = errors.mre_against(sparse, &context.resampling())?;
        self.push(table, TURN_GAIN, &gain, errors.len(), PAIRED);
        Ok(())
    }

    /// How much better than the same rows at each other's poses: what is not owed to there being more
    /// poses to be found at.
    pub(super) fn push_gain_over_shuffled(
        &self,
        table: &mut Table,
        errors: &PoseErrors,
        shuffled: &PoseErrors,
        context: Context<'_>,
    ) -> Result<()> {
        let gain = errors.mte_against(shuffled, &context.resampling())?;
        self.push(table, OVER_SHUFFLED, &gain, errors.len(), PAIRED);
        Ok(())
    }

    /// How much better in both medians than something else that has a name.
    pub(super) fn push_against(
        &self,
        table: &mut Table,
        (ours, theirs): (&PoseErrors, &PoseErrors),
        name: &str,
        context: Context<'_>,
    ) -> Result<()> {
        let n = ours.len();
        let gain = ours.mte_against(theirs, &context.resampling())?;
        self.push(table, &format!("{MTE}, minus that of {name}"), &gain, n, PAIRED);
        let gain = ours.mre_against(theirs, &context.resampling())?;
        self.push(table, &format!("{MRE}, minus that of {name}"), &gain, n, PAIRED);
        Ok(())
    }

    /// Cells without a value, and why.
    pub(super) fn push_absent(&self, table: &mut Table, why: &str) {
        for metric in [MTE, MRE] {
            table.push(Cell::absent(self.label(metric), self.column, why));
        }
    }
}
