//! The outline of a terrain, and those of its vertices that are enough to see it from afar.

use crate::lod::terrain::{NearBoundary, Terrain};
use crate::lod::vertex_cells::plane;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;

/// The edges around a terrain.
pub(crate) struct Outline {
    /// The directed edges with the terrain on their left and nothing on their right.
    pub(crate) edges: Vec<[u32; 2]>,
    /// Tells whether a vertex is on one of them.
    pub(crate) on: Vec<bool>,
    /// The vertices along the edges, ring by ring. An edge leads from each to the next, and from the last to the first.
    pub(crate) rings: Vec<Vec<u32>>,
}

impl Outline {
    pub(crate) fn of(terrain: &Terrain) -> Outline {
        let sides_of = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let sides: Vec<[u32; 2]> = match terrain.may_be_on_boundary {
            Some(NearBoundary { vertices, triangles }) => {
                let sides = triangles.iter().flat_map(|&t| sides_of(&terrain.triangles[t as usize]));
                sides.filter(|side| side.iter().all(|&v| vertices[v as usize])).collect()
            }
            None => terrain.triangles.iter().flat_map(sides_of).collect(),
        };
        let mut known = sides.clone();
        known.sort_unstable();
        let edges: Vec<_> = sides.into_iter().filter(|&[a, b]| known.binary_search(&[b, a]).is_err()).collect();
        let mut on = vec![false; terrain.positions.len()];
        edges.as_flattened().iter().for_each(|&v| on[v as usize] = true);
        let rings = rings_of(&edges);
        Outline { edges, on, rings }
    }

    /// Marks some of the vertices on the outline of the terrain at `positions`: those between which lines of at most `reach` lattice steps
    /// leave nothing of their ring on the right, and those on the convex hull.
    pub(crate) fn rim(&self, positions: &[[i32; 3]], reach: f64) -> Vec<bool> {
        let mut rim = vec![false; positions.len()];
        let mut mark = |v: u32| rim[v as usize] = true;
        self.rings.iter().for_each(|ring| wrap(ring, positions, reach, &mut mark));
        hull(&self.edges, positions, mark);
        rim
    }
}

/// Returns the rings of directed edges, of which as many end at each vertex as begin there.
fn rings_of(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut sorted = edges.to_vec();
    sorted.sort_unstable();
    let mut is_used = vec![false; sorted.len()];
    let mut rings = Vec::new();
    for start in 0..sorted.len() {
        let (mut ring, mut at) = (Vec::new(), Some(start));
        while let Some(edge) = at.filter(|&edge| !is_used[edge]) {
            is_used[edge] = true;
            let [from, to] = sorted[edge];
            ring.push(from);
            let first = sorted.partition_point(|other| other[0] < to);
            let of_vertex = sorted[first..].iter().take_while(|other| other[0] == to).count();
            at = (first..first + of_vertex).find(|&next| !is_used[next]);
        }
        if !ring.is_empty() {
            rings.push(ring);
        }
    }
    rings
}

/// Wraps a line around a ring from its left, as around a gift (Jarvis 1973), but looks no further than `reach` at a time. Calls `mark` with
/// the vertices where the line bends.
fn wrap(ring: &[u32], positions: &[[i32; 3]], reach: f64, mut mark: impl FnMut(u32)) {
    let place = |v: u32| plane(positions[v as usize]);
    let Some(start) = (0..ring.len()).min_by_key(|&at| place(ring[at])) else { return };
    let vertex = |at: usize| ring[(start + at) % ring.len()];
    let mut at = 0;
    while at < ring.len() {
        mark(vertex(at));
        let from = place(vertex(at));
        let mut next = at + 1;
        for ahead in at + 2..=ring.len() {
            let to = place(vertex(ahead));
            let distance = square_of_distance(from, to);
            if distance > reach * reach {
                break;
            }
            let turn = orient2d(from, place(vertex(next)), to);
            if turn < 0 || turn == 0 && distance > square_of_distance(from, place(vertex(next))) {
                next = ahead;
            }
        }
        at = next;
    }
}

fn square_of_distance(a: Site, b: Site) -> f64 {
    (0..2).map(|axis| f64::from(b[axis]) - f64::from(a[axis])).map(|along| along * along).sum()
}

/// Calls `mark` with the vertices of `edges` at the corners of their convex hull (Andrew 1979).
fn hull(edges: &[[u32; 2]], positions: &[[i32; 3]], mut mark: impl FnMut(u32)) {
    let mut sorted: Vec<(Site, u32)> = edges.iter().map(|&[v, _]| (plane(positions[v as usize]), v)).collect();
    sorted.sort_unstable();
    sorted.dedup();
    let mut chain = |places: &mut dyn Iterator<Item = &(Site, u32)>| {
        let mut chain: Vec<(Site, u32)> = Vec::new();
        for &(place, v) in places {
            while let [.., a, b] = chain[..]
                && orient2d(a.0, b.0, place) <= 0
            {
                chain.pop();
            }
            chain.push((place, v));
        }
        chain.iter().for_each(|&(_, v)| mark(v));
    };
    chain(&mut sorted.iter());
    chain(&mut sorted.iter().rev());
}
