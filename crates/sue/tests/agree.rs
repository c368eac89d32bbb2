//! Chapters 3 and 5 see the same matches.

use std::path::Path;

use sue::corpus::Corpora;
use vpr_study::{Direction, Sources};

/// Chapter 3 reads the scores; chapter 5 the retrieval of a corpus.
#[test]
fn chapters_agree_on_the_best_matches_of_every_technique() {
    let cache = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data");
    let corpora = Corpora::new(Sources::new([&*data], cache.path(), &()));
    let sources = corpora.sources();
    for id in ["fixture", "world/street?places=6&camera.width=80&camera.height=60"] {
        let dataset = sources.images(id).unwrap().unwrap();
        let mut n = 0;
        for name in ["hog", "cohog", "default"] {
            let runner = sources.runner(name).unwrap().unwrap();
            let scores = sources.scores(&runner, &dataset, Direction::AsReleased).unwrap();
            let corpus = corpora.open(id, &[name.to_owned()]).unwrap().corpora.remove(0);
            assert_eq!(corpus.retrieval.best(), scores.best().reference, "{name} on {id}");
            n += corpus.judged.len();
        }
        assert!(n >= 18, "{n} matches");
    }
}
