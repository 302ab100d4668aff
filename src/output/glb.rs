//! One tile as a binary glTF 2.0 file.

use bytemuck::{bytes_of, cast_slice};
use serde_json::{Value, json};

use super::Tile;
use super::frame::Frame;
use super::parts::{Part, split};
use crate::{Error, Result};

/// Says in every file who wrote it.
pub(super) const GENERATOR: &str = concat!("gdt-batch ", env!("CARGO_PKG_VERSION"));

pub(super) const MAGIC: u32 = u32::from_le_bytes(*b"glTF");
pub(super) const VERSION: u32 = 2;
pub(super) const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
pub(super) const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

// Names of the glTF specification for its numbers.
pub(super) const UNSIGNED_SHORT: u64 = 5123;
pub(super) const UNSIGNED_INT: u64 = 5125;
pub(super) const FLOAT: u64 = 5126;
const ARRAY_BUFFER: u64 = 34962;
const ELEMENT_ARRAY_BUFFER: u64 = 34963;

/// Linear colour of a terrain without vertex colours.
const PLAIN: [f64; 4] = [0.52, 0.5, 0.45, 1.0];

/// The bytes of the GLB file of `tile`, into `out`, which is cleared first and can be used again for the next tile.
/// The same tile gives the same bytes.
///
/// Fails where a triangle is too long to be exact in f32 ([`Frame::longest_triangle`]) or the file would pass 4 GiB.
pub fn encode_tile(frame: &Frame, tile: &Tile, out: &mut Vec<u8>) -> Result<()> {
    let parts = split(frame, tile)?;
    let document = Document::of(frame, &parts);
    out.clear();
    write_container(document.json(frame).to_string().into_bytes(), document.length, out)?;
    for part in &parts {
        write_part(frame, part, out);
    }
    Ok(())
}

/// Header, JSON chunk and the head of the binary chunk, whose `length` bytes are to follow.
pub(super) fn write_container(mut json: Vec<u8>, length: u64, out: &mut Vec<u8>) -> Result<()> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = if length == 0 { 0 } else { 8 + length };
    let total = 20 + json.len() as u64 + binary;
    let total = u32::try_from(total).map_err(|_| {
        Error::Config(format!(
            "a GLB file of {total} bytes would pass the limit of 4 GiB: set a smaller sites_per_tile"
        ))
    })?;
    out.reserve(total as usize);
    for word in [MAGIC, VERSION, total, json.len() as u32, JSON_CHUNK] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.extend_from_slice(&json);
    if length > 0 {
        out.extend_from_slice(&(length as u32).to_le_bytes());
        out.extend_from_slice(&BIN_CHUNK.to_le_bytes());
    }
    Ok(())
}

/// The arrays of the glTF document while it is put together.
#[derive(Default)]
struct Document {
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    colored: bool,
    /// Bytes of the binary chunk, a multiple of 4.
    length: u64,
}

impl Document {
    fn of(frame: &Frame, parts: &[Part]) -> Document {
        let mut document = Document::default();
        for part in parts {
            document.add_part(frame, part);
        }
        document
    }

    /// In the order in which [`write_part`] writes.
    fn add_part(&mut self, frame: &Frame, part: &Part) {
        let (tile, count) = (&*part.tile, part.tile.positions.len());
        let [low, high] = local_bounds(frame, part);
        let position =
            self.add(ARRAY_BUFFER, 12 * count, accessor(FLOAT, count, "VEC3", json!({"min": low, "max": high})));
        let mut attributes = json!({"POSITION": position});
        if tile.normals.is_some() {
            attributes["NORMAL"] = self.add(ARRAY_BUFFER, 12 * count, accessor(FLOAT, count, "VEC3", json!({}))).into();
        }
        if tile.colors.is_some() {
            let normalized = json!({"normalized": true});
            let color = accessor(UNSIGNED_SHORT, count, "VEC4", normalized);
            attributes["COLOR_0"] = self.add(ARRAY_BUFFER, 8 * count, color).into();
            self.colored = true;
        }
        let corners = 3 * tile.triangles.len();
        let (kind, size) = if has_short_indices(tile) { (UNSIGNED_SHORT, 2) } else { (UNSIGNED_INT, 4) };
        let indices = self.add(ELEMENT_ARRAY_BUFFER, size * corners, accessor(kind, corners, "SCALAR", json!({})));
        let primitive = json!({"attributes": attributes, "indices": indices, "material": 0});
        self.nodes.push(json!({"mesh": self.meshes.len(), "translation": frame.metres(part.origin)}));
        self.meshes.push(json!({"primitives": [primitive]}));
    }

