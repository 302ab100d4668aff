//! What the terrain is like around a place, as far as a sample of the points shows it.

use crate::plan::extent::to_float;
use breaklines::Vertex;
use delaunay::geometry::{Bounds, Site};
use lattice::Lattice;

/// So many sampled points around a place tell its height.
const NEIGHBOURS: usize = 8;

/// A sample of the points, with heights in source units.
pub(super) struct SampledTerrain<'a> {
    pub(super) lattice: &'a Lattice,
    /// The lengths of a unit of x and y and of one of heights in metres.
    metres: [f64; 2],
    /// The box of the points.
    within: Bounds<2>,
    /// Places and heights, by x.
    points: Vec<(Site, i32)>,
}

/// The heights of the sampled points nearest to a place, in source units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    pub(super) lowest: f64,
    pub(super) middle: f64,
    pub(super) highest: f64,
    /// How far the farthest of them is, in units of height.
    pub(super) reach: f64,
}

/// A height, and what is around it.
pub(super) type Pair = (f64, Around);

impl Around {
    /// Returns how far a height lies above all of them (above 0) or below all of them (below 0).
    pub(super) fn beyond(&self, z: f64) -> f64 {
        (z - self.highest).max(0.0) + (z - self.lowest).min(0.0)
    }

    /// Returns the difference of the highest and the lowest.
    pub(super) fn relief(&self) -> f64 {
        self.highest - self.lowest
    }
}

impl<'a> SampledTerrain<'a> {
    pub(super) fn new(
        sample: &[(Site, i32)],
        metres: [f64; 2],
        lattice: &'a Lattice,
        within: Bounds<2>,
    ) -> SampledTerrain<'a> {
        let mut points = sample.to_vec();
        points.sort_unstable();
        SampledTerrain { lattice, metres, within, points }
    }

    /// Returns so many metres in the unit of heights.
    pub(super) fn in_height_unit(&self, metres: f64) -> f64 {
        metres / self.metres[1]
    }

    /// Returns the height of a vertex in source units.
    pub(super) fn height(&self, vertex: &Vertex) -> Option<f64> {
        Some(self.lattice.world(2, vertex.z?))
    }

    /// Returns a difference of heights in lattice steps.
    pub(super) fn steps(&self, difference: f64) -> i64 {
        (difference / to_float(self.lattice.step(2))).ceil() as i64
    }

    /// Tells whether the height of a vertex is 0 in its file: heights there may lie between two of the lattice.
    pub(super) fn is_zero(&self, vertex: &Vertex) -> bool {
        let [offset, step] = [self.lattice.offset[2], self.lattice.step(2)].map(to_float);
        vertex.z.is_some_and(|z| f64::from(z) == (-offset / step).round())
    }

    /// Returns a place as messages have it.
    pub(super) fn place_text(&self, [x, y]: Site) -> String {
        format!("({}, {})", self.lattice.world(0, x), self.lattice.world(1, y))
    }

    /// Returns the height of a vertex in the box of the points, and what is around it.
    pub(super) fn pair(&self, vertex: &Vertex) -> Option<Pair> {
        Some((self.height(vertex)?, self.around(vertex.place)?))
    }

    /// Returns the heights around a place; `None` outside of the box of the points, and if the sample has too few points.
    pub(super) fn around(&self, place: Site) -> Option<Around> {
        if self.nearest_in_box(place) != place {
            return None;
        }
        let nearest = self.nearest(place);
        let (farthest, _) = *nearest.get(NEIGHBOURS - 1)?;
        let mut heights: Vec<i32> = nearest.into_iter().map(|(_, z)| z).collect();
        heights.sort_unstable();
        let at = |index: usize| heights.get(index).map(|z| self.lattice.world(2, *z));
        let reach = self.length(farthest);
        Some(Around { lowest: at(0)?, middle: at(NEIGHBOURS / 2)?, highest: at(NEIGHBOURS - 1)?, reach })
    }

    /// Returns the heights around the place in the box of the points that is nearest to this one, and how far it is, in units of height.
    pub(super) fn beside(&self, place: Site) -> Option<(Around, f64)> {
        let nearest = self.nearest_in_box(place);
        let square = |axis: usize| i128::from(place[axis].abs_diff(nearest[axis])).pow(2);
        Some((self.around(nearest)?, self.length(square(0).saturating_add(square(1)))))
    }

    /// Returns the place in the box of the points that is nearest to this one.
    fn nearest_in_box(&self, place: Site) -> Site {
        // A box without points may be inside out.
        [0, 1].map(|axis| place[axis].min(self.within.max[axis]).max(self.within.min[axis]))
    }

    /// Returns a length in the plane in units of height, from its square in steps.
    fn length(&self, square: i128) -> f64 {
        let [metres, metres_z] = self.metres;
        (square as f64).sqrt() * to_float(self.lattice.resolution) * metres / metres_z
    }

    /// Returns the squares of the distances of the nearest points and their heights, the nearest first.
    fn nearest(&self, [x, y]: Site) -> Vec<(i128, i32)> {
        let square = |a: i32, b: i32| i128::from(a.abs_diff(b)).pow(2);
        let start = self.points.partition_point(|(place, _)| place[0] < x);
        let (left, right) = self.points.split_at(start);
        let mut found: Vec<(i128, i32)> = Vec::new();
        for side in [&mut left.iter().rev() as &mut dyn Iterator<Item = &(Site, i32)>, &mut right.iter()] {
            for (place, z) in side {
                let farthest = found.get(NEIGHBOURS - 1).map_or(i128::MAX, |(distance, _)| *distance);
                if square(place[0], x) > farthest {
                    break;
                }
                let candidate = (square(place[0], x).saturating_add(square(place[1], y)), *z);
                let at = found.partition_point(|known| *known <= candidate);
                if at < NEIGHBOURS {
                    found.insert(at, candidate);
                    found.truncate(NEIGHBOURS);
                }
            }
        }
        found
    }
}

