//! The two decisions on which everything rests, `orient2d` and `in_circle`. Both are exact on lattice coordinates.
//!
//! Coordinates lie within `geometry::REACH` (2^29) of zero, so differences stay within 2^30: the orientation determinant
//! fits an `i64`, the in-circle determinant an `i128`.

use crate::geometry::site::Site;
use multiversion::multiversion;

/// Relative error of the floating-point in-circle determinant on exactly represented differences,
/// (10 + 96 eps) eps in Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic", rounded up.
const IN_CIRCLE_ERROR: f64 = 1.2e-15;

/// Relative error of the difference of two rounded products of exactly represented differences: 2^-53 of the sum of their sizes, doubled
/// for what is rounded here.
const AREA_ERROR: f64 = 2.3e-16;

/// Returns twice the signed area of triangle abc in square lattice steps, which is positive if a, b, c turn left. Exact.
#[inline(always)]
pub fn orient2d(a: Site, b: Site, c: Site) -> i64 {
    let (abx, aby) = (b[0] as i64 - a[0] as i64, b[1] as i64 - a[1] as i64);
    let (acx, acy) = (c[0] as i64 - a[0] as i64, c[1] as i64 - a[1] as i64);
    abx * acy - aby * acx
}

/// Returns whether `d` is inside the circle through the counterclockwise triangle `abc`. `tie` decides if `d` is on the circle.
///
/// This is the canonical decision of the whole project: an edge ac shared by the triangles abc and acd is Delaunay
/// if and only if `!in_circle(a, b, c, d)`, and exactly one diagonal of every strictly convex quadrilateral is.
#[inline(always)]
pub fn in_circle(a: Site, b: Site, c: Site, d: Site) -> bool {
    InCircleTerms::new(a, b, c, d).decide(a, b, c, d)
}

/// Returns whether the edge ab, shared by the triangles abc and bad, fails: [`in_circle`]. If it does, it also returns whether the other
/// diagonal, cd, makes two counterclockwise triangles.
#[inline(always)]
pub fn failing_edge(a: Site, b: Site, c: Site, d: Site) -> Option<bool> {
    let terms = InCircleTerms::new(a, b, c, d);
    terms.decide(a, b, c, d).then(|| {
        // The triangles dbc and dca have these areas.
        let is_left = |[p, q]: [f64; 2], exact: [Site; 3]| {
            let (area, size) = (p - q, p.abs() + q.abs());
            if area.abs() > AREA_ERROR * size { area > 0.0 } else { orient2d(exact[0], exact[1], exact[2]) > 0 }
        };
        is_left(terms.bc, [d, b, c]) && is_left(terms.ca, [d, c, a])
    })
}

/// The products of which the in-circle determinant consists, in double precision.
struct InCircleTerms {
    lifts: [f64; 3],
    /// Two products whose difference is twice the area of a triangle with d.
    bc: [f64; 2],
    ca: [f64; 2],
    ab: [f64; 2],
}

impl InCircleTerms {
    #[inline(always)]
    fn new(a: Site, b: Site, c: Site, d: Site) -> InCircleTerms {
        let diff = |p: Site| (p[0] as f64 - d[0] as f64, p[1] as f64 - d[1] as f64);
        let ((ax, ay), (bx, by), (cx, cy)) = (diff(a), diff(b), diff(c));
        InCircleTerms {
            lifts: [ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy],
            bc: [bx * cy, cx * by],
            ca: [cx * ay, ax * cy],
            ab: [ax * by, bx * ay],
        }
    }

    #[inline(always)]
    fn decide(&self, a: Site, b: Site, c: Site, d: Site) -> bool {
        let InCircleTerms { lifts: [al, bl, cl], bc: [bc, cb], ca: [ca, ac], ab: [ab, ba] } = *self;
        let det = al * (bc - cb) + bl * (ca - ac) + cl * (ab - ba);
        let permanent = al * (bc.abs() + cb.abs()) + bl * (ca.abs() + ac.abs()) + cl * (ab.abs() + ba.abs());
        if det.abs() > IN_CIRCLE_ERROR * permanent {
            return det > 0.0;
        }
        in_circle_exact(a, b, c, d)
    }
}

