//! The area that a job kept points in, as its report says: the polygons of `[input] clip` on a lattice finer than that of points.
//!
//! A point lies in the area if it lies in a polygon, or on one of its edges: of the outline or of a hole. The job decides that with cells;
//! here horizontal bands list the edges, and the crate `robust` tells on which side of them a point lies.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use robust::{Coord, orient2d};

use delaunay::geometry::Site;
use lattice::Polygons;

/// The most bands.
const MOST_BANDS: i64 = 1 << 12;

/// Edges are listed about so often each, at most.
const LISTED_PER_EDGE: usize = 64;

/// An edge, and the number of its polygon.
#[derive(Clone, Copy, Debug)]
struct Edge {
    a: [i64; 2],
    b: [i64; 2],
    polygon: u32,
}

/// The area of a job.
pub(super) struct ClipArea {
    /// The number of parts in a lattice step. All coordinates here are in parts.
    parts: i64,
    least: i64,
    greatest: i64,
    /// The height of a band.
    height: i64,
    bands: Vec<Vec<Edge>>,
}

impl ClipArea {
    /// Returns the area of these polygons, whose coordinates are in units of 1 / `parts` lattice steps.
    pub(super) fn new(polygons: &Polygons, parts: i64) -> ClipArea {
        let mut edges = Vec::new();
        for (polygon, rings) in (0..).zip(polygons) {
            for ring in rings {
                let next = ring.iter().cycle().skip(1);
                edges.extend(ring.iter().zip(next).map(|(&a, &b)| Edge { a, b, polygon }));
            }
        }
        let least = edges.iter().map(|edge| edge.a[1]).min().unwrap_or(0);
        let greatest = edges.iter().map(|edge| edge.a[1]).max().unwrap_or(-1);
        let mut height = (greatest - least) / MOST_BANDS + 1;
        let band_range = |edge: &Edge, height: i64| -> RangeInclusive<i64> {
            let [low, high] = [edge.a[1].min(edge.b[1]), edge.a[1].max(edge.b[1])];
            (low - least) / height..=(high - least) / height
        };
        let listed = |height: i64| edges.iter().map(|edge| band_range(edge, height).count()).sum::<usize>();
        while height <= greatest - least && listed(height) > LISTED_PER_EDGE * edges.len() {
            height *= 2;
        }
        let mut bands = vec![Vec::new(); ((greatest - least).max(0) / height + 1) as usize];
        for edge in &edges {
            band_range(edge, height).for_each(|band| bands[band as usize].push(*edge));
        }
        ClipArea { parts, least, greatest, height, bands }
    }

    /// Tells whether a site lies in the area.
    pub(super) fn holds(&self, site: Site) -> bool {
        let [x, y] = site.map(|value| self.parts * i64::from(value));
        if y < self.least || y > self.greatest {
            return false;
        }
        let mut crossed: HashMap<u32, bool> = HashMap::new();
        for edge in &self.bands[((y - self.least) / self.height) as usize] {
            let [low, high] = if edge.a[1] <= edge.b[1] { [edge.a, edge.b] } else { [edge.b, edge.a] };
            if y < low[1] || y > high[1] {
                continue;
            }
            // Above 0 if the site lies to the left of the edge as it goes upwards.
            let turn = orient2d(coordinates(low), coordinates(high), coordinates([x, y]));
            let is_beside =
                |axis: usize, value: i64| value >= low[axis].min(high[axis]) && value <= low[axis].max(high[axis]);
            if turn == 0.0 && is_beside(0, x) {
                return true;
            }
            // A vertex belongs to the edge that goes up from it.
            if y < high[1] && turn > 0.0 {
                *crossed.entry(edge.polygon).or_default() ^= true;
            }
        }
        crossed.values().any(|is_inside| *is_inside)
    }
}

/// Vertices lie within 2^52 of zero, so they are exact as `f64`.
fn coordinates([x, y]: [i64; 2]) -> Coord<f64> {
    Coord { x: x as f64, y: y as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice::LatticeArea;

    /// Two ways that share no code agree, on vertices and edges too.
    #[test]
    fn the_area_is_that_of_the_job() {
        let square = |low: i64, high: i64| vec![[low, low], [high, low], [high, high], [low, high]];
        let diamond = vec![[50, -9], [109, 50], [50, 109], [-9, 50]];
        let tooth: Vec<[i64; 2]> = (0..40).map(|i| [i * 3, if i % 2 == 0 { 10 } else { 90 }]).collect();
        for polygons in [
            vec![vec![square(0, 100), square(30, 60)], vec![square(40, 50)]],
            vec![vec![diamond.clone(), square(20, 80)], vec![tooth]],
            vec![vec![diamond, square(0, 100)], vec![vec![[1 << 40, 3], [0, 7], [-(1 << 40), 5]]]],
            vec![vec![vec![[5, 5]]]],
            Vec::new(),
        ] {
            for parts in [1, 3] {
                let (area, of_job) = (ClipArea::new(&polygons, parts), LatticeArea::new(&polygons, parts));
                for y in -12..115 {
                    for x in -12..125 {
                        assert_eq!(
                            area.holds([x, y]),
                            of_job.holds([x, y]),
                            "{x}, {y} of {parts} parts in {polygons:?}"
                        );
                    }
                }
            }
        }
    }
}
