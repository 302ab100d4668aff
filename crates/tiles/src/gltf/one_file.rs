//! Joins tile files into one scene, for viewers that open a single file. What `EXT_meshopt_compression` packs is unpacked,
//! because not all viewers know that extension.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use gltf::json::buffer::View;
use gltf::json::mesh::{Mesh, Semantic};
use gltf::json::scene::Scene;
use gltf::json::validation::{Checked::Valid, USize64};
use gltf::json::{Index, Root};

use crate::attributes::AttributeChoice;
use crate::gltf::check_json::{Decoded, RawDocument};
use crate::gltf::container::{GlbFile, write_head};
use crate::gltf::document::{asset, buffer};
use crate::gltf::metadata;
use crate::gltf::metadata::METADATA;
use crate::gltf::schema::{QUANTIZATION, to_text};
use crate::gltf::stored_view::StoredView;
use sys::disk::WriteFrom;
use sys::{Error, Result, disk, interrupt};

/// Writes to `out` one GLB file with all tiles (GLB files of one job, at least one) as nodes of one scene, in this order.
/// One tile is held in memory at a time, and the descriptions of all. `copyright` tells whose the data are.
///
/// # Errors
/// [`Error::Config`] if the file would pass the 4 GiB that a GLB file can have, [`Error::Input`] if a tile is damaged,
/// [`Error::Io`] if a file cannot be read or written.
pub fn write_terrain(out: &Path, tiles: &[PathBuf], copyright: Option<&str>) -> Result<()> {
    write(out, tiles, &GlbFile::open, copyright)
}

/// As [`write_terrain`], with the bytes that `remake` returns for each tile in the place of its file. They must be the same each time.
///
/// # Errors
/// As [`write_terrain`], and those of `remake`.
pub fn write_remade_terrain(
    out: &Path,
    tiles: &[PathBuf],
    remake: &dyn Fn(&Path) -> Result<Vec<u8>>,
    copyright: Option<&str>,
) -> Result<()> {
    write(out, tiles, &|path| GlbFile::in_memory(path, remake(path)?), copyright)
}

/// Opens the tile at a path.
type OpenTile<'a> = &'a dyn Fn(&Path) -> Result<GlbFile>;

fn write(out: &Path, tiles: &[PathBuf], open: OpenTile, copyright: Option<&str>) -> Result<()> {
    let mut joined = JoinedDocument::default();
    for path in tiles {
        interrupt::check()?;
        let file = open(path)?;
        joined.add(path, &file.document(path)?).map_err(|what| not_a_tile(path, what))?;
    }
    let length = joined.length;
    let (text, padding) = joined.finish(copyright)?;
    let mut head = Vec::new();
    write_head(text, length + padding.len() as u64, &mut head)?;
    let file = disk::create(out).map_err(Error::io("create", out))?;
    let mut file = BufWriter::with_capacity(1 << 20, WriteFrom { file: &file, at: 0 });
    file.write_all(&head).map_err(Error::io("write", out))?;
    let mut written = 0;
    for path in tiles {
        interrupt::check()?;
        written += copy_views(path, open(path)?, &mut file)?;
    }
    if written != length {
        return Err(Error::input(out, "the tiles changed while they were joined"));
    }
    file.write_all(padding).and_then(|()| file.flush()).map_err(Error::io("write", out))
}

fn not_a_tile(path: &Path, what: String) -> Error {
    Error::input(path, format!("not a tile of this program: {what}"))
}

/// Writes the unpacked data of `tile`, which is at `path`, and returns the number of bytes written.
fn copy_views(path: &Path, mut tile: GlbFile, file: &mut impl Write) -> Result<u64> {
    let views = stored_views(&tile.document(path)?).map_err(|what| not_a_tile(path, what))?;
    let binary = tile.binary(path)?;
    let mut written = 0;
    for view in views {
        let bytes = view.stored(&binary).and_then(|stored| view.unpack(stored));
        let bytes = bytes.map_err(|what| not_a_tile(path, what))?;
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        file.write_all(&bytes).and_then(|()| file.write_all(&[0; 4][..padding])).map_err(Error::io("copy", path))?;
        written += (bytes.len() + padding) as u64;
    }
    Ok(written)
}

fn stored_views(document: &RawDocument) -> Decoded<Vec<StoredView>> {
    document.buffer_views().map(|view| StoredView::of(&view?)).collect()
}