/// Guesses whether the triangles abc and acd are counterclockwise, and their common edge is Delaunay. The guess is wrong where rounding
/// decides; it takes a fraction of the time of the exact answer.
#[inline(always)]
pub fn seems_delaunay(a: Site, b: Site, c: Site, d: Site) -> bool {
    let diff = |p: Site| (f64::from(p[0].wrapping_sub(d[0])), f64::from(p[1].wrapping_sub(d[1])));
    let ((ax, ay), (bx, by), (cx, cy)) = (diff(a), diff(b), diff(c));
    let (bc, ca, ab) = (bx * cy - cx * by, cx * ay - ax * cy, ax * by - bx * ay);
    let det = (ax * ax + ay * ay) * bc + (bx * bx + by * by) * ca + (cx * cx + cy * cy) * ab;
    // On lattices all is exact, and there are ties everywhere.
    let inside = if det == 0.0 { tie(a, b, c, d) } else { det > 0.0 };
    !inside & (ca < 0.0) & (bc + ca + ab > 0.0)
}

/// Relative error of the in-circle determinant in single precision, from differences that are rounded once. With
/// `e = 2^-24`, the relative errors are: a difference is wrong by `e`, a product of two by 3 e, a lift (sum of two squares) by 4 e, a
/// difference of two products by 4 e of the sum of their sizes, a term by 9 e, their sum by 11 e of the permanent, which itself
/// is wrong by as much. Terms of second order stay below e together; 13 e < 8e-7. Nothing over- or underflows: differences are
/// integers up to 2^30, so that terms that are not zero lie between 1 and 2^123.
const IN_CIRCLE_ERROR_SINGLE: f32 = 1e-6;

/// The orientation of many triangles, and whether the site beyond each of their sides is inside their circle, all at once. Doubtful cases
/// stay undecided. The layout lets the compiler use vector instructions.
///
/// All three tests of a triangle use its lifted plane (Guibas and Stolfi 1985): with `a` as the origin and `l = x^2 + y^2`, the lifted corners
/// lie on the plane `p x + q y + o l = 0`, and `d` is outside the circle if and only if it is above the plane. `o` is the orientation.
pub struct TriangleBatch {
    /// The three corners of each triangle: corner `i` of triangle `t` is `corners[i][t]`. A site is copied whole, which takes half as long
    /// as to part its coordinates here.
    pub corners: [[Site; TriangleBatch::LANES]; 3],
    /// The site beyond side `i` of triangle `t`, the side from corner `i` to the next.
    pub beyond: [[Site; TriangleBatch::LANES]; 3],
}

/// What a [`TriangleBatch`] leaves in doubt: bit `t` is that of triangle `t`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uncertain {
    /// The triangles that may not be counterclockwise.
    pub orientation: u64,
    /// The triangles for which [`in_circle`] may be true with the site beyond side `i`.
    pub sides: [u64; 3],
}

impl Default for TriangleBatch {
    fn default() -> Self {
        TriangleBatch { corners: [[[0; 2]; TriangleBatch::LANES]; 3], beyond: [[[0; 2]; TriangleBatch::LANES]; 3] }
    }
}

impl TriangleBatch {
    /// How many triangles fit.
    pub const LANES: usize = 64;

    /// Returns what is in doubt about the first `count` triangles. A bit is never clear where [`orient2d`] is not positive, or [`in_circle`]
    /// is true.
    #[inline(always)]
    pub fn uncertain(&self, count: usize) -> Uncertain {
        let Uncertain { orientation, sides } = uncertain(self, count);
        let all = u64::MAX >> (TriangleBatch::LANES - count.clamp(1, TriangleBatch::LANES));
        Uncertain { orientation: orientation & all, sides: sides.map(|side| side & all) }
    }
}

