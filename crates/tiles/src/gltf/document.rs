//! Builds the glTF document of a tile, and the bytes that it describes.

use bytemuck::{Pod, cast_slice};
use gltf::json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Buffer, Stride, Target, View};
use gltf::json::mesh::{Mesh, Primitive, Semantic};
use gltf::json::scene::{Node, Scene};
use gltf::json::validation::Checked::{self, Valid};
use gltf::json::validation::USize64;
use gltf::json::{Asset, Index, Root};
use multiversion::multiversion;
use serde_json::json;

use crate::attributes::{AttributeChoice, PointAttributes};
use crate::color::LinearRgb;
use crate::compression::Compression;
use crate::frame::Frame;
use crate::gltf::element_type::ElementType;
use crate::gltf::encoding::{
    EXPONENTIAL_REACH, color_bytes, exponential, long_octahedron, needs_long_normals, normal_bytes,
    normal_long_octahedral, normal_octahedral, normal_shorts,
};
use crate::gltf::index_codec::encode_triangles;
use crate::gltf::meshopt::{PackedFilter, PackedMode, PackedView, fallback_buffer};
use crate::gltf::metadata;
use crate::gltf::metadata::METADATA;
use crate::gltf::schema::{GENERATOR, MESHOPT, QUANTIZATION, to_text};
use crate::gltf::split_nodes::SplitNode;
use crate::gltf::vertex_codec::encode_vertices;
use crate::gltf::vertex_order::order_vertices;
use delaunay::mesh::triangle_order::TriangleSorter;
use sys::{Error, Result};

/// The buffer of the binary chunk.
const STORED: u32 = 0;
/// The buffer of the unpacked data, which no file holds.
const UNPACKED: u32 = 1;

/// What a vertex attribute is, and the accessor that has its values.
type VertexAttribute = (Checked<Semantic>, Index<Accessor>);

/// Sort the triangles of plain tiles. They keep their memory from tile to tile.
#[derive(Debug, Default)]
pub(crate) struct TriangleSorters {
    /// For tiles whose indices take two bytes.
    short: TriangleSorter<u16>,
    /// For those whose indices take four.
    long: TriangleSorter<u32>,
}

/// A document and its binary chunk while they are put together.
pub(crate) struct DocumentBuilder<'a> {
    frame: &'a Frame,
    compression: Compression,
    root: Root,
    colored: bool,
    /// What vertices carry of their points.
    attributes: AttributeChoice,
    /// The binary chunk; its length is a multiple of 4.
    binary: Vec<u8>,
    /// The length of the buffer of the unpacked data in bytes, a multiple of 4.
    unpacked: u64,
}

