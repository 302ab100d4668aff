//! The size of lattice steps.

/// The metres in a step of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// In x and y.
    pub horizontal: f64,
    /// In z.
    pub vertical: f64,
}

impl Scale {
    /// Returns a length in lattice steps, rounded up.
    pub(crate) fn steps_of(self, metres: f64) -> i32 {
        (metres / self.horizontal).ceil().clamp(1.0, f64::from(1 << 28)) as i32
    }
}