// As a function of its own it compiles to vector instructions. Inlined into its callers it might not.
#[multiversion(targets("x86_64+avx2"), attrs(inline(never)))]
fn uncertain(batch: &TriangleBatch, count: usize) -> Uncertain {
    // Half a word at a time, whose bits have the width of the numbers. Arrays of one constant length need no bounds checks.
    const HALF: usize = TriangleBatch::LANES / 2;
    let TriangleBatch { corners: [a, b, c], beyond: [d, e, f] } = batch;
    let mut words = [0u64; 4];
    let mut from_a = [[[0f32; HALF]; 2]; 5];
    for first in (0..count.min(TriangleBatch::LANES)).step_by(HALF) {
        // Coordinates are parted in a loop of their own: with them, the compiler takes half as many lanes for the rest.
        for i in 0..HALF {
            let t = first + i;
            for (from_a, to) in from_a.iter_mut().zip([b[t], c[t], d[t], e[t], f[t]]) {
                let [x, y] = difference(to, a[t]);
                (from_a[0][i], from_a[1][i]) = (x, y);
            }
        }
        let [u, v, d, e, f] = &from_a;
        let mut halves = [0u32; 4];
        for i in 0..HALF {
            let at = |from_a: &[[f32; HALF]; 2]| [from_a[0][i], from_a[1][i]];
            let plane = LiftedPlane::new(at(u), at(v));
            halves[0] |= u32::from(!plane.is_counterclockwise()) << i as u32;
            halves[1] |= u32::from(!plane.is_below(at(d))) << i as u32;
            halves[2] |= u32::from(!plane.is_below(at(e))) << i as u32;
            halves[3] |= u32::from(!plane.is_below(at(f))) << i as u32;
        }
        for (word, half) in words.iter_mut().zip(halves) {
            *word |= u64::from(half) << first;
        }
    }
    let [orientation, sides @ ..] = words;
    Uncertain { orientation, sides }
}

/// Relative error of what [`LiftedPlane`] computes in single precision. With `e = 2^-24`, a difference is wrong by `e`, a lift by 4 e, a
/// product of both by 6 e, and `p` and `q` by 7 e of the sum of the sizes of their two terms; `o` by 4 e. Times a coordinate or a lift, a
/// term is wrong by 9 e to 11 e, and the sum of four by 13 e of the sum of all sizes. The rest is for terms of second order, and for the
/// rounding of the error itself. Nothing overflows: differences are integers up to 2^30, and sums stay below 2^126.
const PLANE_ERROR: f32 = 20.0 / (1 << 24) as f32;

/// The plane through the lifted corners of a triangle, lowered by more than its error.
#[derive(Clone, Copy)]
struct LiftedPlane {
    p: f32,
    q: f32,
    o: f32,
    lowered: f32,
    orientation: f32,
}

impl LiftedPlane {
    #[inline(always)]
    fn new([ux, uy]: [f32; 2], [vx, vy]: [f32; 2]) -> LiftedPlane {
        let (ul, vl) = (ux * ux + uy * uy, vx * vx + vy * vy);
        let (p1, p2, q1, q2, o1, o2) = (uy * vl, ul * vy, ul * vx, ux * vl, ux * vy, uy * vx);
        // The error is that of (|p1| + |p2|) |x| + (|q1| + |q2|) |y| + (|o1| + |o2|) l, and neither |x| nor |y| is greater than
        // (l / size + size) / 2 for any size.
        let size = ux.abs() + uy.abs() + vx.abs() + vy.abs();
        let linear = (0.5 * PLANE_ERROR) * (p1.abs() + p2.abs() + q1.abs() + q2.abs());
        let orientation = (o1 - o2) - PLANE_ERROR * (o1.abs() + o2.abs());
        LiftedPlane { p: p1 - p2, q: q1 - q2, o: orientation - linear / size, lowered: linear * size, orientation }
    }

    /// Returns whether the triangle is surely counterclockwise.
    #[inline(always)]
    fn is_counterclockwise(self) -> bool {
        self.orientation > 0.0
    }

    /// Returns whether the plane is surely below the lifted `d`.
    #[inline(always)]
    fn is_below(self, [x, y]: [f32; 2]) -> bool {
        self.p * x + self.q * y + self.o * (x * x + y * y) - self.lowered > 0.0
    }
}

#[inline(always)]
fn difference(to: Site, from: Site) -> [f32; 2] {
    [to[0].wrapping_sub(from[0]) as f32, to[1].wrapping_sub(from[1]) as f32]
}

/// Returns for each of four counterclockwise triangles and sites whether [`in_circle`] may be true. It is never false where `in_circle` is
/// true.
#[inline(always)]
pub fn four_inside_or_uncertain(triangles: [[Site; 3]; 4], sites: [Site; 4]) -> [bool; 4] {
    let mut uncertain = [false; 4];
    for i in 0..4 {
        let [a, b, c] = triangles[i];
        uncertain[i] = is_inside_or_uncertain(a, b, c, sites[i]);
    }
    uncertain
}

