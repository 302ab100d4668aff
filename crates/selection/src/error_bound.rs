//! Vertical distances as exact fractions.

use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::ops::Range;

/// A bound on vertical distances: a fraction of lattice steps of height.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorBound {
    steps: u64,
    per: u32,
}

impl ErrorBound {
    /// The greatest number of steps, so that no comparison overflows.
    const MOST: u64 = 1 << 33;

    /// Returns the bound of `steps / per` lattice steps. No two heights of a lattice are 2^33 steps apart, so that a greater bound is none.
    pub fn new(steps: u64, per: u32) -> ErrorBound {
        let per = per.max(1);
        ErrorBound { steps: steps.min(ErrorBound::MOST.saturating_mul(u64::from(per))), per }
    }

    /// Returns the bound of so many times as much.
    pub(crate) fn times(self, factor: u64) -> ErrorBound {
        ErrorBound::new(self.steps.saturating_mul(factor), self.per)
    }

    /// Returns the bound in units of [`VerticalError::fixed`], rounded up.
    pub(crate) fn fixed(self) -> u64 {
        (u128::from(self.steps) << VerticalError::FRACTION_BITS).div_ceil(u128::from(self.per)) as u64
    }

    /// Tells whether `error` is greater.
    #[inline]
    pub fn is_exceeded_by(self, error: VerticalError) -> bool {
        error.numerator * u128::from(self.per) > u128::from(self.steps) * u128::from(error.area)
    }
}

/// The bound in a round: one for most triangles, and another for those of some areas.
#[derive(Clone, Debug)]
pub(crate) struct RoundBound {
    usual: ErrorBound,
    other: ErrorBound,
    /// Twice the areas of triangles with the other bound, in square lattice steps.
    with_other: Range<u64>,
    /// The distance in units of [`VerticalError::fixed`] above which a point is selected whatever is beside it.
    pub(crate) far: u64,
}

impl RoundBound {
    /// So many times the bound is far. With this exception, large clouds take half the time, and 1 % more points on most ground and woods. Where walls
    /// are, it and the samples take up to a fifth more. Twice the bound takes 5 to 8 % more on ground.
    const FAR: u64 = 4;

    /// Returns one bound for all triangles.
    pub(crate) fn everywhere(bound: ErrorBound) -> RoundBound {
        RoundBound { usual: bound, other: bound, with_other: 0..0, far: RoundBound::FAR * bound.fixed() }
    }

    /// Returns the same with no point so far away that it is selected whatever is beside it.
    pub(crate) fn without_exception(self) -> RoundBound {
        RoundBound { far: u64::MAX, ..self }
    }

    /// Returns the same with another bound for triangles of these areas in square lattice steps.
    pub(crate) fn but(self, other: ErrorBound, areas: Range<f64>) -> RoundBound {
        RoundBound { other, with_other: (2.0 * areas.start) as u64..(2.0 * areas.end) as u64, ..self }
    }

    /// Returns an error in units of [`VerticalError::fixed`], at least 1, if it exceeds the bound for its triangle, else 0.
    pub(crate) fn excess(&self, error: VerticalError) -> u64 {
        let bound = if self.with_other.contains(&error.area) { self.other } else { self.usual };
        if bound.is_exceeded_by(error) { error.fixed().max(1) } else { 0 }
    }
}

/// The vertical distance of a point from a triangle, in lattice steps of height: `numerator / area`. The area is twice that of the triangle
/// in the plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VerticalError {
    /// Below 2^95.
    pub numerator: u128,
    /// Below 2^62.
    pub area: u64,
}

impl VerticalError {
    /// Fractions of a step are kept to so many bits.
    pub const FRACTION_BITS: u32 = 20;

    /// Returns the error of no distance.
    pub const NONE: VerticalError = VerticalError { numerator: 0, area: 1 };

