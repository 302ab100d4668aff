//! The heights of a simplified terrain: those with which it is nearest to the terrain around, instead of those of single points.

use crate::lod::filling::Filling;
use crate::lod::refine::Places;
use crate::lod::vertex_cells::plane;
use delaunay::geometry::predicates::orient2d;
use sys::{Result, interrupt};

/// Rounds. Each further one would change heights by a few hundredths of the error.
const ROUNDS: usize = 2;

/// Moves the heights of `filling` that are not `fixed` towards the least squares of the vertical distances to the terrain at `positions`.
/// Returns the mean of the distances in steps of z, as they are before the last round.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(crate) fn fit(
    positions: &[[i32; 3]],
    fixed: impl Fn(u32) -> bool,
    filling: &mut Filling,
    places: &mut Places,
) -> Result<f64> {
    let mut error = 0.0;
    let mut heights: Vec<f64> = filling.positions.iter().map(|p| f64::from(p[2])).collect();
    for _ in 0..ROUNDS {
        interrupt::check()?;
        // For every vertex the sum of the weights, and that of the distances times their weights.
        let mut sums = vec![[0.0; 2]; heights.len()];
        let (mut total, mut count) = (0.0, 0u64);
        for (v, &p) in (0..).zip(positions) {
            let Some(triangle) = places.locate(v, filling) else { break };
            let Some(corners) = filling.corners(triangle) else { continue };
            let weights = weights(corners.map(|site| plane(filling.positions[site as usize])), plane(p));
            let height: f64 = corners.iter().zip(weights).map(|(&site, weight)| weight * heights[site as usize]).sum();
            let distance = f64::from(p[2]) - height;
            total += distance.abs();
            count += 1;
            for (&site, weight) in corners.iter().zip(weights) {
                let [of_weights, of_distances] = &mut sums[site as usize];
                *of_weights += weight;
                *of_distances += weight * distance;
            }
        }
        for ((height, [of_weights, of_distances]), &v) in heights.iter_mut().zip(&sums).zip(&filling.vertices) {
            if *of_weights > 0.0 && !fixed(v) {
                *height += of_distances / of_weights;
            }
        }
        if count > 0 {
            error = total / count as f64;
        }
    }
    let of_terrain = positions.iter().map(|p| p[2]);
    let [low, high] = [of_terrain.clone().min().unwrap_or(0), of_terrain.max().unwrap_or(0)];
    filling.positions.iter_mut().zip(&heights).for_each(|(p, height)| p[2] = (height.round() as i32).clamp(low, high));
    Ok(error)
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
    use crate::lod::filling::Filling;

    /// Noise around a plane, of which every seventh point is kept: the mean of the distances falls, and fixed vertices stay.
    #[test]
    fn heights_move_to_the_middle_of_the_points_around() {
        let terrain: Vec<[i32; 3]> =
            (0..2_500i32).map(|i| [i % 50 * 20, i / 50 * 20, i % 50 * 3 + i * 7919 % 101]).collect();
        let kept: Vec<bool> =
            (0..2_500).map(|i| i % 7 == 0 || !(50..2_450).contains(&i) || [0, 49].contains(&(i % 50))).collect();
        let edge = |from: u32, step: u32, count: u32| (0..count).map(move |k| [from + k * step, from + (k + 1) * step]);
        let back = |edge: [u32; 2]| [edge[1], edge[0]];
        let south_east = edge(0, 1, 49).chain(edge(49, 50, 49));
        let boundary: Vec<[u32; 2]> =
            south_east.chain(edge(2_450, 1, 49).map(back)).chain(edge(0, 50, 49).map(back)).collect();
        let distances = |filling: &Filling, places: &mut Places| -> f64 {
            (0..2_500)
                .map(|v| {
                    let triangle = places.locate(v, filling).unwrap();
                    let corners = filling.corners(triangle).unwrap();
                    let weights = weights(
                        corners.map(|site| plane(filling.positions[site as usize])),
                        plane(terrain[v as usize]),
                    );
                    let height: f64 =
                        (0..3).map(|k| weights[k] * f64::from(filling.positions[corners[k] as usize][2])).sum();
                    (height - f64::from(terrain[v as usize][2])).powi(2)
                })
                .sum()
        };
        let mut filling = Filling::new(&terrain, &kept, &boundary).unwrap();
        let mut places = Places::new(&terrain, &filling);
        let before = distances(&filling, &mut places);
        let mean = fit(&terrain, |v| v.is_multiple_of(70), &mut filling, &mut places).unwrap();
        let after = distances(&filling, &mut places);
        assert!(after < 0.85 * before, "{after} of {before}");
        assert!((10.0..60.0).contains(&mean), "{mean}");
        let stays = |v: u32, p: &[i32; 3]| !v.is_multiple_of(70) || *p == terrain[v as usize];
        assert!(filling.vertices.iter().zip(&filling.positions).all(|(&v, p)| stays(v, p)));
    }
}
