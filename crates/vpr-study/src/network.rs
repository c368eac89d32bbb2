//! Networks with their weights, as techniques.

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use vpr_core::{Descriptors, Result, map::About, metrics::Timing};
use vpr_nets::encode::{Encoder, Options, encode_files, encode_images, l1, registry::Matching};
use vpr_vision::{hog::similarity, image};

use crate::describe::{Describe, Features, median};

/// A network with its weights.
#[derive(Clone)]
pub struct Network(Arc<dyn Encoder>);

impl fmt::Debug for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Network").field(&self.0.name()).finish()
    }
}

impl Network {
    /// The network as a technique: its descriptors are compared by cosine, or as the network asks.
    #[must_use]
    pub fn new(encoder: Arc<dyn Encoder>) -> Self {
        Self(encoder)
    }
}

impl Describe for Network {
    fn key(&self) -> String {
        let (name, digest) = (self.0.name(), self.0.weights_digest().unwrap_or_default());
        format!("{name} {digest} {:?}", self.0.preprocessing())
    }

    fn encode(&self, images: &[PathBuf], step: &(dyn Fn() + Sync)) -> Result<Features> {
        let mut n_done = 0;
        let mut done = |upto: usize| {
            (n_done..upto).for_each(|_| step());
            n_done = upto;
        };
        let rows = encode_files(self.0.as_ref(), images, &Options::default(), &mut done)?;
        Ok(self.kept(rows))
    }

    fn time(&self, images: &[PathBuf]) -> Result<Timing> {
        let options = Options { threads: Some(1), ..Options::default() };
        let decode = |path: &PathBuf| image::decode(Path::new(path));
        let decoded = images.iter().map(decode).collect::<Result<Vec<_>>>()?;
        let (mut encoding, mut matching, mut rows) = (Vec::new(), Vec::new(), Vec::new());
        for image in &decoded {
            let start = Instant::now();
            let row = encode_images(self.0.as_ref(), std::slice::from_ref(image), &options)?;
            encoding.push(start.elapsed().as_secs_f64());
            rows.push(row.as_slice().to_vec());
        }
        for (a, b) in rows.iter().zip(rows.iter().skip(1)) {
            let start = Instant::now();
            match self.0.matching() {
                Matching::Euclidean => similarity(a, b)?,
                Matching::L1 => l1::of_pair(a, b),
            };
            matching.push(start.elapsed().as_secs_f64());
        }
        Ok(Timing { encoding: median(&mut encoding)?, matching: median(&mut matching)? })
    }

    fn kept(&self, rows: Descriptors) -> Features {
        match self.0.matching() {
            Matching::Euclidean => Features::Vectors(rows),
            Matching::L1 => Features::Differences(rows),
        }
    }

    fn about(&self) -> Option<About> {
        Some(About {
            encoder: Some(self.0.name().to_owned()),
            weights_digest: self.0.weights_digest().map(str::to_owned),
            ..About::default()
        })
    }
}
