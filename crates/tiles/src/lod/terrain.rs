//! What is simplified.

/// A terrain to be simplified: a part of a Delaunay triangulation.
pub struct Terrain<'a> {
    /// The lattice integers x, y, z of every vertex. Each is the corner of a triangle.
    pub positions: &'a [[i32; 3]],
    /// The triangles, counterclockwise seen from above. They cover their ground once.
    pub triangles: &'a [[u32; 3]],
    /// What may be on the boundary, if that is known.
    pub may_be_on_boundary: Option<NearBoundary<'a>>,
}

/// The surroundings of the boundary of a terrain.
#[derive(Clone, Copy)]
pub struct NearBoundary<'a> {
    /// Whether a vertex may be on the boundary.
    pub vertices: &'a [bool],
    /// The numbers of the triangles that have such a vertex.
    pub triangles: &'a [u32],
}