/// Returns the middle height of lines and that of the points around, for messages.
pub(super) fn middles(pairs: &[Pair]) -> Option<[f64; 2]> {
    Some([
        rounded(median(pairs.iter().map(|(z, _)| *z))?),
        rounded(median(pairs.iter().map(|(_, around)| around.middle))?),
    ])
}

/// Returns the middle one of `values`; of two, the greater.
pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Rounds to hundredths: a sample tells no more.
pub(super) fn rounded(z: f64) -> f64 {
    (z * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use rust_decimal::Decimal;

    #[test]
    fn the_nearest_points_tell_the_height_of_a_place() {
        const WITHIN: Bounds<2> = Bounds { min: [0, i32::MIN], max: [i32::MAX; 2] };
        let step = Decimal::new(1, 2);
        let lattice = Lattice::new([Decimal::ZERO; 3], step, step).unwrap();
        let sample: Vec<(Site, i32)> =
            (0..50).flat_map(|x| (0..50).map(move |y| ([100 * x, 100 * y], 1000 * x))).collect();
        let terrain = SampledTerrain::new(&sample, [1.0; 2], &lattice, WITHIN);
        let around = terrain.around([2010, 2020]).unwrap();
        assert_eq!([around.lowest, around.middle, around.highest], [190.0, 200.0, 210.0]);
        assert!((1.0..2.0).contains(&around.reach), "{around:?}");
        assert_eq!([180.0, 195.0, 260.0].map(|z| around.beyond(z)), [-10.0, 0.0, 50.0]);
        assert_eq!(terrain.around([i32::MAX, i32::MIN]).unwrap().highest, 490.0);
        assert_eq!(terrain.around([-1, 0]), None);
        let (beside, outside) = terrain.beside([-300, 2020]).unwrap();
        assert_eq!((terrain.around([0, 2020]), outside), (Some(beside), 3.0));
        assert_eq!(SampledTerrain::new(&sample[..7], [1.0; 2], &lattice, WITHIN).around([0, 0]), None);
    }
}
