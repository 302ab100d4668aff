//! The glTF document of a tile, and the bytes it describes.

use std::borrow::Cow;

use bytemuck::{Pod, cast_slice};
use multiversion::multiversion;
use serde_json::{Value, json};

use crate::output::color::Linear;
use crate::output::frame::Frame;
use crate::output::gltf::encoding::{
    Compression, EXPONENTIAL_REACH, color_bytes, exponential, needs_long_normals, normal_bytes, normal_octahedral,
    normal_shorts,
};
use crate::output::gltf::parts::Part;
use crate::output::gltf::vertex_order::rings;
use crate::{Error, Result};

/// Says in every file who wrote it.
pub(crate) const GENERATOR: &str = concat!("gdt-batch ", env!("CARGO_PKG_VERSION"));

// Names of the glTF specification and its extensions.
pub(crate) const SIGNED_BYTE: u64 = 5120;
pub(crate) const SIGNED_SHORT: u64 = 5122;
pub(crate) const UNSIGNED_BYTE: u64 = 5121;
pub(crate) const UNSIGNED_SHORT: u64 = 5123;
pub(crate) const UNSIGNED_INT: u64 = 5125;
pub(crate) const FLOAT: u64 = 5126;
const ARRAY_BUFFER: u64 = 34962;
const ELEMENT_ARRAY_BUFFER: u64 = 34963;
pub(crate) const MESHOPT: &str = "EXT_meshopt_compression";
pub(crate) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Linear colour of a terrain without vertex colours.
const PLAIN: [f64; 4] = [0.52, 0.5, 0.45, 1.0];

/// The arrays of the glTF document and the binary chunk while they are put together.
pub(crate) struct Document<'a> {
    frame: &'a Frame,
    compression: Compression,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    colored: bool,
    /// The binary chunk; its length is a multiple of 4.
    pub(crate) binary: Vec<u8>,
    /// Bytes of the buffer that stands for what readers unpack; a multiple of 4.
    unpacked: u64,
}

