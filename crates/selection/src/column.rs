//! Lists of numbers as bytes.

use bytemuck::{Pod, cast_slice, cast_slice_mut, zeroed_vec};

/// A list of numbers.
pub(crate) trait Column {
    fn length(&self) -> usize;
    fn bytes(&self) -> &[u8];
    /// Gives the memory back.
    fn clear(&mut self);
    /// Makes the column as long as this, and returns its bytes.
    fn filled(&mut self, length: usize) -> &mut [u8];
}

impl<T: Pod> Column for Vec<T> {
    fn length(&self) -> usize {
        self.len()
    }

    fn bytes(&self) -> &[u8] {
        cast_slice(self)
    }

    fn clear(&mut self) {
        *self = Vec::new();
    }

    fn filled(&mut self, length: usize) -> &mut [u8] {
        *self = zeroed_vec(length);
        cast_slice_mut(self)
    }
}
