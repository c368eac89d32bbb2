//! What every method makes of one sparse map, as rows of a table.

use vpr_core::{Map, Poses};
use vpr_report::table::Table;

use super::{
    Context, Method,
    dense::{densified, localize, remark},
    rows::Row,
};
use crate::{PoseErrors, Result, Targets, oracle};

/// A sparse map that is made denser at some targets, and the queries that are localized in it.
pub(super) struct Setting<'a> {
    pub(super) sparse: &'a Map,
    pub(super) queries: &'a Map,
    pub(super) targets: &'a Targets<'a>,
}

impl Setting<'_> {
    /// Oracle, sparse map, then every method with its gain; `row` makes a row of the name of a map, a
    /// definition and a note. Gives the errors in the sparse map.
    pub(super) fn push<'r>(
        &self,
        table: &mut Table,
        methods: &[Method],
        row: impl Fn(&str, Option<&'static str>, Option<String>) -> Row<'r>,
        context: Context<'_>,
    ) -> Result<PoseErrors> {
        let queries = self.queries;
        let mut dense = self.sparse.poses().clone();
        dense.extend(&Poses::SixDof(self.targets.iter().map(|it| it.pose).collect()))?;
        let best = oracle(queries.poses(), &dense)?;
        let errors = PoseErrors::of_retrieval(&best, &dense, queries.poses())?;
        row("dense map, oracle", None, None).push_errors(table, &errors, context)?;
        let sparse_errors = localize(self.sparse, queries)?;
        row("sparse map", None, None).push_errors(table, &sparse_errors, context)?;
        let (mut network, mut shuffled) = (None, None);
        for method in methods {
            let map = method.map();
            let ready = match method.ready(context)? {
                Ok(ready) => ready,
                Err(why) => {
                    row(&map, None, None).push_absent(table, &why);
                    continue;
                }
            };
            match densified(self.sparse, self.sparse, self.targets, &ready)? {
                Ok((dense, told)) => {
                    let errors = localize(&dense, queries)?;
                    let row = row(&map, ready.definition, remark(told));
                    row.push_errors(table, &errors, context)?;
                    row.push_gain(table, &errors, &sparse_errors, context)?;
                    if method.is_network() {
                        network = Some(errors);
                    } else if method.is_shuffled_network() {
                        shuffled = Some(errors);
                    }
                }
                Err(why) => row(&map, ready.definition, None).push_absent(table, &why),
            }
        }
        if let (Some(network), Some(shuffled)) = (network, shuffled) {
            let row = row("dense map, Non-lin. Reg.", None, None);
            row.push_gain_over_shuffled(table, &network, &shuffled, context)?;
        }
        Ok(sparse_errors)
    }
}
