//! Joins tiles that were read back from their files into one mesh on the lattice.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use multiversion::multiversion;

use crate::attributes::{AttributeChoice, PointAttributes};
use crate::frame::Frame;
use crate::gltf::read::{TileFile, TilePart};
use crate::gltf::stored_normals::StoredNormals;
use crate::lod::boundary::on_boundary;
use crate::lod::filling::CoarseMesh;
use crate::lod::rim::ShownMesh;
use crate::lod::terrain::{NearBoundary, Terrain};
use crate::tile::Tile;

/// A vertex is at this scene position in metres, where the job's lattice has no point.
#[derive(Debug, thiserror::Error)]
#[error("the vertex at {0:?} is not on the job's lattice")]
pub struct VertexOffLattice([f64; 3]);

/// The number of the vertex at a lattice point.
type VertexAt = HashMap<[i32; 3], u32, BuildHasherDefault<PointHasher>>;

/// The mesh of several tiles. What vertices carry besides their positions stays with the tiles until it is asked for: coarser tiles
/// keep few of the vertices.
pub struct Joined {
    /// The lattice integers x, y, z of every vertex.
    positions: Vec<[i32; 3]>,
    /// The corners as indices of vertices, counterclockwise seen from above.
    triangles: Vec<[u32; 3]>,
    /// Whether a vertex is on the boundary of a mesh of the tiles. Only such vertices can be on the boundary of the whole.
    on_border: Vec<bool>,
    /// The triangles that have such a vertex.
    near_border: Vec<u32>,
    /// Where the vertices come from, ascending.
    runs: Vec<Run>,
    /// The meshes of the tiles, without positions and triangles.
    parts: Vec<TilePart>,
}

/// Vertices that follow each other in a part as they do in the whole.
#[derive(Clone, Copy)]
struct Run {
    /// The number of the first in the whole. The run ends where the next one begins.
    start: u32,
    /// The part.
    part: u32,
    /// The number of the first in the part.
    first: u32,
}

/// Marks the number of a vertex on the boundary of a part. There are far fewer vertices.
const ON_BORDER: u32 = 1 << 31;

/// Tiles that are joined one after the other, so that no two of them are in memory besides what is joined.
pub struct Joining<'a> {
    frame: &'a Frame,
    joined: Joined,
    vertex_at: VertexAt,
}

