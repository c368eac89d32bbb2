//! Progress of long work, for whoever wants to show it.

/// Told how far long work is.
pub trait Observer: Sync {
    /// Work of `n` steps begins.
    fn start(&self, what: &str, n: usize);
    /// One step is done.
    fn step(&self);
    /// The work has ended.
    fn end(&self);
}

/// Listens to nothing.
impl Observer for () {
    fn start(&self, _: &str, _: usize) {}
    fn step(&self) {}
    fn end(&self) {}
}