/// Tells in single precision whether [`in_circle`] may be true. It is never false where `in_circle` is true.
#[inline(always)]
fn is_inside_or_uncertain(a: Site, b: Site, c: Site, d: Site) -> bool {
    let along = |p: Site, axis: usize| p[axis].wrapping_sub(d[axis]) as f32;
    let (ax, ay, bx, by) = (along(a, 0), along(a, 1), along(b, 0), along(b, 1));
    let (cx, cy) = (along(c, 0), along(c, 1));
    let (al, bl, cl) = (ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy);
    let (bc, cb, ca, ac) = (bx * cy, cx * by, cx * ay, ax * cy);
    let (ab, ba) = (ax * by, bx * ay);
    let det = al * (bc - cb) + bl * (ca - ac) + cl * (ab - ba);
    let permanent = al * (bc.abs() + cb.abs()) + bl * (ca.abs() + ac.abs()) + cl * (ab.abs() + ba.abs());
    det >= -IN_CIRCLE_ERROR_SINGLE * permanent
}

/// Decides [`in_circle`] where floating point is in doubt.
#[cold]
#[inline(never)]
fn in_circle_exact(a: Site, b: Site, c: Site, d: Site) -> bool {
    match in_circle_determinant(a, b, c, d).signum() {
        0 => tie(a, b, c, d),
        sign => sign > 0,
    }
}

/// Returns the in-circle determinant of the counterclockwise triangle `abc` and `d`: positive inside, zero on the circle. Exact.
pub fn in_circle_determinant(a: Site, b: Site, c: Site, d: Site) -> i128 {
    let diff = |p: Site| (p[0] as i64 - d[0] as i64, p[1] as i64 - d[1] as i64);
    let ((ax, ay), (bx, by), (cx, cy)) = (diff(a), diff(b), diff(c));
    let term = |px: i64, py: i64, qx: i64, qy: i64, rx: i64, ry: i64| {
        (px * px + py * py) as i128 * (qx * ry - qy * rx) as i128
    };
    term(ax, ay, bx, by, cx, cy) + term(bx, by, cx, cy, ax, ay) + term(cx, cy, ax, ay, bx, by)
}

