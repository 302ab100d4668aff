//! Selecting the vertices of a coarser tile: greedy insertion (Garland and Heckbert 1995, "Fast Polygonal Approximation of Terrains and Height
//! Fields") in rounds.
//!
//! A round inserts the worst point of each triangle where it exceeds the bound, and then looks for the triangles of the points that lay in those that
//! have changed. It begins with some of the points everywhere, so that no point is looked for often. All is done in one order, so that the result
//! depends on the points alone. Distances are computed with doubles, whose error is far less than a step.

use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::{HalfEdgeIndex, SiteIndex};
use delaunay::mesh::insert::{insert, locate};
use delaunay::triangulation::canonical;

/// Stands for no point.
const NONE: u32 = u32::MAX;

/// Of so many points one is selected in any case.
const POINTS_PER_SEED: usize = 32;

/// A mesh of selected points.
pub(crate) struct Refined {
    /// Those that were selected first, then others.
    pub(crate) points: Vec<[i32; 3]>,
    /// Its triangles.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// How far points are from it, at most, if that is more than the bound.
    pub(crate) excess: Option<f64>,
}

/// Selects from `points`, in which neighbours in the plane follow one another, so that all are within `bound` of the triangulation of `first` and
/// the selected ones, along the vertical. If this takes more than `most` points, some of the worst of them are left out. All lie in the hull of `first`.
///
/// # Errors
/// [`delaunay::Error::Stopped`].
pub(crate) fn refined(
    first: &[[i32; 3]],
    points: &[[i32; 3]],
    bound: f64,
    most: usize,
) -> Result<Refined, delaunay::Error> {
    let mut refinement = Refinement::new(first, points)?;
    let mut left = most;
    while left > 0 {
        let mut worst = refinement.exceeding(bound);
        if worst.is_empty() {
            break;
        }
        if worst.len() > left {
            worst.sort_unstable_by(|a, b| b.distance.total_cmp(&a.distance).then(a.point.cmp(&b.point)));
            worst.truncate(left);
        }
        left -= worst.len();
        refinement.insert_all(&worst);
    }
    let greatest = refinement.held.iter().map(|held| held.distance).fold(0.0, f64::max);
    let excess = (greatest > bound).then_some(greatest);
    let Refinement { sites, heights, mesh, .. } = refinement;
    let points = sites.iter().zip(heights).map(|([x, y], h)| [*x, *y, h]).collect();
    Ok(Refined { points, triangles: mesh.corners().to_vec(), excess })
}

/// The points in a triangle.
#[derive(Clone, Copy, Debug)]
struct Held {
    /// The first of them.
    first: u32,
    /// The worst of them, and its distance.
    worst: u32,
    distance: f64,
}

impl Held {
    const NOTHING: Held = Held { first: NONE, worst: NONE, distance: 0.0 };
}

/// The worst point of a triangle.
#[derive(Clone, Copy, Debug)]
struct Proposed {
    point: u32,
    triangle: u32,
    distance: f64,
}

struct Refinement<'a> {
    points: &'a [[i32; 3]],
    /// For each point the next that lies in the same triangle.
    next: Vec<u32>,
    sites: Vec<Site>,
    heights: Vec<i32>,
    mesh: HalfEdgeMesh,
    /// By triangle.
    held: Vec<Held>,
    /// Triangles whose worst point was put there since the last round, some of them several times.
    changed: Vec<u32>,
    /// Points whose triangles have changed, each with a triangle near it.
    displaced: Vec<(u32, u32)>,
}

