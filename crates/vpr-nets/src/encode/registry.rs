//! The published checkpoints by name: `weights.toml`.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use serde::Deserialize;
use vpr_core::Error;

use super::{Channels, Interpolation, Preprocessing, Size};
use crate::{Result, weights::Weights};

/// The weights every clone has (2.6 MB).
const DEFAULT_ENCODER: &[u8] = include_bytes!("../../models/default-encoder.safetensors");

/// Where weights are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A file.
    File(PathBuf),
    /// Part of the program.
    BuiltIn,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::BuiltIn => f.write_str("built in"),
        }
    }
}

/// One entry of `weights.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// What `--method` takes.
    pub name: String,
    /// What `--method` takes together with `--backbone`; the name if there is no other.
    family: Option<String>,
    /// Which network it is.
    pub architecture: Architecture,
    /// Its backbone, as VPR-methods-evaluation writes it; empty if it has no choice.
    #[serde(default)]
    pub backbone: String,
    /// Lengths of the descriptor there are files for; the first is taken if none is asked for, as
    /// VPR-methods-evaluation does.
    pub dimensions: Vec<usize>,
    file: String,
    origin: String,
    /// Licence of the weights, or where it is stated; `None` if none is stated.
    pub licence: Option<String>,
    /// Length of the file, if it was at hand.
    pub size_bytes: Option<u64>,
    /// `sha256:…` of the file, if it was at hand.
    pub digest: Option<String>,
    /// What it was published with.
    pub paper: String,
    /// What was run of it here.
    #[serde(default)]
    pub checked: String,
    size: Option<SizeEntry>,
    #[serde(default)]
    interpolation: InterpolationEntry,
    #[serde(default)]
    channels: ChannelsEntry,
    mean: Option<[f32; 3]>,
    std: Option<[f32; 3]>,
    #[serde(default)]
    resize: ResizeEntry,
    #[serde(default)]
    equalize: bool,
    /// Files that are read with its own if one lies in the same folder: the first that does.
    #[serde(default)]
    beside: Vec<String>,
    /// How its descriptors are compared.
    #[serde(default)]
    pub matching: Matching,
}

/// How descriptors of a method are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Matching {
    /// By distance, or by cosine, which ranks unit vectors alike.
    #[default]
    Euclidean,
    /// By the sum of absolute differences, as AMOSNet and HybridNet:
    /// [`similarities`](super::l1::similarities).
    L1,
}

/// The networks that are built here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Architecture {
    /// The small network this project trains.
    Default,
    /// `BoQ` on the trunk of the default network.
    BoqDefault,
    /// SALAD on the trunk of the default network.
    SaladDefault,
    /// NetVLAD on ten blocks of MobileNetV2.
    NetVladMobileNetV2,
    /// The mean of EfficientNet-Lite0's feature map.
    EfficientNetLite0,
    /// `BoQ` on DINOv2 ViT-B/14.
    BoqDinov2,
    /// `BoQ` on ResNet-50 cropped after `layer3`.
    BoqResnet50,
    /// SALAD on DINOv2 ViT-B/14.
    Salad,
    /// MixVPR on ResNet-50 cropped after `layer3`.
    MixVpr,
    /// CosPlace.
    CosPlace,
    /// EigenPlaces.
    EigenPlaces,
    /// NetVLAD on VGG16.
    NetVlad,
    /// `CricaVPR` on DINOv2 ViT-B/14.
    CricaVpr,
    /// GeM on ResNet-50.
    GemResNet50,
    /// AP-GeM on ResNet-101.
    ApGem,
    /// AlexNet to `conv3`, randomly projected.
    AlexNetConv3,
    /// `CaffeNet` to `conv5` under the pyramid of VPR-Bench's code: AMOSNet and HybridNet.
    PyramidPublished,
    /// The same under contiguous pyramids (VB-13).
    PyramidCorrected,
    /// CALC.
    Calc,
    /// Region-VLAD with the regions of VPR-Bench's code.
    RegionVladPublished,
    /// Region-VLAD with those of its paper.
    RegionVladCorrected,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
