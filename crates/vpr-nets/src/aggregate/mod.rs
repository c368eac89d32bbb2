//! Aggregators: from a feature map to one descriptor per image.
