//! What two triangles have in common.
//!
//! Whether they overlap is decided in whole numbers: two triangles have no common area if and only if one of their six edges has the
//! other triangle on its outer side, or on itself. The heights at their corners are exact too, each rounded once. Only then floating point
//! computes the common polygon: the smaller triangle, from whose first corner places are counted, is clipped by the edges of the
//! larger one. The area and the volumes of the polygon change continuously with its vertices, so that rounding moves them by no more than
//! some 1e-16 of the area and the heights of the smaller triangle, however thin the polygon is.

use crate::mesh::{Point, double_area_of};
use crate::polygon::{Polygon, Vertex};
use crate::rectangle::Rectangle;
use crate::whole_number::WholeNumber;

/// Within this many steps, and heights within [`NARROW_HEIGHTS`], all numbers fit an `i64`.
const NARROW: i64 = 1 << 18;
const NARROW_HEIGHTS: i64 = 1 << 20;

/// The common area of two triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overlap {
    /// Where the places of the polygon are counted from.
    pub(crate) origin: [i64; 2],
    pub(crate) polygon: Polygon,
    /// Twice the area, if the polygon is one of the two triangles.
    pub(crate) double_area: Option<i128>,
}

/// Tells whether heights in this range are small enough for `i64`.
pub(crate) fn are_narrow(heights: [i64; 2]) -> bool {
    heights[1].saturating_sub(heights[0]) < NARROW_HEIGHTS
}

/// Returns what the triangle `before` of one terrain and `after` of the other have in common; `None` if that has no area. Both have their
/// corners in canonical order, and `boxes` around them.
#[inline]
pub(crate) fn overlap(
    before: &[Point; 3],
    after: &[Point; 3],
    boxes: [&Rectangle; 2],
    has_narrow_heights: bool,
) -> Option<Overlap> {
    if is_same_place(before, after) {
        return Some(same_place(before, after));
    }
    let after_is_smaller = boxes[1].extent() <= boxes[0].extent();
    let [small, large] = if after_is_smaller { [after, before] } else { [before, after] };
    if has_narrow_heights && boxes[0].joined(*boxes[1]).extent() < NARROW {
        clipped::<i64>(small, large, after_is_smaller)
    } else {
        clipped::<i128>(small, large, after_is_smaller)
    }
}

/// Tells whether both have the same corners, but for heights.
#[inline(always)]
pub(crate) fn is_same_place(a: &[Point; 3], b: &[Point; 3]) -> bool {
    (0..3).all(|k| a[k][0] == b[k][0] && a[k][1] == b[k][1])
}

/// Tells whether two triangles have an area in common.
pub(crate) fn have_common_area(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let is_apart = |from: &[Point; 3], other: &[Point; 3]| {
        (0..3).any(|k| other.iter().all(|corner| side::<i128>(from, k, corner) <= 0))
    };
    !is_apart(a, b) && !is_apart(b, a)
}

fn same_place(before: &[Point; 3], after: &[Point; 3]) -> Overlap {
    let origin = [after[0][0], after[0][1]];
    let corner =
        |k: usize| Vertex { at: place(&after[k], origin), rise: (after[k][2] - before[k][2]) as f64, sides: [0.0; 3] };
    Overlap { origin, polygon: Polygon::triangle([0, 1, 2].map(corner)), double_area: Some(double_area_of(after)) }
}

#[inline(always)]
fn place(point: &Point, origin: [i64; 2]) -> [f64; 2] {
    [(point[0] - origin[0]) as f64, (point[1] - origin[1]) as f64]
}

/// Returns twice the area of edge `k` and a point: above 0 if it lies on the inner side.
#[inline(always)]
#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128, and long enough")]
fn side<T: WholeNumber>(triangle: &[Point; 3], k: usize, point: &Point) -> T {
    let [from, to] = [&triangle[k], &triangle[if k == 2 { 0 } else { k + 1 }]];
    let along = |p: &Point, axis: usize| T::from(p[axis] - from[axis]);
    along(to, 0) * along(point, 1) - along(to, 1) * along(point, 0)
}

#[inline(always)]
#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128, and long enough")]
fn clipped<T: WholeNumber>(small: &[Point; 3], large: &[Point; 3], after_is_smaller: bool) -> Option<Overlap> {
    let zero = T::from(0);
    // By corner of the smaller triangle: its sides of the edges of the larger one.
    let sides = [0, 1, 2].map(|corner| [0, 1, 2].map(|k| side::<T>(large, k, &small[corner])));
    let is_beyond = |k: usize| sides.iter().all(|sides: &[T; 3]| sides[k] <= zero);
    if is_beyond(0) || is_beyond(1) || is_beyond(2) {
        return None;
    }
    let is_inside = sides.iter().any(|sides| sides.iter().all(|side| *side > zero));
    if !is_inside && (0..3).any(|k| large.iter().all(|corner| side::<T>(small, k, corner) <= zero)) {
        return None;
    }
    let area = sides[0][0] + sides[0][1] + sides[0][2];
    let origin = [small[0][0], small[0][1]];
    let corner = |c: usize| {
        // The height above the plane of the larger triangle, times twice its area. A corner of it weighs as much as the edge opposite.
        let above = |opposite: usize, k: usize| T::from(small[c][2] - large[opposite][2]) * sides[c][k];
        let above = above(0, 1) + above(1, 2) + above(2, 0);
        let rise = if after_is_smaller { above } else { -above };
        Vertex { at: place(&small[c], origin), rise: rise.quotient(area), sides: sides[c].map(T::nearest) }
    };
    let triangle = Polygon::triangle([corner(0), corner(1), corner(2)]);
    if sides.iter().flatten().all(|side| *side >= zero) {
        return Some(Overlap { origin, polygon: triangle, double_area: Some(double_area_of(small)) });
    }
    Some(Overlap { origin, polygon: triangle.within_sides(), double_area: None })
}

impl Overlap {
    /// Returns the part within a triangle.
    pub(crate) fn within(&self, zone: &[Point; 3]) -> Polygon {
        let mut polygon = self.polygon;
        let corners = zone.map(|corner| place(&corner, self.origin));
        for vertex in polygon.vertices_mut() {
            vertex.sides = [0, 1, 2].map(|k| {
                let [from, to] = [corners[k], corners[(k + 1) % 3]];
                (to[0] - from[0]) * (vertex.at[1] - from[1]) - (to[1] - from[1]) * (vertex.at[0] - from[0])
            });
        }
        polygon.within_sides()
    }
}
