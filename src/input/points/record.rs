//! One record of a source.

/// What a record says before it is judged. `raw` is in steps of the source's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PointRecord {
    pub(crate) raw: [i64; 3],
    pub(crate) rgb: [u16; 3],
    pub(crate) class: u8,
    pub(crate) withheld: bool,
    /// Whether x or y, and whether z, was rounded on the way to `raw`.
    pub(crate) rounded: [bool; 2],
}