impl<'a> Refinement<'a> {
    fn new(first: &[[i32; 3]], points: &'a [[i32; 3]]) -> Result<Refinement<'a>, delaunay::Error> {
        let mut selected: Vec<[i32; 3]> = first.to_vec();
        selected.extend(points.iter().skip(POINTS_PER_SEED / 2).step_by(POINTS_PER_SEED));
        let sites: Vec<Site> = selected.iter().map(|[x, y, _]| [*x, *y]).collect();
        let mesh = canonical(&sites)?;
        let held = vec![Held::NOTHING; mesh.triangles.len()];
        let heights = selected.iter().map(|[_, _, h]| *h).collect();
        let (next, changed) = (vec![NONE; points.len()], Vec::new());
        let mut refinement = Refinement { points, next, sites, heights, mesh, held, changed, displaced: Vec::new() };
        let mut last = 0;
        for point in 0..points.len() as u32 {
            last = refinement.place(point, last);
        }
        Ok(refinement)
    }

    /// Returns the worst points of triangles that have changed where they exceed the bound.
    fn exceeding(&mut self, bound: f64) -> Vec<Proposed> {
        let mut changed = std::mem::take(&mut self.changed);
        changed.sort_unstable();
        changed.dedup();
        let proposed = changed.iter().filter_map(|&triangle| {
            let Held { worst, distance, .. } = self.held[triangle as usize];
            (distance > bound).then_some(Proposed { point: worst, triangle, distance })
        });
        proposed.collect()
    }

    fn insert_all(&mut self, proposed: &[Proposed]) {
        for Proposed { point, triangle, .. } in proposed {
            self.insert(*point, *triangle as usize);
        }
        let mut displaced = std::mem::take(&mut self.displaced);
        for (point, start) in displaced.drain(..) {
            self.place(point, start);
        }
        self.displaced = displaced;
    }

    /// Inserts a point, looking for its place from a triangle on, and notes which points that displaces.
    fn insert(&mut self, point: u32, start: usize) {
        let [x, y, h] = self.points[point as usize];
        let Refinement { next, sites, heights, mesh, held, displaced, .. } = self;
        let Some(triangle) = locate(mesh, sites, start, [x, y], &mut u64::MAX.clone()) else { return };
        if mesh.triangles[triangle].iter().any(|v| sites[v.get()] == [x, y]) {
            return;
        }
        let v = SiteIndex::new(sites.len());
        sites.push([x, y]);
        heights.push(h);
        insert(mesh, sites, v, triangle, |t| {
            if t >= held.len() {
                held.push(Held::NOTHING);
            }
            let mut point = std::mem::replace(&mut held[t], Held::NOTHING).first;
            while point != NONE {
                displaced.push((point, t as u32));
                point = next[point as usize];
            }
        });
    }

    /// Puts a point into its triangle, looking from a triangle on, and returns that. A selected point is in none.
    fn place(&mut self, point: u32, start: u32) -> u32 {
        let [x, y, h] = self.points[point as usize];
        let (mut triangle, mut entry) = (start as usize, 3);
        let (corners, parts) = loop {
            let corners = self.mesh.triangles[triangle];
            let sites = corners.map(|v| self.sites[v.get()]);
            let (mut parts, mut exit) = ([0; 3], None);
            for k in 0..3 {
                let part = orient2d(sites[k], sites[(k + 1) % 3], [x, y]);
                // Opposite the third corner.
                parts[(k + 2) % 3] = part;
                if part < 0 && k != entry {
                    exit = Some(self.mesh.twins[3 * triangle + k]);
                    break;
                }
            }
            match exit {
                Some(twin) if twin != HalfEdgeIndex::HULL => (triangle, entry) = (twin.triangle(), twin.corner()),
                _ => break (corners, parts),
            }
        };
        // Two parts without area: it is a corner.
        if parts.iter().filter(|part| **part == 0).count() == 2 {
            return triangle as u32;
        }
        let [a, b, c] = corners.map(|v| self.heights[v.get()]);
        let [of_a, of_b, of_c] = parts.map(|part| part as f64);
        let over_a = |height: i32| f64::from(height) - f64::from(a);
        let distance = ((over_a(b) * of_b + over_a(c) * of_c) / (of_a + of_b + of_c) - over_a(h)).abs();
        let held = &mut self.held[triangle];
        self.next[point as usize] = std::mem::replace(&mut held.first, point);
        if held.worst == NONE || distance > held.distance || distance == held.distance && point < held.worst {
            (held.worst, held.distance) = (point, distance);
            self.changed.push(triangle as u32);
        }
        triangle as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    const SIDE: i32 = 4_000;

    /// Returns how far a point is from a mesh along the vertical.
    fn distance(mesh: &Refined, [x, y, h]: [i32; 3]) -> f64 {
        let over = |corners: &[u32; 3]| {
            let corners = corners.map(|v| mesh.points[v as usize]);
            let [a, b, c] = corners.map(|[x, y, _]| [x, y]);
            let parts = [orient2d(b, c, [x, y]), orient2d(c, a, [x, y]), orient2d(a, b, [x, y])];
            let whole: i64 = parts.iter().sum();
            let height = (0..3).map(|k| parts[k] as f64 * f64::from(corners[k][2])).sum::<f64>() / whole as f64;
            parts.iter().all(|part| *part >= 0).then_some((height - f64::from(h)).abs())
        };
        mesh.triangles.iter().find_map(over).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 80, ..ProptestConfig::default() })]

