//! Reads tiles back as any reader of glTF would, and trusts nothing: a damaged or hostile file gives an error that says what is
//! wrong with it, and takes no more memory than a few times its size.

use std::borrow::Cow;
use std::path::Path;

use bytemuck::{AnyBitPattern, NoUninit, allocation::pod_collect_to_vec};
use gltf::json::Index;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::scene::{Node, Scene};
use gltf::json::validation::Checked::Valid;
use multiversion::multiversion;

use crate::attributes::PointAttributes;
use crate::compression::Compression;
use crate::frame::Extras;
use crate::gltf::check_json::{Decoded, RawDocument};
use crate::gltf::container::GlbFile;
use crate::gltf::meshopt::{MOST_EXPANSION, PackedFilter};
use crate::gltf::metadata;
use crate::gltf::stored_normals::StoredNormals;
use crate::gltf::stored_view::StoredView;
use sys::{Error, Result};

/// A GLB file of this program, as it is on the disk.
#[derive(Clone, Debug)]
pub struct TileFile {
    /// The scene's georeference.
    pub extras: Extras,
    /// The meshes of the scene, one for each node.
    pub parts: Vec<TilePart>,
}

/// One node and its mesh.
#[derive(Clone, Debug)]
pub struct TilePart {
    /// The translation in metres.
    pub translation: [f64; 3],
    /// The metres in a unit of the positions.
    pub scale: [f64; 3],
    /// The positions (x, y up, z) from the translation, in units of the scale. They are finite.
    pub positions: Vec<[f32; 3]>,
    /// The normals, as many as positions.
    pub normals: Option<StoredNormals>,
    /// The colours, as many as positions: linear red, green, blue and alpha, 65535 for 1.
    pub colors: Option<Vec<[u16; 4]>>,
    /// What the vertices carry of their points, as many as positions.
    pub attributes: PointAttributes,
    /// The triangles as indices of positions, within range.
    pub triangles: Vec<[u32; 3]>,
}

impl TilePart {
    /// Returns the position of vertex `v` in the scene in metres. It is exact.
    #[inline(always)]
    pub fn world(&self, v: usize) -> [f64; 3] {
        let (position, translation) = (self.positions[v], self.translation);
        [0, 1, 2].map(|k| translation[k] + self.scale[k] * position[k] as f64)
    }
}

/// Reads the GLB file at `path`.
pub fn read_tile(path: &Path) -> Result<TileFile> {
    read(path, |document| document)
}

/// Reads the GLB file at `path`, but for normals, colours and what vertices carry of their points.
pub fn read_surface(path: &Path) -> Result<TileFile> {
    read(path, TileDocument::bare)
}

/// As [`read_surface`], for the `bytes` of the file at `path`.
pub fn read_surface_of(path: &Path, bytes: Vec<u8>) -> Result<TileFile> {
    decode(path, GlbFile::in_memory(path, bytes)?, TileDocument::bare)
}

/// As [`read_tile`], for the `bytes` of the file at `path`. Also returns how it is packed.
pub fn read_packed_tile_of(path: &Path, bytes: Vec<u8>) -> Result<(TileFile, Compression)> {
    let file = GlbFile::in_memory(path, bytes)?;
    let compression = file.compression();
    Ok((decode(path, file, |document| document)?, compression))
}

fn read(path: &Path, wanted: impl FnOnce(TileDocument) -> TileDocument) -> Result<TileFile> {
    decode(path, GlbFile::open(path)?, wanted)
}

fn decode(path: &Path, mut file: GlbFile, wanted: impl FnOnce(TileDocument) -> TileDocument) -> Result<TileFile> {
    let document = wanted(read_document(path, &file)?);
    let binary = file.binary(path)?;
    let mut decoder = Decoder { document: &document, binary: &binary, used: 0 };
    decoder.tile().map_err(|what| Error::input(path, format!("not a tile of this program: {what}")))
}

