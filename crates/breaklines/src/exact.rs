//! Exact decisions about segments, and points on segments rounded to the lattice.
//!
//! Coordinates lie within `geometry::REACH` (2^29) of zero. So differences stay within 2^30, and dot and cross products within 2^61.

use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, Site};

/// Returns whether `p` lies in the closed disc that has ab as its diameter.
#[inline]
pub(crate) fn in_disc(a: Site, b: Site, p: Site) -> bool {
    dot(p, a, b) <= 0
}

/// Returns the dot product of ab and ac.
#[inline]
pub(crate) fn dot(a: Site, b: Site, c: Site) -> i64 {
    let along = |axis: usize| difference(a, b, axis) * difference(a, c, axis);
    along(0) + along(1)
}

/// Returns the square of the distance between `a` and `b`.
#[inline]
pub(crate) fn distance2(a: Site, b: Site) -> i64 {
    dot(a, b, b)
}

#[inline]
fn difference(a: Site, b: Site, axis: usize) -> i64 {
    i64::from(b[axis]) - i64::from(a[axis])
}

/// Returns whether `p`, which lies in the closed disc of ab, is within `floor` steps of the segment ab.
pub(crate) fn is_near(a: Site, b: Site, p: Site, floor: u32) -> bool {
    let (area, floor) = (i128::from(orient2d(a, b, p)), i128::from(floor));
    area * area <= floor * floor * i128::from(distance2(a, b))
}

/// Returns the lattice point nearest to the point of the line ab at `numerator / denominator` of the way from `a` to `b`. The fraction lies
/// between 0 and 1. Halves are rounded up.
pub(crate) fn between(a: Site, b: Site, numerator: i64, denominator: i64) -> Site {
    [0, 1].map(|axis| {
        let wide = i128::from(difference(a, b, axis)) * i128::from(numerator);
        a[axis] + round(wide, i128::from(denominator)) as i32
    })
}

/// Returns `numerator / denominator` rounded to the nearest whole number, halves up. The denominator is positive.
pub(crate) fn round(numerator: i128, denominator: i128) -> i128 {
    (2 * numerator + denominator).div_euclid(2 * denominator)
}

/// Returns the foot of the perpendicular from `p` on the line ab, rounded to the lattice. `p` lies in the closed disc of ab.
pub(crate) fn foot(a: Site, b: Site, p: Site) -> Site {
    between(a, b, dot(a, b, p), distance2(a, b))
}

/// Returns the point half way from `a` to `b`, rounded to the lattice.
pub(crate) fn middle(a: Site, b: Site) -> Site {
    [0, 1].map(|axis| ((i64::from(a[axis]) + i64::from(b[axis])) >> 1) as i32)
}

/// Returns the point of the line ab at the distance from `a` whose square is `radius2`, rounded to the lattice. It is not beyond `b`.
pub(crate) fn at_radius(a: Site, b: Site, radius2: i64) -> Site {
    let length2 = distance2(a, b) as u128;
    [0, 1].map(|axis| {
        let along = difference(a, b, axis);
        // The square of twice the way along the axis: less than 4 * 2^60 * 2^61.
        let twice = (4 * (along * along) as u128 * radius2 as u128 / length2).isqrt() as i64;
        a[axis] + (along.signum() * ((twice + 1) >> 1)) as i32
    })
}

/// Returns where the segments ab and cd cross, rounded to the lattice, if they do so in the interior of both.
pub(crate) fn crossing([a, b]: [Site; 2], [c, d]: [Site; 2]) -> Option<Site> {
    let (from, to) = (orient2d(c, d, a), orient2d(c, d, b));
    let is_crossed = |one: i64, other: i64| one.signum() * other.signum() < 0;
    let crosses = is_crossed(from, to) && is_crossed(orient2d(a, b, c), orient2d(a, b, d));
    crosses.then(|| between(a, b, from.abs(), from.abs() + to.abs()))
}

/// Returns the least box of whole numbers that is sure to hold the closed disc of ab.
pub(crate) fn disc_box(a: Site, b: Site) -> Bounds<2> {
    let length = (distance2(a, b) as u64).isqrt() as i64 + 1;
    let twice = |axis: usize| i64::from(a[axis]) + i64::from(b[axis]);
    Bounds {
        min: [0, 1].map(|axis| ((twice(axis) - length) >> 1) as i32),
        max: [0, 1].map(|axis| ((twice(axis) + length + 1) >> 1) as i32),
    }
}

/// Returns the box of the segment ab.
pub(crate) fn segment_box(a: Site, b: Site) -> Bounds<2> {
    Bounds::of_point(a).union(Bounds::of_point(b))
}

/// Returns the box with a border of `steps` around it.
pub(crate) fn grown(bounds: Bounds<2>, steps: u32) -> Bounds<2> {
    Bounds {
        min: bounds.min.map(|v| v.saturating_sub_unsigned(steps)),
        max: bounds.max.map(|v| v.saturating_add_unsigned(steps)),
    }
}

/// Returns whether the boxes have a point in common.
#[inline]
pub(crate) fn meet(one: &Bounds<2>, other: &Bounds<2>) -> bool {
    (0..2).all(|axis| one.min[axis] <= other.max[axis] && other.min[axis] <= one.max[axis])
}

/// Returns whether the box holds `p`.
#[inline]
pub(crate) fn holds(bounds: &Bounds<2>, p: Site) -> bool {
    (0..2).all(|axis| bounds.min[axis] <= p[axis] && p[axis] <= bounds.max[axis])
}

/// Returns the boxes of pieces of the segment ab, each at most about `length` long, so that they cover little more than the segment.
pub(crate) fn piece_boxes(a: Site, b: Site, length: u32) -> impl Iterator<Item = Bounds<2>> {
    let pieces = (distance2(a, b) as u64).isqrt() as i64 / i64::from(length) + 1;
    let ends = move |i: i64| between(a, b, i, pieces);
    (0..pieces).map(move |i| grown(segment_box(ends(i), ends(i + 1)), 1))
}
