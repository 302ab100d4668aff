//! The vertical distance between a simplified terrain and the one that it was made of: the greatest value over all of the ground, not
//! a sample.
//!
//! The simplified terrain has some vertices of the other, but their heights may differ. Both terrains are linear over every triangle.
//! So their difference is linear over every piece that the two sets of edges together cut the ground into, and it is greatest at a
//! corner of such a piece. A corner is a vertex of the fine mesh (the vertices of the
//! coarse mesh are among them), or a place where a fine and a coarse edge cross. `FineMesh` finds the crossings by walking along a
//! coarse edge through the fine mesh, and `VertexCells` finds the fine vertices in a coarse triangle. `HeightBounds` bounds the
//! error of a coarse triangle in advance, so that few triangles need this.

use crate::lod::filling::CoarseMesh;
use crate::lod::height_bounds::HeightBounds;
use crate::lod::vertex_cells::{VertexCells, plane};
use delaunay::geometry::predicates::orient2d;
use delaunay::mesh::adjacency::VertexAdjacency;

/// Steps of a walk along an edge, on average. A mesh that needs more has nothing but slivers, and gets a rougher bound.
const STEPS_PER_EDGE: u64 = 64;

/// Looking through this many triangles around a vertex counts as a step. Few vertices have as many, but the hub of a fan may have all.
const TRIANGLES_PER_STEP: u64 = 8;

/// The number of triangles that are measured first. On LiDAR hardly any of the others can have a greater error.
const MEASURED_FIRST: usize = 1024;

/// What rounding loses of the range of heights, and more.
const LOST: f64 = 1.0 / (1u64 << 48) as f64;

/// Returns the greatest vertical distances in steps of z between a terrain and two simplified ones: to `working`, and to the triangles of `shown` that
/// may be `changed` from those of `working`, or the former and what the others have `sunk`, if that is more. They are never too small. The
/// triangles `fine` are between `positions` (lattice x, y, z), counterclockwise, and cover their ground, which has this `outline`, once. Those of the
/// simplified ones are between some of these vertices, with other heights, and cover at least the same ground.
pub(crate) fn vertical_errors(
    positions: &[[i32; 3]],
    fine: &[[u32; 3]],
    outline: &[[u32; 2]],
    working: &CoarseMesh,
    (shown, changed, sunk): (&CoarseMesh, &[[u32; 3]], i32),
) -> [f64; 2] {
    let heights = HeightBounds::new(positions, fine);
    let range = heights.height_range();
    let fine = FineTerrain { heights: &heights, positions, triangles: fine, outline };
    let of_working = fine.error_of(working, &working.triangles, 0.0).unwrap_or(range);
    let of_others = of_working + f64::from(sunk.abs());
    let of_shown = fine.error_of(shown, changed, of_others).unwrap_or(range.max(of_others));
    // Rounding loses about 2^-50 of a height.
    let lost = 1e-9 + range * LOST;
    [of_working, of_shown].map(|greatest| if greatest > 0.0 { (greatest + lost).min(range.max(greatest)) } else { 0.0 })
}

/// The terrain before it was simplified.
struct FineTerrain<'a> {
    heights: &'a HeightBounds,
    positions: &'a [[i32; 3]],
    triangles: &'a [[u32; 3]],
    outline: &'a [[u32; 2]],
}

impl FineTerrain<'_> {
    /// Returns the greatest distance to these triangles of a simplified terrain, or `greatest` if that is more. `None` if that takes too long.
    fn error_of(&self, coarse: &CoarseMesh, all: &[[u32; 3]], mut greatest: f64) -> Option<f64> {
        let corners = |triangle: &[u32; 3]| triangle.map(|v| coarse.positions[v as usize]);
        let mut bounds: Vec<(u32, u32)> = all.iter().map(|t| self.heights.error_bound(&corners(t))).zip(0..).collect();
        // Triangles that may have the greatest error come first, so that most of the others can be skipped.
        let first = MEASURED_FIRST.min(bounds.len());
        if first < bounds.len() {
            bounds.select_nth_unstable_by(first, |a, b| b.cmp(a));
        }
        let mut steps = StepsLeft::new(all.len());
        let (first, others) = bounds.split_at(first);
        for bounds in [first, others] {
            let mut measured: Vec<_> = bounds.iter().filter(|(bound, _)| *bound as f64 > greatest).copied().collect();
            if measured.is_empty() {
                continue;
            }
            measured.sort_unstable_by(|a, b| b.cmp(a));
            let triangles = || measured.iter().map(|(_, triangle)| all[*triangle as usize]);
            let near = NearTerrain::new(self, triangles().map(|t| corners(&t)));
            for ((bound, _), triangle) in measured.iter().zip(triangles()) {
                if *bound as f64 > greatest {
                    let vertices = triangle.map(|v| coarse.vertices[v as usize]);
                    greatest = greatest.max(near.error_of(vertices, &corners(&triangle), &mut steps)?);
                }
            }
        }
        Some(greatest)
    }
}

