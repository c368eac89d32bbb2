//! Training: optimisers, schedules, checkpoints.