/// The description of all tiles so far.
#[derive(Default)]
struct JoinedDocument {
    root: Root,
    /// The scene's extras, those of the first tile.
    scene: Option<Scene>,
    colored: bool,
    quantized: bool,
    attributes: AttributeChoice,
    /// Bytes of the binary chunk.
    length: u64,
}

impl JoinedDocument {
    /// Appends what the tile at `path` describes, with the numbers that its elements have here.
    fn add(&mut self, path: &Path, tile: &RawDocument) -> Decoded<()> {
        let views: Vec<View> = tile.buffer_views().collect::<Decoded<_>>()?;
        let view_numbers = Numbers::new(self.root.buffer_views.len(), views.len());
        for view in views {
            let view = self.moved(view)?;
            self.root.push(view);
        }
        let accessors: Vec<_> = tile.accessors().collect::<Decoded<_>>()?;
        let accessor_numbers = Numbers::new(self.root.accessors.len(), accessors.len());
        for mut accessor in accessors {
            accessor.buffer_view.as_mut().map_or(Ok(()), |view| view_numbers.shift(view))?;
            self.root.push(accessor);
        }
        let meshes: Vec<Mesh> = tile.meshes().collect::<Decoded<_>>()?;
        let mesh_numbers = Numbers::new(self.root.meshes.len(), meshes.len());
        for mut mesh in meshes {
            for primitive in &mut mesh.primitives {
                primitive.indices.as_mut().map_or(Ok(()), |indices| accessor_numbers.shift(indices))?;
                primitive.attributes.values_mut().try_for_each(|accessor| accessor_numbers.shift(accessor))?;
                let has = |semantic| primitive.attributes.contains_key(&Valid(semantic));
                self.colored |= has(Semantic::Colors(0));
                let (classification, intensity) = (has(metadata::classification()), has(metadata::intensity()));
                self.attributes = self.attributes.or(AttributeChoice { classification, intensity });
            }
            self.root.push(mesh);
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for node in tile.nodes() {
            let mut node = node?;
            node.mesh.as_mut().map_or(Ok(()), |mesh| mesh_numbers.shift(mesh))?;
            node.name = Some(name.to_string());
            self.root.push(node);
        }
        if self.scene.is_none() {
            self.scene = tile.scenes().next().transpose()?;
        }
        self.quantized |= tile.extensions_required.iter().any(|name| name == QUANTIZATION);
        Ok(())
    }

    /// Returns `view` as a view of the next unpacked data in the joined binary chunk.
    fn moved(&mut self, view: View) -> Decoded<View> {
        let (start, length) = (self.length, StoredView::of(&view)?.unpacked_length());
        self.length = start.saturating_add(length).saturating_add(3) & !3;
        let (byte_offset, byte_length) = (Some(USize64(start)), USize64(length));
        Ok(View { buffer: Index::new(0), byte_offset, byte_length, extensions: None, ..view })
    }

    /// Returns the JSON text, and what follows the data in the binary chunk.
    fn finish(mut self, copyright: Option<&str>) -> Result<(Vec<u8>, &'static [u8])> {
        let nodes = (0..self.root.nodes.len() as u32).map(Index::new).collect();
        let extras = self.scene.and_then(|scene| scene.extras);
        let scene = self.root.push(Scene { nodes, extras, extensions: None, name: None });
        self.root.scene = Some(scene);
        self.root.asset = asset(copyright);
        self.root.extensions = metadata::of_document(self.attributes);
        // All data are multiples of four bytes.
        let is_short = self.root.extensions.is_some() && !self.length.is_multiple_of(metadata::ALIGNMENT as u64);
        let padding: &[u8] = if is_short { &[0; 4] } else { &[] };
        self.root.push(buffer(self.length + padding.len() as u64));
        if self.quantized {
            self.root.extensions_used = vec![QUANTIZATION.into()];
            self.root.extensions_required = self.root.extensions_used.clone();
        }
        if self.root.extensions.is_some() {
            self.root.extensions_used.push(METADATA.into());
        }
        let mut text = to_text(&self.root, self.colored)?;
        if self.root.extensions.is_some() {
            metadata::align_text(&mut text);
        }
        Ok((text, padding))
    }
}

/// The numbers of one tile's elements in the joined document.
struct Numbers {
    first: usize,
    count: usize,
}

impl Numbers {
    fn new(first: usize, count: usize) -> Numbers {
        Numbers { first, count }
    }

    fn shift<T>(&self, index: &mut Index<T>) -> Decoded<()> {
        if index.value() >= self.count {
            return Err(format!("there is no element {index} of {}", self.count));
        }
        *index = Index::new((self.first + index.value()) as u32);
        Ok(())
    }
}
