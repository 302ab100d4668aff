//! Samples of a cloud, each a part of the next.

use crate::error_bound::ErrorBound;

/// Some of the points of a cloud: one of so many, chosen by a hash of the place.
///
/// Rounds go over a small sample first, and over greater ones from what that has selected on: a point has to be looked at in a few rounds only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sample {
    /// It has one of two to the power of so many points.
    halvings: u32,
    /// The steps in x and y from zero of the source coordinates to zero of the lattice.
    offset: [i64; 2],
}

impl Sample {
    /// The first sample has one of two to the power of so many points.
    const FIRST: u32 = 4;
    /// A sample has one of two to the power of so many points of the next.
    const STEP: u32 = 2;

    /// Tells whether it has all points.
    pub(crate) fn is_all(self) -> bool {
        self.halvings == 0
    }

    /// Returns all points, on a lattice with this offset.
    pub(crate) fn all(offset: [i64; 2]) -> Sample {
        Sample { halvings: 0, offset }
    }

    /// Returns the samples from the smallest on to all points.
    pub(crate) fn ladder(offset: [i64; 2]) -> impl Iterator<Item = Sample> {
        let steps = Sample::FIRST / Sample::STEP;
        (0..=steps).rev().map(move |step| Sample { halvings: step * Sample::STEP, offset })
    }

    /// Tells whether it has a point.
    #[inline]
    pub(crate) fn has(self, [x, y, _]: [i32; 3]) -> bool {
        if self.is_all() {
            return true;
        }
        // All points of a sample are in greater ones, since these ask for fewer of the same bits.
        let along = |value: i32, axis: usize| (i64::from(value) + self.offset[axis]) as u64;
        let mut hash =
            along(x, 0).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ along(y, 1).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
        hash = (hash ^ hash >> 32).wrapping_mul(0xFF51_AFD7_ED55_8CCD);
        hash.leading_zeros() >= self.halvings
    }
}

/// Returns the bound for samples. If it were that of all points, some percent of the vertices would be superfluous in the end.
pub(crate) fn bound_of_samples(bound: ErrorBound) -> ErrorBound {
    bound.times(4)
}

/// Returns the distance above which all points of a sample are selected at once: the ones of the sample before it, a quarter of them, were within
/// [`bound_of_samples`], so that the ground is too rough for a choice to matter.
pub(crate) fn very_far_above(bound: ErrorBound) -> ErrorBound {
    bound.times(16)
}