impl<'a> Document<'a> {
    /// An empty document; what `binary` holds is forgotten, and its memory used.
    pub(crate) fn new(frame: &'a Frame, compression: Compression, mut binary: Vec<u8>) -> Document<'a> {
        binary.clear();
        Document {
            frame,
            compression,
            views: Vec::new(),
            accessors: Vec::new(),
            meshes: Vec::new(),
            nodes: Vec::new(),
            colored: false,
            binary,
            unpacked: 0,
        }
    }

    /// Appends a node, its mesh and their data.
    pub(crate) fn add_part(&mut self, part: &Part) -> Result<()> {
        let tile = &*part.tile;
        let (triangles, order) = match self.compression {
            Compression::None => (Cow::Borrowed(&tile.triangles), None),
            _ => {
                let (triangles, order) = rings(tile.positions.len(), &tile.triangles);
                (Cow::Owned(triangles), Some(order))
            }
        };
        let order = order.as_deref();
        let mut attributes = json!({"POSITION": self.add_positions(part, order)?});
        if let Some(normals) = &tile.normals {
            attributes["NORMAL"] = self.add_normals(normals, order)?.into();
        }
        if let Some(colors) = &tile.colors {
            attributes["COLOR_0"] = self.add_colors(colors, order)?.into();
            self.colored = true;
        }
        let indices = self.add_triangles(&triangles, tile.positions.len())?;
        let primitive = json!({"attributes": attributes, "indices": indices, "material": 0});
        let mut node = json!({"mesh": self.meshes.len(), "translation": self.frame.metres(part.origin)});
        if self.compression != Compression::None {
            node["scale"] = json!(self.frame.step());
        }
        self.nodes.push(node);
        self.meshes.push(json!({"primitives": [primitive]}));
        Ok(())
    }

    fn add_positions(&mut self, part: &Part, order: Option<&[u32]>) -> Result<usize> {
        let positions = &part.tile.positions;
        // The way from the lattice is monotonic, and y turns round.
        let [low, high] = part.tile.bounds().unwrap_or_default();
        let [low, high] = [[low[0], high[1], low[2]], [high[0], low[1], high[2]]];
        let (frame, origin) = (self.frame, part.origin);
        if self.compression == Compression::None {
            let local = |p| frame.local(p, origin);
            let bounds = json!({"min": local(low), "max": local(high)});
            return self.add_attribute(positions, order, local, Kind::new(FLOAT, "VEC3", bounds));
        }
        let steps = |p| frame.local_steps(p, origin);
        let bounds = json!({"min": steps(low).map(|v| v as f32), "max": steps(high).map(|v| v as f32)});
        if !part.short {
            let is_near = [low, high].map(steps).as_flattened().iter().all(|v| v.abs() < EXPONENTIAL_REACH);
            if self.compression == Compression::Meshopt && is_near {
                let convert = |p| steps(p).map(exponential);
                let accessor = self.add_attribute(positions, order, convert, Kind::new(FLOAT, "VEC3", bounds))?;
                self.set_filter("EXPONENTIAL");
                return Ok(accessor);
            }
            let convert = |p| steps(p).map(|v| v as f32);
            return self.add_attribute(positions, order, convert, Kind::new(FLOAT, "VEC3", bounds));
        }
        let convert = |p| {
            let [x, y, z] = steps(p).map(|v| v as u16);
            [x, y, z, 0]
        };
        self.add_attribute(positions, order, convert, Kind::new(UNSIGNED_SHORT, "VEC3", bounds))
    }

    fn add_normals(&mut self, normals: &[[f32; 3]], order: Option<&[u32]>) -> Result<usize> {
        let up = |[x, y, z]: [f32; 3]| [x, z, 0.0 - y];
        if self.compression == Compression::None {
            return self.add_attribute(normals, order, up, Kind::new(FLOAT, "VEC3", json!({})));
        }
        let anisotropy = self.frame.anisotropy();
        if needs_long_normals(anisotropy) {
            let convert = |normal| normal_shorts(up(normal), anisotropy);
            return self.add_attribute(normals, order, convert, Kind::normalized(SIGNED_SHORT, "VEC3"));
        }
        if self.compression == Compression::Quantized {
            let convert = |normal| normal_bytes(up(normal), anisotropy);
            return self.add_attribute(normals, order, convert, Kind::normalized(SIGNED_BYTE, "VEC3"));
        }
        let convert = |normal| normal_octahedral(up(normal), anisotropy);
        let accessor = self.add_attribute(normals, order, convert, Kind::normalized(SIGNED_BYTE, "VEC3"))?;
        self.set_filter("OCTAHEDRAL");
        Ok(accessor)
    }

    /// Says how readers go on once they have unpacked the view that was added last.
    fn set_filter(&mut self, name: &str) {
        if let Some(view) = self.views.last_mut() {
            view["extensions"][MESHOPT]["filter"] = name.into();
        }
    }

    fn add_colors(&mut self, colors: &[Linear], order: Option<&[u32]>) -> Result<usize> {
        if self.compression == Compression::None {
            let convert = |[r, g, b]: Linear| [r, g, b, u16::MAX];
            return self.add_attribute(colors, order, convert, Kind::normalized(UNSIGNED_SHORT, "VEC4"));
        }
        self.add_attribute(colors, order, color_bytes, Kind::normalized(UNSIGNED_BYTE, "VEC4"))
    }

    /// Appends an accessor and a view of what `convert` makes of the vertices' `values`, those with the numbers in `order` or all
    /// of them as they are; its index.
    fn add_attribute<T: Copy, B: Pod>(
        &mut self,
        values: &[T],
        order: Option<&[u32]>,
        convert: impl Fn(T) -> B,
        kind: Kind,
    ) -> Result<usize> {
        let mut view = json!({"target": ARRAY_BUFFER});
        if self.compression != Compression::None {
            view["byteStride"] = size_of::<B>().into();
        }
        let count = order.map_or(values.len(), <[u32]>::len);
        if self.compression == Compression::Meshopt {
            let vertex = |i: usize| order.map_or(i, |order| order[i] as usize);
            let converted: Vec<B> = (0..count).map(|i| convert(values[vertex(i)])).collect();
            // Version 0 is the one of the extension.
            let packed = meshopt::encode_vertex_buffer_level(&converted, 0, Some(0)).map_err(not_packed)?;
            self.add_packed(view, &packed, "ATTRIBUTES", size_of::<B>(), count);
        } else {
            match order {
                Some(order) => self.add_view(view, order, |v| convert(values[v as usize])),
                None => self.add_view(view, values, convert),
            }
        }
        Ok(self.add_accessor(count, kind))
    }

    fn add_triangles(&mut self, triangles: &[[u32; 3]], vertices: usize) -> Result<usize> {
        let view = json!({"target": ELEMENT_ARRAY_BUFFER});
        let corners = triangles.as_flattened();
        // Index 65535 would restart a primitive.
        let short = vertices <= u16::MAX as usize;
        let (component, size) = if short { (UNSIGNED_SHORT, 2) } else { (UNSIGNED_INT, 4) };
        if self.compression == Compression::Meshopt {
            let packed = meshopt::encode_index_buffer(corners, vertices).map_err(not_packed)?;
            self.add_packed(view, &packed, "TRIANGLES", size, corners.len());
        } else if short {
            self.add_view(view, corners, |v| v as u16);
        } else {
            self.add_view(view, corners, |v| v);
        }
        Ok(self.add_accessor(corners.len(), Kind::new(component, "SCALAR", json!({}))))
    }

    fn add_accessor(&mut self, count: usize, kind: Kind) -> usize {
        let mut accessor = kind.more;
        accessor["bufferView"] = (self.views.len() - 1).into();
        accessor["componentType"] = kind.component.into();
        accessor["count"] = count.into();
        accessor["type"] = kind.shape.into();
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends a view of what `convert` makes of `values`.
    fn add_view<T: Copy, B: Pod>(&mut self, mut view: Value, values: &[T], convert: impl Fn(T) -> B) {
        view["buffer"] = 0.into();
        view["byteOffset"] = self.binary.len().into();
        view["byteLength"] = (values.len() * size_of::<B>()).into();
        append_converted(&mut self.binary, values, convert);
        self.pad();
        self.views.push(view);
    }

    /// Appends a view of `count` elements of `size` bytes that readers have to unpack.
    fn add_packed(&mut self, mut view: Value, packed: &[u8], mode: &str, size: usize, count: usize) {
        view["extensions"][MESHOPT] = json!({
            "buffer": 0,
            "byteOffset": self.append(packed),
            "byteLength": packed.len(),
            "byteStride": size,
            "count": count,
            "mode": mode,
        });
        view["buffer"] = 1.into();
        view["byteOffset"] = self.unpacked.into();
        view["byteLength"] = (size * count).into();
        self.unpacked += (size * count).next_multiple_of(4) as u64;
        self.views.push(view);
    }

    /// Appends to the binary chunk; where.
    fn append(&mut self, bytes: &[u8]) -> usize {
        let start = self.binary.len();
        self.binary.extend_from_slice(bytes);
        self.pad();
        start
    }

    fn pad(&mut self) {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
    }

    pub(crate) fn json(&self) -> Value {
        let mut json = json!({
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"extras": self.frame.extras()}],
        });
        if self.nodes.is_empty() {
            return json;
        }
        json["scenes"][0]["nodes"] = (0..self.nodes.len()).collect();
        json["nodes"] = self.nodes.clone().into();
        json["meshes"] = self.meshes.clone().into();
        json["materials"] = json!([material(self.colored)]);
        json["accessors"] = self.accessors.clone().into();
        json["bufferViews"] = self.views.clone().into();
        let mut buffers = vec![json!({"byteLength": self.binary.len()})];
        let extensions: &[&str] = match self.compression {
            Compression::None => &[],
            Compression::Quantized => &[QUANTIZATION],
            Compression::Meshopt => &[QUANTIZATION, MESHOPT],
        };
        if self.compression == Compression::Meshopt {
            buffers.push(json!({"byteLength": self.unpacked, "extensions": {MESHOPT: {"fallback": true}}}));
        }
        json["buffers"] = buffers.into();
        if !extensions.is_empty() {
            json["extensionsUsed"] = extensions.into();
            json["extensionsRequired"] = extensions.into();
        }
        json
    }
}

