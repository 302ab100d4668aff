//! The contract between steps: what each writes to the job's store for later ones, one type for each kind of record, and what the
//! steps are called in the journal.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::durable::journal;
use crate::durable::journal::StepKey;
use crate::durable::packing::{pack, unpack};
use crate::durable::store;
use crate::durable::store::RecordKey;
use crate::index::{NodeIndex, PartIndex, TileIndex};
use bytemuck::{Pod, Zeroable};
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::index::SiteIndex;
use points::Point;
use serde::{Deserialize, Serialize};
use sys::{Error, Result};
use tiles::lod::relief::Relief;
use tiles::normals::NormalSum;

/// The store of a job.
pub type Store = store::Store<StepRecord>;
/// A record of a job's store as the journal knows it.
pub type RecordRef = store::RecordRef<StepRecord>;
/// What has become of the records of a job's store since its journal was told.
pub type RecordChanges = store::RecordChanges<StepRecord>;
/// The journal of a job.
pub type Journal = journal::Journal<JobStep, StepRecord>;
/// A complete phase in it.
pub type JournalEntry = journal::JournalEntry<JobStep, StepRecord>;

/// A phase of a job, of a part of it, or of the nodes above the parts, as the journal of each names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum JobStep {
    /// Plans the job, and finds out how its scene follows the curve of the earth.
    Plan,
    /// Reads the inputs that a part is the first to need.
    Read,
    /// Selects the points of a part that are vertices, with all other parts.
    Select,
    /// Triangulates a part.
    Mesh,
    /// Writes tiles of a part. There is a line for those that are written at one time.
    Tiles,
    /// Merges at a node above the parts.
    Merge(NodeIndex),
    /// Merges at all nodes above the parts, and finds out how tiles look.
    Join,
    /// Makes some of the coarser tiles of a part, or of those above the parts, with `--update`.
    LevelTiles,
    /// Makes the coarser tiles of a part, or those above the parts.
    Levels,
    /// Writes the raster of heights.
    Raster,
    /// Writes the map tiles of heights, from the raster.
    MapTiles,
    /// Writes the mesh for CAD and other programs.
    Exports,
    /// Writes the contour lines.
    Contours,
    /// Writes the terrain tiles for globes.
    Terrain,
    /// Writes the inputs with the classes that the job has found.
    Classified,
    /// Writes what is beside the tiles, except the raster, the map tiles, the contour lines and the report.
    Publish,
    /// Writes the report: the job is complete.
    Report,
}

impl StepKey for JobStep {}

/// A kind of record, and the tile or tree node that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum StepRecord {
    /// [`Leaf`]
    Leaf(TileIndex),
    /// [`Frontier`](crate::merge_records::Frontier)
    Frontier(NodeIndex),
    /// [`PartialNormals`]
    PartialNormals(TileIndex),
    /// [`Seam`](crate::merge_records::Seam)
    Seam(NodeIndex),
    /// [`FinishedBorder`]
    FinishedBorder(TileIndex),
    /// The pixels of the preview that a tile covers.
    Pixels(TileIndex),
    /// The tree of a part and what it holds ([`Partition`](crate::partition::result::Partition)).
    Partition,
    /// The points by bucket that a reader has found.
    Read(PartIndex),
    /// The selected points by bucket.
    Selected,
    /// The corners of the long triangles on ground, with `max_error`.
    OnGround,
    /// The heights of the ground that the job has found.
    Ground,
    /// How many sites there are around every place.
    Spacing,
    /// [`LevelSummary`]
    Level(NodeIndex),
    /// The working mesh of a coarser tile: see `levels/level_mesh.rs`.
    LevelMesh(NodeIndex),
    /// [`TileSummary`] of an exact tile.
    Tile(TileIndex),
}

