//! Keys of backbones as published checkpoints spell them.

use crate::Result;
use crate::backbone::ResNetConfig;
use crate::backbone::resnet::Block;
use crate::weights::Shapes;
use crate::weights::Weights;

/// A ResNet that was made a `Sequential` of its children, below `backbone.` or `backbone.net.`.
pub const SEQUENTIAL_RESNET: [(&str, &str); 6] = [
    (r"^backbone\.(net\.)?0\.", "backbone.conv1."),
    (r"^backbone\.(net\.)?1\.", "backbone.bn1."),
    (r"^backbone\.(net\.)?4\.", "backbone.layer1."),
    (r"^backbone\.(net\.)?5\.", "backbone.layer2."),
    (r"^backbone\.(net\.)?6\.", "backbone.layer3."),
    (r"^backbone\.(net\.)?7\.", "backbone.layer4."),
];

/// The convolutions of a VGG16 that were made a `Sequential`.
pub(super) const SEQUENTIAL_VGG: [(&str, &str); 1] =
    [(r"^backbone\.(\d+)\.", "backbone.features.$1.")];

/// The ResNet whose weights begin with `prefix`, after the renames above.
pub(super) fn resnet(weights: &Weights, prefix: &str) -> Result<ResNetConfig> {
    let shapes = Shapes::new(weights, prefix);
    shapes.axis("conv1.weight", 0)?;
    let block = if shapes.has("layer1.0.conv3.weight") { Block::Bottleneck } else { Block::Basic };
    let blocks = |stage| shapes.count(|index| format!("layer{stage}.{index}.conv1.weight"));
    Ok(ResNetConfig::new(block, [blocks(1), blocks(2), blocks(3), blocks(4)]))
}