enum SizeEntry {
    Fixed([usize; 2]),
    ShorterSide(usize),
    Native(Native),
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Native {
    Native,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum InterpolationEntry {
    BilinearOpencv,
    BicubicOpencv,
    #[default]
    Bilinear,
    Bicubic,
    Nearest,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ChannelsEntry {
    #[default]
    Rgb,
    Bgr,
    Gray,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ResizeEntry {
    #[default]
    BeforeNormalize,
    AfterNormalize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Registry {
    method: Vec<Method>,
}

/// All methods, in the order of the file.
///
/// # Panics
///
/// Never: the file is tested.
#[must_use]
pub fn methods() -> Vec<Method> {
    let text = include_str!("../../weights.toml");
    toml::from_str::<Registry>(text).expect("weights.toml is tested").method
}

impl Method {
    /// The method of this name; `backbone` chooses among those of a family.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`] with the names there are.
    pub fn find(name: &str, backbone: Option<&str>) -> Result<Self> {
        let methods = methods();
        let matches = |method: &&Method| match backbone {
            None => method.name == name,
            Some(backbone) => {
                (method.name == name || method.family() == name)
                    && method.backbone.eq_ignore_ascii_case(backbone)
            }
        };
        if let Some(method) = methods.iter().find(matches) {
            return Ok(method.clone());
        }
        let of_family: Vec<_> =
            methods.iter().filter(|it| it.name == name || it.family() == name).collect();
        let (kind, name, known): (_, _, Vec<_>) = match backbone {
            Some(backbone) if !of_family.is_empty() => {
                let known = of_family.iter().map(|it| it.backbone.as_str()).collect();
                ("backbone", backbone, known)
            }
            _ => ("method", name, methods.iter().map(|it| it.name.as_str()).collect()),
        };
        Err(Error::Unknown { kind, name: name.to_owned(), known: known.join(", ") }.into())
    }

    /// What `--method` takes together with `--backbone`.
    #[must_use]
    pub fn family(&self) -> &str {
        self.family.as_deref().unwrap_or(&self.name)
    }

    /// The chosen length of the descriptor, or the usual one.
    ///
    /// # Errors
    ///
    /// [`Error::Unknown`] if there is no file for it.
    pub fn dimension(&self, chosen: Option<usize>) -> Result<usize> {
        match chosen {
            None => Ok(self.dimensions[0]),
            Some(chosen) if self.dimensions.contains(&chosen) => Ok(chosen),
            Some(chosen) => {
                let known: Vec<_> = self.dimensions.iter().map(ToString::to_string).collect();
                let (kind, name) = ("dimension of its descriptors", chosen.to_string());
                Err(Error::Unknown { kind, name, known: known.join(", ") }.into())
            }
        }
    }

    /// What its file is called.
    #[must_use]
    pub fn file(&self, dimension: usize) -> String {
        self.file.replace("{dimension}", &dimension.to_string())
    }

    /// Where its file is from.
    #[must_use]
    pub fn origin(&self, dimension: usize) -> String {
        self.origin.replace("{dimension}", &dimension.to_string())
    }

    /// Its file in `weights/` or `models/` of one of these folders; the default network's are
    /// built in as well.
    #[must_use]
    pub fn locate(&self, dimension: usize, roots: &[PathBuf]) -> Option<Place> {
        let file = self.file(dimension);
        let place = |root: &PathBuf| ["weights", "models"].map(|it| root.join(it).join(&file));
        let found = roots.iter().flat_map(place).find(|path| path.is_file());
        let built_in = || (self.architecture == Architecture::Default).then_some(Place::BuiltIn);
        found.map(Place::File).or_else(built_in)
    }

    /// The weights that are part of the program, of the method that has some.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] for every other method.
    pub fn built_in_weights(&self) -> Result<Weights> {
        if self.architecture != Architecture::Default {
            return Err(Error::Empty("built-in weights").into());
        }
        Weights::read(self.file(self.dimensions[0]).as_ref(), DEFAULT_ENCODER)
    }

    /// What [`Self::locate`] finds, read, and what lies beside it; or why it is not there.
    pub(super) fn weights(
        &self,
        given: Option<&Path>,
        dimension: usize,
        roots: &[PathBuf],
    ) -> Result<Weights> {
        if let Some(path) = given {
            return self.with_beside(path);
        }
        let place = self.locate(dimension, roots).ok_or_else(|| {
            let searched: Vec<_> = roots.iter().map(|it| it.display().to_string()).collect();
            let others = self
                .dimensions
                .iter()
                .filter(|&&it| it != dimension && self.file(it) != self.file(dimension));
            let at_hand = others.filter(|&&it| self.locate(it, roots).is_some());
            let at_hand: Vec<_> = at_hand.map(ToString::to_string).collect();
            let hint = if at_hand.is_empty() {
                String::new()
            } else {
                format!("; at hand for `--descriptors-dimension` {}", at_hand.join(", "))
            };
            let reason = format!(
                "not in weights/ or models/ of {}; it is from {}{hint}",
                searched.join(", "),
                self.origin(dimension)
            );
            crate::Error::format(self.file(dimension), "weights", reason)
        })?;
        match place {
            Place::File(path) => self.with_beside(&path),
            Place::BuiltIn => self.built_in_weights(),
        }
    }

    /// The weights of a file, with those of the first file of [`Self::beside`] in its folder.
    fn with_beside(&self, path: &Path) -> Result<Weights> {
        let weights = Weights::open(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = self.beside.iter().map(|file| folder.join(file)).find(|path| path.is_file());
        match beside {
            Some(beside) => weights.joined(Weights::open(&beside)?),
            None => Ok(weights),
        }
    }

    /// Files that are read with its own if they lie in the same folder.
    #[must_use]
    pub fn beside(&self) -> &[String] {
        &self.beside
    }

    /// How images become its input.
    #[must_use]
    pub fn preprocessing(&self) -> Preprocessing {
        let usual = Preprocessing::image_net(224, 224);
        Preprocessing {
            size: match self.size {
                Some(SizeEntry::Fixed([height, width])) => Size::Fixed { height, width },
                Some(SizeEntry::ShorterSide(side)) => Size::ShorterSide(side),
                Some(SizeEntry::Native(Native::Native)) => Size::Native,
                None => usual.size,
            },
            interpolation: match self.interpolation {
                InterpolationEntry::BilinearOpencv => Interpolation::BilinearOpenCv,
                InterpolationEntry::BicubicOpencv => Interpolation::BicubicOpenCv,
                InterpolationEntry::Bilinear => Interpolation::Bilinear,
                InterpolationEntry::Bicubic => Interpolation::Bicubic,
                InterpolationEntry::Nearest => Interpolation::Nearest,
            },
            channels: match self.channels {
                ChannelsEntry::Rgb => Channels::Rgb,
                ChannelsEntry::Bgr => Channels::Bgr,
                ChannelsEntry::Gray => Channels::Gray,
            },
            mean: self.mean.unwrap_or(usual.mean),
            std: self.std.unwrap_or(usual.std),
            equalize: self.equalize,
            resize_after_normalize: matches!(self.resize, ResizeEntry::AfterNormalize),
            ..usual
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_means_one_method() {
        let mut names: Vec<_> = methods().into_iter().map(|it| it.name).collect();
        let n_names = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), n_names);
    }

    #[test]
    fn a_backbone_chooses_within_a_family() {
        assert_eq!(Method::find("cosplace", None).unwrap().backbone, "ResNet50");
        let small = Method::find("cosplace", Some("resnet18")).unwrap();
        assert_eq!(small.name, "cosplace-resnet18");
        assert_eq!(small.file(512), "ResNet18_512_cosplace.pth");
        assert_eq!(Method::find("boq", Some("Dinov2")).unwrap().name, "boq-dinov2");
    }

    #[test]
    fn lengths_are_those_of_the_tool_whose_flags_are_promised() {
        let lengths = [
            ("cosplace", "ResNet50", 2048),
            ("cosplace", "ResNet101", 2048),
            ("cosplace", "ResNet18", 512),
            ("cosplace", "VGG16", 512),
            ("eigenplaces", "ResNet50", 2048),
            ("eigenplaces", "ResNet101", 2048),
            ("eigenplaces", "ResNet18", 512),
            ("eigenplaces", "VGG16", 512),
            ("mixvpr", "ResNet50", 4096),
            ("netvlad", "VGG16", 4096),
            ("boq", "ResNet50", 16_384),
            ("boq", "Dinov2", 12_288),
            ("salad", "Dinov2", 8448),
            ("cricavpr", "Dinov2", 10_752),
        ];
        for (name, backbone, length) in lengths {
            let method = Method::find(name, Some(backbone)).unwrap();
            assert_eq!(method.dimension(None).unwrap(), length, "{name} on {backbone}");
        }
        assert_eq!(Method::find("netvlad", None).unwrap().dimension(Some(32_768)).unwrap(), 32_768);
    }

    #[test]
    fn a_file_of_another_length_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("weights/ResNet50_512_cosplace.pth");
        std::fs::create_dir(folder.path().join("weights")).unwrap();
        std::fs::write(file, b"").unwrap();
        let method = Method::find("cosplace", None).unwrap();
        let err = method.weights(None, 2048, &[folder.path().to_owned()]).unwrap_err().to_string();
        assert!(err.starts_with("ResNet50_2048_cosplace.pth: "), "{err}");
        assert!(err.ends_with("; at hand for `--descriptors-dimension` 512"), "{err}");
    }

    #[test]
    fn what_there_is_not_is_refused_with_what_there_is() {
        let unknown = Method::find("cosplace", Some("GoogLeNet")).unwrap_err().to_string();
        assert!(unknown.contains("unknown backbone `GoogLeNet`") && unknown.contains("ResNet18"));
        assert!(Method::find("coplace", None).unwrap_err().to_string().contains("cosplace"));
        let dimension = Method::find("cosplace", None).unwrap().dimension(Some(33)).unwrap_err();
        assert!(dimension.to_string().contains("2048"), "{dimension}");
    }
}
