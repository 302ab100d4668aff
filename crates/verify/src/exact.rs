//! The two exact decisions of the proof. They are made with the crate `robust` (Shewchuk's adaptive predicates), not with
//! [`delaunay::geometry::predicates`], which the job uses: so the proof shares no arithmetic with what it proves.
//!
//! Lattice integers are exact as `f64`, and so are their differences. `robust` decides exactly on such numbers, since no product
//! comes near the limits of an `f64`.

use std::cmp::Ordering;

use robust::{Coord, incircle, orient2d};

use delaunay::geometry::Site;

/// Whether an edge between two triangles is Delaunay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EdgeState {
    Delaunay,
    /// The four corners lie on one circle, and the edge is the diagonal that the tie rule wants.
    Tie,
    NotDelaunay,
}

/// Returns on which side of the line from `a` to `b` the site `c` lies: `Greater` if it is on the left.
#[inline]
pub(super) fn side(a: Site, b: Site, c: Site) -> Ordering {
    order(orient2d(coordinates(a), coordinates(b), coordinates(c)))
}

/// Decides on the edge `ac` between the counterclockwise triangles `abc` and `acd`.
///
/// The tie rule: of four sites on one circle the lexicographically last one counts as outside the circle of the other three.
/// Then the triangle of the other three is Delaunay, and the diagonal is the side of it that faces the last site. So the right
/// diagonal is the one that does not end at the last site.
#[inline]
pub(super) fn edge_state(a: Site, b: Site, c: Site, d: Site) -> EdgeState {
    match order(incircle(coordinates(a), coordinates(b), coordinates(c), coordinates(d))) {
        Ordering::Less => EdgeState::Delaunay,
        Ordering::Equal if a.max(c) < b.max(d) => EdgeState::Tie,
        _ => EdgeState::NotDelaunay,
    }
}

/// Returns twice the signed area of the triangle `abc` in square lattice steps.
#[inline]
pub(super) fn double_area(a: Site, b: Site, c: Site) -> i128 {
    cross(a, b) + cross(b, c) + cross(c, a)
}

/// Returns twice the signed area of the triangle of the origin, `a` and `b`. Summed over a closed loop of edges this is twice the
/// area that the loop encloses.
#[inline]
pub(super) fn cross(a: Site, b: Site) -> i128 {
    let [ax, ay, bx, by] = [a[0], a[1], b[0], b[1]].map(i64::from);
    // Coordinates are below 2^31, so each product fits an i64.
    (ax * by) as i128 - (ay * bx) as i128
}

fn coordinates(site: Site) -> Coord<f64> {
    Coord { x: f64::from(site[0]), y: f64::from(site[1]) }
}

/// The sign of a determinant, which is never NaN here.
fn order(determinant: f64) -> Ordering {
    determinant.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::geometry::REACH;
    use delaunay::geometry::predicates;
    use proptest::prelude::*;

    /// What the job decides, from its own arithmetic.
    fn expected(a: Site, b: Site, c: Site, d: Site) -> EdgeState {
        match (predicates::in_circle_determinant(a, b, c, d), predicates::in_circle(a, b, c, d)) {
            (0, false) => EdgeState::Tie,
            (_, false) => EdgeState::Delaunay,
            (_, true) => EdgeState::NotDelaunay,
        }
    }

    /// Compares both ways to decide on the edge `ac` of a strictly convex quadrilateral.
    fn check(a: Site, b: Site, c: Site, d: Site) {
        for (p, q, r) in [(a, b, c), (a, c, d), (b, c, d), (d, a, b)] {
            let area = predicates::orient2d(p, q, r);
            assert_eq!(side(p, q, r), area.cmp(&0));
            assert_eq!(double_area(p, q, r), area.into());
        }
        if [side(a, b, c), side(a, c, d), side(b, c, d), side(d, a, b)].iter().all(|side| side.is_gt()) {
            assert_eq!(edge_state(a, b, c, d), expected(a, b, c, d), "{a:?} {b:?} {c:?} {d:?}");
        }
    }

    #[test]
    fn one_diagonal_of_every_square_is_right() {
        let square: [Site; 4] = [[0, 0], [5, 0], [5, 5], [0, 5]];
        for turn in 0..4 {
            let [a, b, c, d] = [0, 1, 2, 3].map(|corner| square[(corner + turn) % 4]);
            let states = [edge_state(a, b, c, d), edge_state(b, c, d, a)];
            assert!(states.contains(&EdgeState::Tie) && states.contains(&EdgeState::NotDelaunay), "{states:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn small_quadrilaterals_are_decided_as_the_job_decides_them(corners: [[i8; 2]; 4]) {
            let [a, b, c, d] = corners.map(|corner| corner.map(|v| i32::from(v) / 16));
            check(a, b, c, d);
        }

        #[test]
        fn rectangles_and_near_rectangles_are_decided_as_the_job_decides_them(
            corner in prop::array::uniform2(-REACH / 4..REACH / 4),
            edge in prop::array::uniform2(-REACH / 4..REACH / 4),
            times in 1..3i32,
            step in prop::array::uniform2(-1..2i32),
        ) {
            let [x, y] = corner;
            let [dx, dy] = edge;
            let third = [x + dx - times * dy + step[0], y + dy + times * dx + step[1]];
            check(corner, [x + dx, y + dy], third, [x - times * dy, y + times * dx]);
        }

        #[test]
        fn wide_quadrilaterals_are_decided_as_the_job_decides_them(
            corners in prop::array::uniform4(prop::array::uniform2(-REACH..=REACH)),
        ) {
            let [a, b, c, d] = corners;
            check(a, b, c, d);
        }
    }
}
