//! Step 6, once for each tile: writes the tile's own triangles and those of its seam that it owns as one GLB, and draws its pixels of
//! the preview.

use crate::durable::atomic_file::{PendingFile, create_folder_of, write_pending_pieces};
use crate::durable::columns::ColumnWriter;
use crate::durable::directory::JobDirectory;
use crate::index::TileIndex;
use crate::merge_records::SeamOfTile;
use crate::records::{ExactTile, FinishedBorder, Leaf, StepRecord, Store, TileSummary, owner};
use crate::tiles::hull_slivers::HullSlivers;
use crate::tiles::style::TileStyle;
use crate::tiles::tile_content::{BorderOf, TileContent};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::iter::Sum;
use std::ops::AddAssign;
use std::path::Path;
use sys::Result;
use tiles::Tile;
use tiles::gltf::glb::GlbEncoder;
use tiles::lod::relief::Relief;
use tiles::preview::canvas::Canvas;

/// The figures of one tile, or the sum over all.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct TileStats {
    /// GLB files written. A tile whose triangles all belong to others has none.
    pub files: u64,
    /// Triangles in them.
    pub triangles: u64,
    /// Those of them that cross a border between tiles.
    pub seam_triangles: u64,
    /// Twice the area of the triangles in the plane, in square lattice steps.
    pub double_area: u64,
    /// Triangles that are left out.
    pub cut_triangles: u64,
    /// Those of them that are slivers along the hull.
    pub slivers: u64,
    /// Sites that have no pixel in the orthophoto.
    pub without_pixel: u64,
    /// Bytes of the GLB files, including those of triangles that are left out.
    pub bytes: u64,
}

impl Sum for TileStats {
    fn sum<I: Iterator<Item = TileStats>>(each: I) -> TileStats {
        each.fold(TileStats::default(), |mut sum, stats| {
            sum += stats;
            sum
        })
    }
}

impl AddAssign for TileStats {
    fn add_assign(&mut self, other: TileStats) {
        self.files += other.files;
        self.triangles += other.triangles;
        self.seam_triangles += other.seam_triangles;
        self.double_area += other.double_area;
        self.cut_triangles += other.cut_triangles;
        self.slivers += other.slivers;
        self.without_pixel += other.without_pixel;
        self.bytes += other.bytes;
    }
}

/// Writes the GLB of `tile`, whose seam is `seam`, and one of its triangles that are left out. Stores its pixels of the preview and what
/// `tileset.json` says of it. `border_of` returns the finished frontiers of other tiles.
///
/// # Errors
/// [`sys::Error::Io`] on the output or the store, [`sys::Error::Config`] if a triangle is too long for f32; those of an orthophoto.
pub(crate) fn write_tile(
    directory: &JobDirectory,
    store: &Store,
    style: &TileStyle,
    canvas: &Canvas,
    tile: TileIndex,
    seam: &SeamOfTile,
    border_of: BorderOf,
) -> Result<(TileStats, Vec<PendingFile>)> {
    let leaf = Leaf::load(store, tile)?;
    let border = FinishedBorder::load(store, tile)?;
    let slivers = HullSlivers::new(style.hull.as_ref(), &seam.trimmed);
    let mut content = TileContent::of_leaf(leaf, &border, &slivers, style)?;
    let own = seam.triangles.iter().copied().filter(|triangle| owner(triangle) == tile);
    let seam_triangles = content.add_seam(border_of, tile, own, &slivers, style)?;
    let (left_out, slivers, without_pixel) = (content.left_out(), content.slivers, content.without_pixel);
    let kept = content.into_tile(style);
    let mut stats = TileStats {
        triangles: kept.triangles.len() as u64,
        double_area: kept.double_area(),
        seam_triangles,
        cut_triangles: left_out.triangles.len() as u64,
        slivers,
        without_pixel,
        ..TileStats::default()
    };
    let mut pixels = canvas.draw(&kept)?;
    pixels.extend(canvas.dots(&kept, pixels.len()));
    ColumnWriter::default().push(&pixels).write(store, StepRecord::Pixels(tile))?;
    let vertices = if kept.triangles.is_empty() { 0 } else { kept.positions.len() };
    let relief = Relief::of(&kept.positions, &kept.triangles);
    ExactTile { summary: TileSummary::new(kept.bounds(), vertices), relief }.save(store, tile)?;
    let mut files = Vec::new();
    if vertices > 0 {
        files.push(write_glb(&directory.output().tile(tile.number()), &kept, style)?);
        stats.files = 1;
    }
    if !left_out.triangles.is_empty() {
        files.push(write_glb(&directory.output().cut_tile(tile.number()), &left_out, style)?);
    }
    stats.bytes = files.iter().map(|file| file.bytes).sum();
    Ok((stats, files))
}

thread_local! {
    /// Encodes the thread's files. It keeps its memory from tile to tile, so that its pages are faulted in once.
    static GLB: RefCell<GlbEncoder> = RefCell::default();
}

/// Writes a tile as a pending GLB file, and makes its folder.
///
/// # Errors
/// [`sys::Error::Io`] if writing fails, [`sys::Error::Config`] if a triangle is too long for f32.
pub(crate) fn write_glb(path: &Path, content: &Tile, style: &TileStyle) -> Result<PendingFile> {
    create_folder_of(path)?;
    GLB.with_borrow_mut(|glb| {
        glb.encode(&style.frame, content, style.compression, style.copyright.as_deref())?;
        write_pending_pieces(path, &glb.pieces())
    })
}
