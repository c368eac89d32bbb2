//! Backbones: from an image to a feature map or tokens.
