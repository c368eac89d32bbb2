//! `bench map merge`: several maps, or many segments, become one file.

use std::path::PathBuf;

use vpr_core::map::{OpenMap, Opening, merge};
use vpr_report::cli::{self, Outcome};

#[derive(clap::Args)]
pub(super) struct MergeArgs {
    /// Map files and folders of growing maps, in this order
    #[arg(required = true)]
    maps: Vec<PathBuf>,
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn run(args: &MergeArgs) -> anyhow::Result<Outcome> {
    cli::check_out(&args.out)?;
    let open = |path: &PathBuf| OpenMap::open(path, Opening::default());
    let maps = args.maps.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let n = merge(&maps, &args.out)?;
    cli::note(&format!("wrote {n} references"));
    Ok(Outcome::Success)
}