impl<'a> DocumentBuilder<'a> {
    /// Returns a builder without parts. It takes over the memory of `binary`, not its content.
    pub(crate) fn new(frame: &'a Frame, compression: Compression, mut binary: Vec<u8>) -> DocumentBuilder<'a> {
        binary.clear();
        let attributes = AttributeChoice::default();
        DocumentBuilder { frame, compression, root: Root::default(), colored: false, attributes, binary, unpacked: 0 }
    }

    /// Appends a node, its mesh and the data of both.
    pub(crate) fn add_part(&mut self, part: &SplitNode, sorters: &mut TriangleSorters) -> Result<()> {
        let tile = &*part.tile;
        let vertices = tile.positions.len();
        // A plain tile has its triangles in ascending order, a packed one in that of `order_vertices`. Either depends on the mesh alone, so
        // a tile is the same with every backend.
        let ordered = match self.compression {
            Compression::None => None,
            _ => Some(order_vertices(vertices, &tile.triangles)),
        };
        // Both orders are those of planar meshes, in which no directed edge has two triangles. Here it shows.
        if ordered.as_ref().is_some_and(|(triangles, _)| triangles.len() != tile.triangles.len()) {
            return Err(Error::Broken("the triangles of a tile are not a planar mesh".into()));
        }
        let order = ordered.as_ref().map(|(_, order)| &order[..]);
        let mut attributes = vec![(Valid(Semantic::Positions), self.add_positions(part, order)?)];
        if let Some(normals) = &tile.normals {
            attributes.push((Valid(Semantic::Normals), self.add_normals(normals, order)?));
        }
        if let Some(colors) = &tile.colors {
            attributes.push((Valid(Semantic::Colors(0)), self.add_colors(colors, order)?));
            self.colored = true;
        }
        self.attributes = tile.attributes.choice();
        attributes.extend(self.add_point_attributes(&tile.attributes, order)?);
        let indices = match &ordered {
            Some((triangles, _)) => self.add_triangles(triangles, vertices),
            None => self.add_ascending(&tile.triangles, vertices, sorters),
        };
        let primitive = Primitive {
            attributes: attributes.into_iter().collect(),
            indices: Some(indices),
            material: Some(Index::new(0)),
            extensions: (!self.attributes.is_none()).then(metadata::of_primitive),
            extras: None,
            mode: Default::default(),
            targets: None,
        };
        let primitives = vec![primitive];
        let mesh = self.root.push(Mesh { primitives, extensions: None, extras: None, name: None, weights: None });
        // Both are exact in single precision: translations by the frame's choice, steps because they are powers of two.
        let translation = Some(self.frame.metres(part.origin).map(|v| v as f32));
        let scale = (self.compression != Compression::None).then(|| self.frame.step().map(|v| v as f32));
        self.root.push(Node { mesh: Some(mesh), translation, scale, ..Node::default() });
        Ok(())
    }

    fn add_positions(&mut self, part: &SplitNode, order: Option<&[u32]>) -> Result<Index<Accessor>> {
        let frame = self.frame;
        match &part.bent {
            Some(places) => self.add_places(places, order, part, |steps| steps),
            None => self.add_places(&part.tile.positions, order, part, |point| frame.flat_steps(point)),
        }
    }

    /// Appends the positions of the vertices of `part`, whose glTF coordinates in steps are those of `places`.
    fn add_places<T: Copy>(
        &mut self,
        places: &[T],
        order: Option<&[u32]>,
        part: &SplitNode,
        steps: impl Fn(T) -> [f64; 3],
    ) -> Result<Index<Accessor>> {
        let (frame, origin) = (self.frame, part.origin);
        let extent = part.extent.map(|end| [0, 1, 2].map(|k| end[k] - origin[k]));
        if self.compression == Compression::None {
            let local = |place| frame.local(steps(place), origin);
            let ends = extent.map(|end| frame.metres(end).map(|v| v as f32));
            return self.add_attribute(places, order, local, ElementType::position(ends));
        }
        let local = |place| {
            let steps = steps(place);
            [0, 1, 2].map(|k| steps[k] - origin[k])
        };
        let element = ElementType::position(extent.map(|end| end.map(|v| v as f32)));
        if !part.short {
            let is_near = extent.as_flattened().iter().all(|v| v.abs() < EXPONENTIAL_REACH);
            if self.compression == Compression::Meshopt && is_near {
                let convert = |place| local(place).map(exponential);
                return self.add_attribute(places, order, convert, element.filtered(PackedFilter::Exponential));
            }
            let convert = |place| local(place).map(|v| v as f32);
            return self.add_attribute(places, order, convert, element);
        }
        let convert = |place| {
            let [x, y, z] = local(place).map(|v| v as u16);
            [x, y, z, 0]
        };
        self.add_attribute(places, order, convert, ElementType { component: ComponentType::U16, ..element })
    }

    fn add_normals(&mut self, normals: &[[f32; 3]], order: Option<&[u32]>) -> Result<Index<Accessor>> {
        let up = |[x, y, z]: [f32; 3]| [x, z, 0.0 - y];
        if self.compression == Compression::None {
            return self.add_attribute(normals, order, up, ElementType::new(ComponentType::F32, Type::Vec3));
        }
        let anisotropy = self.frame.anisotropy();
        let is_packed = self.compression == Compression::Meshopt;
        if !needs_long_normals(anisotropy) {
            let element = ElementType::normalized(ComponentType::I8, Type::Vec3);
            if !is_packed {
                return self.add_attribute(normals, order, |n| normal_bytes(up(n), anisotropy), element);
            }
            let convert = |n| normal_octahedral(up(n), anisotropy);
            return self.add_attribute(normals, order, convert, element.filtered(PackedFilter::Octahedral));
        }
        let element = ElementType::normalized(ComponentType::I16, Type::Vec3);
        match long_octahedron(anisotropy).filter(|_| is_packed) {
            Some(one) => {
                let convert = |n| normal_long_octahedral(up(n), anisotropy, one);
                self.add_attribute(normals, order, convert, element.filtered(PackedFilter::Octahedral))
            }
            None => self.add_attribute(normals, order, |n| normal_shorts(up(n), anisotropy), element),
        }
    }

    fn add_colors(&mut self, colors: &[LinearRgb], order: Option<&[u32]>) -> Result<Index<Accessor>> {
        if self.compression == Compression::None {
            let convert = |[r, g, b]: LinearRgb| [r, g, b, u16::MAX];
            return self.add_attribute(colors, order, convert, ElementType::normalized(ComponentType::U16, Type::Vec4));
        }
        self.add_attribute(colors, order, color_bytes, ElementType::normalized(ComponentType::U8, Type::Vec4))
    }

    /// Appends what the vertices carry of their points. Each element takes four bytes: glTF wants vertex attributes aligned to them.
    fn add_point_attributes(&mut self, all: &PointAttributes, order: Option<&[u32]>) -> Result<Vec<VertexAttribute>> {
        let mut added = Vec::new();
        if let Some(classes) = &all.classification {
            let element = ElementType::new(ComponentType::U8, Type::Scalar);
            let accessor = self.add_attribute(classes, order, |class| [class, 0, 0, 0], element)?;
            added.push((Valid(metadata::classification()), accessor));
        }
        if let Some(intensities) = &all.intensity {
            let element = ElementType::new(ComponentType::U16, Type::Scalar);
            let accessor = self.add_attribute(intensities, order, |intensity| [intensity, 0], element)?;
            added.push((Valid(metadata::intensity()), accessor));
        }
        Ok(added)
    }

    /// Appends an accessor and a buffer view of the vertices' `values`, converted, in this `order` of vertices if there is one.
    fn add_attribute<T: Copy, B: Pod>(
        &mut self,
        values: &[T],
        order: Option<&[u32]>,
        convert: impl Fn(T) -> B,
        element: ElementType,
    ) -> Result<Index<Accessor>> {
        let count = order.map_or(values.len(), <[u32]>::len);
        let mut view = if self.compression == Compression::Meshopt {
            let start = self.binary.len();
            encode_vertices(values, order, convert, &mut self.binary);
            self.add_packed(start, PackedMode::Attributes, element.filter, size_of::<B>(), count)
        } else {
            match order {
                Some(order) => self.add_plain(order, |v| convert(values[v as usize])),
                None => self.add_plain(values, convert),
            }
        };
        view.target = Some(Valid(Target::ArrayBuffer));
        let is_padded = size_of::<B>() != element.size();
        view.byte_stride = (is_padded || self.compression != Compression::None).then_some(Stride(size_of::<B>()));
        Ok(self.add_accessor(view, count, element))
    }

    fn add_triangles(&mut self, triangles: &[[u32; 3]], vertices: usize) -> Index<Accessor> {
        let corners = triangles.as_flattened();
        let component = index_type(vertices);
        let view = if self.compression == Compression::Meshopt {
            let start = self.binary.len();
            encode_triangles(triangles, vertices, &mut self.binary);
            self.add_packed(start, PackedMode::Triangles, None, component.size(), corners.len())
        } else if component == ComponentType::U16 {
            self.add_plain(corners, |v| v as u16)
        } else {
            self.add_plain(corners, |v| v)
        };
        self.add_indices(view, corners.len(), component)
    }

    /// Appends the triangles in ascending order.
    fn add_ascending(
        &mut self,
        triangles: &[[u32; 3]],
        vertices: usize,
        sorters: &mut TriangleSorters,
    ) -> Index<Accessor> {
        let component = index_type(vertices);
        let view = if component == ComponentType::U16 {
            self.add_plain(sorters.short.ascending(vertices, triangles), |corners| corners)
        } else {
            self.add_plain(sorters.long.ascending(vertices, triangles), |corners| corners)
        };
        self.add_indices(view, 3 * triangles.len(), component)
    }

    fn add_indices(&mut self, view: View, count: usize, component: ComponentType) -> Index<Accessor> {
        let view = View { target: Some(Valid(Target::ElementArrayBuffer)), ..view };
        self.add_accessor(view, count, ElementType::new(component, Type::Scalar))
    }

    /// Appends an accessor of all `count` elements of `view`, and the view.
    fn add_accessor(&mut self, view: View, count: usize, element: ElementType) -> Index<Accessor> {
        let view = self.root.push(view);
        let [min, max] = [0, 1].map(|end| element.bounds.map(|bounds| json!(bounds[end])));
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(element.component)),
            type_: Valid(element.shape),
            normalized: element.normalized,
            min,
            max,
            extensions: None,
            extras: None,
            name: None,
            sparse: None,
        })
    }

    /// Appends the converted `values` to the binary chunk, and returns their view.
    fn add_plain<T: Copy, B: Pod>(&mut self, values: &[T], convert: impl Fn(T) -> B) -> View {
        let start = self.binary.len();
        append_converted(&mut self.binary, values, convert);
        self.pad();
        view(STORED, start as u64, (values.len() * size_of::<B>()) as u64)
    }

    /// Returns the view of the unpacked data of `count` elements of `size` bytes each, whose packed data lie in the binary chunk from
    /// `start` on.
    fn add_packed(
        &mut self,
        start: usize,
        mode: PackedMode,
        filter: Option<PackedFilter>,
        size: usize,
        count: usize,
    ) -> View {
        let (byte_offset, byte_length) = (start as u64, (self.binary.len() - start) as u64);
        self.pad();
        let (buffer, byte_stride, count) = (STORED as usize, size as u64, count as u64);
        let packed = PackedView { buffer, byte_offset, byte_length, byte_stride, count, mode, filter };
        let length = count * byte_stride;
        let unpacked = self.unpacked;
        self.unpacked += length.next_multiple_of(4);
        View { extensions: Some(packed.to_extensions()), ..view(UNPACKED, unpacked, length) }
    }

    fn pad(&mut self) {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
    }

    /// Returns the JSON text and the binary chunk.
    pub(crate) fn finish(mut self, copyright: Option<&str>) -> Result<(Vec<u8>, Vec<u8>)> {
        let extras = serde_json::value::to_raw_value(self.frame.extras())
            .map_err(|e| Error::Broken(format!("the georeference of a tile cannot be written: {e}")))?;
        let nodes = (0..self.root.nodes.len() as u32).map(Index::new).collect();
        let scene = self.root.push(Scene { nodes, extras: Some(extras), extensions: None, name: None });
        self.root.scene = Some(scene);
        self.root.asset = asset(copyright);
        if !self.root.nodes.is_empty() {
            self.add_buffers();
        }
        let mut text = to_text(&self.root, self.colored)?;
        if self.root.extensions.is_some() {
            metadata::align_text(&mut text);
        }
        Ok((text, self.binary))
    }

    fn add_buffers(&mut self) {
        self.root.extensions = metadata::of_document(self.attributes);
        if self.root.extensions.is_some() {
            self.binary.resize(self.binary.len().next_multiple_of(metadata::ALIGNMENT), 0);
        }
        self.root.push(buffer(self.binary.len() as u64));
        let extensions: &[&str] = match self.compression {
            Compression::None => &[],
            Compression::Quantized => &[QUANTIZATION],
            Compression::Meshopt => {
                self.root.push(Buffer { extensions: Some(fallback_buffer()), ..buffer(self.unpacked) });
                &[QUANTIZATION, MESHOPT]
            }
        };
        self.root.extensions_required = extensions.iter().map(|name| name.to_string()).collect();
        self.root.extensions_used = self.root.extensions_required.clone();
        if self.root.extensions.is_some() {
            // Viewers that do not know it show the terrain all the same.
            self.root.extensions_used.push(METADATA.into());
        }
    }
}

/// Returns the type of the numbers of so many vertices. Index 65535 would restart a primitive.
fn index_type(vertices: usize) -> ComponentType {
    if vertices <= u16::MAX as usize { ComponentType::U16 } else { ComponentType::U32 }
}

/// Returns the version of glTF, the name of this program, and whose the data are.
pub(crate) fn asset(copyright: Option<&str>) -> Asset {
    Asset { generator: Some(GENERATOR.into()), copyright: copyright.map(str::to_owned), ..Asset::default() }
}

/// Returns a buffer of `length` bytes.
pub(crate) fn buffer(length: u64) -> Buffer {
    Buffer { byte_length: USize64(length), name: None, uri: None, extensions: None, extras: None }
}

fn view(buffer: u32, start: u64, length: u64) -> View {
    View {
        buffer: Index::new(buffer),
        byte_length: USize64(length),
        byte_offset: Some(USize64(start)),
        byte_stride: None,
        name: None,
        target: None,
        extensions: None,
        extras: None,
    }
}

/// Appends the converted `values`, in pieces that stay in the cache.
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
