//! The simple way in: points, and the triangles between them.

use crate::error::{Error, Result};
use crate::geometry::{REACH, Site};
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::HalfEdgeIndex;
use crate::triangulation::canonical;

/// The Delaunay triangulation of points in the plane. Where more than three lie on one circle, the canonical one: it depends on the
/// coordinates alone, not on the order of the points.
#[derive(Clone, Debug)]
pub struct Delaunay {
    /// Its corners are positions in `first`.
    mesh: HalfEdgeMesh,
    /// For each site the first point that lies there.
    first: Vec<u32>,
    /// The corners of each triangle: numbers of points.
    triangles: Vec<[u32; 3]>,
    /// For each point the first that lies at the same place, most often itself.
    same: Vec<u32>,
}

impl Delaunay {
    /// Triangulates points with whole coordinates. Points that coincide become one vertex, that of the first.
    ///
    /// Works on the calling thread alone, in memory of about 500 bytes a point.
    ///
    /// # Errors
    /// [`Error::OutOfReach`] if a coordinate exceeds [`REACH`] or there are more than 4,294,967,295 / 6 points, [`Error::Stopped`].
    ///
    /// ```
    /// let square = delaunay::Delaunay::of_integers(&[[0, 0], [4, 0], [4, 4], [0, 4], [1, 2]])?;
    /// assert_eq!(square.triangles().len(), 4);
    /// assert_eq!(square.hull(), [0, 1, 2, 3]);
    /// # Ok::<(), delaunay::Error>(())
    /// ```
    pub fn of_integers(points: &[Site]) -> Result<Delaunay> {
        if u32::try_from(points.len()).is_err() {
            return Err(Error::OutOfReach);
        }
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        // Rows from the south: neighbours are close in memory, and the first of several points at a place comes first.
        order.sort_unstable_by_key(|&i| (points[i as usize][1], points[i as usize][0], i));
        let mut same: Vec<u32> = (0..points.len() as u32).collect();
        let mut first: Vec<u32> = Vec::with_capacity(points.len());
        for i in order {
            match first.last() {
                Some(&last) if points[last as usize] == points[i as usize] => same[i as usize] = last,
                _ => first.push(i),
            }
        }
        let sites: Vec<Site> = first.iter().map(|&i| points[i as usize]).collect();
        let mesh = canonical(&sites)?;
        let triangles = mesh.corners().iter().map(|corners| corners.map(|site| first[site as usize])).collect();
        Ok(Delaunay { mesh, first, triangles, same })
    }

    /// Triangulates points on a grid with steps of `resolution`, whose origin is the first point: each is moved to the nearest node. The
    /// triangulation is exact for the nodes.
    ///
    /// # Errors
    /// [`Error::Resolution`], [`Error::OffGrid`] for a point that is not finite or more than [`REACH`] steps from the first, and those of
    /// [`Delaunay::of_integers`].
    ///
    /// ```
    /// let metres = [[500_000.25, 4_100_000.5], [500_010.0, 4_100_000.0], [500_003.75, 4_100_009.0]];
    /// let terrain = delaunay::Delaunay::of_points(&metres, 0.001)?;
    /// assert_eq!(terrain.triangles(), [[0, 1, 2]]);
    /// # Ok::<(), delaunay::Error>(())
    /// ```
    pub fn of_points(points: &[[f64; 2]], resolution: f64) -> Result<Delaunay> {
        if !(resolution > 0.0 && resolution.is_finite()) {
            return Err(Error::Resolution);
        }
        let origin = points.first().copied().unwrap_or_default();
        let reach = f64::from(REACH);
        let node = |(point, place): (usize, &[f64; 2])| {
            let steps = [0, 1].map(|axis| ((place[axis] - origin[axis]) / resolution).round());
            let is_on_grid = steps.iter().all(|steps| steps.abs() <= reach);
            if is_on_grid { Ok(steps.map(|steps| steps as i32)) } else { Err(Error::OffGrid { point }) }
        };
        Delaunay::of_integers(&points.iter().enumerate().map(node).collect::<Result<Vec<Site>>>()?)
    }

