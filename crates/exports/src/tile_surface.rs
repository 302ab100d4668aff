//! The mesh of one tile, ready to be numbered.

/// The mesh of a tile: every vertex once, in the order in which triangles use them, and all triangles counterclockwise.
#[derive(Debug, Default)]
pub struct TileSurface {
    pub(crate) vertices: Vec<[i32; 3]>,
    /// For each vertex, the index of its position among those that the surface was made of.
    pub(crate) origins: Vec<u32>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The directed edges of triangles that have no triangle of this tile on the other side.
    pub(crate) rim: Vec<[u32; 2]>,
}

const UNUSED: u32 = u32::MAX;

impl TileSurface {
    /// Returns the surface of these triangles, whose corners are indices of `positions`, in lattice steps. Equal positions become one vertex.
    pub fn new(positions: &[[i32; 3]], triangles: &[[u32; 3]]) -> TileSurface {
        let same = first_equal(positions);
        let mut own = vec![UNUSED; positions.len()];
        let mut surface = TileSurface::default();
        let TileSurface { vertices, origins, triangles: numbered, .. } = &mut surface;
        numbered.reserve_exact(triangles.len());
        for triangle in triangles {
            numbered.push(triangle.map(|corner| {
                let first = same[corner as usize] as usize;
                if own[first] == UNUSED {
                    own[first] = vertices.len() as u32;
                    vertices.push(positions[first]);
                    origins.push(first as u32);
                }
                own[first]
            }));
        }
        for triangle in numbered.iter_mut() {
            if twice_area(triangle.map(|corner| vertices[corner as usize])) < 0 {
                triangle.swap(1, 2);
            }
        }
        surface.rim = rim(vertices.len(), numbered);
        surface
    }
}

/// Returns for each position the index of the first one that is equal.
fn first_equal(positions: &[[i32; 3]]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|&index| (positions[index as usize], index));
    let mut first = vec![0; positions.len()];
    for equal in order.chunk_by(|a, b| positions[*a as usize] == positions[*b as usize]) {
        equal.iter().for_each(|&index| first[index as usize] = equal[0]);
    }
    first
}

/// Returns twice the area of a triangle in square steps, positive if it is counterclockwise. Lattice coordinates are within 2^29 of zero.
pub(crate) fn twice_area([a, b, c]: [[i32; 3]; 3]) -> i64 {
    let side = |to: [i32; 3], axis: usize| i64::from(to[axis]) - i64::from(a[axis]);
    side(b, 0) * side(c, 1) - side(b, 1) * side(c, 0)
}

/// Returns the directed edges of triangles without a triangle on the other side, in the order of the triangles.
fn rim(vertices: usize, triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = || triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    // The ends of the edges that leave each vertex, one vertex after the other.
    let mut starts = vec![0_u32; vertices + 1];
    edges().for_each(|[from, _]| starts[from as usize + 1] += 1);
    (0..vertices).for_each(|vertex| starts[vertex + 1] += starts[vertex]);
    let mut ends = vec![0_u32; triangles.len() * 3];
    let mut next = starts.clone();
    for [from, to] in edges() {
        ends[next[from as usize] as usize] = to;
        next[from as usize] += 1;
    }
    let leaving = |from: u32| &ends[starts[from as usize] as usize..starts[from as usize + 1] as usize];
    edges().filter(|[from, to]| !leaving(*to).contains(from)).collect()
}
