//! The shipped NetVLAD on the real Corridor images, against the numbers it is known to give.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

use std::path::{Path, PathBuf};

use vpr_core::{Similarities, metrics::recall_at};
use vpr_data::layout::vpr_bench::{GroundTruthFile, image_folder};
use vpr_nets::encode::{Options, by_name, encode_files};

#[test]
fn recall_on_corridor_is_that_of_the_original_network() {
    let Some(data) = std::env::var_os("VPR_DATA").map(PathBuf::from) else {
        println!("skipped: VPR_DATA is not set, weights/ and vpr-bench/ are in it");
        return;
    };
    let folder = data.join("vpr-bench/datasets/corridor");
    // The gray twin has no published numbers; `docs/parity.md` holds it against NumPy.
    for (name, expected) in [("rgb", Some([0.4505, 0.8198])), ("gray", None)] {
        let name = format!("netvlad-mobilenetv2-{name}");
        let encoder = by_name(&name, None, std::slice::from_ref(&data)).unwrap();
        let encode = |side: &str| {
            let images = image_folder(&folder.join(side)).unwrap();
            encode_files(&*encoder, &images, &Options::default(), &mut |_| ()).unwrap()
        };
        let (queries, references) = (encode("query"), encode("ref"));
        let similarities =
            Similarities::new(queries.view().dot(&references.view().t()).mapv(f64::from)).unwrap();
        let truth = read_truth(&folder, references.len());
        let ranking = similarities.ranked(20).unwrap();
        let recalls = [1, 5].map(|n| recall_at(n, &ranking, &truth).unwrap());
        println!("{name}: R@1 {:.3}, R@5 {:.3}", recalls[0], recalls[1]);
        for (actual, expected) in recalls.into_iter().zip(expected.into_iter().flatten()) {
            assert!((actual - expected).abs() <= 0.01, "{name}: {actual}, not {expected}");
        }
    }
}

fn read_truth(folder: &Path, n_references: usize) -> vpr_core::GroundTruth {
    let file = GroundTruthFile::read(&folder.join("ground_truth_new.npy")).unwrap();
    file.truth(n_references).unwrap().0
}
