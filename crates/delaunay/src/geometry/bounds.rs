//! Axis-aligned boxes of lattice points.

use multiversion::multiversion;

/// The box of all lattice points p with `min <= p <= max` on each of `N` axes. A box made from points holds at least one. A box
/// whose `min` exceeds its `max` holds none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds<const N: usize> {
    /// The least lattice integer on each axis.
    pub min: [i32; N],
    /// The greatest lattice integer on each axis.
    pub max: [i32; N],
}

impl<const N: usize> Bounds<N> {
    /// Returns the box of one point.
    pub fn of_point(point: [i32; N]) -> Bounds<N> {
        Bounds { min: point, max: point }
    }

    /// Returns the least box that holds all `points`, or `None` if there are none.
    #[inline]
    pub fn of_points(points: impl IntoIterator<Item = [i32; N]>) -> Option<Bounds<N>> {
        let mut points = points.into_iter();
        let mut bounds = Bounds::of_point(points.next()?);
        points.for_each(|point| bounds.include(point));
        Some(bounds)
    }

    /// Grows the box until it holds `point`.
    #[inline(always)]
    pub fn include(&mut self, point: [i32; N]) {
        for (axis, value) in point.into_iter().enumerate() {
            self.min[axis] = self.min[axis].min(value);
            self.max[axis] = self.max[axis].max(value);
        }
    }

    /// Returns the least box that holds both boxes.
    pub fn union(mut self, other: Bounds<N>) -> Bounds<N> {
        self.include(other.min);
        self.include(other.max);
        self
    }

    /// Returns the length along `axis` in lattice steps, which is 0 for a box of one point.
    pub fn extent(&self, axis: usize) -> i64 {
        self.max[axis] as i64 - self.min[axis] as i64
    }

    /// Returns the point in the middle, rounded down.
    pub fn middle(&self) -> [i32; N] {
        std::array::from_fn(|axis| ((self.min[axis] as i64 + self.max[axis] as i64) >> 1) as i32)
    }
}

/// Returns the least box that holds all `points`, or `None` if there are none. Points that lie side by side are
/// compared with vector instructions.
#[multiversion(targets("x86_64+avx2"))]
pub fn bounds_of<const N: usize>(points: &[[i32; N]]) -> Option<Bounds<N>> {
    Bounds::of_points(points.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_what_they_are_made_of() {
        assert_eq!(Bounds::<2>::of_points([]), None);
        let bounds = Bounds::of_points([[3, -1], [0, 5], [2, 2]]).unwrap();
        assert_eq!(bounds, Bounds { min: [0, -1], max: [3, 5] });
        assert_eq!((bounds.extent(0), bounds.extent(1)), (3, 6));
        assert_eq!(bounds.union(Bounds::of_point([-7, 0])).min, [-7, -1]);
        let widest = Bounds { min: [i32::MIN], max: [i32::MAX] };
        assert_eq!((widest.extent(0), widest.middle()), (u32::MAX as i64, [-1]));
        assert_eq!(bounds.middle(), [1, 2]);
    }
}