/// Returns the number of bytes that the parts of the GLB file at `path` take in memory, at most, according to its description.
pub fn held_bytes(path: &Path) -> Result<u64> {
    let file = GlbFile::open(path)?;
    let size = |elements: &Elements| elements.count.saturating_mul(if elements.shape == Type::Scalar { 4 } else { 12 });
    let said = read_document(path, &file)?.elements.iter().map(size).fold(0, u64::saturating_add);
    Ok(said.min(file.binary_length.saturating_mul(MOST_EXPANSION)))
}

/// Reads the georeference alone of the GLB file at `path`.
pub fn read_extras(path: &Path) -> Result<Extras> {
    let mut document = read_document(path, &GlbFile::open(path)?)?;
    if document.scene < document.scenes.len() {
        return Ok(document.scenes.swap_remove(document.scene).extras);
    }
    Err(Error::input(path, "not a tile of this program: there is no scene"))
}

fn read_document(path: &Path, file: &GlbFile) -> Result<TileDocument> {
    let document = file.document(path)?;
    let not_ours = |what| Error::input(path, format!("its JSON chunk is not one of this program: {what}"));
    TileDocument::new(&document).map_err(not_ours)
}

/// The parts of a document that decoding a tile needs. Any index may be out of range.
struct TileDocument {
    scene: usize,
    scenes: Vec<TileScene>,
    nodes: Vec<PlacedMesh>,
    meshes: Vec<Vec<Surface>>,
    elements: Vec<Elements>,
    views: Vec<StrideView>,
}

struct TileScene {
    extras: Extras,
    nodes: Vec<usize>,
}

/// A mesh, and where a node puts it.
struct PlacedMesh {
    mesh: usize,
    translation: [f64; 3],
    scale: [f64; 3],
}

/// The accessors of a primitive.
#[derive(Clone, Copy)]
struct Surface {
    positions: usize,
    normals: Option<usize>,
    colors: Option<usize>,
    classification: Option<usize>,
    intensity: Option<usize>,
    indices: usize,
}

/// The elements that an accessor describes.
struct Elements {
    view: usize,
    component: ComponentType,
    shape: Type,
    count: u64,
}

/// A buffer view, and the bytes from one of its elements to the next if it says them.
#[derive(Clone, Copy)]
struct StrideView {
    stored: StoredView,
    stride: Option<usize>,
}

impl TileDocument {
    fn new(document: &RawDocument) -> Decoded<TileDocument> {
        Ok(TileDocument {
            scene: document.scene,
            scenes: document.scenes().map(|scene| TileScene::new(&scene?)).collect::<Decoded<_>>()?,
            nodes: document.nodes().map(|node| PlacedMesh::new(&node?)).collect::<Decoded<_>>()?,
            meshes: document
                .meshes()
                .map(|mesh| mesh?.primitives.iter().map(Surface::new).collect())
                .collect::<Decoded<_>>()?,
            elements: document.accessors().map(|accessor| Elements::new(&accessor?)).collect::<Decoded<_>>()?,
            views: document.buffer_views().map(|view| StrideView::new(&view?)).collect::<Decoded<_>>()?,
        })
    }
}

impl TileDocument {
    /// Returns the document with positions and triangles alone.
    fn bare(mut self) -> TileDocument {
        let bare = |&Surface { positions, indices, .. }: &Surface| Surface {
            positions,
            normals: None,
            colors: None,
            classification: None,
            intensity: None,
            indices,
        };
        self.meshes.iter_mut().flatten().for_each(|surface| *surface = bare(surface));
        self
    }
}

impl TileScene {
    fn new(scene: &Scene) -> Decoded<TileScene> {
        let extras = scene.extras.as_ref().ok_or("a scene has no extras")?;
        let extras = serde_json::from_str(extras.get()).map_err(|e| format!("the extras of a scene: {e}"))?;
        Ok(TileScene { extras, nodes: scene.nodes.iter().map(|node| node.value()).collect() })
    }
}

