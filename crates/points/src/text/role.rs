//! What columns hold.

use serde::{Deserialize, Serialize};

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ColumnRole {
    /// x, y or z.
    Coordinate(usize),
    /// Red, green or blue.
    Color(usize),
    /// The classification.
    Class,
    /// The strength of the return.
    Intensity,
    /// Which return of its pulse it is.
    ReturnNumber,
    /// How many returns the pulse had.
    Returns,
    /// Nothing of use.
    Skipped,
}