/// What the elements of an accessor are.
struct Kind {
    component: u64,
    shape: &'static str,
    /// What else the accessor says.
    more: Value,
}

impl Kind {
    fn new(component: u64, shape: &'static str, more: Value) -> Kind {
        Kind { component, shape, more }
    }

    fn normalized(component: u64, shape: &'static str) -> Kind {
        Kind::new(component, shape, json!({"normalized": true}))
    }
}

/// Appends what `convert` makes of `values`, by pieces that never leave the cache.
#[multiversion(targets("x86_64+avx2"))]
fn append_converted<T: Copy, B: Pod>(bytes: &mut Vec<u8>, values: &[T], convert: impl Fn(T) -> B) {
    let mut piece = [B::zeroed(); 256];
    bytes.reserve(size_of::<B>() * values.len());
    for values in values.chunks(piece.len()) {
        for (converted, &value) in piece.iter_mut().zip(values) {
            *converted = convert(value);
        }
        bytes.extend_from_slice(cast_slice(&piece[..values.len()]));
    }
}

fn not_packed(error: meshopt::Error) -> Error {
    Error::Broken(format!("a tile could not be packed: {error}"))
}

/// Dull and seen from both sides; white under vertex colours, which it multiplies.
fn material(colored: bool) -> Value {
    let mut surface = json!({"metallicFactor": 0.0, "roughnessFactor": 1.0});
    if !colored {
        surface["baseColorFactor"] = json!(PLAIN);
    }
    json!({"name": "terrain", "doubleSided": true, "pbrMetallicRoughness": surface})
}
