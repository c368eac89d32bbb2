//! What each family needs: table 5.1, read off the types of evidence.

use vpr_core::Provenance;
use vpr_report::table::{Cell, Table};

use crate::{Evidence, Inliers, L2Distance, Share, Sue, UncertaintyEstimator, Variance};

pub(super) fn run(table: &mut Table) {
    push::<L2Distance>(table);
    push::<Variance>(table);
    push::<Inliers>(table);
    push::<Sue>(table);
}

/// One row: what the evidence of this type of estimator is made of.
fn push<E: UncertaintyEstimator>(table: &mut Table) {
    let needs = <E::Evidence<'_> as Evidence>::NEEDS;
    let row = E::CATEGORY.label();
    let efficient = if needs.is_efficient() { "Yes" } else { "No" };
    let entries = [
        ("Descr.?", share(needs.descriptors)),
        ("Poses?", share(needs.poses)),
        ("Images?", share(needs.images)),
        ("Efficient?", efficient),
    ];
    for (column, value) in entries {
        table.push(Cell::new(row, column, value, Provenance::Published, 1));
    }
}

/// As the table writes it.
fn share(share: Share) -> &'static str {
    match share {
        Share::None => "No",
        Share::TopK => "Top-K",
        Share::Training => "Only train",
        Share::Query | Share::Pair => "Yes",
    }
}