/// How much work is left before a rougher bound must do.
struct StepsLeft {
    of_walks: u64,
    of_vertices: u64,
}

impl StepsLeft {
    /// Returns the steps for a terrain of so many simplified triangles.
    fn new(coarse: usize) -> StepsLeft {
        let of_walks = STEPS_PER_EDGE * (3 * coarse as u64 + 1000);
        StepsLeft { of_walks, of_vertices: VertexCells::steps_for(coarse) }
    }
}

/// What of the terrain is near the simplified triangles that are measured.
struct NearTerrain<'a> {
    mesh: FineMesh<'a>,
    vertices: VertexCells,
}

impl<'a> NearTerrain<'a> {
    fn new(fine: &FineTerrain<'a>, measured: impl Iterator<Item = [[i32; 3]; 3]>) -> NearTerrain<'a> {
        let (vertices, triangles) = fine.heights.near(fine.positions, fine.triangles, measured);
        NearTerrain {
            mesh: FineMesh::new(fine.positions, &triangles, fine.outline),
            vertices: VertexCells::new(fine.positions, &vertices),
        }
    }

    /// Returns the greatest distance between the terrain and a simplified triangle between these vertices, whose `corners` may have other
    /// heights. `None` if that takes more than `steps`.
    fn error_of(&self, vertices: [u32; 3], corners: &[[i32; 3]; 3], steps: &mut StepsLeft) -> Option<f64> {
        let at_crossings = self.mesh.error_at_crossings(vertices, corners, &mut steps.of_walks)?;
        let at_vertices = self.vertices.furthest_inside(corners, &mut steps.of_vertices)?;
        Some(at_crossings.max(at_vertices))
    }
}

/// The triangles of the terrain that are near those that are measured.
struct FineMesh<'a> {
    positions: &'a [[i32; 3]],
    adjacency: VertexAdjacency,
    outline: &'a [[u32; 2]],
}

/// The place that a walk has come to.
enum WalkPosition {
    /// A vertex.
    Vertex(u32),
    /// A point on the edge between these two vertices, the first to the right of the way.
    Edge(u32, u32),
}

