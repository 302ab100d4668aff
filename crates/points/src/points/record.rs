//! One record of a source.

use crate::points::returns::PulseReturn;

/// The raw height of a record whose height stands for nodata. It lies outside every lattice.
pub(crate) const NODATA: i64 = i64::MAX;

/// What a record says before the rules are applied to it. `raw` counts steps of the source's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PointRecord {
    pub(crate) raw: [i64; 3],
    pub(crate) rgb: [u16; 3],
    /// The strength of the return; 0 where it is not wanted, or the file does not say.
    pub(crate) intensity: u16,
    pub(crate) class: u8,
    pub(crate) withheld: bool,
    /// Which return of its pulse it is.
    pub(crate) pulse_return: PulseReturn,
    /// Whether the reader rounded x or y, and whether it rounded z, to get `raw`.
    pub(crate) rounded: [bool; 2],
}
