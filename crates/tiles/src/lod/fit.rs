//! The heights of a simplified terrain: those with which it is nearest to the terrain around, instead of those of single points.

use crate::lod::filling::Filling;
use crate::lod::vertex_cells::plane;
use delaunay::geometry::predicates::orient2d;
use sys::{Result, interrupt};

/// How often all heights move. Each further time would change them by a few hundredths of the error.
const ROUNDS: usize = 3;

/// Returns twice the area of the triangles around each vertex at `positions`, in square lattice steps: six times its share of the ground.
pub(crate) fn areas_around(positions: &[[i32; 3]], triangles: &[[u32; 3]]) -> Vec<f64> {
    let mut areas = vec![0.0; positions.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|v| plane(positions[v as usize]));
        let double_area = orient2d(a, b, c) as f64;
        corners.iter().for_each(|&v| areas[v as usize] += double_area);
    }
    areas
}

/// Moves the heights of `filling` that are not `fixed` towards the least squares of the vertical distances to the vertices of a terrain at
/// `positions`, as far as triangles around them are `located`. Each has the weight of its share of the ground, one of `areas`: vertices of a
/// level are dense where much stands out, so without weights each level of a wood would be higher than the one before. Returns the mean of
/// the distances in steps of z, as they are before the heights move the last time.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(crate) fn fit(
    (positions, areas): (&[[i32; 3]], &[f64]),
    fixed: impl Fn(u32) -> bool,
    filling: &mut Filling,
    located: &[u32],
) -> Result<f64> {
    let moves: Vec<bool> = filling.vertices.iter().map(|&v| !fixed(v)).collect();
    let samples = samples((positions, areas), &moves, filling, located);
    let mut error = 0.0;
    let mut heights: Vec<f64> = filling.positions.iter().map(|p| f64::from(p[2])).collect();
    for _ in 0..ROUNDS {
        error = improve(&samples, &moves, &mut heights)?;
    }
    let rounded = rounded(positions, &heights);
    filling.positions.iter_mut().zip(rounded).for_each(|(p, height)| p[2] = height);
    Ok(error)
}

/// Returns `heights` as steps of z, all within the range of the terrain at `positions`.
fn rounded(positions: &[[i32; 3]], heights: &[f64]) -> impl Iterator<Item = i32> {
    let of_terrain = positions.iter().map(|p| p[2]);
    let [low, high] = [of_terrain.clone().min().unwrap_or(0), of_terrain.max().unwrap_or(0)];
    heights.iter().map(move |height| (height.round() as i32).clamp(low, high))
}

/// A vertex of a terrain in a triangle of a filling.
pub(crate) struct Sample {
    /// The corners of the triangle.
    sites: [u32; 3],
    /// Its barycentric coordinates.
    weights: [f64; 3],
    /// In steps of z.
    height: i32,
    /// Its share of the ground.
    area: f64,
}

/// Returns the vertices at `positions` with these `areas` that lie in triangles of `filling` with a corner that moves. `located` has the triangle
/// around each.
pub(crate) fn samples(
    (positions, areas): (&[[i32; 3]], &[f64]),
    moves: &[bool],
    filling: &Filling,
    located: &[u32],
) -> Vec<Sample> {
    let sample = |((&triangle, &p), &area): ((&u32, &[i32; 3]), &f64)| {
        let sites = filling.corners(triangle as usize);
        let place = |site: u32| plane(filling.positions[site as usize]);
        let is_used = sites.iter().any(|&site| moves[site as usize]);
        is_used.then(|| Sample { sites, weights: weights(sites.map(place), plane(p)), height: p[2], area })
    };
    let mut samples = Vec::with_capacity(located.len());
    samples.extend(located.iter().zip(positions).zip(areas).filter_map(sample));
    samples
}

/// Returns the sum of `heights`, one of each site, over the ground of the samples: height times area.
pub(crate) fn volume(samples: &[Sample], heights: &[f64]) -> f64 {
    let height_at =
        |s: &Sample| s.sites.iter().zip(s.weights).map(|(&site, w)| w * heights[site as usize]).sum::<f64>();
    samples.iter().map(|sample| sample.area * height_at(sample)).sum()
}

/// Moves those of `heights` once that may move. Returns the mean distance of the samples before.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(crate) fn improve(samples: &[Sample], moves: &[bool], heights: &mut [f64]) -> Result<f64> {
    interrupt::check()?;
    // For every vertex the sum of the weights, and that of the distances times their weights.
    let mut sums = vec![[0.0; 2]; heights.len()];
    let mut total = 0.0;
    for Sample { sites, weights, height, area } in samples {
        let of_filling: f64 = sites.iter().zip(weights).map(|(&site, weight)| weight * heights[site as usize]).sum();
        let distance = f64::from(*height) - of_filling;
        total += distance.abs();
        for (&site, weight) in sites.iter().zip(weights) {
            let [of_weights, of_distances] = &mut sums[site as usize];
            *of_weights += area * weight;
            *of_distances += area * weight * distance;
        }
    }
    for ((height, [of_weights, of_distances]), moves) in heights.iter_mut().zip(&sums).zip(moves) {
        if *of_weights > 0.0 && *moves {
            *height += of_distances / of_weights;
        }
    }
    Ok(total / samples.len().max(1) as f64)
}

