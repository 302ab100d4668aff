//! Finds the curvature of a scene: the polynomial that is nearest to where its places lie on the earth.

use crate::curvature::{Curvature, MOST_DEGREE, terms};
use crate::tiles3d::globe::NotPlaced;
use crate::tiles3d::ground::Ground;
use delaunay::geometry::Bounds;
use std::f64::consts::PI;

/// A polynomial that is off by less than this many metres is near enough. Tiles meet exactly however far off it is.
const NEAR_ENOUGH: f64 = 0.005;

/// The degree to begin with.
const LEAST_DEGREE: usize = 4;

/// Places along a side at which a polynomial is compared with the earth.
const COMPARED: usize = 15;

/// A higher degree must lower the distance from the earth at least to this part of it.
const WORTH_A_DEGREE: f64 = 0.7;

/// Along which axes a scene is bent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bent {
    /// Along all of them.
    All,
    /// Upwards alone, as the ground in the middle between the lowest and the highest point needs it. So x and y stay on the lattice.
    Up,
}

/// Returns the curvature of the scene of `ground` within `bounds`, seen from the middle.
///
/// # Errors
/// As [`Ground::displacement`], and if no place within `bounds` has a height of the geoid.
pub fn fit_curvature(ground: &Ground, bounds: Bounds<3>, bent: Bent) -> Result<Curvature, NotPlaced> {
    let centre = bounds.middle();
    let half = [0, 1, 2].map(|k| (bounds.extent(k) / 2 + 1).min(i32::MAX as i64) as i32);
    let fit = |metres: Vec<[f64; 6]>, degree| {
        let curvature = Curvature::new(centre, half, degree, &metres);
        curvature.ok_or_else(|| NotPlaced::System("the terrain is larger than the earth".into()))
    };
    let none = fit(vec![[0.0; 6]], 0)?;
    let middle = ground.seen_from(none.bounds())?;
    let transform = ground.tangent(middle)?;
    let displacement = |share: [f64; 3]| {
        let share = if bent == Bent::Up { [share[0], share[1], 0.0] } else { share };
        let moved = ground.displacement(&transform, none.place(share), middle)?;
        Ok(if bent == Bent::Up { [0.0, 0.0, moved[2]] } else { moved })
    };
    // Where the geoid has no height there is no point either.
    let is_known = |share| ground.is_known(none.place(share));
    let off = |curvature: &Curvature| off(curvature, &displacement, &is_known);
    let mut best = fit(interpolated(LEAST_DEGREE, &displacement)?, LEAST_DEGREE)?;
    let mut far = off(&best)?;
    for degree in (LEAST_DEGREE + 2..=MOST_DEGREE).step_by(2) {
        if far < NEAR_ENOUGH {
            break;
        }
        let next = fit(interpolated(degree, &displacement)?, degree)?;
        let next_far = off(&next)?;
        if next_far < far * WORTH_A_DEGREE {
            (best, far) = (next, next_far);
        }
    }
    Ok(best)
}

/// A displacement in metres at a place of the box, each coordinate from -1 to 1.
type DisplacementAt<'a> = &'a dyn Fn([f64; 3]) -> Result<[f64; 3], NotPlaced>;

/// Returns the greatest distance in metres between a curvature and what it stands for, at the places that count.
fn off(
    curvature: &Curvature,
    displacement: DisplacementAt,
    counts: &dyn Fn([f64; 3]) -> bool,
) -> Result<f64, NotPlaced> {
    let mut greatest = 0.0f64;
    for i in 0..COMPARED * COMPARED * 2 {
        let along = |number: usize| 2.0 * number as f64 / (COMPARED - 1) as f64 - 1.0;
        let share =
            [along(i % COMPARED), along(i / COMPARED % COMPARED), if i < COMPARED * COMPARED { -1.0 } else { 1.0 }];
        if !counts(share) {
            continue;
        }
        let (found, wanted) = (curvature.displacement(curvature.place(share)), displacement(share)?);
        greatest = (0..3).map(|k| (found[k] - wanted[k]).abs()).fold(greatest, f64::max);
    }
    Ok(greatest)
}

