//! Tiles read back from their files become one mesh on the lattice again.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use crate::output::Tile;
use crate::output::frame::Frame;
use crate::output::gltf::read::{Part, TileFile};
use crate::output::lod::boundary::on_outline;

/// Number of the vertex at a site.
type VertexOf = HashMap<[i32; 2], u32, BuildHasherDefault<SiteHasher>>;

/// One mesh of all of `files`, tiles of the job of `frame`: a vertex that several of them share is one vertex, with the normal and
/// colour of the first. Vertices stand in the order of the files.
///
/// Fails with a sentence where a vertex is not on the lattice or some files have normals or colours and others do not.
pub fn join(frame: &Frame, files: &[TileFile]) -> Result<Tile, String> {
    let parts = || files.iter().flat_map(|file| &file.parts);
    let mut joined = Tile {
        normals: parts().all(|part| part.normals.is_some()).then(Vec::new),
        colors: parts().all(|part| part.colors.is_some()).then(Vec::new),
        ..Tile::default()
    };
    let mut vertex_of = VertexOf::default();
    for part in parts() {
        // Only what is on an outline can be in another part too.
        let shared = on_outline(part.positions.len(), &part.triangles);
        let numbers: Vec<u32> = (0..part.positions.len())
            .map(|v| number(frame, part, v, shared[v].then_some(&mut vertex_of), &mut joined))
            .collect::<Result<_, _>>()?;
        joined.triangles.extend(part.triangles.iter().map(|t| t.map(|v| numbers[v as usize])));
    }
    Ok(joined)
}

/// The number in `joined` of vertex `v` of `part`, which is appended if it is new: always, unless `shared` knows its site.
fn number(
    frame: &Frame,
    part: &Part,
    v: usize,
    shared: Option<&mut VertexOf>,
    joined: &mut Tile,
) -> Result<u32, String> {
    let world = part.world(v);
    let point = frame.integers(world).ok_or_else(|| format!("the vertex at {world:?} is not on the job's lattice"))?;
    let next = joined.positions.len() as u32;
    let number = shared.map_or(next, |vertex_of| *vertex_of.entry([point[0], point[1]]).or_insert(next));
    if number == next {
        joined.positions.push(point);
        if let (Some(normals), Some(theirs)) = (&mut joined.normals, &part.normals) {
            normals.push(normal(theirs[v], part.scale));
        }
        if let (Some(colors), Some(theirs)) = (&mut joined.colors, &part.colors) {
            let [red, green, blue, _] = theirs[v];
            colors.push([red, green, blue]);
        }
    }
    Ok(number)
}

/// The unit normal x east, y north, z up of one in a mesh that its node stretches by `scale`.
fn normal(theirs: [f32; 3], scale: [f64; 3]) -> [f32; 3] {
    let [x, up, z] = [0, 1, 2].map(|k| theirs[k] as f64 / scale[k]);
    let length = (x * x + up * up + z * z).sqrt();
    if length > 0.0 { [x / length, -z / length, up / length].map(|v| v as f32) } else { [0.0, 0.0, 1.0] }
}

/// Multiplies: the sites of a mesh need to be spread, not protected.
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