impl<'a> Joining<'a> {
    /// Begins to join tiles of the job of `frame`, with so many `vertices` all together.
    pub fn new(frame: &'a Frame, vertices: usize) -> Joining<'a> {
        let joined = Joined {
            positions: Vec::with_capacity(vertices),
            // A mesh has fewer than twice as many triangles as vertices.
            triangles: Vec::with_capacity(2 * vertices),
            on_border: Vec::with_capacity(vertices),
            near_border: Vec::new(),
            runs: Vec::new(),
            parts: Vec::new(),
        };
        Joining { frame, joined, vertex_at: VertexAt::default() }
    }

    /// Joins a tile. A vertex that it shares with an earlier one keeps the normal, the colour and the attributes of that one. Vertices
    /// are in the order of the tiles.
    ///
    /// # Errors
    /// [`VertexOffLattice`] if a vertex is not on the lattice.
    pub fn add(&mut self, file: TileFile) -> Result<(), VertexOffLattice> {
        for mut part in file.parts {
            let positions = std::mem::take(&mut part.positions);
            let points = self.frame.points(&positions, part.translation, part.scale).map_err(VertexOffLattice)?;
            drop(positions);
            self.add_part(&points, part);
        }
        Ok(())
    }

    /// Joins a mesh as [`Joining::add`] does.
    pub fn add_mesh(&mut self, tile: Tile) {
        // As a file has them: y is up.
        let normals = tile.normals.map(|all| all.into_iter().map(|[east, north, up]| [east, up, -north]).collect());
        let opaque = |[red, green, blue]: [u16; 3]| [red, green, blue, u16::MAX];
        let part = TilePart {
            translation: [0.0; 3],
            scale: [1.0; 3],
            positions: Vec::new(),
            normals: normals.map(StoredNormals::Single),
            colors: tile.colors.map(|all| all.into_iter().map(opaque).collect()),
            attributes: tile.attributes,
            triangles: tile.triangles,
        };
        self.add_part(&tile.positions, part);
    }

    /// Joins the mesh of a part whose vertices are at these lattice `points`.
    fn add_part(&mut self, points: &[[i32; 3]], mut part: TilePart) {
        let triangles = std::mem::take(&mut part.triangles);
        // Only vertices on a boundary can be in another part too.
        let on_border = on_boundary(points.len(), &triangles);
        let number = self.joined.parts.len() as u32;
        let numbers = self.joined.append(number, points, &on_border, &mut self.vertex_at);
        self.joined.append_triangles(&triangles, &numbers);
        self.joined.parts.push(part);
    }

    /// Returns the mesh of all tiles.
    pub fn finish(self) -> Joined {
        self.joined
    }
}

impl Joined {
    /// Appends the vertices of part `part` at these lattice points, but for those that are there already. Returns the number of each,
    /// with a mark if it is on the border of the part.
    fn append(&mut self, part: u32, points: &[[i32; 3]], on_border: &[bool], vertex_at: &mut VertexAt) -> Vec<u32> {
        let mut numbers = Vec::with_capacity(points.len());
        // Nearly all vertices are new, and many follow each other without one that is not.
        let mut new_from = 0;
        for v in (0..points.len()).filter(|&v| on_border[v]) {
            let next = (self.positions.len() + v - new_from) as u32;
            let number = *vertex_at.entry(points[v]).or_insert(next);
            if number != next {
                self.append_new(part, points, on_border, new_from..v, &mut numbers);
                numbers.push(number | ON_BORDER);
                new_from = v + 1;
            }
        }
        self.append_new(part, points, on_border, new_from..points.len(), &mut numbers);
        numbers
    }

    fn append_new(
        &mut self,
        part: u32,
        points: &[[i32; 3]],
        on_border: &[bool],
        vertices: Range<usize>,
        numbers: &mut Vec<u32>,
    ) {
        if vertices.is_empty() {
            return;
        }
        let start = self.positions.len() as u32;
        let on_border = &on_border[vertices.clone()];
        numbers.extend((start..).zip(on_border).map(|(number, on)| number | (u32::from(*on) * ON_BORDER)));
        self.runs.push(Run { start, part, first: vertices.start as u32 });
        self.positions.extend_from_slice(&points[vertices]);
        self.on_border.extend_from_slice(on_border);
    }

    /// Appends the triangles of a part, whose vertices have these `numbers`.
    fn append_triangles(&mut self, triangles: &[[u32; 3]], numbers: &[u32]) {
        let near_border = &mut self.near_border;
        let start = self.triangles.len() as u32;
        self.triangles.extend((start..).zip(triangles).map(|(at, triangle)| {
            let [a, b, c] = triangle.map(|v| numbers[v as usize]);
            if (a | b | c) & ON_BORDER != 0 {
                near_border.push(at);
            }
            [a, b, c].map(|v| v & !ON_BORDER)
        }));
    }

    /// Returns for each of these ascending `vertices` which of the parts has it, and its number there.
    fn origins(&self, vertices: &[u32]) -> Vec<[usize; 2]> {
        let mut run = 0;
        let origin = |&v: &u32| {
            while self.runs.get(run + 1).is_some_and(|next| next.start <= v) {
                run += 1;
            }
            let Run { start, part, first } = self.runs[run];
            [part, first + (v - start)].map(|at| at as usize)
        };
        vertices.iter().map(origin).collect()
    }

    /// Returns the whole mesh, to be simplified.
    #[inline]
    pub fn terrain(&self) -> Terrain<'_> {
        let near = NearBoundary { vertices: &self.on_border, triangles: &self.near_border };
        Terrain { positions: &self.positions, triangles: &self.triangles, may_be_on_boundary: Some(near) }
    }

