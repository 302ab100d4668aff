//! A box of raw integers.

use serde::{Deserialize, Serialize};

/// The raw integers of points that are no mistakes, borders included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawBox {
    /// Least x, y, z.
    pub min: [i64; 3],
    /// Greatest x, y, z.
    pub max: [i64; 3],
}

impl RawBox {
    /// Returns whether a record with these raw integers lies within the box.
    #[inline]
    pub(crate) fn holds(&self, raw: &[i64; 3]) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&raw[axis]))
    }
}
