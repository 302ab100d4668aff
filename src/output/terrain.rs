//! Joins tile files into one scene, for viewers that open a single file.

use std::fs::File;
use std::io::{BufWriter, Write, copy};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::glb::{GENERATOR, write_container};
use super::read::Container;
use crate::{Error, Result, interrupt};

/// Writes to `out` one GLB file with all tiles (GLB files of one job, at least one) as nodes of one scene, in this order.
/// Only the JSON chunks are held in memory.
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
    for path in tiles {
        interrupt::check()?;
        let mut container = Container::open(path)?;
        let copied = copy(&mut container.binary(), &mut file).map_err(Error::io("copy", path))?;
        if copied != container.binary_length {
            return Err(Error::input(path, "changed while it was read"));
        }
    }
    file.flush().map_err(Error::io("write", out))
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
            shift(view, "byteOffset", self.length);
            self.views.push(view);
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
        self.length += container.binary_length;
        Ok(())
    }

    fn json(&self) -> Vec<u8> {
        let nodes: Vec<u64> = (0..self.nodes.count).collect();
        let scene = json!({"nodes": nodes, "extras": self.extras});
        let asset = json!({"version": "2.0", "generator": GENERATOR});
        let (materials, length) = (&self.materials, self.length);
        let [views, accessors, meshes, nodes] =
            [&self.views, &self.accessors, &self.meshes, &self.nodes].map(|list| &list.text);
        format!(
            r#"{{"asset":{asset},"scene":0,"scenes":[{scene}],"nodes":[{nodes}],"meshes":[{meshes}],"materials":{materials},"accessors":[{accessors}],"bufferViews":[{views}],"buffers":[{{"byteLength":{length}}}]}}"#
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
