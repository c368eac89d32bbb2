//! Datasets on disk: what they are called, where they lie and how they are laid out.

pub mod layout;
