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
use tiles::normals::NormalSum;

/// The store of a job.
pub type Store = store::Store<StepRecord>;
/// A record of a job's store as the journal knows it.
pub type RecordRef = store::RecordRef<StepRecord>;
/// What a finished step of a job gives back.
pub type StepOutput<T> = journal::StepOutput<T, StepRecord>;
/// The journal of a job.
pub type Journal<'a> = journal::Journal<'a, JobStep, StepRecord>;
/// A line of a job's journal.
pub type JournalEntry = journal::JournalEntry<JobStep, StepRecord>;

/// A step of a job, for one tile or one tree node where it runs once for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum JobStep {
    /// Plans a job of several parts, and finds out how its scene follows the curve of the earth.
    Plan,
    /// Reads the points of a part and cuts it into tiles.
    Partition,
    /// Reads the inputs that a part is the first to need.
    Read(PartIndex),
    /// Finds out how the scene of a job of one part follows the curve of the earth.
    Curve,
    /// Triangulates a tile.
    Leaf(TileIndex),
    /// Merges what the nodes below a node left pending.
    Merge(NodeIndex),
    /// Triangulates a part and writes the tiles that need no other part.
    MeshPart,
    /// Finishes the normals on a tile's border.
    BorderNormals(TileIndex),
    /// Writes a tile.
    WriteTile(TileIndex),
    /// Merges above the parts, and finds out how tiles look.
    Join,
    /// Writes the tiles of a part that have waited for other parts.
    WriteWaiting,
    /// Makes a coarser tile.
    Level(NodeIndex),
    /// Makes all coarser tiles of a part.
    Levels,
    /// Writes the raster of heights.
    Raster,
    /// Writes what is beside the tiles, except the raster and the report.
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
    /// The result of the step that reads the points.
    Partition,
    /// The points by bucket that a reader has found.
    Read(PartIndex),
    /// How many sites there are around every place.
    Spacing,
    /// [`LevelSummary`]
    Level(NodeIndex),
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
    /// Writes the record of `tile`: its sites, which are `points`, and those of the `triangles` that are marked as final. Returns the record
    /// and the number of these triangles.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(
        store: &Store,
        tile: TileIndex,
        points: &[Point],
        triangles: impl ExactSizeIterator<Item = ([u32; 3], bool)>,
    ) -> Result<(RecordRef, u64)> {
        let key = StepRecord::Leaf(tile);
        // These records are most of what a job stores, so they are packed.
        let (count, mut positions, mut attributes) = ([points.len() as u64], Vec::new(), Vec::new());
        pack(points, |point| point.corner().map(|value| value as u32), &mut positions);
        pack(points, |point| point.rgb.map(u32::from), &mut attributes);
        pack(points, |point| [point.class as u32], &mut attributes);
        if points.iter().any(|point| point.intensity != 0) {
            pack(points, |point| [point.intensity as u32], &mut attributes);
        }
        let columns = ColumnWriter::default().push(&count).push(&positions).push(&attributes);
        // Packing triangles would take more time than it saves, but corners take two bytes where that is enough.
        if has_short_corners(points.len()) {
            let triangles = marked(triangles.map(|(t, is_final)| (t.map(|v| v as u16), is_final)));
            Ok((columns.push(&triangles).write(store, key)?, triangles.len() as u64))
        } else {
            let triangles = marked(triangles);
            Ok((columns.push(&triangles).write(store, key)?, triangles.len() as u64))
        }
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
        Ok(Leaf { positions, rgb, class, intensity, triangles: Leaf::read_triangles(&mut columns, count)? })
    }

    /// Reads the record of `tile` without colours, classes and intensities.
    ///
    /// # Errors
    /// As [`Leaf::load`].
    pub fn load_mesh(store: &Store, tile: TileIndex) -> Result<Leaf> {
        let mut columns = ColumnReader::open(store, StepRecord::Leaf(tile))?;
        let (count, positions) = Leaf::read_positions(&mut columns, tile)?;
        columns.skip_column::<u8>()?;
        Ok(Leaf { positions, triangles: Leaf::read_triangles(&mut columns, count)?, ..Leaf::default() })
    }

    fn read_triangles(columns: &mut ColumnReader<StepRecord>, count: usize) -> Result<Vec<[u32; 3]>> {
        if has_short_corners(count) {
            return Ok(widened(&columns.column::<[u16; 3]>()?));
        }
        columns.column_vec()
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

/// Returns triangles with corners of four bytes, and room for those of the seam.
fn widened(short: &[[u16; 3]]) -> Vec<[u32; 3]> {
    let mut triangles = Vec::with_capacity(with_room(short.len()));
    let mut piece = [[0u32; 3]; PIECE];
    for short in short.chunks(PIECE) {
        // As flat numbers, which vector instructions widen.
        for (corner, &short) in piece.as_flattened_mut().iter_mut().zip(short.as_flattened()) {
            *corner = short.into();
        }
        triangles.extend_from_slice(&piece[..short.len()]);
    }
    triangles
}

/// Returns a capacity with room for what a seam adds to so many vertices or triangles. If it adds more, the column is copied once.
fn with_room(count: usize) -> usize {
    count + count / 16
}

fn has_short_corners(sites: usize) -> bool {
    sites <= 1 << 16
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
    pub fn save(&self, store: &Store, tile: TileIndex) -> Result<RecordRef> {
        let columns = ColumnWriter::default().push(&self.sums).push(&self.rgb).push(&self.class);
        push_unless_empty(columns, &self.intensity).write(store, StepRecord::PartialNormals(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: TileIndex) -> Result<PartialNormals> {
        let mut columns = ColumnReader::open(store, StepRecord::PartialNormals(tile))?;
        let (sums, rgb, class) = (columns.column_vec()?, columns.column_vec()?, columns.column_vec()?);
        Ok(PartialNormals { sums, rgb, class, intensity: last_column(&mut columns)? })
    }
}

/// Adds a last column, which few jobs have.
fn push_unless_empty<'a, T: Pod>(columns: ColumnWriter<'a>, last: &'a [T]) -> ColumnWriter<'a> {
    if last.is_empty() { columns } else { columns.push(last) }
}

/// Reads the column that [`push_unless_empty`] has written.
fn last_column<T: Pod>(columns: &mut ColumnReader<StepRecord>) -> Result<Vec<T>> {
    if columns.is_at_end() { Ok(Vec::new()) } else { columns.column_vec() }
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
    pub fn save(&self, store: &Store, tile: TileIndex) -> Result<RecordRef> {
        let columns = ColumnWriter::default().push(&self.vertices);
        push_unless_empty(columns, &self.intensity).write(store, StepRecord::FinishedBorder(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: TileIndex) -> Result<FinishedBorder> {
        let mut columns = ColumnReader::open(store, StepRecord::FinishedBorder(tile))?;
        Ok(FinishedBorder { vertices: columns.column_vec()?, intensity: last_column(&mut columns)? })
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
    /// The least and greatest lattice x, y, z of the exact mesh below. Without a triangle, the least are greater.
    corners: [[i32; 3]; 2],
    /// The vertices of its GLB; 0 if there is none.
    pub vertices: u32,
    unused: u32,
}

impl TileSummary {
    /// Returns the summary of a tile over the exact mesh within `bounds`, whose GLB has `vertices`; 0 if there is no GLB.
    pub fn new(bounds: Option<Bounds<3>>, vertices: usize) -> TileSummary {
        let corners = bounds.map_or([[1; 3], [0; 3]], |bounds| [bounds.min, bounds.max]);
        TileSummary { error: 0.0, greatest_error: 0.0, corners, vertices: vertices as u32, unused: 0 }
    }

    /// Writes the record of exact tile `tile`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store, tile: TileIndex) -> Result<RecordRef> {
        ColumnWriter::default().push(&[*self]).write(store, StepRecord::Tile(tile))
    }

    /// Reads the record of exact tile `tile`.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if it is missing or damaged.
    pub fn load(store: &Store, tile: TileIndex) -> Result<TileSummary> {
        let own = ColumnReader::open(store, StepRecord::Tile(tile))?.column()?;
        let [own] = own[..] else { return Err(Error::Broken(format!("the record of tile {tile} is damaged"))) };
        Ok(own)
    }

    /// Returns the box of the exact mesh below; `None` if it has no triangle.
    pub fn bounds(&self) -> Option<Bounds<3>> {
        let [min, max] = self.corners;
        (min[0] <= max[0]).then_some(Bounds { min, max })
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
    pub fn save(&self, store: &Store, node: NodeIndex) -> Result<RecordRef> {
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
        Ok(LevelSummary { own, leaves: columns.column_vec()? })
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

        #[test]
        fn widened_triangles_have_the_same_corners(short in prop::collection::vec(any::<[u16; 3]>(), 0..3 * PIECE)) {
            let expected: Vec<[u32; 3]> = short.iter().map(|t| t.map(u32::from)).collect();
            prop_assert_eq!(widened(&short), expected);
        }
    }
}
