//! Images and hand-crafted vision for visual place recognition.

pub mod cohog;
pub mod hog;
pub mod image;