    /// Appends an accessor with a view of its own of `length` bytes; its index.
    fn add(&mut self, target: u64, length: usize, mut accessor: Value) -> usize {
        accessor["bufferView"] = self.views.len().into();
        self.views.push(json!({"buffer": 0, "byteOffset": self.length, "byteLength": length, "target": target}));
        self.length += length.next_multiple_of(4) as u64;
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn json(&self, frame: &Frame) -> Value {
        let mut json = json!({
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"extras": frame.extras()}],
        });
        if !self.nodes.is_empty() {
            json["scenes"][0]["nodes"] = (0..self.nodes.len()).collect();
            json["nodes"] = self.nodes.clone().into();
            json["meshes"] = self.meshes.clone().into();
            json["materials"] = json!([material(self.colored)]);
            json["accessors"] = self.accessors.clone().into();
            json["bufferViews"] = self.views.clone().into();
            json["buffers"] = json!([{"byteLength": self.length}]);
        }
        json
    }
}

fn accessor(component: u64, count: usize, kind: &str, mut more: Value) -> Value {
    more["componentType"] = component.into();
    more["count"] = count.into();
    more["type"] = kind.into();
    more
}

/// Dull and seen from both sides; white under vertex colours, which it multiplies.
fn material(colored: bool) -> Value {
    let mut surface = json!({"metallicFactor": 0.0, "roughnessFactor": 1.0});
    if !colored {
        surface["baseColorFactor"] = json!(PLAIN);
    }
    json!({"name": "terrain", "doubleSided": true, "pbrMetallicRoughness": surface})
}

/// The least and greatest f32 coordinates of a part; the way from the lattice is monotonic, y turns round.
fn local_bounds(frame: &Frame, part: &Part) -> [[f32; 3]; 2] {
    let [low, high] = part.tile.bounds().unwrap_or_default();
    let (a, b) = (frame.local(low, part.origin), frame.local(high, part.origin));
    [[a[0], a[1], b[2]], [b[0], b[1], a[2]]]
}

/// Index 65535 would restart a primitive.
fn has_short_indices(tile: &Tile) -> bool {
    tile.positions.len() <= u16::MAX as usize
}

fn write_part(frame: &Frame, part: &Part, out: &mut Vec<u8>) {
    let tile = &*part.tile;
    write_all(&tile.positions, out, |&p| frame.local(p, part.origin));
    if let Some(normals) = &tile.normals {
        write_all(normals, out, |&[x, y, z]| [x, z, 0.0 - y]);
    }
    if let Some(colors) = &tile.colors {
        write_all(colors, out, |&[r, g, b]| [r, g, b, u16::MAX]);
    }
    if has_short_indices(tile) {
        write_all(&tile.triangles, out, |t| t.map(|v| v as u16));
        out.resize(out.len().next_multiple_of(4), 0);
    } else {
        out.extend_from_slice(cast_slice(&tile.triangles));
    }
}

fn write_all<T, B: bytemuck::Pod>(items: &[T], out: &mut Vec<u8>, to_bytes: impl Fn(&T) -> B) {
    for item in items {
        out.extend_from_slice(bytes_of(&to_bytes(item)));
    }
}
