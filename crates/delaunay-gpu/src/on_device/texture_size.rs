//! The size of a texture, and what follows from it.

/// The width and height of a texture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureSize {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl TextureSize {
    /// Returns the number of pixels.
    pub fn pixels(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Returns the steps of 1+JFA: 1, then half the side (as a power of two), a quarter, and so on down to 1.
    pub fn jump_steps(self) -> Vec<u32> {
        let half = self.width.max(self.height).next_power_of_two() / 2;
        std::iter::once(1).chain((0..32).rev().map(|i| 1 << i).filter(|&step| step <= half)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jump_flooding_starts_and_ends_with_one() {
        assert_eq!(TextureSize { width: 1, height: 1 }.jump_steps(), [1]);
        assert_eq!(TextureSize { width: 17, height: 3 }.jump_steps(), [1, 16, 8, 4, 2, 1]);
        assert_eq!(TextureSize { width: 16, height: 16 }.jump_steps(), [1, 8, 4, 2, 1]);
    }
}
