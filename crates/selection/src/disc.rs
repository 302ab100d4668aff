//! The circumscribed disc of a triangle, in floating point on the safe side.

use delaunay::geometry::predicates::{in_circle, orient2d};
use delaunay::geometry::{Bounds, Site};

/// A disc that surely holds the circumscribed disc of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disc {
    centre: [f64; 2],
    pub(crate) reach: f64,
}

impl Disc {
    /// Returns the disc of the triangle of `corners`.
    ///
    /// The centre is computed from a corner of the shortest side, so that its error is a small share of the radius: with `s` the length of
    /// that side, `l` of the others and `area` twice that of the triangle, it is about 2^-51 l^2 s / area, and the radius is l^2 s / (2 area).
    pub(crate) fn of(corners: [Site; 3]) -> Disc {
        let squared = |p: Site, q: Site| (0..2).map(|k| (f64::from(p[k]) - f64::from(q[k])).powi(2)).sum::<f64>();
        let side = |k: &usize| squared(corners[*k], corners[(*k + 1) % 3]);
        let start = (0..3).min_by(|p, q| side(p).total_cmp(&side(q))).unwrap_or(0);
        let [a, b, c] = [0, 1, 2].map(|k| corners[(start + k) % 3].map(f64::from));
        let ([bx, by], [cx, cy]) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let (b_squared, c_squared) = (bx * bx + by * by, cx * cx + cy * cy);
        let twice = 2.0 * orient2d(corners[0], corners[1], corners[2]) as f64;
        let from_a = [(cy * b_squared - by * c_squared) / twice, (bx * c_squared - cx * b_squared) / twice];
        let radius = (from_a[0] * from_a[0] + from_a[1] * from_a[1]).sqrt();
        Disc { centre: [a[0] + from_a[0], a[1] + from_a[1]], reach: radius * (1.0 + 1e-9) + 2.0 }
    }

    /// Tells whether the circumscribed disc of the triangle of `corners` surely lies in `bounds`, in less time than it takes to find the disc.
    ///
    /// It does if its diameter, `p q r / area` with the lengths of the sides and twice the area of the triangle, is less than the distance of a
    /// corner from the border.
    #[inline(always)]
    pub(crate) fn is_surely_in(corners: [Site; 3], bounds: &Bounds<2>) -> bool {
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        let squared = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]);
        let inwards = |k: usize| (a[k] - f64::from(bounds.min[k])).min(f64::from(bounds.max[k]) - a[k]);
        let distance = inwards(0).min(inwards(1));
        let twice = orient2d(corners[0], corners[1], corners[2]) as f64;
        // Rounding is far less than the factor allows for.
        distance > 0.0
            && squared(a, b) * squared(b, c) * squared(c, a) * (1.0 + 1e-9) < (distance * twice) * (distance * twice)
    }

    /// Tells whether it surely lies in `bounds`.
    pub(crate) fn is_in(&self, bounds: &Bounds<2>) -> bool {
        (0..2).all(|k| f64::from(bounds.min[k]) <= self.low(k) && self.high(k) <= f64::from(bounds.max[k]))
    }

    /// Returns the least box of lattice points that holds it, as far as a lattice goes.
    pub(crate) fn bounds(&self) -> Bounds<2> {
        Bounds { min: [0, 1].map(|axis| self.low(axis) as i32), max: [0, 1].map(|axis| self.high(axis).ceil() as i32) }
    }

    pub(crate) fn low(&self, axis: usize) -> f64 {
        self.centre[axis] - self.reach
    }

    pub(crate) fn high(&self, axis: usize) -> f64 {
        self.centre[axis] + self.reach
    }

    pub(crate) fn squared_distance_from_centre(&self, point: [i32; 3]) -> f64 {
        let [x, y] = [0, 1].map(|axis| f64::from(point[axis]) - self.centre[axis]);
        x * x + y * y
    }

    /// Returns the disc of this reach about the same centre.
    pub(crate) fn with_reach(&self, reach: f64) -> Disc {
        Disc { reach, ..*self }
    }

    /// Tells whether a point of the disc lies inside the circle of the triangle of `corners`, which has the same centre. None of the corners does.
    #[inline]
    pub(crate) fn has_inside(&self, corners: [Site; 3], point: [i32; 3]) -> bool {
        let ([a, b, c], site) = (corners, [point[0], point[1]]);
        self.squared_distance_from_centre(point) <= self.reach * self.reach
            && !corners.contains(&site)
            && in_circle(a, b, c, site)
    }

    /// Returns the range of x where the disc meets the stripe of these y.
    pub(crate) fn chord(&self, south: f64, north: f64) -> [f64; 2] {
        let from_centre = (south - self.centre[1]).max(self.centre[1] - north).max(0.0);
        let half = ((self.reach - from_centre) * (self.reach + from_centre)).max(0.0).sqrt();
        let margin = 1e-9 * self.reach + 2.0;
        [self.centre[0] - half - margin, self.centre[0] + half + margin]
    }
}