impl RecordKey for StepRecord {
    fn code(self) -> [u32; 2] {
        match self {
            StepRecord::Leaf(tile) => [1, tile.0],
            StepRecord::Frontier(node) => [2, node.0],
            StepRecord::PartialNormals(tile) => [3, tile.0],
            StepRecord::Seam(node) => [4, node.0],
            StepRecord::FinishedBorder(tile) => [5, tile.0],
            StepRecord::Pixels(tile) => [6, tile.0],
            StepRecord::Partition => [7, 0],
            StepRecord::Level(node) => [8, node.0],
            StepRecord::Tile(tile) => [9, tile.0],
            StepRecord::Read(part) => [10, part.0],
            StepRecord::Spacing => [11, 0],
            StepRecord::Selected => [12, 0],
            StepRecord::OnGround => [13, 0],
            StepRecord::Ground => [14, 0],
            StepRecord::LevelMesh(node) => [15, node.0],
        }
    }
}

/// A site on the border of a tile, as other tiles know it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct BorderVertex {
    /// The tile that owns the site.
    pub tile: TileIndex,
    /// The number of the site in that tile.
    pub site: SiteIndex,
    /// Lattice integers x, y, z.
    pub position: [i32; 3],
}

impl BorderVertex {
    /// Returns its x and y.
    pub fn plane(&self) -> Site {
        [self.position[0], self.position[1]]
    }
}

/// A triangle of a seam, counterclockwise.
pub type SeamTriangle = [BorderVertex; 3];

/// Returns the tile that a triangle of a seam belongs to: that of its first corner in the order of tiles.
pub fn owner(triangle: &SeamTriangle) -> TileIndex {
    triangle[0].tile.min(triangle[1].tile).min(triangle[2].tile)
}

/// The sites of a tile, in order, and the triangles that its leaf makes final.
#[derive(Debug, Default)]
pub struct Leaf {
    /// Lattice integers x, y, z of the sites.
    pub positions: Vec<[i32; 3]>,
    /// Their colours as read.
    pub rgb: Vec<[u16; 3]>,
    /// Their classes.
    pub class: Vec<u8>,
    /// Their intensities; empty if all are 0.
    pub intensity: Vec<u16>,
    /// The final triangles as numbers of sites, counterclockwise.
    pub triangles: Vec<[u32; 3]>,
}