impl PlacedMesh {
    fn new(node: &Node) -> Decoded<PlacedMesh> {
        let mesh = node.mesh.ok_or("a node has no mesh")?.value();
        let [translation, scale] = [node.translation.unwrap_or_default(), node.scale.unwrap_or([1.0; 3])];
        Ok(PlacedMesh { mesh, translation: translation.map(f64::from), scale: scale.map(f64::from) })
    }
}

impl Surface {
    fn new(primitive: &Primitive) -> Decoded<Surface> {
        let attribute = |semantic| primitive.attributes.get(&Valid(semantic)).map(Index::value);
        Ok(Surface {
            positions: attribute(Semantic::Positions).ok_or("a primitive has no positions")?,
            normals: attribute(Semantic::Normals),
            colors: attribute(Semantic::Colors(0)),
            classification: attribute(metadata::classification()),
            intensity: attribute(metadata::intensity()),
            indices: primitive.indices.ok_or("a primitive has no indices")?.value(),
        })
    }
}

impl Elements {
    fn new(accessor: &Accessor) -> Decoded<Elements> {
        let (Valid(component), Valid(shape)) = (accessor.component_type, accessor.type_) else {
            return Err("an accessor's type is not one of glTF's".into());
        };
        let view = accessor.buffer_view.ok_or("an accessor has no buffer view")?.value();
        Ok(Elements { view, component: component.0, shape, count: accessor.count.0 })
    }
}

impl StrideView {
    fn new(view: &View) -> Decoded<StrideView> {
        Ok(StrideView { stored: StoredView::of(view)?, stride: view.byte_stride.map(|stride| stride.0) })
    }
}

struct Decoder<'b> {
    document: &'b TileDocument,
    binary: &'b [u8],
    /// Bytes decoded so far. A limit keeps data that are used again and again from growing without bound.
    used: usize,
}

impl<'b> Decoder<'b> {
    fn tile(&mut self) -> Decoded<TileFile> {
        let scene = item(&self.document.scenes, self.document.scene, "scene")?;
        let parts = scene.nodes.iter().map(|&node| self.part(node)).collect::<Decoded<_>>()?;
        Ok(TileFile { extras: scene.extras.clone(), parts })
    }

    fn part(&mut self, node: usize) -> Decoded<TilePart> {
        let node = item(&self.document.nodes, node, "node")?;
        let mesh = item(&self.document.meshes, node.mesh, "mesh")?;
        let [surface] = mesh[..] else {
            return Err(format!("mesh {} does not have one primitive", node.mesh));
        };
        let positions = self.positions(surface.positions)?;
        let same_count = |count: usize, name: &str| match count == positions.len() {
            true => Ok(()),
            false => Err(format!("{} positions, but {count} {name}", positions.len())),
        };
        let normals = surface.normals.map(|n| self.normals(n)).transpose()?;
        let colors = surface.colors.map(|c| self.colors(c)).transpose()?;
        normals.as_ref().map_or(Ok(()), |n| same_count(n.count(), "normals"))?;
        colors.as_ref().map_or(Ok(()), |c| same_count(c.len(), "colours"))?;
        let attributes = self.attributes(&surface)?;
        attributes.classification.as_ref().map_or(Ok(()), |c| same_count(c.len(), "classes"))?;
        attributes.intensity.as_ref().map_or(Ok(()), |i| same_count(i.len(), "intensities"))?;
        let triangles = self.triangles(surface.indices, positions.len())?;
        let PlacedMesh { translation, scale, .. } = *node;
        Ok(TilePart { translation, scale, positions, normals, colors, attributes, triangles })
    }

    fn positions(&mut self, accessor: usize) -> Decoded<Vec<[f32; 3]>> {
        if self.component(accessor)? == ComponentType::F32 {
            let positions: Vec<[f32; 3]> = self.elements(accessor, ComponentType::F32, Type::Vec3)?;
            return match positions.as_flattened().iter().all(|v| v.is_finite()) {
                true => Ok(positions),
                false => Err("a position is not a finite number".into()),
            };
        }
        let short: Vec<[u16; 4]> = self.elements(accessor, ComponentType::U16, Type::Vec3)?;
        Ok(short.into_iter().map(|[x, y, z, _]| [x, y, z].map(f32::from)).collect())
    }