impl<'a> FineMesh<'a> {
    fn new(positions: &'a [[i32; 3]], triangles: &[[u32; 3]], outline: &'a [[u32; 2]]) -> FineMesh<'a> {
        FineMesh { positions, adjacency: VertexAdjacency::new(positions.len(), triangles), outline }
    }

    /// Returns the third corner of the triangle with the directed edge ab.
    fn third(&self, a: u32, b: u32) -> Option<u32> {
        self.adjacency.around(a).iter().find(|edge| edge[0] == b).map(|edge| edge[1])
    }

    /// Returns the steps that it takes to look at all triangles around `v`.
    fn steps_around(&self, v: u32) -> u64 {
        1 + self.adjacency.around(v).len() as u64 / TRIANGLES_PER_STEP
    }

    /// Returns the greatest distance where an edge of a coarse triangle crosses an edge of this mesh. `None` if that takes more than
    /// `steps`.
    fn error_at_crossings(&self, vertices: [u32; 3], corners: &[[i32; 3]; 3], steps: &mut u64) -> Option<f64> {
        let mut greatest = 0.0f64;
        for [i, j] in [[0, 1], [1, 2], [2, 0]] {
            // The other triangle at an edge has it in the other direction. If there is none, no edge of this mesh crosses it.
            if vertices[i] < vertices[j] {
                let edge = CoarseEdge { from: corners[i], to: corners[j] };
                greatest = greatest.max(self.error_along(vertices[i], vertices[j], &edge, steps)?);
            }
        }
        Some(greatest)
    }

    /// Returns the greatest distance along one coarse edge, between its ends.
    fn error_along(&self, from: u32, to: u32, edge: &CoarseEdge, steps: &mut u64) -> Option<f64> {
        let mut greatest = 0.0f64;
        let mut at = WalkPosition::Vertex(from);
        loop {
            let (WalkPosition::Vertex(v) | WalkPosition::Edge(_, v)) = at;
            *steps = steps.checked_sub(self.steps_around(v))?;
            at = match at {
                WalkPosition::Vertex(v) if v == to => return Some(greatest),
                WalkPosition::Vertex(v) => match self.leave_vertex(v, to, edge) {
                    Some(next) => next,
                    None => self.enter(edge, edge.share_at_vertex(self.positions[v as usize]), steps)?,
                },
                WalkPosition::Edge(right, left) => {
                    let [r, l] = [right, left].map(|v| self.positions[v as usize]);
                    greatest = greatest.max(edge.distance_to_edge(r, l));
                    match self.third(left, right) {
                        Some(next) => self.leave_edge(right, left, next, edge),
                        None => self.enter(edge, edge.share_at_edge(r, l), steps)?,
                    }
                }
            };
            // The ends are among the vertices in the triangle.
            if let WalkPosition::Vertex(v) = at
                && v != to
            {
                greatest = greatest.max(edge.distance_to_vertex(self.positions[v as usize]));
            }
        }
    }

    /// Returns where the way next meets the outline, from outside, after this `share` of it. `None` if it does not, or if that takes more than
    /// `steps`.
    fn enter(&self, way: &CoarseEdge, share: f64, steps: &mut u64) -> Option<WalkPosition> {
        *steps = steps.checked_sub(self.outline.len() as u64 / TRIANGLES_PER_STEP)?;
        let meeting = |&[from, to]: &[u32; 2]| {
            let [left, right] = [from, to].map(|v| self.positions[v as usize]);
            match (way.side(left), way.side(right)) {
                (0, _) => Some((way.share_at_vertex(left), WalkPosition::Vertex(from))),
                (of_left, of_right) if of_left > 0 && of_right < 0 => {
                    Some((way.share_at_edge(right, left), WalkPosition::Edge(to, from)))
                }
                _ => None,
            }
        };
        let ahead = self.outline.iter().filter_map(meeting).filter(|(at, _)| *at > share && *at <= 1.0);
        ahead.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, position)| position)
    }

    /// Walks from vertex `v` towards vertex `to`.
    fn leave_vertex(&self, v: u32, to: u32, way: &CoarseEdge) -> Option<WalkPosition> {
        let here = self.positions[v as usize];
        for &[right, left] in self.adjacency.around(v) {
            if right == to || left == to {
                return Some(WalkPosition::Vertex(to));
            }
            let [r, l] = [right, left].map(|corner| self.positions[corner as usize]);
            let (of_right, of_left) = (way.side(r), way.side(l));
            if of_right < 0 && of_left > 0 {
                return Some(WalkPosition::Edge(right, left));
            }
            if let Some(corner) = [(right, r, of_right), (left, l, of_left)]
                .into_iter()
                .find_map(|(corner, p, side)| (side == 0 && way.leads(here, p)).then_some(corner))
            {
                return Some(WalkPosition::Vertex(corner));
            }
        }
        None
    }

    /// Walks from the edge between `right` and `left` into the triangle whose third corner is `next`.
    fn leave_edge(&self, right: u32, left: u32, next: u32, way: &CoarseEdge) -> WalkPosition {
        match way.side(self.positions[next as usize]) {
            0 => WalkPosition::Vertex(next),
            side if side > 0 => WalkPosition::Edge(right, next),
            _ => WalkPosition::Edge(next, left),
        }
    }
}

/// An edge of the simplified terrain.
struct CoarseEdge {
    from: [i32; 3],
    to: [i32; 3],
}

impl CoarseEdge {
    /// Returns a positive number if `point` is to the left of the edge, zero if it is on its line.
    fn side(&self, point: [i32; 3]) -> i64 {
        orient2d(plane(self.from), plane(self.to), plane(point))
    }

    /// Tells whether `point`, on the edge's line, lies ahead of `here`.
    fn leads(&self, here: [i32; 3], point: [i32; 3]) -> bool {
        (0..2).any(|k| {
            (self.to[k] as i64 - self.from[k] as i64).signum() * (point[k] as i64 - here[k] as i64).signum() > 0
        })
    }

    /// Returns the vertical distance to a vertex over or under the edge.
    fn distance_to_vertex(&self, point: [i32; 3]) -> f64 {
        (self.height(self.share_at_vertex(point)) - (point[2] as f64 - self.from[2] as f64)).abs()
    }

