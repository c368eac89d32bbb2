//! Learned local features: keypoints, scores, descriptors.
//!
//! ```no_run
//! use vpr_nets::local;
//! use vpr_vision::{image, matching, ransac};
//!
//! let xfeat = local::by_name("xfeat", Some("xfeat.pt".as_ref()), 4096)?;
//! let [a, b] = ["a.jpg", "b.jpg"].map(|it| image::decode(it.as_ref()));
//! let (a, b) = (xfeat.extract(&a?)?, xfeat.extract(&b?)?);
//! let matches = matching::match_features(&a, &b, &matching::MatchParams::MUTUAL)?;
//! let points = ransac::correspondences(&a, &b, &matches);
//! println!("{}", ransac::homography(&points, &ransac::RansacParams::HOMOGRAPHY)?.count());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod delf;
mod disk;
mod map;
mod norm;
mod peaks;
mod superpoint;
mod xfeat;

use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use vpr_core::Error;
use vpr_vision::{
    features::{Extractor, LocalFeatures},
    image::RgbImage,
    orb::{Orb, OrbParams},
    sift::{Sift, SiftParams},
};

pub use self::{
    delf::{Delf, DelfNet, DelfParams},
    disk::{Disk, DiskNet, DiskParams, Suppression},
    superpoint::{SuperPoint, SuperPointMaps, SuperPointNet, SuperPointParams},
    xfeat::{XFeat, XFeatMaps, XFeatNet, XFeatParams},
};
use crate::Result;

/// A network that finds and describes keypoints, and its rule for them.
pub trait Detector: Extractor {
    /// Where it computes.
    fn device(&self) -> &Device;

    /// Features of each of `n × channels × h × w` images with values from 0 to 1.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the images are too small, [`Error::NotFinite`] if the network gives NaN.
    fn detect(&self, images: Tensor<4>) -> vpr_core::Result<Vec<LocalFeatures>>;
}

fn extract(
    detector: &(impl Detector + ?Sized),
    image: &RgbImage,
) -> vpr_core::Result<LocalFeatures> {
    let mut features = detector.detect(tensor(image, detector.device()))?;
    Ok(features.pop().expect("one image in, one out"))
}

/// The names that [`by_name`] knows.
pub const NAMES: [&str; 6] = ["sift", "orb", "xfeat", "disk", "superpoint", "delf"];

/// The method of a name, keeping at most `features` keypoints, its other parameters as released. `weights` is the file
/// of a network; SIFT and ORB have none.
///
/// # Errors
///
/// [`Error::Unknown`] for another name, [`Error::Empty`] without the weights that are needed, and those of
/// [`crate::weights::load`].
pub fn by_name(name: &str, weights: Option<&Path>, features: usize) -> Result<Box<dyn Extractor>> {
    let device = Device::flex();
    let file = || weights.ok_or(Error::Empty("weights of the network"));
    Ok(match name {
        "sift" => Box::new(Sift(SiftParams { features, ..SiftParams::default() })),
        "orb" => Box::new(Orb(OrbParams { features, ..OrbParams::default() })),
        "xfeat" => {
            let params = XFeatParams { features, ..XFeatParams::default() };
            Box::new(XFeat::new(XFeatNet::load(file()?, &device)?, params, device))
        }
        "disk" => {
            let params = DiskParams { features: Some(features), ..DiskParams::default() };
            Box::new(Disk::new(DiskNet::load(file()?, &device)?, params, device)?)
        }
        "superpoint" => {
            let params =
                SuperPointParams { features: Some(features), ..SuperPointParams::default() };
            Box::new(SuperPoint::new(SuperPointNet::load(file()?, &device)?, params, device))
        }
        "delf" => {
            let params = DelfParams { features, ..DelfParams::default() };
            Box::new(Delf::new(DelfNet::load(file()?, &device)?, params, device)?)
        }
        _ => {
            let (name, known) = (name.to_owned(), NAMES.join(", "));
            return Err(Error::Unknown { kind: "local feature", name, known }.into());
        }
    })
}

/// `1 × 3 × h × w`, red first, from 0 to 1.
fn tensor(image: &RgbImage, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = image.as_slice().iter().map(|&it| f32::from(it) / 255.0).collect();
    let data = TensorData::new(values, [1, image.height(), image.width(), 3]);
    Tensor::<4>::from_data(data, device).permute([0, 3, 1, 2])
}

/// Refuses images that are too small.
fn check_size(
    reason: &'static str,
    [height, width]: [usize; 2],
    least: usize,
) -> vpr_core::Result<()> {
    if height.min(width) >= least {
        return Ok(());
    }
    Err(Error::Parameter { name: "image", value: format!("{width}x{height}"), reason })
}