    /// Returns the tiles of two meshes between some of the vertices: what viewers get, and the `working` one, which has all of its vertices.
    /// They have normals if all tiles have them, and likewise colours and attributes.
    pub fn tiles(&self, shown: ShownMesh, working: CoarseMesh) -> [Tile; 2] {
        let CoarseMesh { vertices, positions, triangles } = working;
        let working = self.dressed(Tile { positions, triangles, ..Tile::default() }, &vertices);
        let mut others = (0..).zip(&vertices);
        let numbers: Vec<u32> =
            shown.mesh.vertices.iter().filter_map(|v| others.find(|(_, other)| *other == v)).map(|(n, _)| n).collect();
        let (mesh, first) = (shown.mesh, numbers.len() as u32);
        let tops: Vec<u32> = shown.bottoms.iter().map(|bottom| bottom.0).collect();
        let all: Vec<u32> = numbers.iter().copied().chain(tops.iter().map(|&top| numbers[top as usize])).collect();
        let mut positions = mesh.positions;
        positions.extend(shown.bottoms.iter().map(|&(top, height)| {
            let [x, y, _] = working.positions[numbers[top as usize] as usize];
            [x, y, height]
        }));
        let mut triangles = mesh.triangles;
        for [start, end] in shown.skirts {
            let [from, to] = [start, end].map(|bottom| tops[bottom as usize]);
            triangles.extend([[first + start, first + end, to], [first + start, to, from]]);
        }
        [working.with_style_of(&all, positions, triangles), working]
    }

    /// Adds to a tile what these `vertices` carry, which are its own in their order.
    fn dressed(&self, tile: Tile, vertices: &[u32]) -> Tile {
        let origins = self.origins(vertices);
        let all_have = |has: fn(&TilePart) -> bool| self.parts.iter().all(has);
        let color = |&[part, v]: &[usize; 2]| {
            let [red, green, blue, _] = self.parts[part].colors.as_ref()?[v];
            Some([red, green, blue])
        };
        let mut attributes = PointAttributes::empty(AttributeChoice {
            classification: all_have(|part| part.attributes.classification.is_some()),
            intensity: all_have(|part| part.attributes.intensity.is_some()),
        });
        origins.iter().for_each(|&[part, v]| attributes.push_from(&self.parts[part].attributes, v));
        Tile {
            normals: self.normals(&origins),
            colors: all_have(|part| part.colors.is_some()).then(|| origins.iter().filter_map(color).collect()),
            attributes,
            ..tile
        }
    }

    /// Returns the unit normals of vertices by their ascending origins, if all tiles have normals.
    fn normals(&self, origins: &[[usize; 2]]) -> Option<Vec<[f32; 3]>> {
        let mut all =
            self.parts.iter().all(|part| part.normals.is_some()).then(|| Vec::with_capacity(origins.len()))?;
        for of_part in origins.chunk_by(|a, b| a[0] == b[0]) {
            let part = &self.parts[of_part[0][0]];
            let vertices: Vec<u32> = of_part.iter().map(|origin| origin[1] as u32).collect();
            append_unscaled(&part.normals.as_ref()?.pick(&vertices), part.scale, &mut all);
        }
        Some(all)
    }

    /// Returns the whole mesh as a tile.
    pub fn into_tile(mut self) -> Tile {
        let triangles = std::mem::take(&mut self.triangles);
        let (tile, vertices) = Tile::with_vertices(&self.positions, triangles);
        self.dressed(tile, &vertices)
    }
}

/// Appends the unit normals (x east, y north, z up) for the `normals` of a mesh that its node stretches by `scale`.
#[multiversion(targets("x86_64+avx2"))]
fn append_unscaled(normals: &[[f32; 3]], scale: [f64; 3], all: &mut Vec<[f32; 3]>) {
    all.extend(normals.iter().map(|normal| {
        let [x, up, z] = [0, 1, 2].map(|k| normal[k] as f64 / scale[k]);
        let length = (x * x + up * up + z * z).sqrt();
        if length > 0.0 { [x / length, -z / length, up / length].map(|v| v as f32) } else { [0.0, 0.0, 1.0] }
    }));
}

/// A multiplication: the points of a mesh need to be spread, not protected.
#[derive(Default)]
struct PointHasher(u64);

impl Hasher for PointHasher {
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
