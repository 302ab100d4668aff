//! What has been read of a model, so that it is read once.

use std::collections::HashMap;
use std::sync::{PoisonError, RwLock};
use sys::Error;

/// Values by their number.
pub(super) struct BlockCache<T>(RwLock<HashMap<u64, T>>);

impl<T: Clone> BlockCache<T> {
    pub(super) fn new() -> BlockCache<T> {
        BlockCache(RwLock::default())
    }

    /// Returns value `number`, which `make` makes if it is not there. Two threads may make the same value, which does no harm.
    pub(super) fn get(&self, number: u64, make: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
        if let Some(known) = self.0.read().unwrap_or_else(PoisonError::into_inner).get(&number) {
            return Ok(known.clone());
        }
        let made = make()?;
        self.0.write().unwrap_or_else(PoisonError::into_inner).insert(number, made.clone());
        Ok(made)
    }
}
