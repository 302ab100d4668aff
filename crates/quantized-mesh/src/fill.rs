//! Triangles between the outline of the terrain and the border of its tile.

use crate::mesh::Node;
use spade::handles::{DirectedEdgeHandle, FixedFaceHandle, FixedVertexHandle, InnerTag};
use spade::{CdtEdge, ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, HashSet};

/// A vertex with its number.
struct Vertex {
    place: Point2<f64>,
    number: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.place
    }
}

type Plane = ConstrainedDelaunayTriangulation<Vertex>;

/// Returns triangles beside the terrain, which lies on the left of the edges of its outline within the tile.
pub(crate) fn fill(nodes: &[Node], outline: &[[u32; 2]]) -> Vec<[u32; 3]> {
    let corners = (0..).zip(nodes).filter(|(_, node)| node.corner().is_some()).map(|(v, _)| v);
    let mut plane = Plane::new();
    let mut handles: BTreeMap<u32, FixedVertexHandle> = BTreeMap::new();
    for v in corners.chain(outline.iter().flatten().copied()) {
        let place = nodes[v as usize];
        let vertex = Vertex { place: Point2::new(f64::from(place.u), f64::from(place.v)), number: v };
        if !handles.contains_key(&v)
            && let Ok(handle) = plane.insert(vertex)
        {
            handles.insert(v, handle);
        }
    }
    for edge in outline {
        // Rounding may let two edges of an outline cross. One of them is no border then.
        if let [Some(&from), Some(&to)] = edge.map(|v| handles.get(&v))
            && plane.can_add_constraint(from, to)
        {
            plane.add_constraint(from, to);
        }
    }
    let ends = outline.iter().filter_map(|edge| Some([*handles.get(&edge[0])?, *handles.get(&edge[1])?]));
    let beside: Vec<FixedFaceHandle<InnerTag>> = ends.flat_map(|ends| faces_on_the_right(&plane, ends)).collect();
    reached(&plane, beside)
}

/// An edge of the plane.
type PlaneEdge<'a> = DirectedEdgeHandle<'a, Vertex, (), CdtEdge<()>, ()>;

/// Returns the faces on the right of the way from one vertex to another, along edges that no other vertex divides, or several do.
fn faces_on_the_right(plane: &Plane, [from, to]: [FixedVertexHandle; 2]) -> Vec<FixedFaceHandle<InnerTag>> {
    let goal = plane.vertex(to).position();
    let (mut at, mut faces) = (plane.vertex(from), Vec::new());
    while at.fix() != to {
        let start = at.position();
        let way = |edge: &PlaneEdge| {
            let end = edge.to().position();
            let ([dx, dy], [gx, gy]) = ([end.x - start.x, end.y - start.y], [goal.x - start.x, goal.y - start.y]);
            edge.is_constraint_edge() && dx * gy == dy * gx && dx * gx + dy * gy > 0.0
        };
        let Some(edge) = at.out_edges().find(way) else { break };
        faces.extend(edge.rev().face().as_inner().map(|face| face.fix()));
        at = edge.to();
    }
    faces
}

/// Returns the triangles of all faces that are reached from some without crossing an outline.
fn reached(plane: &Plane, mut open: Vec<FixedFaceHandle<InnerTag>>) -> Vec<[u32; 3]> {
    let mut seen: HashSet<FixedFaceHandle<InnerTag>> = open.iter().copied().collect();
    open = seen.iter().copied().collect();
    let mut triangles = Vec::new();
    while let Some(face) = open.pop() {
        let face = plane.face(face);
        triangles.push(face.vertices().map(|vertex| vertex.data().number));
        for edge in face.adjacent_edges() {
            let beside = edge.rev().face().as_inner().map(|face| face.fix());
            if let Some(beside) = beside.filter(|_| !edge.is_constraint_edge())
                && seen.insert(beside)
            {
                open.push(beside);
            }
        }
    }
    triangles
}