impl Leaf {
    /// Writes the record of `tile`: its sites, which are `points`, and those of the `triangles` that are marked as final. Returns the number
    /// of these triangles.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(
        store: &Store,
        tile: TileIndex,
        points: &[Point],
        triangles: impl ExactSizeIterator<Item = ([u32; 3], bool)>,
    ) -> Result<u64> {
        let key = StepRecord::Leaf(tile);
        // These records are most of what a job stores, so they are packed.
        let (count, mut positions, mut attributes) = ([points.len() as u64], Vec::new(), Vec::new());
        pack(points, |point| point.corner().map(|value| value as u32), &mut positions);
        pack(points, |point| point.rgb.map(u32::from), &mut attributes);
        pack(points, |point| [point.class as u32], &mut attributes);
        if points.iter().any(|point| point.intensity != 0) {
            pack(points, |point| [point.intensity as u32], &mut attributes);
        }
        let (triangles, mut corners) = (marked(triangles), Vec::new());
        pack(&triangles, |&[a, b, c]| [a, b.wrapping_sub(a), c.wrapping_sub(a)], &mut corners);
        let (number, columns) = ([triangles.len() as u64], ColumnWriter::default().push(&count).push(&positions));
        columns.push(&attributes).push(&number).push(&corners).write(store, key)?;
        Ok(number[0])
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: TileIndex) -> Result<Leaf> {
        let mut columns = ColumnReader::open(store, StepRecord::Leaf(tile))?;
        let (count, positions) = Leaf::read_positions(&mut columns, tile)?;
        let attributes = columns.column::<u8>()?;
        let (mut rgb, mut class) = (Vec::with_capacity(count), Vec::with_capacity(with_room(count)));
        let rest = unpack(&attributes, count, |rgb| rgb.map(|value| value as u16), &mut rgb)
            .and_then(|rest| unpack(rest, count, |[class]| class as u8, &mut class))
            .ok_or_else(|| Leaf::damaged(tile))?;
        let mut intensity = Vec::new();
        if !rest.is_empty() {
            let rest = unpack(rest, count, |[intensity]| intensity as u16, &mut intensity);
            rest.filter(|rest| rest.is_empty()).ok_or_else(|| Leaf::damaged(tile))?;
        }
        Ok(Leaf { positions, rgb, class, intensity, triangles: Leaf::read_triangles(&mut columns, tile)? })
    }

    /// Reads the record of `tile` without colours, classes and intensities.
    ///
    /// # Errors
    /// As [`Leaf::load`].
    pub fn load_mesh(store: &Store, tile: TileIndex) -> Result<Leaf> {
        let mut columns = ColumnReader::open(store, StepRecord::Leaf(tile))?;
        let (_, positions) = Leaf::read_positions(&mut columns, tile)?;
        columns.skip_column::<u8>()?;
        Ok(Leaf { positions, triangles: Leaf::read_triangles(&mut columns, tile)?, ..Leaf::default() })
    }

    fn read_triangles(columns: &mut ColumnReader<StepRecord>, tile: TileIndex) -> Result<Vec<[u32; 3]>> {
        let count = columns.column::<u64>()?;
        let &[count] = &count[..] else { return Err(Leaf::damaged(tile)) };
        let packed = columns.column::<u8>()?;
        let mut triangles = Vec::with_capacity(with_room((count as usize).min(packed.len() * 256)));
        let join = |[a, b, c]: [u32; 3]| [a, a.wrapping_add(b), a.wrapping_add(c)];
        let rest = unpack(&packed, count as usize, join, &mut triangles);
        rest.map(|_| triangles).ok_or_else(|| Leaf::damaged(tile))
    }

    fn read_positions(columns: &mut ColumnReader<StepRecord>, tile: TileIndex) -> Result<(usize, Vec<[i32; 3]>)> {
        // Where the record was freed there are zeros, and so no number.
        let count = columns.column::<u64>()?;
        let &[count] = &count[..] else { return Err(Leaf::damaged(tile)) };
        let packed = columns.column::<u8>()?;
        let mut positions = Vec::with_capacity(with_room((count as usize).min(packed.len())));
        let rest = unpack(&packed, count as usize, |corner| corner.map(|value| value as i32), &mut positions);
        rest.map(|_| (count as usize, positions)).ok_or_else(|| Leaf::damaged(tile))
    }

    fn damaged(tile: TileIndex) -> Error {
        Error::Broken(format!("the leaf of tile {tile} in the store is damaged"))
    }

    /// Calls `visit` with the positions of the sites of `tile`, without reading the rest of its record.
    ///
    /// # Errors
    /// As [`Leaf::load`].
    pub fn visit_positions(store: &Store, tile: TileIndex, visit: impl FnMut(&[i32; 3])) -> Result<()> {
        let (_, positions) = Leaf::read_positions(&mut ColumnReader::open(store, StepRecord::Leaf(tile))?, tile)?;
        positions.iter().for_each(visit);
        Ok(())
    }
}

/// How many values are put together in the first-level cache before they go to a column.
const PIECE: usize = 64;

/// Returns the values that are marked. Each is written before its mark is looked at, so no branch depends on the mark.
fn marked<T: Pod>(values: impl ExactSizeIterator<Item = (T, bool)>) -> Vec<T> {
    let mut kept = Vec::with_capacity(values.len());
    let (mut piece, mut count) = ([T::zeroed(); PIECE], 0);
    for (value, is_marked) in values {
        piece[count] = value;
        count += usize::from(is_marked);
        if count == PIECE {
            kept.extend_from_slice(&piece);
            count = 0;
        }
    }
    kept.extend_from_slice(&piece[..count]);
    kept
}

