//! Published weights: read key by key, never executed.
