//! Reads tiles back as any reader of glTF would, trusting nothing: a damaged or hostile file gives an error that says
//! what is wrong with it, and never takes more memory than a few times its size.

use std::borrow::Cow;
use std::path::Path;

use bytemuck::{AnyBitPattern, NoUninit, allocation::pod_collect_to_vec};
use serde::Deserialize;

use crate::output::frame::Extras;
use crate::output::gltf::container::Container;
use crate::output::gltf::document::{FLOAT, SIGNED_BYTE, SIGNED_SHORT, UNSIGNED_BYTE, UNSIGNED_INT, UNSIGNED_SHORT};
use crate::output::gltf::meshopt::{MOST_EXPANSION, Packed};
use crate::{Error, Result};

/// A GLB file of this program, as it is on disk.
#[derive(Clone, Debug)]
pub struct TileFile {
    /// The scene's georeference.
    pub extras: Extras,
    /// The meshes of the scene, one for every node.
    pub parts: Vec<Part>,
}

/// One node and its mesh.
#[derive(Clone, Debug)]
pub struct Part {
    /// Metres.
    pub translation: [f64; 3],
    /// Metres in a unit of the positions.
    pub scale: [f64; 3],
    /// From the translation (x, y up, z) in units of the scale; finite.
    pub positions: Vec<[f32; 3]>,
    /// As many as positions; a viewer divides them by the scale and makes them unit vectors.
    pub normals: Option<Vec<[f32; 3]>>,
    /// As many as positions; linear red, green, blue and alpha, 65535 for 1.
    pub colors: Option<Vec<[u16; 4]>>,
    /// Indices of positions, within range.
    pub triangles: Vec<[u32; 3]>,
}

impl Part {
    /// The position of vertex `v` in the scene, metres; exact.
    #[inline(always)]
    pub fn world(&self, v: usize) -> [f64; 3] {
        let (position, translation) = (self.positions[v], self.translation);
        [0, 1, 2].map(|k| translation[k] + self.scale[k] * position[k] as f64)
    }
}

/// Reads the GLB file at `path`.
pub fn read_tile(path: &Path) -> Result<TileFile> {
    let mut container = Container::open(path)?;
    let document: Document = container.document(path)?;
    let binary = container.binary(path)?;
    let mut decoder = Decoder { document: &document, binary: &binary, used: 0 };
    decoder.tile().map_err(|what| Error::input(path, format!("not a tile of this program: {what}")))
}

/// Bytes that the parts of the GLB file at `path` take in memory at most, as far as its description says.
pub fn held_bytes(path: &Path) -> Result<u64> {
    let container = Container::open(path)?;
    let document: Document = container.document(path)?;
    let size = |accessor: &Accessor| accessor.count.saturating_mul(if accessor.kind == "SCALAR" { 4 } else { 12 });
    let said = document.accessors.iter().map(size).fold(0, u64::saturating_add);
    Ok(said.min(container.binary_length.saturating_mul(MOST_EXPANSION)))
}

/// The georeference alone of the GLB file at `path`.
pub fn read_extras(path: &Path) -> Result<Extras> {
    let container = Container::open(path)?;
    let mut document: Document = container.document(path)?;
    if document.scene < document.scenes.len() {
        return Ok(document.scenes.swap_remove(document.scene).extras);
    }
    Err(Error::input(path, "not a tile of this program: there is no scene"))
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    scene: usize,
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<View>,
}

#[derive(Deserialize)]
struct Scene {
    extras: Extras,
    #[serde(default)]
    nodes: Vec<usize>,
}

// Unknown fields of these would change what the data mean.

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Node {
    #[serde(default, rename = "name")]
    _name: String,
    mesh: usize,
    #[serde(default)]
    translation: [f64; 3],
    #[serde(default = "unscaled")]
    scale: [f64; 3],
}

fn unscaled() -> [f64; 3] {
    [1.0; 3]
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Primitive {
    attributes: Attributes,
    indices: usize,
    #[serde(rename = "material")]
    _material: Option<usize>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: usize,
    #[serde(rename = "NORMAL")]
    normal: Option<usize>,
    #[serde(rename = "COLOR_0")]
    color: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
struct Accessor {
    buffer_view: usize,
    component_type: u64,
    count: u64,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default, rename = "normalized")]
    _normalized: bool,
    #[serde(default, rename = "min")]
    _min: Vec<f64>,
    #[serde(default, rename = "max")]
    _max: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
    #[serde(rename = "target")]
    _target: Option<u64>,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Extensions {
    #[serde(rename = "EXT_meshopt_compression")]
    packed: Option<Packed>,
}

type Decoded<T> = std::result::Result<T, String>;

struct Decoder<'a> {
    document: &'a Document,
    binary: &'a [u8],
    /// Bytes decoded so far: data that are used again and again would otherwise grow without bound.
    used: usize,
}