/// Returns a capacity with room for what a seam adds to so many vertices or triangles. If it adds more, the column is copied once.
fn with_room(count: usize) -> usize {
    count + count / 16
}

/// What a leaf knows of its frontier before the seams are known; each column is in the order of the sites of its frontier.
#[derive(Debug, Default)]
pub struct PartialNormals {
    /// The sum of the normals of the leaf's final triangles around each site.
    pub sums: Vec<NormalSum>,
    /// Colours as read.
    pub rgb: Vec<[u16; 3]>,
    /// Classes.
    pub class: Vec<u8>,
    /// Intensities; empty if all are 0.
    pub intensity: Vec<u16>,
}

impl PartialNormals {
    /// Writes the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, tile: TileIndex) -> Result<()> {
        let columns = ColumnWriter::default().push(&self.sums).push(&self.rgb).push(&self.class);
        push_unless_empty(columns, &self.intensity).write(store, StepRecord::PartialNormals(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: TileIndex) -> Result<PartialNormals> {
        let mut columns = ColumnReader::open(store, StepRecord::PartialNormals(tile))?;
        let (sums, rgb, class) = (columns.column()?, columns.column()?, columns.column()?);
        Ok(PartialNormals { sums, rgb, class, intensity: last_column(&mut columns)? })
    }
}

/// Adds a last column, which few jobs have.
fn push_unless_empty<'a, T: Pod>(columns: ColumnWriter<'a>, last: &'a [T]) -> ColumnWriter<'a> {
    if last.is_empty() { columns } else { columns.push(last) }
}

/// Reads the column that [`push_unless_empty`] has written.
fn last_column<T: Pod>(columns: &mut ColumnReader<StepRecord>) -> Result<Vec<T>> {
    if columns.is_at_end() { Ok(Vec::new()) } else { columns.column() }
}

/// A finished vertex on the border of a tile, with what the neighbouring tiles write of it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BorderAttributes {
    /// Its number in its tile.
    pub site: SiteIndex,
    /// Unit normal along the source's axes, from lengths in metres.
    pub normal: [f32; 3],
    /// Colour as read.
    pub rgb: [u16; 3],
    /// Class.
    pub class: u16,
}

/// The finished frontier of one leaf, by ascending site.
#[derive(Clone, Debug)]
pub struct FinishedBorder {
    /// Its vertices.
    pub vertices: Vec<BorderAttributes>,
    /// The intensity of each; empty if all are 0.
    pub intensity: Vec<u16>,
}

impl FinishedBorder {
    /// Writes the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, tile: TileIndex) -> Result<()> {
        let columns = ColumnWriter::default().push(&self.vertices);
        push_unless_empty(columns, &self.intensity).write(store, StepRecord::FinishedBorder(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: TileIndex) -> Result<FinishedBorder> {
        let mut columns = ColumnReader::open(store, StepRecord::FinishedBorder(tile))?;
        Ok(FinishedBorder { vertices: columns.column()?, intensity: last_column(&mut columns)? })
    }

    /// Returns the vertex of `site` and its intensity.
    pub fn find(&self, site: SiteIndex) -> Option<(&BorderAttributes, u16)> {
        let at = self.vertices.binary_search_by_key(&site, |vertex| vertex.site).ok()?;
        Some((&self.vertices[at], self.intensity.get(at).copied().unwrap_or(0)))
    }
}

/// What `tileset.json` says of a tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TileSummary {
    /// The error that viewers choose levels by, in metres; 0 for an exact tile.
    pub error: f64,
    /// The greatest vertical distance to the exact mesh in metres.
    pub greatest_error: f64,
    /// The same of its working mesh, which the tile above it is made from.
    pub mesh_error: f64,
    /// About the mean vertical distance to the vertices of the exact mesh in metres.
    pub typical_error: f64,
    /// The least and greatest lattice x, y, z of the exact mesh below. Without a triangle, the least are greater.
    corners: [[i32; 3]; 2],
    /// The same of everything drawn by this tile and by those below it.
    drawn: [[i32; 3]; 2],
    /// The vertices of its working mesh; of an exact tile, those of its GLB; 0 if there is none.
    pub vertices: u32,
    unused: u32,
}

