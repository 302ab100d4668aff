//! Joins tile files into one scene, for viewers that open a single file. What `EXT_meshopt_compression` packs is unpacked,
//! for not all of them know it.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};

use crate::output::gltf::container::Container;
use crate::output::gltf::document::{GENERATOR, MESHOPT, QUANTIZATION};
use crate::output::gltf::glb::write_container;
use crate::output::gltf::meshopt::Packed;
use crate::{Error, Result, interrupt};

/// Writes to `out` one GLB file with all tiles (GLB files of one job, at least one) as nodes of one scene, in this order.
/// One tile is held in memory at a time, and a description of every other.
///
/// Fails where the file would pass the 4 GiB that a GLB file can have, or a tile is damaged.
pub fn write_terrain(out: &Path, tiles: &[PathBuf]) -> Result<()> {
    let mut scene = Scene::default();
    for path in tiles {
        scene.add(path, &Container::open(path)?)?;
    }
    let mut head = Vec::new();
    write_container(scene.json(), scene.length, &mut head)?;
    let file = File::create(out).map_err(Error::io("create", out))?;
    let mut file = BufWriter::with_capacity(1 << 20, file);
    file.write_all(&head).map_err(Error::io("write", out))?;
    let mut written = 0;
    for path in tiles {
        interrupt::check()?;
        written += copy_views(path, &mut file)?;
    }
    if written != scene.length {
        return Err(Error::input(out, "the tiles changed while they were joined"));
    }
    file.flush().map_err(Error::io("write", out))
}

/// Writes the unpacked data of the tile at `path`; how many bytes.
fn copy_views(path: &Path, file: &mut impl Write) -> Result<u64> {
    let mut container = Container::open(path)?;
    let tile: Value = container.document(path)?;
    let binary = container.binary(path)?;
    let damaged = |what: String| Error::input(path, format!("not a tile of this program: {what}"));
    let mut written = 0;
    for view in tile["bufferViews"].as_array().into_iter().flatten() {
        let view = View::of(view).map_err(damaged)?;
        let bytes = view.bytes(&binary).map_err(damaged)?;
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        file.write_all(&bytes).and_then(|()| file.write_all(&[0; 4][..padding])).map_err(Error::io("copy", path))?;
        written += (bytes.len() + padding) as u64;
    }
    Ok(written)
}

/// Where the data of a buffer view are.
struct View {
    start: u64,
    /// Bytes in the file.
    length: u64,
    packed: Option<Packed>,
}

impl View {
    fn of(view: &Value) -> std::result::Result<View, String> {
        if let Some(packed) = view["extensions"].get(MESHOPT) {
            let packed = Packed::deserialize(packed).map_err(|e| e.to_string())?;
            return Ok(View { start: packed.byte_offset, length: packed.byte_length, packed: Some(packed) });
        }
        let number = |key: &str| view[key].as_u64();
        let length = number("byteLength").ok_or("a buffer view has no length")?;
        Ok(View { start: number("byteOffset").unwrap_or(0), length, packed: None })
    }

    /// Bytes of the unpacked data.
    fn unpacked_length(&self) -> u64 {
        self.packed.map_or(Some(self.length), |packed| packed.unpacked_length()).unwrap_or(u64::MAX)
    }

    fn bytes<'a>(&self, binary: &'a [u8]) -> std::result::Result<Cow<'a, [u8]>, String> {
        let end = self.start.saturating_add(self.length).try_into().unwrap_or(usize::MAX);
        let bytes = binary.get(self.start as usize..end).ok_or("a buffer view goes past the end of the data")?;
        match &self.packed {
            Some(packed) => packed.unpack(bytes).map(Cow::Owned),
            None => Ok(Cow::Borrowed(bytes)),
        }
    }
}

/// The arrays of the joined document as JSON texts, which take far less room than parsed values.
#[derive(Default)]
struct Scene {
    views: List,
    accessors: List,
    meshes: List,
    nodes: List,
    extras: Value,
    materials: Value,
    quantized: bool,
    /// Bytes of the binary chunk.
    length: u64,
}

/// A JSON array in the making.
#[derive(Default)]
struct List {
    text: String,
    count: u64,
}

impl List {
    fn push(&mut self, value: &Value) {
        if self.count > 0 {
            self.text.push(',');
        }
        self.text.push_str(&value.to_string());
        self.count += 1;
    }
}

impl Scene {
    fn add(&mut self, path: &Path, container: &Container) -> Result<()> {
        let mut tile: Value = container.document(path)?;
        let (views, accessors, meshes) = (self.views.count, self.accessors.count, self.meshes.count);
        for view in elements(&mut tile, "bufferViews") {
            let length = View::of(view).map_err(|what| Error::input(path, what))?.unpacked_length();
            view["buffer"] = 0.into();
            view["byteOffset"] = self.length.into();
            view["byteLength"] = length.into();
            view.as_object_mut().into_iter().for_each(|view| drop(view.remove("extensions")));
            self.views.push(view);
            self.length = self.length.saturating_add(length).saturating_add(3) & !3;
        }
        for accessor in elements(&mut tile, "accessors") {
            shift(accessor, "bufferView", views);
            self.accessors.push(accessor);
        }
        for mesh in elements(&mut tile, "meshes") {
            for primitive in elements(mesh, "primitives") {
                shift(primitive, "indices", accessors);
                let attributes = primitive["attributes"].as_object_mut().into_iter().flatten();
                attributes.for_each(|(_, attribute)| add(attribute, accessors));
            }
            self.meshes.push(mesh);
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for node in elements(&mut tile, "nodes") {
            shift(node, "mesh", meshes);
            node["name"] = json!(name);
            self.nodes.push(node);
        }
        if self.extras.is_null() {
            self.extras = tile["scenes"][0]["extras"].take();
            self.materials = tile["materials"].take();
        }
        let extensions = tile["extensionsRequired"].as_array();
        self.quantized |= extensions.is_some_and(|names| names.iter().any(|name| name == QUANTIZATION));
        Ok(())
    }

    fn json(&self) -> Vec<u8> {
        let nodes: Vec<u64> = (0..self.nodes.count).collect();
        let scene = json!({"nodes": nodes, "extras": self.extras});
        let asset = json!({"version": "2.0", "generator": GENERATOR});
        let (materials, length) = (&self.materials, self.length);
        let extensions = match self.quantized {
            true => format!(r#""extensionsUsed":["{QUANTIZATION}"],"extensionsRequired":["{QUANTIZATION}"],"#),
            false => String::new(),
        };
        let [views, accessors, meshes, nodes] =
            [&self.views, &self.accessors, &self.meshes, &self.nodes].map(|list| &list.text);
        format!(
            r#"{{"asset":{asset},{extensions}"scene":0,"scenes":[{scene}],"nodes":[{nodes}],"meshes":[{meshes}],"materials":{materials},"accessors":[{accessors}],"bufferViews":[{views}],"buffers":[{{"byteLength":{length}}}]}}"#
        )
        .into_bytes()
    }
}

fn elements<'a>(value: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
    value.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
}

fn shift(value: &mut Value, key: &str, by: u64) {
    if let Some(number) = value.get_mut(key) {
        add(number, by);
    }
}

fn add(number: &mut Value, by: u64) {
    if let Some(old) = number.as_u64() {
        *number = old.saturating_add(by).into();
    }
}
