//! Joins tiles that were read back from their files into one mesh on the lattice.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use crate::output::attributes::{AttributeChoice, PointAttributes};
use crate::output::frame::Frame;
use crate::output::gltf::read::{TileFile, TilePart};
use crate::output::lod::boundary::on_boundary;
use crate::output::lod::simplify::Terrain;
use crate::output::tile::Tile;

/// A vertex is at this scene position in metres, where the job's lattice has no point.
#[derive(Debug, thiserror::Error)]
#[error("the vertex at {0:?} is not on the job's lattice")]
pub struct VertexOffLattice([f64; 3]);

/// The number of the vertex at a site.
type VertexAt = HashMap<[i32; 2], u32, BuildHasherDefault<SiteHasher>>;

/// The mesh of several tiles. What vertices carry besides their positions stays with the tiles until it is asked for: coarser tiles
/// keep few of the vertices.
pub struct Joined {
    /// The lattice integers x, y, z of every vertex.
    positions: Vec<[i32; 3]>,
    /// The corners as indices of vertices, counterclockwise seen from above.
    triangles: Vec<[u32; 3]>,
    /// Whether a vertex is on the boundary of a mesh of the tiles. Only such vertices can be on the boundary of the whole.
    on_border: Vec<bool>,
    /// Which of the `parts` has a vertex, and its number there.
    origins: Vec<[u32; 2]>,
    /// The meshes of the tiles, without positions and triangles.
    parts: Vec<TilePart>,
}

/// Joins all of `files`, tiles of the job of `frame`, into one mesh. A vertex that several of them share becomes one vertex, with the
/// normal, the colour and the attributes of the first. Vertices are in the order of the files.
///
/// # Errors
/// [`VertexOffLattice`] if a vertex is not on the lattice.
pub fn join(frame: &Frame, files: Vec<TileFile>) -> Result<Joined, VertexOffLattice> {
    let mut parts: Vec<TilePart> = files.into_iter().flat_map(|file| file.parts).collect();
    let vertices = parts.iter().map(|part| part.positions.len()).sum();
    let mut joined = Joined {
        positions: Vec::with_capacity(vertices),
        triangles: Vec::with_capacity(parts.iter().map(|part| part.triangles.len()).sum()),
        on_border: Vec::with_capacity(vertices),
        origins: Vec::with_capacity(vertices),
        parts: Vec::new(),
    };
    let mut vertex_at = VertexAt::default();
    for (part, number) in parts.iter_mut().zip(0..) {
        let positions = std::mem::take(&mut part.positions);
        let points = frame.points(&positions, part.translation, part.scale).map_err(VertexOffLattice)?;
        drop(positions);
        let triangles = std::mem::take(&mut part.triangles);
        // Only vertices on a boundary can be in another part too.
        let on_border = on_boundary(points.len(), &triangles);
        let numbers = joined.append(number, &points, &on_border, &mut vertex_at);
        joined.triangles.extend(triangles.iter().map(|t| t.map(|v| numbers[v as usize])));
    }
    joined.parts = parts;
    Ok(joined)
}

impl Joined {
    /// Appends the vertices of part `part` at these lattice points, but for those that are there already. Returns the number of each.
    fn append(&mut self, part: u32, points: &[[i32; 3]], on_border: &[bool], vertex_at: &mut VertexAt) -> Vec<u32> {
        let mut numbers = Vec::with_capacity(points.len());
        // Nearly all vertices are new, and many follow each other without one that is not.
        let mut new_from = 0;
        for v in (0..points.len()).filter(|&v| on_border[v]) {
            let next = (self.positions.len() + v - new_from) as u32;
            let number = *vertex_at.entry([points[v][0], points[v][1]]).or_insert(next);
            if number != next {
                self.append_new(part, points, on_border, new_from..v, &mut numbers);
                numbers.push(number);
                new_from = v + 1;
            }
        }
        self.append_new(part, points, on_border, new_from..points.len(), &mut numbers);
        numbers
    }

    fn append_new(
        &mut self,
        part: u32,
        points: &[[i32; 3]],
        on_border: &[bool],
        vertices: Range<usize>,
        numbers: &mut Vec<u32>,
    ) {
        let next = self.positions.len();
        numbers.extend(next as u32..(next + vertices.len()) as u32);
        self.origins.extend((vertices.start as u32..vertices.end as u32).map(|v| [part, v]));
        self.positions.extend_from_slice(&points[vertices.clone()]);
        self.on_border.extend_from_slice(&on_border[vertices]);
    }

    /// Returns the whole mesh, to be simplified.
    pub fn terrain(&self) -> Terrain<'_> {
        Terrain { positions: &self.positions, triangles: &self.triangles, may_be_on_boundary: Some(&self.on_border) }
    }

    /// Returns the tile of these triangles between the vertices, each at its place in `positions`. It has normals if all tiles have them,
    /// and likewise colours and attributes.
    pub fn tile(&self, positions: &[[i32; 3]], triangles: Vec<[u32; 3]>) -> Tile {
        let (tile, vertices) = Tile::with_vertices(positions, triangles);
        let origins = || vertices.iter().map(|&v| self.origins[v as usize].map(|at| at as usize));
        let all_have = |has: fn(&TilePart) -> bool| self.parts.iter().all(has);
        let normal = |[part, v]: [usize; 2]| {
            let part = &self.parts[part];
            part.normals.as_ref().map(|normals| unscaled_normal(normals.get(v), part.scale))
        };
        let color = |[part, v]: [usize; 2]| {
            let [red, green, blue, _] = self.parts[part].colors.as_ref()?[v];
            Some([red, green, blue])
        };
        let mut attributes = PointAttributes::empty(AttributeChoice {
            classification: all_have(|part| part.attributes.classification.is_some()),
            intensity: all_have(|part| part.attributes.intensity.is_some()),
        });
        origins().for_each(|[part, v]| attributes.push_from(&self.parts[part].attributes, v));
        Tile {
            normals: all_have(|part| part.normals.is_some()).then(|| origins().filter_map(normal).collect()),
            colors: all_have(|part| part.colors.is_some()).then(|| origins().filter_map(color).collect()),
            attributes,
            ..tile
        }
    }

    /// Returns the whole mesh as a tile.
    pub fn into_tile(mut self) -> Tile {
        let triangles = std::mem::take(&mut self.triangles);
        self.tile(&self.positions, triangles)
    }
}

/// Returns the unit normal (x east, y north, z up) for the normal of a mesh that its node stretches by `scale`.
fn unscaled_normal(normal: [f32; 3], scale: [f64; 3]) -> [f32; 3] {
    let [x, up, z] = [0, 1, 2].map(|k| normal[k] as f64 / scale[k]);
    let length = (x * x + up * up + z * z).sqrt();
    if length > 0.0 { [x / length, -z / length, up / length].map(|v| v as f32) } else { [0.0, 0.0, 1.0] }
}

/// A multiplication: the sites of a mesh need to be spread, not protected.
#[derive(Default)]
struct SiteHasher(u64);

impl Hasher for SiteHasher {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(4) {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = (self.0.rotate_left(32) ^ u64::from(u32::from_le_bytes(word))).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }

    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }
}
