//! Reads tiles back as any reader of glTF would, trusting nothing: a damaged or hostile file gives an error that says
//! what is wrong with it, and never takes more memory than a few times its size.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use bytemuck::{AnyBitPattern, NoUninit, allocation::pod_collect_to_vec};
use serde::Deserialize;

use super::document::{FLOAT, UNSIGNED_INT, UNSIGNED_SHORT};
use super::frame::Extras;
use super::glb::{BIN_CHUNK, JSON_CHUNK, MAGIC, VERSION};
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
    /// Metres (x, y up, z) from the translation; finite.
    pub positions: Vec<[f32; 3]>,
    /// As many as positions.
    pub normals: Option<Vec<[f32; 3]>>,
    /// As many as positions; linear red, green, blue and alpha.
    pub colors: Option<Vec<[u16; 4]>>,
    /// Indices of positions, within range.
    pub triangles: Vec<[u32; 3]>,
}

impl Part {
    /// The position of vertex `v` in the scene, metres; exact.
    #[inline(always)]
    pub fn world(&self, v: usize) -> [f64; 3] {
        let (position, translation) = (self.positions[v], self.translation);
        [0, 1, 2].map(|k| translation[k] + position[k] as f64)
    }
}

/// Reads the GLB file at `path`.
pub fn read_tile(path: &Path) -> Result<TileFile> {
    let mut container = Container::open(path)?;
    let document: Document = container.document(path)?;
    let mut binary = Vec::new();
    binary
        .try_reserve_exact(container.binary_length as usize)
        .map_err(|_| Error::Memory(format!("{} needs {} bytes to read", path.display(), container.binary_length)))?;
    container.binary().read_to_end(&mut binary).map_err(Error::io("read", path))?;
    if binary.len() as u64 != container.binary_length {
        return Err(Error::input(path, "ends inside its binary chunk"));
    }
    let mut decoder = Decoder { document: &document, binary: &binary, used: 0 };
    decoder.tile().map_err(|what| Error::input(path, format!("not a tile of this program: {what}")))
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

/// The two chunks of a GLB file.
pub(super) struct Container {
    file: File,
    json: Vec<u8>,
    binary_start: u64,
    /// Bytes in the binary chunk.
    pub(super) binary_length: u64,
}

impl Container {
    /// Reads all but the binary chunk and checks the lengths against the file's size.
    pub(super) fn open(path: &Path) -> Result<Container> {
        let mut file = File::open(path).map_err(Error::io("open", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        let damaged = |what: &str| Error::input(path, format!("not a whole GLB file: {what}"));
        if size < 20 {
            return Err(damaged("shorter than its header"));
        }
        let [magic, version, total, json_length, json_kind] = read_words(&mut file).map_err(Error::io("read", path))?;
        if magic != MAGIC || version != VERSION || json_kind != JSON_CHUNK {
            return Err(damaged("it does not start as glTF 2.0"));
        }
        if total as u64 != size {
            return Err(damaged(&format!("its header says {total} bytes, it has {size}")));
        }
        let json_end = 20 + json_length as u64;
        if json_end > size {
            return Err(damaged("its JSON chunk goes past the end"));
        }
        let mut json = vec![0; json_length as usize];
        file.read_exact(&mut json).map_err(Error::io("read", path))?;
        let mut container = Container { file, json, binary_start: json_end + 8, binary_length: 0 };
        if json_end + 8 <= size {
            let [length, kind] = read_words(&mut container.file).map_err(Error::io("read", path))?;
            if kind != BIN_CHUNK || container.binary_start + length as u64 != size {
                return Err(damaged("its second chunk is not binary data up to the end"));
            }
            container.binary_length = length as u64;
        }
        Ok(container)
    }

    /// The JSON chunk as a `T`.
    pub(super) fn document<'a, T: Deserialize<'a>>(&'a self, path: &Path) -> Result<T> {
        serde_json::from_slice(&self.json)
            .map_err(|e| Error::input(path, format!("its JSON chunk is not one of this program: {e}")))
    }

    /// The binary chunk from its start.
    pub(super) fn binary(&mut self) -> impl Read {
        // A seek that fails shows as an empty chunk, whose length is then found wrong.
        let length = self.file.seek(SeekFrom::Start(self.binary_start)).map_or(0, |_| self.binary_length);
        (&mut self.file).take(length)
    }
}

fn read_words<const N: usize>(file: &mut File) -> std::io::Result<[u32; N]> {
    let mut words = [[0u8; 4]; N];
    file.read_exact(words.as_flattened_mut())?;
    Ok(words.map(u32::from_le_bytes))
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
    #[serde(rename = "buffer")]
    _buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    #[serde(rename = "target")]
    _target: Option<u64>,
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
        let positions: Vec<[f32; 3]> = self.elements(attributes.position, FLOAT, "VEC3")?;
        if !positions.as_flattened().iter().chain(&[0.0]).all(|v| v.is_finite()) {
            return Err("a position is not a finite number".into());
        }
        let same_count = |count: usize, name: &str| match count == positions.len() {
            true => Ok(()),
            false => Err(format!("{} positions, but {count} {name}", positions.len())),
        };
        let normals: Option<Vec<_>> = attributes.normal.map(|n| self.elements(n, FLOAT, "VEC3")).transpose()?;
        let colors: Option<Vec<_>> = attributes.color.map(|c| self.elements(c, UNSIGNED_SHORT, "VEC4")).transpose()?;
        normals.as_ref().map_or(Ok(()), |n| same_count(n.len(), "normals"))?;
        colors.as_ref().map_or(Ok(()), |c| same_count(c.len(), "colours"))?;
        let triangles = self.triangles(*indices, positions.len())?;
        Ok(Part { translation: node.translation, positions, normals, colors, triangles })
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
        let length = accessor.count.checked_mul(size_of::<T>() as u64).filter(|&length| length <= view.byte_length);
        let end = length.and_then(|length| view.byte_offset.checked_add(length));
        let range = end.and_then(|end| self.binary.get(view.byte_offset as usize..usize::try_from(end).ok()?));
        let bytes = range.ok_or_else(|| format!("accessor {number} goes past the end of the data"))?;
        self.used += bytes.len();
        if self.used > self.binary.len() {
            return Err("the same data are used more than once".into());
        }
        Ok(pod_collect_to_vec(bytes))
    }
}

fn item<'a, T>(items: &'a [T], index: usize, name: &str) -> Decoded<&'a T> {
    items.get(index).ok_or_else(|| format!("there is no {name} {index}"))
}
