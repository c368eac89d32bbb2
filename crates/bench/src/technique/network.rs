//! Networks whose weights are at hand, as techniques.

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use vpr_core::{Result, metrics::Timing};
use vpr_nets::encode::{Encoder, Options, by_name, encode_files, encode_images, registry::Method};
use vpr_vision::{hog::similarity, image};

use super::{Describe, Features, hand_crafted::median};

/// Columns of the networks that run here, and their names in the registry of weights. None is one
/// of the thesis' ten: its NetVLAD is VGG-16.
const NETWORKS: [(&str, &str); 2] =
    [("default network", "default"), ("NetVLAD, MobileNetV2", "netvlad-mobilenetv2-rgb")];

/// A network with its weights.
#[derive(Clone)]
pub struct Network(Arc<dyn Encoder>);

impl fmt::Debug for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Network").field(&self.0.name()).finish()
    }
}

/// The networks whose weights lie in one of these data folders, by column.
///
/// # Errors
///
/// If weights are there but are not those of the network.
pub fn networks(roots: &[PathBuf]) -> Result<Vec<(&'static str, Network)>> {
    let mut networks = Vec::new();
    for (column, name) in NETWORKS {
        let method = Method::find(name, None)?;
        if method.locate(method.dimension(None)?, roots).is_some() {
            networks.push((column, Network(by_name(name, None, roots)?.into())));
        }
    }
    Ok(networks)
}

impl Describe for Network {
    fn key(&self) -> String {
        format!("{} {}", self.0.name(), self.0.weights_digest().unwrap_or_default())
    }

    fn encode(&self, images: &[PathBuf], step: &(dyn Fn() + Sync)) -> Result<Features> {
        let options = Options::default();
        let rows = encode_files(self.0.as_ref(), images, &options, &mut |_| step())?;
        Ok(Features::Vectors(rows))
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
            similarity(a, b)?;
            matching.push(start.elapsed().as_secs_f64());
        }
        Ok(Timing { encoding: median(&mut encoding)?, matching: median(&mut matching)? })
    }
}