        #[test]
        fn all_points_are_within_the_bound_that_is_told(
            places in prop::collection::btree_map((1..SIDE, 1..SIDE), -500..500i32, 0..400),
            grid in prop::sample::select(vec![1, 50, 800]),
            bound in prop::sample::select(vec![1.0, 100.0, 1000.0]),
            most in prop::sample::select(vec![0usize, 7, 1000]),
        ) {
            let first = [[0, 0, 3], [SIDE, 0, -70], [0, SIDE, 20], [SIDE, SIDE, 400]];
            let on_grid = |along: i32| (along / grid * grid).clamp(1, SIDE - 1);
            let places: std::collections::BTreeMap<[i32; 2], i32> =
                places.into_iter().map(|((x, y), h)| ([on_grid(x), on_grid(y)], h)).collect();
            let points: Vec<[i32; 3]> = places.iter().map(|([x, y], h)| [*x, *y, *h]).collect();
            let mesh = refined(&first, &points, bound, most).unwrap();
            let farthest = points.iter().map(|point| distance(&mesh, *point)).fold(0.0, f64::max);
            match mesh.excess {
                None => prop_assert!(farthest <= bound + 1e-6),
                Some(excess) => {
                    prop_assert!(excess > bound && (farthest - excess).abs() < 1e-6);
                    prop_assert!(mesh.points.len() >= 4 + most);
                }
            }
            prop_assert!(mesh.points.len() <= 4 + most + points.len().div_ceil(POINTS_PER_SEED));
            let known: BTreeSet<[i32; 3]> = first.into_iter().chain(points).collect();
            prop_assert!(mesh.points.iter().all(|point| known.contains(point)));
            let distinct: BTreeSet<&[i32; 3]> = mesh.points.iter().collect();
            prop_assert_eq!(distinct.len(), mesh.points.len());
            let sites: Vec<Site> = mesh.points.iter().map(|[x, y, _]| [*x, *y]).collect();
            let sorted = |triangles: &[[u32; 3]]| -> BTreeSet<[u32; 3]> {
                triangles.iter().map(|&triangle| crate::mesh::least_first(triangle)).collect()
            };
            prop_assert_eq!(sorted(canonical(&sites).unwrap().corners()), sorted(&mesh.triangles));
        }
    }

    /// A plane needs no points but those that are selected in any case.
    #[test]
    fn a_plane_has_few_vertices() {
        let plane = |x: i32, y: i32| [x, y, x + 2 * y];
        let first = [plane(0, 0), plane(SIDE, 0), plane(0, SIDE), plane(SIDE, SIDE)];
        let points: Vec<[i32; 3]> = (0..900).map(|i| plane(i % 30 * 100 + 1, i / 30 * 100 + 1)).collect();
        let mesh = refined(&first, &points, 0.5, 1000).unwrap();
        assert!(mesh.points.len() <= 4 + 900_usize.div_ceil(POINTS_PER_SEED) && mesh.excess.is_none());
    }
}