/// Decides [`in_circle`] for four distinct sites on one circle: the last of them in lexicographic (x, y) order counts as outside
/// the circle of the other three. This is the symbolic perturbation of Devillers and Teillaud 2011, "Perturbations for Delaunay and
/// weighted Delaunay 3D triangulations", in which the last site in the order is raised most. Because no three sites of a
/// circle are collinear, the first step of their rule always decides.
fn tie(a: Site, b: Site, c: Site, d: Site) -> bool {
    let last = a.max(b).max(c).max(d);
    if last == d {
        false
    } else if last == c {
        orient2d(a, b, d) > 0
    } else if last == b {
        orient2d(a, d, c) > 0
    } else {
        orient2d(d, b, c) > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::REACH;
    use proptest::prelude::*;

    /// Returns a number within 2^bits of zero (xorshift64*).
    fn number(state: &mut u64, bits: u32) -> i32 {
        *state ^= *state >> 12;
        *state ^= *state << 25;
        *state ^= *state >> 27;
        let top = state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> (63 - bits);
        top as i32 - (1 << bits)
    }

    #[test]
    fn single_precision_never_misses_a_site_inside() {
        let mut state = 7;
        let (mut inside, mut sure) = (0, 0);
        for round in 0..100_000 {
            let bits = [2, 6, 14, 22, 29][round % 5];
            let mut site = || [number(&mut state, bits), number(&mut state, bits)];
            let (a, mut b, mut c, mut d) = (site(), site(), site(), site());
            if round % 3 == 0 {
                // Nearly on the circle: the fourth corner of a rectangle, or one step beside it.
                c = [b[0] - (b[1] - a[1]), b[1] + (b[0] - a[0])];
                d = [a[0] - (b[1] - a[1]) + (round % 2) as i32, a[1] + (b[0] - a[0])];
            }
            if orient2d(a, b, c) < 0 {
                std::mem::swap(&mut b, &mut c);
            }
            if orient2d(a, b, c) == 0 || [c, d].iter().flatten().any(|v| v.abs() > 1 << 29) {
                continue;
            }
            let uncertain = four_inside_or_uncertain([[a, b, c]; 4], [d; 4])[1];
            let exact = in_circle_determinant(a, b, c, d);
            assert_eq!(in_circle(a, b, c, d), exact > 0 || (exact == 0 && tie(a, b, c, d)));
            assert!(uncertain || exact < 0, "{a:?} {b:?} {c:?} {d:?}");
            inside += (exact >= 0) as usize;
            sure += !uncertain as usize;
        }
        assert!(inside > 10_000 && sure > 10_000);
    }

    fn set(batch: &mut TriangleBatch, t: usize, corners: [Site; 3], beyond: [Site; 3]) {
        for i in 0..3 {
            (batch.corners[i][t], batch.beyond[i][t]) = (corners[i], beyond[i]);
        }
    }

    #[test]
    fn a_batch_is_sure_of_most_triangles() {
        let mut state = 9;
        let mut sites = || -> [Site; 4] { [(); 4].map(|()| [number(&mut state, 20), number(&mut state, 20)]) };
        let mut batch = TriangleBatch::default();
        let mut quadrilaterals = Vec::new();
        for t in 0..TriangleBatch::LANES {
            let [a, mut b, mut c, d] = sites();
            if orient2d(a, b, c) < 0 {
                std::mem::swap(&mut b, &mut c);
            }
            set(&mut batch, t, [a, b, c], [d; 3]);
            quadrilaterals.push([a, b, c, d]);
        }
        let uncertain = batch.uncertain(TriangleBatch::LANES);
        let inside = (0..)
            .zip(&quadrilaterals)
            .fold(0u64, |inside, (t, &[a, b, c, d])| inside | u64::from(in_circle(a, b, c, d)) << t);
        assert_eq!(uncertain, Uncertain { orientation: 0, sides: [inside; 3] });
    }

    /// Returns the sign of `value`.
    fn sign(value: f64) -> i64 {
        (value > 0.0) as i64 - (value < 0.0) as i64
    }

    fn coord(site: Site) -> robust::Coord<f64> {
        robust::Coord { x: site[0].into(), y: site[1].into() }
    }

    fn robust_orientation(a: Site, b: Site, c: Site) -> i64 {
        sign(robust::orient2d(coord(a), coord(b), coord(c)))
    }

    fn robust_in_circle(a: Site, b: Site, c: Site, d: Site) -> i64 {
        sign(robust::incircle(coord(a), coord(b), coord(c), coord(d)))
    }

    fn clamped([x, y]: [i64; 2]) -> Site {
        [x, y].map(|c| c.clamp(-i64::from(REACH), i64::from(REACH)) as i32)
    }

    fn site_within(reach: i32) -> impl Strategy<Value = Site> {
        [-reach..=reach, -reach..=reach]
    }

    /// Generates a distance from zero, of any order of magnitude.
    fn reach() -> impl Strategy<Value = i32> {
        (0..=29).prop_map(|bits| 1 << bits)
    }

    fn random() -> impl Strategy<Value = [Site; 4]> {
        reach().prop_flat_map(|reach| [(); 4].map(|()| site_within(reach)))
    }

    /// Generates coordinates at the ends of the range, so that differences reach 2^30.
    fn extreme() -> impl Strategy<Value = [Site; 4]> {
        let coordinate = || prop_oneof![Just(-REACH), Just(REACH), Just(0), -REACH..=-REACH + 2, REACH - 2..=REACH];
        [(); 4].map(|()| [coordinate(), coordinate()])
    }

    /// Generates sites on the line through two sites, or up to two steps off.
    fn near_a_line() -> impl Strategy<Value = [Site; 4]> {
        let parts = (
            site_within(REACH),
            site_within(1 << 14),
            [(); 3].map(|()| -(1i64 << 15)..1 << 15),
            [(); 3].map(|()| site_within(2)),
        );
        parts.prop_map(|(a, direction, factors, off)| {
            let on = |i: usize| {
                [0, 1].map(|k| i64::from(a[k]) + factors[i] * i64::from(direction[k]) + i64::from(off[i][k]))
            };
            [a, clamped(on(0)), clamped(on(1)), clamped(on(2))]
        })
    }

    /// Generates four sites of one circle: a site turned by right angles and mirrored around a centre.
    fn cocircular() -> impl Strategy<Value = [Site; 4]> {
        (site_within(REACH / 2), site_within(REACH / 2), [(); 4].map(|()| 0..8usize)).prop_map(
            |([x, y], [p, q], turns)| {
                let around = [[p, q], [-q, p], [-p, -q], [q, -p], [q, p], [-p, q], [-q, -p], [p, -q]];
                turns.map(|turn| [x + around[turn][0], y + around[turn][1]])
            },
        )
    }

    /// Generates four sites up to one step off a circle.
    fn near_a_circle() -> impl Strategy<Value = [Site; 4]> {
        (cocircular(), [(); 4].map(|()| site_within(1))).prop_map(|(sites, off)| {
            [0, 1, 2, 3].map(|i| clamped([0, 1].map(|k| i64::from(sites[i][k]) + i64::from(off[i][k]))))
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn signs_are_those_of_robust(
            [a, b, c, d] in prop_oneof![random(), extreme(), near_a_line(), cocircular(), near_a_circle()]
        ) {
            prop_assert_eq!(orient2d(a, b, c).signum(), robust_orientation(a, b, c));
            let expected = robust_in_circle(a, b, c, d);
            prop_assert_eq!(in_circle_determinant(a, b, c, d).signum() as i64, expected);
            if orient2d(a, b, c) > 0 && ![a, b, c].contains(&d) {
                prop_assert_eq!(in_circle(a, b, c, d), expected > 0 || (expected == 0 && tie(a, b, c, d)));
                prop_assert!(four_inside_or_uncertain([[a, b, c]; 4], [d; 4])[0] || expected < 0);
                let is_convex = robust_orientation(d, b, c) > 0 && robust_orientation(d, c, a) > 0;
                prop_assert_eq!(failing_edge(a, b, c, d), in_circle(a, b, c, d).then_some(is_convex));
            }
        }

        /// Every triangle is tested in any place of the batch and from all its corners, beside triangles of another kind.
        #[test]
        fn a_batch_leaves_in_doubt_what_may_be_wrong(
            [a, b, c, d] in prop_oneof![random(), extreme(), near_a_line(), cocircular(), near_a_circle()],
            [e, f, g, h] in prop_oneof![random(), extreme()],
            place in 0..TriangleBatch::LANES,
        ) {
            let mut batch = TriangleBatch::default();
            (0..TriangleBatch::LANES).for_each(|t| set(&mut batch, t, [e, f, g], [h; 3]));
            for corners in [[a, b, c], [b, c, a], [c, a, b]] {
                set(&mut batch, place, corners, [d, h, d]);
                let uncertain = batch.uncertain(place + 1);
                let is_doubtful = |word: u64| word >> place & 1 != 0;
                prop_assert!(is_doubtful(uncertain.orientation) || orient2d(a, b, c) > 0);
                for (side, beyond) in uncertain.sides.into_iter().zip([d, h, d]) {
                    prop_assert!(is_doubtful(side) || robust_in_circle(a, b, c, beyond) < 0);
                }
                // What comes after the last triangle is not in doubt.
                let all = uncertain.sides.iter().fold(uncertain.orientation, |all, side| all | side);
                prop_assert_eq!(u128::from(all) >> (place + 1), 0);
            }
        }

        #[test]
        fn turned_and_mirrored_sites_are_cocircular([a, b, c, d] in cocircular()) {
            prop_assert_eq!(robust_in_circle(a, b, c, d), 0);
            prop_assert_eq!(in_circle_determinant(a, b, c, d), 0);
        }

        #[test]
        fn exactly_one_diagonal_of_a_convex_quadrilateral_is_delaunay(
            [a, b, c, d] in prop_oneof![random(), extreme(), near_a_line(), cocircular(), near_a_circle()]
        ) {
            let orders = [[a, b, c, d], [a, b, d, c], [a, c, b, d], [a, c, d, b], [a, d, b, c], [a, d, c, b]];
            let is_convex = |&[a, b, c, d]: &[Site; 4]| {
                [[a, b, c], [b, c, d], [c, d, a], [d, a, b]].iter().all(|&[p, q, r]| orient2d(p, q, r) > 0)
            };
            for [a, b, c, d] in orders.into_iter().filter(is_convex) {
                prop_assert!(in_circle(a, b, c, d) != in_circle(b, c, d, a));
                prop_assert_eq!(in_circle(a, b, c, d), in_circle(c, d, a, b));
            }
        }
    }
}
