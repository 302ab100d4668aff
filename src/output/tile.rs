//! The content of one tile, in lattice steps and source axes.

/// A piece of the terrain: vertices on the job's lattice and the triangles between them. Every vertex is the corner of
/// at least one triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tile {
    /// Lattice integers x, y, z of every vertex.
    pub positions: Vec<[i32; 3]>,
    /// Unit normals of the vertices (x east, y north, z up) in a space where all axes are in metres.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Linear red, green and blue of the vertices, 65535 for full intensity.
    pub colors: Option<Vec<[u16; 3]>>,
    /// Corners as indices of vertices, counterclockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
}

impl Tile {
    /// The least and greatest lattice integers of the vertices on every axis; `None` without vertices.
    pub fn bounds(&self) -> Option<[[i32; 3]; 2]> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold([first, first], |[low, high], p| {
            [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
        }))
    }
}