    /// Returns the error of a point at height `z`, given the triangle's corners, its corners' heights, and `parts`: twice the areas of the
    /// triangles that the point makes with the side opposite each corner.
    #[inline(always)]
    pub(crate) fn of_parts(parts: [i64; 3], heights: [i32; 3], z: i32) -> VerticalError {
        let term = |k: usize| i128::from(parts[k]) * i128::from(i64::from(z) - i64::from(heights[k]));
        let numerator = (term(0) + term(1) + term(2)).unsigned_abs();
        VerticalError { numerator, area: (parts[0] + parts[1] + parts[2]) as u64 }
    }

    /// Returns the error of `point` in the triangle of `corners`, which it lies in, or on the border of.
    pub fn of(corners: [[i32; 3]; 3], point: [i32; 3]) -> VerticalError {
        let site = |p: [i32; 3]| -> Site { [p[0], p[1]] };
        let [a, b, c] = corners.map(site);
        let p = site(point);
        let parts = [orient2d(b, c, p), orient2d(c, a, p), orient2d(a, b, p)];
        VerticalError::of_parts(parts, corners.map(|corner| corner[2]), point[2])
    }

    /// Returns the distance in units of 2^-20 steps, rounded down.
    #[inline]
    pub fn fixed(self) -> u64 {
        ((self.numerator << VerticalError::FRACTION_BITS) / u128::from(self.area)) as u64
    }
}

/// The worst point of a triangle, or of what a block holds of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// That of its distance, in two halves: it takes less memory. All points of a triangle have the same denominator.
    pub(crate) numerator: [u64; 2],
    /// Its distance in units of [`VerticalError::fixed`].
    pub(crate) excess: u64,
    /// Lattice integers.
    pub(crate) point: [i32; 3],
}

impl Candidate {
    /// Tells whether it is the worse of two points of one triangle. Of equal distances that of the site that comes first by x, then y, is
    /// taken for greater.
    pub(crate) fn is_worse_in_triangle(&self, other: &Candidate) -> bool {
        (self.numerator, Reverse(self.point)) > (other.numerator, Reverse(other.point))
    }

    /// Tells whether it is selected beside the worst point of another triangle: its distance is greater than that one's, or greater than `far`. Equal
    /// ones are ordered likewise.
    #[inline]
    pub(crate) fn stands_beside(&self, other: &Candidate, far: u64) -> bool {
        self.excess > far || (self.excess, Reverse(self.point)) > (other.excess, Reverse(other.point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_exact_at_the_ends_of_the_lattice() {
        const R: i32 = 1 << 29;
        let corners = [[-R, -R, i32::MIN], [R, -R, i32::MIN], [-R, R, i32::MIN]];
        let error = VerticalError::of(corners, [0, 0, i32::MAX]);
        let span = u64::from(u32::MAX);
        assert_eq!(error.fixed(), span << VerticalError::FRACTION_BITS);
        assert!(ErrorBound::new(span - 1, 1).is_exceeded_by(error) && !ErrorBound::new(span, 1).is_exceeded_by(error));
        assert!(!ErrorBound::new(u64::MAX, 1).is_exceeded_by(error));
        assert_eq!(ErrorBound::new(u64::MAX, 1).fixed(), 1 << 53);
    }

    #[test]
    fn fractions_are_compared_exactly() {
        // A third of a step.
        let error = VerticalError::of([[0, 0, 0], [3, 0, 1], [0, 3, 0]], [1, 1, 0]);
        assert_eq!(error, VerticalError { numerator: 3, area: 9 });
        assert!(ErrorBound::new(333_333, 1_000_000).is_exceeded_by(error));
        assert!(
            !ErrorBound::new(1, 3).is_exceeded_by(error) && !ErrorBound::new(333_334, 1_000_000).is_exceeded_by(error)
        );
        assert_eq!((error.fixed(), ErrorBound::new(1, 3).fixed()), ((1 << 20) / 3, (1 << 20) / 3 + 1));
    }
}
