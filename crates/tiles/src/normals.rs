//! Vertex normals, weighted by the area of the triangles around the vertex. They come from exact integer sums, so neither the order
//! of the triangles nor the cut into tiles changes a bit of them.

use crate::frame::Frame;
use delaunay::geometry::bounds_of;
use multiversion::multiversion;

/// The sum of the normals of the triangles around a vertex, each with a length of twice the triangle's area, in lattice steps
/// (x, y, z). The sums of one vertex in several tiles are added.
pub type NormalSum = [i128; 3];

/// The sums of all vertices of a tile: narrow if the tile's extent proves that they cannot overflow.
#[derive(Clone, Debug)]
pub enum NormalSums {
    /// No sum can leave an `i64`.
    Narrow(Vec<[i64; 3]>),
    /// A sum may leave an `i64`, because triangles are huge.
    Wide(Vec<NormalSum>),
}

impl NormalSums {
    /// Returns the sums over `triangles` (indices of `positions`, counterclockwise) at every vertex of `positions` (lattice steps).
    pub fn new(positions: &[[i32; 3]], triangles: &[[u32; 3]]) -> NormalSums {
        let mut sums = if narrow_suffices(positions, triangles.len()) {
            NormalSums::Narrow(vec![[0; 3]; positions.len()])
        } else {
            NormalSums::Wide(vec![[0; 3]; positions.len()])
        };
        match &mut sums {
            NormalSums::Narrow(sums) => accumulate(positions, triangles, sums, cross_narrow),
            NormalSums::Wide(sums) => accumulate(positions, triangles, sums, cross),
        }
        sums
    }

    /// Returns the sum of vertex `v`.
    #[inline]
    pub fn get(&self, v: usize) -> NormalSum {
        match self {
            NormalSums::Narrow(sums) => sums[v].map(i128::from),
            NormalSums::Wide(sums) => sums[v],
        }
    }

    /// Tells of every vertex whether it is a corner of a triangle: then the z of its sum is above zero, because counterclockwise triangles
    /// have an area.
    pub fn are_corners(&self) -> Vec<bool> {
        match self {
            NormalSums::Narrow(sums) => sums.iter().map(|sum| sum[2] > 0).collect(),
            NormalSums::Wide(sums) => sums.iter().map(|sum| sum[2] > 0).collect(),
        }
    }

    /// Returns the unit normals of all vertices, each as [`unit_normal`] does.
    pub fn unit_normals(&self, frame: &Frame) -> Vec<[f32; 3]> {
        let weights = weights(frame);
        match self {
            NormalSums::Narrow(sums) => units(sums, weights),
            NormalSums::Wide(sums) => sums.iter().map(|s| unit(s.map(|v| v as f64), weights)).collect(),
        }
    }
}

/// Returns the unit normal (x east, y north, z up) in metres of a vertex with a complete sum, or straight up for a zero sum.
pub fn unit_normal(sum: NormalSum, frame: &Frame) -> [f32; 3] {
    unit(sum.map(|v| v as f64), weights(frame))
}

/// Returns `a + b`.
#[inline]
pub fn add(a: NormalSum, b: NormalSum) -> NormalSum {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Returns the normal of the counterclockwise triangle `abc`, with a length of twice its area, in lattice steps.
#[inline]
pub fn cross(a: [i32; 3], b: [i32; 3], c: [i32; 3]) -> NormalSum {
    let difference = |p: [i32; 3]| [0, 1, 2].map(|k| p[k] as i128 - a[k] as i128);
    let ([ux, uy, uz], [vx, vy, vz]) = (difference(b), difference(c));
    [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx]
}

/// Does what [`cross`] does, for tiles where [`narrow_suffices`].
#[inline(always)]
fn cross_narrow(a: [i32; 3], b: [i32; 3], c: [i32; 3]) -> [i64; 3] {
    let difference = |p: [i32; 3]| [0, 1, 2].map(|k| p[k] as i64 - a[k] as i64);
    let ([ux, uy, uz], [vx, vy, vz]) = (difference(b), difference(c));
    [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx]
}

#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128")]
#[inline(always)]
fn accumulate<T: Copy + std::ops::AddAssign>(
    positions: &[[i32; 3]],
    triangles: &[[u32; 3]],
    sums: &mut [[T; 3]],
    cross: impl Fn([i32; 3], [i32; 3], [i32; 3]) -> [T; 3],
) {
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let normal = cross(a, b, c);
        for &v in triangle {
            let sum = &mut sums[v as usize];
            for k in 0..3 {
                sum[k] += normal[k];
            }
        }
    }
}

