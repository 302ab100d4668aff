//! Triangles between the edge of the terrain and the border of its tile.

use crate::groups::Groups;
use crate::mesh::Node;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

/// A vertex with its number.
struct Vertex {
    place: [u16; 2],
    number: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        let [x, y] = self.place.map(f64::from);
        Point2::new(x, y)
    }
}

/// Returns triangles beside the terrain. `inner` are the edges that they share with it, and `around` are the edges around all of the terrain in the
/// tile, with the terrain on their left.
pub(crate) fn fill(nodes: &[Node], inner: &[[u32; 2]], around: &[[u32; 2]]) -> Vec<[u32; 3]> {
    let corners = (0..).zip(nodes).filter(|(_, node)| node.corner().is_some()).map(|(v, _)| v);
    let vertices = corners.chain(inner.iter().flatten().copied());
    let mut faces = faces(nodes, vertices, inner.iter().copied());
    faces.retain(|face| !is_terrain(nodes, *face, around));
    faces
}

/// Returns triangles between all vertices on the border of a tile.
pub(crate) fn within_border(nodes: &[Node]) -> Vec<[u32; 3]> {
    faces(nodes, (0..).zip(nodes).filter(|(_, node)| node.is_on_border()).map(|(v, _)| v), [])
}

/// Returns triangles between all vertices of a tile that have as many as possible of the edges of `triangles`. Of two that cross, the shorter one
/// stays: edges of long slivers along the hull are straight in degrees, not on the ground, so they may cross ordinary triangles beside them.
pub(crate) fn planar(nodes: &[Node], triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let of_least = Groups::new(nodes.len(), edges.map(|[a, b]| (a.min(b), a.max(b))));
    drop(triangles);
    let edges = of_least.all().flat_map(|(v, others)| others.chunk_by(|a, b| a == b).map(move |same| [v, same[0]]));
    let mut edges: Vec<[u32; 2]> = edges.collect();
    drop(of_least);
    edges.sort_unstable_by_key(|&edge| (square_length(edge.map(|v| nodes[v as usize])), edge));
    faces(nodes, 0..nodes.len() as u32, edges)
}

/// Returns the square of the length of an edge in square steps.
fn square_length([from, to]: [Node; 2]) -> u64 {
    u64::from(from.u.abs_diff(to.u)).pow(2) + u64::from(from.v.abs_diff(to.v)).pow(2)
}

/// Returns the constrained Delaunay triangulation of some vertices. Where two of the edges cross, the first is one of it.
fn faces(
    nodes: &[Node],
    vertices: impl Iterator<Item = u32> + Clone,
    edges: impl IntoIterator<Item = [u32; 2]>,
) -> Vec<[u32; 3]> {
    let count = vertices.clone().count();
    let mut plane = ConstrainedDelaunayTriangulation::<Vertex>::with_capacity(count, 3 * count, 2 * count);
    let mut handles: Vec<Option<FixedVertexHandle>> = vec![None; nodes.len()];
    for v in vertices {
        let Node { u, v: north, .. } = nodes[v as usize];
        let handle = &mut handles[v as usize];
        if handle.is_none() {
            *handle = plane.insert(Vertex { place: [u, north], number: v }).ok();
        }
    }
    for edge in edges {
        if let [Some(from), Some(to)] = edge.map(|v| handles[v as usize])
            && plane.can_add_constraint(from, to)
        {
            plane.add_constraint(from, to);
        }
    }
    plane.inner_faces().map(|face| face.vertices().map(|vertex| vertex.data().number)).collect()
}

/// Tells whether the terrain lies in the middle of a triangle: whether the edges around it go around that.
fn is_terrain(nodes: &[Node], triangle: [u32; 3], around: &[[u32; 2]]) -> bool {
    let place = |v: u32| {
        let node = nodes[v as usize];
        [node.u, node.v].map(i64::from)
    };
    let corners = triangle.map(place);
    // Three times its middle is a whole number.
    let [x, y] = [0, 1].map(|axis: usize| corners.iter().map(|corner| corner[axis]).sum::<i64>());
    let mut turns = 0;
    for edge in around {
        let [from, to] = edge.map(|v| place(v).map(|along| 3 * along));
        let side = (to[0] - from[0]) * (y - from[1]) - (to[1] - from[1]) * (x - from[0]);
        turns += i32::from(from[1] <= y && y < to[1] && side > 0) - i32::from(to[1] <= y && y < from[1] && side < 0);
    }
    turns > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_edges_that_cross_the_shorter_one_stays() {
        let place = |(u, v): (u16, u16)| Node { u, v, h: 0 };
        // A sliver from end to end, and two triangles on both sides of a short edge across it.
        let nodes = [(0, 100), (1000, 100), (500, 90), (500, 110), (400, 102), (600, 101), (500, 120)].map(place);
        let triangles = vec![[0, 1, 6], [2, 3, 4], [3, 2, 5]];
        let planar = planar(&nodes, triangles);
        let has = |a: u32, b: u32| planar.iter().any(|triangle| triangle.contains(&a) && triangle.contains(&b));
        assert!(has(2, 3) && has(2, 4) && has(3, 5), "{planar:?}");
        assert!(!has(0, 1), "{planar:?}");
    }
}
