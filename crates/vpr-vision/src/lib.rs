//! Images and hand-crafted vision for visual place recognition.

pub mod image;