    fn normals(&mut self, accessor: usize) -> Decoded<StoredNormals> {
        let element = item(&self.document.elements, accessor, "accessor")?;
        let filter = item(&self.document.views, element.view, "buffer view")?.stored.filter();
        let (bytes, shorts) = (ComponentType::I8, ComponentType::I16);
        Ok(match (element.component, filter) {
            (ComponentType::I8, Some(PackedFilter::Octahedral)) => {
                StoredNormals::OctahedralBytes(self.unfiltered(accessor, bytes, Type::Vec3)?)
            }
            (ComponentType::I16, Some(PackedFilter::Octahedral)) => {
                StoredNormals::OctahedralShorts(self.unfiltered(accessor, shorts, Type::Vec3)?)
            }
            (ComponentType::I8, _) => StoredNormals::Bytes(self.elements(accessor, bytes, Type::Vec3)?),
            (ComponentType::I16, _) => StoredNormals::Shorts(self.elements(accessor, shorts, Type::Vec3)?),
            _ => StoredNormals::Single(self.elements(accessor, ComponentType::F32, Type::Vec3)?),
        })
    }

    fn colors(&mut self, accessor: usize) -> Decoded<Vec<[u16; 4]>> {
        if self.component(accessor)? == ComponentType::U16 {
            return self.elements(accessor, ComponentType::U16, Type::Vec4);
        }
        let bytes: Vec<[u8; 4]> = self.elements(accessor, ComponentType::U8, Type::Vec4)?;
        Ok(bytes.into_iter().map(|c| c.map(|v| u16::from(v) * 257)).collect())
    }

    fn attributes(&mut self, surface: &Surface) -> Decoded<PointAttributes> {
        let mut attributes = PointAttributes::default();
        if let Some(accessor) = surface.classification {
            let padded: Vec<[u8; 4]> = self.elements(accessor, ComponentType::U8, Type::Scalar)?;
            attributes.classification = Some(padded.into_iter().map(|[class, ..]| class).collect());
        }
        if let Some(accessor) = surface.intensity {
            let padded: Vec<[u16; 2]> = self.elements(accessor, ComponentType::U16, Type::Scalar)?;
            attributes.intensity = Some(padded.into_iter().map(|[intensity, _]| intensity).collect());
        }
        Ok(attributes)
    }

    fn component(&self, accessor: usize) -> Decoded<ComponentType> {
        Ok(item(&self.document.elements, accessor, "accessor")?.component)
    }

    fn triangles(&mut self, indices: usize, vertices: usize) -> Decoded<Vec<[u32; 3]>> {
        let accessor = item(&self.document.elements, indices, "accessor")?;
        if accessor.count % 3 != 0 {
            return Err(format!("{} indices are not whole triangles", accessor.count));
        }
        let triangles = match item(&self.document.views, accessor.view, "buffer view")?.stored.packed_triangles() {
            Some(_) => self.packed_triangles(indices)?,
            None if accessor.component == ComponentType::U16 => {
                let short: Vec<u16> = self.elements(indices, ComponentType::U16, Type::Scalar)?;
                short.chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect()
            }
            None => {
                let corners: Vec<u32> = self.elements(indices, ComponentType::U32, Type::Scalar)?;
                corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
            }
        };
        let greatest = greatest_of(triangles.as_flattened());
        match greatest as usize >= vertices && !triangles.is_empty() {
            true => Err(format!("index {greatest} of {vertices} vertices")),
            false => Ok(triangles),
        }
    }

