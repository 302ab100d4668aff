//! Joins tiles that were read back from their files into one mesh on the lattice.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use crate::output::attributes::{AttributeChoice, PointAttributes};
use crate::output::frame::Frame;
use crate::output::gltf::read::{TileFile, TilePart};
use crate::output::lod::boundary::on_boundary;
use crate::output::tile::Tile;

/// A vertex is at this scene position in metres, where the job's lattice has no point.
#[derive(Debug, thiserror::Error)]
#[error("the vertex at {0:?} is not on the job's lattice")]
pub struct VertexOffLattice([f64; 3]);

/// The number of the vertex at a site.
type VertexAt = HashMap<[i32; 2], u32, BuildHasherDefault<SiteHasher>>;

/// Joins all of `files`, tiles of the job of `frame`, into one mesh. A vertex that several of them share becomes one vertex, with the
/// normal, the colour and the attributes of the first. Vertices are in the order of the files. The mesh has normals if all files have
/// them, and likewise colours and attributes.
///
/// # Errors
/// [`VertexOffLattice`] if a vertex is not on the lattice.
pub fn join(frame: &Frame, files: &[TileFile]) -> Result<Tile, VertexOffLattice> {
    let parts = || files.iter().flat_map(|file| &file.parts);
    let mut joined = Tile {
        normals: parts().all(|part| part.normals.is_some()).then(Vec::new),
        colors: parts().all(|part| part.colors.is_some()).then(Vec::new),
        attributes: PointAttributes::empty(AttributeChoice {
            classification: parts().all(|part| part.attributes.classification.is_some()),
            intensity: parts().all(|part| part.attributes.intensity.is_some()),
        }),
        ..Tile::default()
    };
    let mut vertex_at = VertexAt::default();
    for part in parts() {
        // Only vertices on a boundary can be in another part too.
        let shared = on_boundary(part.positions.len(), &part.triangles);
        let numbers: Vec<u32> = (0..part.positions.len())
            .map(|v| number(frame, part, v, shared[v].then_some(&mut vertex_at), &mut joined))
            .collect::<Result<_, _>>()?;
        joined.triangles.extend(part.triangles.iter().map(|t| t.map(|v| numbers[v as usize])));
    }
    Ok(joined)
}

/// Returns the number in `joined` of vertex `v` of `part`. The vertex is appended unless `shared` knows its site.
fn number(
    frame: &Frame,
    part: &TilePart,
    v: usize,
    shared: Option<&mut VertexAt>,
    joined: &mut Tile,
) -> Result<u32, VertexOffLattice> {
    let world = part.world(v);
    let point = frame.integers(world).ok_or(VertexOffLattice(world))?;
    let next = joined.positions.len() as u32;
    let number = shared.map_or(next, |vertex_at| *vertex_at.entry([point[0], point[1]]).or_insert(next));
    if number == next {
        joined.positions.push(point);
        if let (Some(normals), Some(theirs)) = (&mut joined.normals, &part.normals) {
            normals.push(unscaled_normal(theirs[v], part.scale));
        }
        if let (Some(colors), Some(theirs)) = (&mut joined.colors, &part.colors) {
            let [red, green, blue, _] = theirs[v];
            colors.push([red, green, blue]);
        }
        joined.attributes.push_from(&part.attributes, v);
    }
    Ok(number)
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
