//! Learned local features: keypoints, scores, descriptors.
