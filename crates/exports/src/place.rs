//! Places as writers see them.

/// A place whose coordinates can be written.
pub trait Place {
    /// Appends the coordinate along an axis (0: x, 1: y, 2: z) as a decimal number.
    fn push(&self, axis: usize, out: &mut Vec<u8>);
}

/// Coordinates that are written already.
impl Place for [&str; 3] {
    fn push(&self, axis: usize, out: &mut Vec<u8>) {
        out.extend_from_slice(self[axis].as_bytes());
    }
}
