//! Encoders: from image files to descriptors.