/// Returns the terms of the polynomial through the values at the Chebyshev nodes, without those above the degree. Heights count linearly,
/// as on the earth: up is a straight line.
fn interpolated(degree: usize, displacement: DisplacementAt) -> Result<Vec<[f64; 6]>, NotPlaced> {
    let count = degree + 1;
    let angle = |k: usize| PI * (k as f64 + 0.5) / count as f64;
    let mut chebyshev = vec![vec![[0.0; 6]; count]; count];
    for k in 0..count {
        for l in 0..count {
            let [u, v] = [k, l].map(|node| libm::cos(angle(node)));
            let [low, high] = [displacement([u, v, -1.0])?, displacement([u, v, 1.0])?];
            for (i, row) in chebyshev.iter_mut().enumerate() {
                for (j, term) in row.iter_mut().enumerate() {
                    let norm = [i, j].map(|n| if n == 0 { 1.0 } else { 2.0 } / count as f64);
                    let weight = norm[0] * norm[1] * libm::cos(i as f64 * angle(k)) * libm::cos(j as f64 * angle(l));
                    for a in 0..3 {
                        term[a] += weight * (high[a] + low[a]) / 2.0;
                        term[3 + a] += weight * (high[a] - low[a]) / 2.0;
                    }
                }
            }
        }
    }
    Ok(powers(degree, &chebyshev))
}

/// Returns the terms in powers of a sum of products of Chebyshev polynomials, in the order of [`Curvature`].
fn powers(degree: usize, chebyshev: &[Vec<[f64; 6]>]) -> Vec<[f64; 6]> {
    let polynomials = chebyshev_polynomials(degree);
    let mut found = Vec::with_capacity(terms(degree));
    for p in 0..=degree {
        for q in 0..=degree - p {
            let mut sum = [0.0; 6];
            for i in p..=degree {
                for j in q..=degree - i.min(degree) {
                    let weight = polynomials[i][p] * polynomials[j][q];
                    (0..6).for_each(|a| sum[a] += weight * chebyshev[i][j][a]);
                }
            }
            found.push(sum);
        }
    }
    found
}

/// Returns the Chebyshev polynomials up to a degree, each by its coefficients of powers.
fn chebyshev_polynomials(degree: usize) -> Vec<Vec<f64>> {
    let mut all = vec![vec![0.0; degree + 1]; degree + 1];
    all[0][0] = 1.0;
    for n in 1..=degree {
        for p in 0..=degree {
            let twice = if p > 0 { all[n - 1][p - 1] } else { 0.0 };
            all[n][p] = if n == 1 { twice } else { 2.0 * twice - all[n - 2][p] };
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_found_again() {
        let exact = |[u, v, w]: [f64; 3]| Ok([u * u * v - 3.0 * v, 5.0 + w * u, v * v * v * v - w * (u + 2.0 * v * v)]);
        let found = interpolated(4, &exact).unwrap();
        let order: Vec<[usize; 2]> = (0..5).flat_map(|i| (0..5 - i).map(move |j| [i, j])).collect();
        for ([i, j], term) in order.into_iter().zip(found) {
            let expected = match [i, j] {
                [2, 1] => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                [0, 1] => [-3.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                [0, 0] => [0.0, 5.0, 0.0, 0.0, 0.0, 0.0],
                [1, 0] => [0.0, 0.0, 0.0, 0.0, 1.0, -1.0],
                [0, 4] => [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
                [0, 2] => [0.0, 0.0, 0.0, 0.0, 0.0, -2.0],
                _ => [0.0; 6],
            };
            assert!((0..6).all(|a| (term[a] - expected[a]).abs() < 1e-12), "{i} {j}: {term:?}");
        }
    }
}