    /// Returns triangles that the index codec has packed.
    fn packed_triangles(&mut self, indices: usize) -> Decoded<Vec<[u32; 3]>> {
        let accessor = item(&self.document.elements, indices, "accessor")?;
        let StrideView { stored: view, stride } = *item(&self.document.views, accessor.view, "buffer view")?;
        let size = accessor.component.size();
        let is_index = matches!(accessor.component, ComponentType::U16 | ComponentType::U32)
            && accessor.shape == Type::Scalar
            && stride.is_none_or(|stride| stride == size);
        let packed = view
            .packed_triangles()
            .filter(|packed| is_index && packed.byte_stride == size as u64 && packed.filter.is_none());
        let packed = packed.ok_or_else(|| format!("accessor {indices} does not hold packed indices"))?;
        let mut triangles = packed.unpack_triangles(self.stored(&view)?)?;
        if accessor.count > 3 * triangles.len() as u64 {
            return Err(format!("accessor {indices} goes past the end of the data"));
        }
        triangles.truncate(accessor.count as usize / 3);
        // Viewers cut numbers that are too large for 16 bits.
        let is_short = accessor.component == ComponentType::U16;
        match is_short && greatest_of(triangles.as_flattened()) > u32::from(u16::MAX) {
            true => Err(format!("accessor {indices} has indices of more than 16 bits")),
            false => Ok(triangles),
        }
    }

    /// Returns the elements of an accessor of this type, tightly packed.
    fn elements<T: AnyBitPattern + NoUninit>(
        &mut self,
        accessor: usize,
        component: ComponentType,
        shape: Type,
    ) -> Decoded<Vec<T>> {
        self.unpacked(accessor, component, shape, |view, stored| view.unpack(stored))
    }

    /// Returns the elements of an accessor of this type, tightly packed, as they are before the filter.
    fn unfiltered<T: AnyBitPattern + NoUninit>(
        &mut self,
        accessor: usize,
        component: ComponentType,
        shape: Type,
    ) -> Decoded<Vec<T>> {
        self.unpacked(accessor, component, shape, |view, stored| view.unpack_unfiltered(stored))
    }

    fn unpacked<T: AnyBitPattern + NoUninit>(
        &mut self,
        accessor: usize,
        component: ComponentType,
        shape: Type,
        unpack: impl for<'s> Fn(&StoredView, &'s [u8]) -> Decoded<Cow<'s, [u8]>>,
    ) -> Decoded<Vec<T>> {
        let elements = item(&self.document.elements, accessor, "accessor")?;
        if elements.component != component || elements.shape != shape {
            return Err(format!(
                "accessor {accessor} holds {:?} of {:?}, where {shape:?} of {component:?} was expected",
                elements.shape, elements.component
            ));
        }
        let view = item(&self.document.views, elements.view, "buffer view")?;
        // Elements without a stride follow each other without padding.
        if view.stride.unwrap_or(component.size() * shape.multiplicity()) != size_of::<T>() {
            return Err(format!("accessor {accessor} is not {} bytes an element", size_of::<T>()));
        }
        if view.stored.packed_stride().is_some_and(|stride| stride != size_of::<T>() as u64) {
            return Err(format!("accessor {accessor} is packed as elements of another size"));
        }
        let bytes = unpack(&view.stored, self.stored(&view.stored)?)?;
        let length = elements.count.checked_mul(size_of::<T>() as u64).and_then(|length| usize::try_from(length).ok());
        let bytes = length.and_then(|length| bytes.get(..length));
        Ok(pod_collect_to_vec(bytes.ok_or_else(|| format!("accessor {accessor} goes past the end of the data"))?))
    }

    /// Returns the bytes of a view in the file.
    fn stored(&mut self, view: &StoredView) -> Decoded<&'b [u8]> {
        let stored = view.stored(self.binary)?;
        self.used += stored.len();
        if self.used > self.binary.len() {
            return Err("the same data are used more than once".into());
        }
        Ok(stored)
    }
}

/// Returns the greatest of the numbers, or 0 without any.
#[multiversion(targets("x86_64+avx2"))]
fn greatest_of(numbers: &[u32]) -> u32 {
    numbers.iter().fold(0, |greatest, &number| greatest.max(number))
}

fn item<'a, T>(items: &'a [T], index: usize, name: &str) -> Decoded<&'a T> {
    items.get(index).ok_or_else(|| format!("there is no {name} {index}"))
}
