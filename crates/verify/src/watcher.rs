//! Who is told how far a verification is.

/// What a program shows of a verification. Any thread may call it.
pub trait Watcher: Sync {
    /// A step of `total` `unit`s begins. The one before is done.
    fn begin(&self, step: &'static str, total: u64, unit: &'static str);

    /// `amount` more units of the step are done.
    fn advance(&self, amount: u64);
}

/// Shows nothing.
pub(crate) struct Unwatched;

impl Watcher for Unwatched {
    fn begin(&self, _: &'static str, _: u64, _: &'static str) {}

    fn advance(&self, _: u64) {}
}