impl Decoder<'_> {
    fn tile(&mut self) -> Decoded<TileFile> {
        let scene = item(&self.document.scenes, self.document.scene, "scene")?;
        let parts = scene.nodes.iter().map(|&node| self.part(node)).collect::<Decoded<_>>()?;
        Ok(TileFile { extras: scene.extras.clone(), parts })
    }

    fn part(&mut self, node: usize) -> Decoded<Part> {
        let node = item(&self.document.nodes, node, "node")?;
        let mesh = item(&self.document.meshes, node.mesh, "mesh")?;
        let [Primitive { attributes, indices, .. }] = &mesh.primitives[..] else {
            return Err(format!("mesh {} does not have one primitive", node.mesh));
        };
        let positions = self.positions(attributes.position)?;
        if !positions.as_flattened().iter().chain(&[0.0]).all(|v| v.is_finite()) {
            return Err("a position is not a finite number".into());
        }
        let same_count = |count: usize, name: &str| match count == positions.len() {
            true => Ok(()),
            false => Err(format!("{} positions, but {count} {name}", positions.len())),
        };
        let normals = attributes.normal.map(|n| self.normals(n)).transpose()?;
        let colors = attributes.color.map(|c| self.colors(c)).transpose()?;
        normals.as_ref().map_or(Ok(()), |n| same_count(n.len(), "normals"))?;
        colors.as_ref().map_or(Ok(()), |c| same_count(c.len(), "colours"))?;
        let triangles = self.triangles(*indices, positions.len())?;
        Ok(Part { translation: node.translation, scale: node.scale, positions, normals, colors, triangles })
    }

    fn positions(&mut self, accessor: usize) -> Decoded<Vec<[f32; 3]>> {
        if self.component(accessor)? == FLOAT {
            return self.elements(accessor, FLOAT, "VEC3");
        }
        let short: Vec<[u16; 4]> = self.elements(accessor, UNSIGNED_SHORT, "VEC3")?;
        Ok(short.into_iter().map(|[x, y, z, _]| [x, y, z].map(f32::from)).collect())
    }

    fn normals(&mut self, accessor: usize) -> Decoded<Vec<[f32; 3]>> {
        if self.component(accessor)? == FLOAT {
            return self.elements(accessor, FLOAT, "VEC3");
        }
        if self.component(accessor)? == SIGNED_SHORT {
            let shorts: Vec<[i16; 4]> = self.elements(accessor, SIGNED_SHORT, "VEC3")?;
            return Ok(shorts.into_iter().map(|[x, y, z, _]| [x, y, z].map(|v| f32::from(v) / 32767.0)).collect());
        }
        let bytes: Vec<[i8; 4]> = self.elements(accessor, SIGNED_BYTE, "VEC3")?;
        Ok(bytes.into_iter().map(|[x, y, z, _]| [x, y, z].map(|v| f32::from(v) / 127.0)).collect())
    }

    fn colors(&mut self, accessor: usize) -> Decoded<Vec<[u16; 4]>> {
        if self.component(accessor)? == UNSIGNED_SHORT {
            return self.elements(accessor, UNSIGNED_SHORT, "VEC4");
        }
        let bytes: Vec<[u8; 4]> = self.elements(accessor, UNSIGNED_BYTE, "VEC4")?;
        Ok(bytes.into_iter().map(|c| c.map(|v| u16::from(v) * 257)).collect())
    }

    fn component(&self, accessor: usize) -> Decoded<u64> {
        Ok(item(&self.document.accessors, accessor, "accessor")?.component_type)
    }

    fn triangles(&mut self, indices: usize, vertices: usize) -> Decoded<Vec<[u32; 3]>> {
        let accessor = item(&self.document.accessors, indices, "accessor")?;
        if accessor.count % 3 != 0 {
            return Err(format!("{} indices are not whole triangles", accessor.count));
        }
        let triangles: Vec<[u32; 3]> = if accessor.component_type == UNSIGNED_SHORT {
            let short: Vec<u16> = self.elements(indices, UNSIGNED_SHORT, "SCALAR")?;
            short.chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect()
        } else {
            let corners: Vec<u32> = self.elements(indices, UNSIGNED_INT, "SCALAR")?;
            corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
        };
        match triangles.as_flattened().iter().find(|&&v| v as usize >= vertices) {
            Some(v) => Err(format!("index {v} of {vertices} vertices")),
            None => Ok(triangles),
        }
    }

    /// The elements of an accessor of this type, tightly packed.
    fn elements<T: AnyBitPattern + NoUninit>(
        &mut self,
        accessor: usize,
        component: u64,
        kind: &str,
    ) -> Decoded<Vec<T>> {
        let number = accessor;
        let accessor = item(&self.document.accessors, accessor, "accessor")?;
        if accessor.component_type != component || accessor.kind != kind {
            return Err(format!(
                "accessor {number} holds {} of component type {}, where {kind} of {component} was expected",
                accessor.kind, accessor.component_type
            ));
        }
        let view = item(&self.document.buffer_views, accessor.buffer_view, "buffer view")?;
        let size = size_of::<T>() as u64;
        if view.byte_stride.is_some_and(|stride| stride != size) {
            return Err(format!("accessor {number} is not {size} bytes an element"));
        }
        let bytes = self.bytes(view)?;
        let length = accessor.count.checked_mul(size).and_then(|length| usize::try_from(length).ok());
        let bytes = length.and_then(|length| bytes.get(..length));
        Ok(pod_collect_to_vec(bytes.ok_or_else(|| format!("accessor {number} goes past the end of the data"))?))
    }

    /// What a view shows.
    fn bytes(&mut self, view: &View) -> Decoded<Cow<'_, [u8]>> {
        let (buffer, start, length) = match &view.extensions.packed {
            Some(packed) => (packed.buffer, packed.byte_offset, packed.byte_length),
            None => (view.buffer, view.byte_offset, view.byte_length),
        };
        let end = start.checked_add(length).and_then(|end| usize::try_from(end).ok());
        let range = end.and_then(|end| self.binary.get(start as usize..end)).filter(|_| buffer == 0);
        let bytes = range.ok_or("a buffer view goes past the end of the data")?;
        self.used += bytes.len();
        if self.used > self.binary.len() {
            return Err("the same data are used more than once".into());
        }
        match &view.extensions.packed {
            Some(packed) => packed.unpack(bytes).map(Cow::Owned),
            None => Ok(Cow::Borrowed(bytes)),
        }
    }
}

fn item<'a, T>(items: &'a [T], index: usize, name: &str) -> Decoded<&'a T> {
    items.get(index).ok_or_else(|| format!("there is no {name} {index}"))
}