/// Tells whether the sum of `triangles` normals, all at one vertex, stays within an `i64`.
fn narrow_suffices(positions: &[[i32; 3]], triangles: usize) -> bool {
    let Some(bounds) = bounds_of(positions) else { return true };
    let [x, y, z] = [0, 1, 2].map(|axis| bounds.extent(axis) as u128);
    let largest = (x * y).max(y * z).max(x * z) * 2;
    largest.saturating_mul(triangles as u128) < 1 << 63
}

/// Returns the factors for x and y, and for z, that turn a normal in lattice steps into one in metres, up to a common factor.
fn weights(frame: &Frame) -> [f64; 2] {
    let [horizontal, vertical] = frame.resolution_metres();
    [vertical, horizontal]
}

#[multiversion(targets("x86_64+avx2"))]
fn units(sums: &[[i64; 3]], weights: [f64; 2]) -> Vec<[f32; 3]> {
    sums.iter().map(|s| unit(s.map(|v| v as f64), weights)).collect()
}

#[inline(always)]
fn unit(sum: [f64; 3], weights: [f64; 2]) -> [f32; 3] {
    let [x, y, z] = [sum[0] * weights[0], sum[1] * weights[0], sum[2] * weights[1]];
    let length = (x * x + y * y + z * z).sqrt();
    // One division instead of three. The loss is far below an f32's last place.
    let shrink = 1.0 / length;
    if length > 0.0 { [x, y, z].map(|v| (v * shrink) as f32) } else { [0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice::{Lattice, shortest_decimal};

    /// Returns a frame with steps of 2 cm in x and y, and 1 cm in z.
    fn frame() -> Frame {
        let decimal = |v: f64| shortest_decimal(v).unwrap();
        let lattice = Lattice { offset: [decimal(0.0); 3], resolution: decimal(0.02), resolution_z: decimal(0.01) };
        Frame::new(&lattice, 1.0, 1.0, None).unwrap()
    }

    #[test]
    fn normals_are_in_metres() {
        let positions = [[0, 0, 0], [10, 0, 20], [0, 10, 0], [10, 10, 20]];
        for normal in NormalSums::new(&positions, &[[0, 1, 2], [1, 3, 2]]).unit_normals(&frame()) {
            assert_eq!(normal, [-std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2]);
        }
    }

    #[test]
    fn the_order_of_additions_does_not_matter() {
        let positions = [[0, 0, 5], [90, 10, 7], [70, 90, -3], [-60, 80, 2], [-40, -50, 11]];
        let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let whole = NormalSums::new(&positions, &fan).get(0);
        for split in 0..fan.len() {
            let (a, b) = fan.split_at(split);
            let sum = add(NormalSums::new(&positions, b).get(0), NormalSums::new(&positions, a).get(0));
            assert_eq!(sum, whole);
        }
        assert_eq!(unit_normal(whole, &frame()), NormalSums::new(&positions, &fan).unit_normals(&frame())[0]);
    }

    #[test]
    fn huge_triangles_do_not_overflow() {
        let far = 1 << 29;
        let positions = [[-far, -far, i32::MIN], [far, -far, i32::MAX], [-far, far, i32::MIN], [far, far, i32::MAX]];
        let sums = NormalSums::new(&positions, &[[0, 1, 2], [1, 3, 2]]);
        assert!(matches!(sums, NormalSums::Wide(_)));
        assert_eq!(
            sums.get(1),
            add(cross(positions[0], positions[1], positions[2]), cross(positions[1], positions[3], positions[2]))
        );
        for [x, y, z] in sums.unit_normals(&frame()) {
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-6 && x < 0.0 && z > 0.0);
        }
    }

    #[test]
    fn a_vertex_without_triangles_has_a_normal_straight_up() {
        assert_eq!(unit_normal([0; 3], &frame()), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn corners_of_triangles_are_known_by_their_sums() {
        for (x, z) in [(1, 1), (1 << 29, i32::MAX)] {
            let positions = [[-x, -x, -z], [x, -x, z], [-x, x, -z], [0, 0, 0]];
            let sums = NormalSums::new(&positions, &[[0, 1, 2], [0, 1, 2]]);
            assert_eq!(matches!(sums, NormalSums::Wide(_)), z > 1);
            assert_eq!(sums.are_corners(), [true, true, true, false]);
        }
    }
}