impl TileSummary {
    /// Returns the summary of a tile over the exact mesh within `bounds`, whose mesh has `vertices`; 0 if it has none.
    pub fn new(bounds: Option<Bounds<3>>, vertices: usize) -> TileSummary {
        let corners = bounds.map_or([[1; 3], [0; 3]], |bounds| [bounds.min, bounds.max]);
        TileSummary {
            error: 0.0,
            greatest_error: 0.0,
            mesh_error: 0.0,
            typical_error: 0.0,
            corners,
            drawn: corners,
            vertices: vertices as u32,
            unused: 0,
        }
    }

    /// Returns the box of the exact mesh below; `None` if it has no triangle.
    pub fn bounds(&self) -> Option<Bounds<3>> {
        box_between(self.corners)
    }

    /// Returns the box of all that is drawn of it, at this level and below; `None` if there is no triangle.
    pub fn drawn(&self) -> Option<Bounds<3>> {
        box_between(self.drawn)
    }

    /// Makes the box of what is drawn large enough for another one.
    pub fn draw(&mut self, other: Bounds<3>) {
        let Bounds { min, max } = self.drawn().map_or(other, |own| own.union(other));
        self.drawn = [min, max];
    }
}

fn box_between([min, max]: [[i32; 3]; 2]) -> Option<Bounds<3>> {
    (min[0] <= max[0]).then_some(Bounds { min, max })
}

/// What an exact tile leaves for the coarser tiles above it and for `tileset.json`.
#[derive(Debug)]
pub struct ExactTile {
    /// What `tileset.json` says of it.
    pub summary: TileSummary,
    /// What decides how many of its vertices the coarser tile above it gets.
    pub relief: Relief,
}

impl ExactTile {
    /// Writes the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, tile: TileIndex) -> Result<()> {
        ColumnWriter::default().push(&[self.summary]).push(&[self.relief]).write(store, StepRecord::Tile(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if it is missing or damaged.
    pub fn load(store: &Store, tile: TileIndex) -> Result<ExactTile> {
        let mut columns = ColumnReader::open(store, StepRecord::Tile(tile))?;
        match (&columns.column()?[..], &columns.column()?[..]) {
            (&[summary], &[relief]) => Ok(ExactTile { summary, relief }),
            _ => Err(Error::Broken(format!("the record of tile {tile} is damaged"))),
        }
    }
}

/// What a coarser tile leaves for the tile above it and for `tileset.json`.
#[derive(Debug)]
pub struct LevelSummary {
    /// The tile itself.
    pub own: TileSummary,
    /// The exact tiles among its children, in their order.
    pub leaves: Vec<TileSummary>,
}

impl LevelSummary {
    /// Writes the record of the coarser tile at `node`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, node: NodeIndex) -> Result<()> {
        ColumnWriter::default().push(&[self.own]).push(&self.leaves).write(store, StepRecord::Level(node))
    }

    /// Reads the record of the coarser tile at `node`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if it is missing or damaged.
    pub fn load(store: &Store, node: NodeIndex) -> Result<LevelSummary> {
        let mut columns = ColumnReader::open(store, StepRecord::Level(node))?;
        let own = columns.column()?;
        let [own] = own[..] else { return Err(Error::Broken(format!("the record of coarser tile {node} is damaged"))) };
        Ok(LevelSummary { own, leaves: columns.column()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn marked_values_stay_in_order(values in prop::collection::vec((any::<[u16; 3]>(), any::<bool>()), 0..5 * PIECE)) {
            let expected: Vec<_> = values.iter().filter(|(_, is_marked)| *is_marked).map(|(value, _)| *value).collect();
            prop_assert_eq!(marked(values.into_iter()), expected);
        }
    }
}