    /// Returns the corners of each triangle, counterclockwise: numbers of points. There is none if all points lie on one line.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the triangles beside triangle number `triangle`: across the edge from its first corner to its second, from the second to the
    /// third, and from the third to the first; `None` where the edge is on the hull.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn neighbours(&self, triangle: usize) -> [Option<usize>; 3] {
        HalfEdgeIndex::of_triangle(triangle).map(|edge| {
            let twin = self.mesh.twin(edge);
            (twin != HalfEdgeIndex::HULL).then(|| twin.triangle())
        })
    }

    /// Returns the points on the convex hull, counterclockwise from the one with the least number, with those on its edges.
    pub fn hull(&self) -> Vec<u32> {
        let mut next = std::collections::HashMap::new();
        for edge in self.mesh.hull() {
            next.insert(self.mesh.origin(edge), self.mesh.destination(edge));
        }
        let point = |site: crate::mesh::index::SiteIndex| self.first[site.get()];
        let Some(start) = next.keys().copied().min_by_key(|&site| point(site)) else { return Vec::new() };
        let walk = std::iter::successors(Some(start), |site| next.get(site).copied().filter(|&site| site != start));
        walk.map(point).collect()
    }

    /// Returns the vertex at the place of point number `point`: the first point there.
    ///
    /// # Panics
    /// If there is no such point.
    pub fn vertex_of(&self, point: usize) -> u32 {
        self.same[point]
    }

    /// Returns the mesh as half-edges. Its corners are positions in [`Delaunay::vertices`].
    pub fn mesh(&self) -> &HalfEdgeMesh {
        &self.mesh
    }

    /// Returns the points that are vertices, in the order of the mesh.
    pub fn vertices(&self) -> &[u32] {
        &self.first
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn points_that_coincide_are_one_vertex() {
        let delaunay = Delaunay::of_integers(&[[9, 9], [0, 0], [9, 0], [9, 9], [0, 0]]).unwrap();
        assert_eq!([0, 1, 2, 3, 4].map(|point| delaunay.vertex_of(point)), [0, 1, 2, 0, 1]);
        assert_eq!((delaunay.triangles().len(), delaunay.hull()), (1, vec![0, 1, 2]));
    }

    #[test]
    fn what_is_no_number_is_named() {
        let off = |points: &[[f64; 2]], resolution| Delaunay::of_points(points, resolution).unwrap_err();
        assert_eq!(off(&[[0.0, 0.0], [f64::NAN, 0.0]], 1.0), Error::OffGrid { point: 1 });
        assert_eq!(off(&[[0.0, 0.0], [1.0, 1e9]], 1.0), Error::OffGrid { point: 1 });
        assert_eq!(off(&[[0.0, 0.0]], 0.0), Error::Resolution);
        assert_eq!(off(&[[0.0, 0.0]], f64::NAN), Error::Resolution);
        let far = Delaunay::of_integers(&[[0, 0], [1, 0], [0, REACH + 1]]);
        assert_eq!(far.unwrap_err(), Error::OutOfReach);
    }

    #[test]
    fn few_points_and_lines_have_no_triangle() {
        for points in [vec![], vec![[1, 1]], vec![[1, 1], [2, 2]], vec![[1, 1], [2, 2], [5, 5]]] {
            let delaunay = Delaunay::of_integers(&points).unwrap();
            assert!(delaunay.triangles().is_empty() && delaunay.hull().is_empty());
        }
    }

    proptest! {
        #[test]
        fn neighbours_share_an_edge_and_the_order_does_not_matter(
            points in prop::collection::vec([0i32..30, 0i32..30], 0..80),
            turn in 0usize..80,
        ) {
            let delaunay = Delaunay::of_integers(&points).unwrap();
            for (at, corners) in delaunay.triangles().iter().enumerate() {
                for (edge, neighbour) in delaunay.neighbours(at).into_iter().enumerate() {
                    let ends = [corners[edge], corners[(edge + 1) % 3]];
                    if let Some(neighbour) = neighbour {
                        prop_assert!(ends.iter().all(|end| delaunay.triangles()[neighbour].contains(end)));
                        prop_assert!(delaunay.neighbours(neighbour).contains(&Some(at)));
                    } else {
                        prop_assert!(ends.iter().all(|end| delaunay.hull().contains(end)));
                    }
                }
            }
            let places = |delaunay: &Delaunay, points: &[Site]| {
                let mut triangles: Vec<[Site; 3]> =
                    delaunay.triangles().iter().map(|t| t.map(|corner| points[corner as usize])).collect();
                triangles.iter_mut().for_each(|corners| corners.sort_unstable());
                triangles.sort_unstable();
                triangles
            };
            let mut turned = points.clone();
            turned.rotate_left(turn % points.len().max(1));
            turned.reverse();
            prop_assert_eq!(places(&delaunay, &points), places(&Delaunay::of_integers(&turned).unwrap(), &turned));
        }
    }
}
