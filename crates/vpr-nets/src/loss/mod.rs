//! Losses of place-recognition training.
