//! Which augmentations are used together.

use serde::{Deserialize, Serialize};

use super::{Augmentation, Augmentations, Change};

/// Augmentations by name: the rows of thesis table 4.6. The thesis names no ranges; these are ours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Viewpoint and appearance
    #[default]
    All,
    /// Viewpoint only
    Viewpoint,
    /// Appearance only
    Appearance,
    /// Queries are the references as they are
    None,
}

impl Preset {
    /// All, in the order of table 4.6.
    pub const EACH: [Self; 4] = [Self::None, Self::Appearance, Self::Viewpoint, Self::All];

    /// Its name in files and flags.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Viewpoint => "viewpoint",
            Self::Appearance => "appearance",
            Self::None => "none",
        }
    }

    /// The augmentations.
    #[must_use]
    pub fn augmentations(self) -> Augmentations {
        Augmentations(match self {
            Self::All => [viewpoint(), appearance()].concat(),
            Self::Viewpoint => viewpoint(),
            Self::Appearance => appearance(),
            Self::None => Vec::new(),
        })
    }
}

fn viewpoint() -> Vec<Augmentation> {
    let affine = Change::RandomAffine {
        degrees: 5.0,
        translate: (0.06, 0.04),
        scale: (0.92, 1.1),
        shear: 4.0,
    };
    let crop = Change::RandomResizedCrop { scale: (0.65, 1.0), ratio: (0.87, 1.15) };
    vec![
        Augmentation { change: crop, p: 0.6 },
        Augmentation { change: Change::RandomPerspective { distortion_scale: 0.2 }, p: 0.4 },
        Augmentation { change: affine, p: 0.4 },
    ]
}

fn appearance() -> Vec<Augmentation> {
    let jiggle = Change::ColorJiggle { brightness: 0.3, contrast: 0.4, saturation: 0.5, hue: 0.05 };
    let erasing = Change::RandomErasing { scale: (0.02, 0.15), ratio: (0.5, 2.0), value: 0.4 };
    let snow = Change::RandomSnow { snow_coefficient: (0.3, 0.7), brightness: (1.3, 3.0) };
    [
        (snow, 0.35),
        (Change::RandomFog { density: (0.2, 0.8) }, 0.25),
        (Change::RandomNight { darkness: (0.2, 1.0) }, 0.2),
        (jiggle, 0.7),
        (Change::RandomGamma { gamma: (0.6, 1.7), gain: (0.9, 1.1) }, 0.3),
        (Change::RandomGrayscale, 0.2),
        (Change::RandomEqualize, 0.1),
        (Change::RandomPosterize { bits: (3, 6) }, 0.1),
        (Change::RandomGaussianBlur { kernel_size: 5, sigma: (0.3, 1.5) }, 0.25),
        (Change::RandomMotionBlur { kernel_size: (3, 7), angle: 30.0, direction: 0.5 }, 0.15),
        (Change::RandomGaussianNoise { std: 0.03 }, 0.3),
        (erasing, 0.2),
    ]
    .into_iter()
    .map(|(change, p)| Augmentation { change, p })
    .collect()
}