/// Returns how far a point is above a triangle of `filling`, in steps of z.
pub(crate) fn distance_above(filling: &Filling, triangle: usize, p: [i32; 3]) -> f64 {
    let corners = filling.corners(triangle).map(|site| filling.positions[site as usize]);
    let weights = weights(corners.map(plane), plane(p));
    f64::from(p[2]) - (0..3).map(|k| weights[k] * f64::from(corners[k][2])).sum::<f64>()
}

/// Returns the barycentric coordinates of `p` in a triangle.
fn weights(corners: [[i32; 2]; 3], p: [i32; 2]) -> [f64; 3] {
    let [a, b, c] = corners;
    let areas = [orient2d(b, c, p), orient2d(c, a, p), orient2d(a, b, p)].map(|area| area as f64);
    let whole: f64 = areas.iter().sum();
    areas.map(|area| area / whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lod::refine::Places;

    /// Areas of the points of a [`Square`] that are all equal.
    static EQUAL: [f64; 2_500] = [1.0; 2_500];

    /// A lattice of 50 by 50 points, of which the outermost and every seventh are kept.
    struct Square {
        terrain: Vec<[i32; 3]>,
        kept: Vec<bool>,
    }

    impl Square {
        fn new(height: impl Fn(i32, i32) -> i32) -> Square {
            let point = |i: i32| [i % 50 * 20, i / 50 * 20, height(i % 50, i / 50)];
            let outermost = |i: i32| [0, 49].contains(&(i % 50)) || [0, 49].contains(&(i / 50));
            Square {
                terrain: (0..2_500).map(point).collect(),
                kept: (0..2_500).map(|i| i % 7 == 0 || outermost(i)).collect(),
            }
        }

        /// Returns how far each point is above the filling.
        fn distances(&self, filling: &Filling, places: &mut Places) -> Vec<f64> {
            let distance = |(&triangle, &p): (&u32, &[i32; 3])| {
                let corners = filling.corners(triangle as usize).map(|site| filling.positions[site as usize]);
                let weights = weights(corners.map(plane), plane(p));
                f64::from(p[2]) - (0..3).map(|k| weights[k] * f64::from(corners[k][2])).sum::<f64>()
            };
            places.locate_all(filling).iter().zip(&self.terrain).map(distance).collect()
        }
    }

    #[test]
    fn heights_move_to_the_middle_of_the_points_around_but_for_fixed_ones() {
        let square = Square::new(|x, y| 3 * x + (x + 50 * y) * 7919 % 101);
        let mut filling = Filling::new(&square.terrain, &square.kept).unwrap();
        let mut places = Places::new(&square.terrain, &filling);
        let squares = |distances: Vec<f64>| distances.iter().map(|d| d * d).sum::<f64>();
        let before = squares(square.distances(&filling, &mut places));
        let located = places.locate_all(&filling);
        let mean = fit((&square.terrain, &EQUAL), |v| v.is_multiple_of(70), &mut filling, located).unwrap();
        let after = squares(square.distances(&filling, &mut places));
        assert!(after < 0.85 * before, "{after} of {before}");
        assert!((10.0..60.0).contains(&mean), "{mean}");
        let stays = |v: u32, p: &[i32; 3]| !v.is_multiple_of(70) || *p == square.terrain[v as usize];
        assert!(filling.vertices.iter().zip(&filling.positions).all(|(&v, p)| stays(v, p)));
    }

    /// Points of every second column are as far above the middle as the others are below it.
    #[test]
    fn stripes_are_neither_lifted_nor_sunk() {
        for sign in [1, -1] {
            let square = Square::new(|x, _| sign * (1_000 * (x % 2) - 500));
            let mut filling = Filling::new(&square.terrain, &square.kept).unwrap();
            let mut places = Places::new(&square.terrain, &filling);
            let located = places.locate_all(&filling);
            fit((&square.terrain, &EQUAL), |_| false, &mut filling, located).unwrap();
            let distances = square.distances(&filling, &mut places);
            let mean = distances.iter().sum::<f64>() / distances.len() as f64;
            assert!(mean.abs() < 10.0, "{mean} of 500");
        }
    }

    /// Far more points stand out than others, but on a tenth of the ground.
    #[test]
    fn what_covers_little_ground_weighs_little() {
        let square = Square::new(|x, _| if x % 10 == 0 { 0 } else { 1_000 });
        let areas: Vec<f64> = (0..2_500).map(|i| if i % 10 == 0 { 81.0 } else { 1.0 }).collect();
        let mut filling = Filling::new(&square.terrain, &square.kept).unwrap();
        let mut places = Places::new(&square.terrain, &filling);
        let located = places.locate_all(&filling);
        fit((&square.terrain, &areas), |_| false, &mut filling, located).unwrap();
        let distances = square.distances(&filling, &mut places);
        let mean = distances.iter().zip(&areas).map(|(d, area)| d * area).sum::<f64>() / areas.iter().sum::<f64>();
        assert!(mean.abs() < 50.0, "{mean} of 1000");
    }
}