    /// Returns the vertical distance to a fine edge where the two cross.
    fn distance_to_edge(&self, right: [i32; 3], left: [i32; 3]) -> f64 {
        let (to_right, to_left) = (-self.side(right) as f64, self.side(left) as f64);
        let height = |p: [i32; 3]| p[2] as f64 - self.from[2] as f64;
        let of_fine = (height(right) * to_left + height(left) * to_right) / (to_left + to_right);
        (of_fine - self.height(self.share_at_edge(right, left))).abs()
    }

    /// Returns the part of the edge that is before a point on its line.
    fn share_at_vertex(&self, point: [i32; 3]) -> f64 {
        let difference = |k: usize, p: [i32; 3]| p[k] as f64 - self.from[k] as f64;
        let longer = if difference(0, self.to).abs() >= difference(1, self.to).abs() { 0 } else { 1 };
        difference(longer, point) / difference(longer, self.to)
    }

    /// Returns the part of the edge that is before a fine edge that crosses it.
    fn share_at_edge(&self, right: [i32; 3], left: [i32; 3]) -> f64 {
        let start = orient2d(plane(right), plane(left), plane(self.from)) as f64;
        let end = -orient2d(plane(right), plane(left), plane(self.to)) as f64;
        start / (start + end)
    }

    /// Returns the height above the start after this share of the edge.
    fn height(&self, share: f64) -> f64 {
        (self.to[2] as f64 - self.from[2] as f64) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::geometry::Site;
    use delaunay::mesh::half_edge::HalfEdgeMesh;
    use delaunay::triangulation::canonical;
    use proptest::prelude::*;

    fn triangulation(positions: &[[i32; 3]], kept: &[u32]) -> HalfEdgeMesh {
        let sites: Vec<Site> = kept.iter().map(|&v| plane(positions[v as usize])).collect();
        canonical(&sites).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Mostly flat with a few peaks, so that most triangles are skipped.
        #[test]
        fn skipped_triangles_are_no_further_off(
            mut positions in prop::collection::vec((0..3_000, 0..3_000, 0..20i32), 400..3_000),
            peaks in prop::collection::vec((0..400usize, 20..5_000), 0..6),
            every in 3..9usize,
            lifts in prop::collection::vec(-30..30i32, 0..40),
        ) {
            peaks.iter().for_each(|&(at, height)| positions[at].2 = height);
            let mut positions: Vec<[i32; 3]> = positions.into_iter().map(|(x, y, z)| [x, y, z]).collect();
            positions.sort_unstable();
            positions.dedup_by_key(|p| plane(*p));
            let all: Vec<u32> = (0..positions.len() as u32).collect();
            let fine = triangulation(&positions, &all);
            let mut kept = vec![false; positions.len()];
            kept.iter_mut().step_by(every).for_each(|kept| *kept = true);
            fine.hull().for_each(|h| kept[fine.origin(h).get()] = true);
            let kept: Vec<u32> = all.into_iter().filter(|&v| kept[v as usize]).collect();
            let triangles = triangulation(&positions, &kept).corners().to_vec();

            let (low, high) = positions.iter().fold((i32::MAX, i32::MIN), |(l, h), p| (l.min(p[2]), h.max(p[2])));
            let mut moved = positions.clone();
            for (p, lift) in moved.iter_mut().step_by(7).zip(&lifts) {
                p[2] = (p[2] + lift).clamp(low, high);
            }
            let coarse = CoarseMesh { positions: kept.iter().map(|&v| moved[v as usize]).collect(), vertices: kept, triangles };

            let every_vertex: Vec<u32> = (0..positions.len() as u32).collect();
            let hull: Vec<[u32; 2]> = fine.hull().map(|h| [fine.origin(h).0, fine.destination(h).0]).collect();
            let mesh = FineMesh::new(&positions, fine.corners(), &hull);
            let vertices = VertexCells::new(&positions, &every_vertex);
            let whole = NearTerrain { mesh, vertices };
            let mut steps = StepsLeft { of_walks: u64::MAX, of_vertices: u64::MAX };
            let furthest = coarse.triangles.iter().map(|t| {
                let corners = t.map(|v| coarse.positions[v as usize]);
                whole.error_of(t.map(|v| coarse.vertices[v as usize]), &corners, &mut steps).unwrap()
            });
            let furthest = furthest.fold(0.0, f64::max);
            let [found, of_none] = vertical_errors(&positions, fine.corners(), &hull, &coarse, (&coarse, &[], 0));
            prop_assert_eq!(found, of_none);
            let most = furthest + 2e-9;
            prop_assert!(found == 0.0 && furthest == 0.0 || (furthest..most).contains(&found), "{} and {}", found, furthest);
        }
    }
}
