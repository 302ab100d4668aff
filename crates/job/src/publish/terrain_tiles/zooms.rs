//! The tiles of one zoom after the other.

use crate::durable::directory::JobDirectory;
use crate::plan::terrain_crowd::{BYTES_PER_VERTEX, BYTES_TO_SELECT};
use crate::publish::terrain_tiles::room::{Load, Room};
use crate::publish::terrain_tiles::waiting::WaitingRecords;
use quantized_mesh::{
    BorderNormal, Child, FIRST_SURROUNDED_ZOOM, HeightSteps, OUTSIDE, Scheme, Surface, Tile, TileMesh, Water, assemble,
    border_normals, coarser, encode, flat,
};
use std::collections::{HashMap, HashSet};
use sys::{Error, Result, interrupt};
use tiles::gzip::gzipped_mesh;

/// A tile whose mesh waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct WaitingTile {
    pub(super) tile: Tile,
    /// Where its mesh is.
    at: u64,
    /// The lowest and the highest vertex of the terrain, in steps.
    heights: [i32; 2],
    /// Whether some vertices are not of the terrain.
    has_surroundings: bool,
    vertices: u64,
    pub(super) triangles: u64,
    /// How far the vertices of the tiles below may be from it, in steps.
    pub(super) bound: u64,
    /// The sum and the number of the heights along the edge of the terrain.
    edge: [i64; 2],
}

/// The tiles of a zoom.
pub(super) struct Zoom {
    scheme: Scheme,
    pub(super) zoom: u8,
    /// In order.
    pub(super) tiles: Vec<WaitingTile>,
    file: WaitingRecords,
}

/// A piece of a tile that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct WaitingPiece {
    pub(super) tile: Tile,
    /// Where it is.
    pub(super) at: u64,
    pub(super) vertices: u64,
}

/// Bytes that a vertex of a tile takes while the tile is written: its mesh, the same in the order of the format, normals, and the bytes.
const BYTES_TO_WRITE: u64 = 160;

/// Returns the bytes that the greatest tile of the zoom before that of these pieces takes while it is made, at most.
fn to_select(pieces: &[WaitingPiece]) -> u64 {
    let mut vertices: HashMap<Tile, u64> = HashMap::new();
    pieces.iter().for_each(|piece| *vertices.entry(piece.tile.parent()).or_default() += piece.vertices);
    vertices.into_values().max().unwrap_or(0) * BYTES_TO_SELECT
}

impl Zoom {
    /// Joins pieces, which may come in any order, to the tiles of the finest zoom.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Interrupted`].
    pub(super) fn finest(
        (scheme, zoom): (Scheme, u8),
        room: &Room,
        directory: &JobDirectory,
        pieces: WaitingRecords,
        mut list: Vec<WaitingPiece>,
        finish_tile: &(dyn Fn() + Sync),
    ) -> Result<Zoom> {
        list.sort_unstable();
        let file = WaitingRecords::create(directory, &format!("terrain.{zoom}.meshes"))?;
        let groups: Vec<&[WaitingPiece]> = list.chunk_by(|a, b| a.tile == b.tile).collect();
        let load = |group: &&[WaitingPiece]| {
            let vertices = group.iter().map(|piece| piece.vertices).sum::<u64>();
            Load { tile: group[0].tile, vertices, bytes: vertices * BYTES_PER_VERTEX }
        };
        let made = room.share(&groups, load, to_select(&list), |group| {
            interrupt::check()?;
            let of_tile = group.iter().map(|piece| pieces.piece(piece.at)).collect::<Result<Vec<_>>>()?;
            let made = assemble(of_tile).map(|mesh| WaitingTile::add(&file, group[0].tile, &mesh, 0));
            finish_tile();
            made.transpose()
        });
        let tiles = made?.into_iter().flatten().collect();
        pieces.discard()?;
        let mut finest = Zoom { scheme, zoom, tiles, file };
        finest.surround()?;
        Ok(finest)
    }

    /// Adds tiles beside the terrain: all around those that hold some of it, and so many that a tile of the zoom before has all four or none.
    ///
    /// Where a tile is missing, viewers show a part of a coarser one. So none is missing beside a part of the terrain, and the coarser one has none of
    /// it either: both are flat there.
    fn surround(&mut self) -> Result<()> {
        if self.zoom < self.scheme.as_wide_as(FIRST_SURROUNDED_ZOOM) {
            return Ok(());
        }
        let known: HashSet<Tile> = self.tiles.iter().map(|tile| tile.tile).collect();
        let rows = 0..1 << self.zoom;
        let holds_terrain = |tile: &&WaitingTile| tile.heights[0] <= tile.heights[1];
        let around = self.tiles.iter().filter(holds_terrain).flat_map(|tile| offsets().map(|by| tile.tile.beside(by)));
        let around: HashSet<Tile> = around.filter(|tile| rows.contains(&tile.y)).chain(known.iter().copied()).collect();
        let siblings = around.iter().flat_map(|tile| tile.siblings());
        let mut missing: Vec<Tile> = siblings.filter(|tile| !known.contains(tile)).collect();
        missing.sort_unstable();
        missing.dedup();
        for tile in missing {
            self.tiles.push(WaitingTile::add(&self.file, tile, &flat(tile).map_err(broken)?, 0)?);
        }
        Ok(())
    }

    /// Returns the tiles of the zoom before. At zoom 0 all are there, because viewers want all. `outside` is the height beside the terrain in steps.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Interrupted`].
    pub(super) fn coarser(
        &self,
        room: &Room,
        directory: &JobDirectory,
        outside: i32,
        finish_tile: &(dyn Fn() + Sync),
    ) -> Result<Zoom> {
        let zoom = self.zoom.saturating_sub(1);
        let file = WaitingRecords::create(directory, &format!("terrain.{zoom}.meshes"))?;
        let mut by_parent: Vec<(Tile, &WaitingTile)> =
            self.tiles.iter().map(|tile| (tile.tile.parent(), tile)).collect();
        by_parent.sort_unstable_by_key(|(parent, child)| (*parent, child.tile));
        let groups: Vec<&[(Tile, &WaitingTile)]> = by_parent.chunk_by(|a, b| a.0 == b.0).collect();
        let load = |group: &&[(Tile, &WaitingTile)]| {
            let vertices = group.iter().map(|(_, child)| child.vertices).sum::<u64>();
            Load { tile: group[0].0, vertices, bytes: vertices * BYTES_TO_SELECT }
        };
        let made = room.share(&groups, load, 0, |group| {
            interrupt::check()?;
            let made = self.above(group, &file, outside);
            finish_tile();
            made
        });
        let mut tiles: Vec<WaitingTile> = made?;
        if zoom == 0 {
            for x in 0..self.scheme.columns(zoom) {
                if !tiles.iter().any(|tile| tile.tile.column() == x) {
                    let tile = Tile { scheme: self.scheme, zoom, x, y: 0 };
                    tiles.push(WaitingTile::add(&file, tile, &flat(tile).map_err(broken)?, 0)?);
                }
            }
        }
        let mut coarser = Zoom { scheme: self.scheme, zoom, tiles, file };
        coarser.surround()?;
        Ok(coarser)
    }

    /// Makes the tile above some, which are all tiles in it.
    fn above(&self, group: &[(Tile, &WaitingTile)], file: &WaitingRecords, outside: i32) -> Result<WaitingTile> {
        let tile = group[0].0;
        let child = |(_, child): &(Tile, &WaitingTile)| {
            let quadrant = [child.tile.x & 1, child.tile.y & 1].map(|half| half as u8);
            Ok(Child { quadrant, nodes: self.file.nodes(child.at)? })
        };
        let children = group.iter().map(child).collect::<Result<Vec<Child>>>()?;
        let (mesh, bound) = coarser(tile, &children, outside).map_err(broken)?;
        WaitingTile::add(file, tile, &mesh, bound)
    }

    /// Returns the height of the surroundings in steps: the mean along the edge of the terrain, or the middle of all heights if it has no edge within its
    /// tiles. Tiles of all zooms hold it exactly.
    pub(super) fn surroundings(&self) -> i32 {
        let heights = self.tiles.iter().map(|tile| tile.heights).filter(|[low, high]| low <= high);
        let ends = heights.reduce(|[low, high], [lowest, highest]| [low.min(lowest), high.max(highest)]);
        let [low, high] = ends.unwrap_or_default();
        let sums = self.tiles.iter().map(|tile| tile.edge.map(i128::from));
        let [sum, count] = sums.fold([0, 0], |[sum, count], [more, others]| [sum + more, count + others]);
        let mean = if count > 0 { sum.div_euclid(count) as i32 } else { low.midpoint(high) };
        let farthest = low.unsigned_abs().max(high.unsigned_abs());
        HeightSteps::over(high.abs_diff(low).into(), farthest.into()).nearest(mean)
    }

    /// Returns the step of height that all tiles can be written with.
    pub(super) fn height_steps(&self, outside: i32) -> HeightSteps {
        let ends = |tile: &WaitingTile| {
            let [low, high] = tile.heights;
            match (low > high, tile.has_surroundings) {
                (true, _) => [outside; 2],
                (false, true) => [low.min(outside), high.max(outside)],
                (false, false) => [low, high],
            }
        };
        let ends = || self.tiles.iter().map(ends);
        let range = ends().map(|[low, high]| high.abs_diff(low)).max().unwrap_or(0);
        let farthest = ends().flatten().map(i32::unsigned_abs).max().unwrap_or(0);
        HeightSteps::over(range.into(), farthest.into())
    }

    /// Calls `write` with each tile and the bytes of its file. `water` is the water of the zoom, if tiles tell that.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Interrupted`], and those of `write`.
    pub(super) fn encode<T: Send>(
        &self,
        room: &Room,
        outside: i32,
        water: Option<&Water>,
        write: &(dyn Fn(Tile, Vec<u8>) -> Result<T> + Sync),
    ) -> Result<Vec<T>> {
        let steps = self.height_steps(outside);
        let places: HashMap<Tile, u64> = self.tiles.iter().map(|tile| (tile.tile, tile.at)).collect();
        let load = |waiting: &WaitingTile| {
            let WaitingTile { tile, vertices, .. } = *waiting;
            Load { tile, vertices, bytes: vertices * BYTES_TO_WRITE }
        };
        room.share(&self.tiles, load, 0, |waiting| {
            interrupt::check()?;
            let (mesh, around) = (self.file.mesh(waiting.at)?, self.around(waiting.tile, &places)?);
            let surface = Surface { tile: waiting.tile, mesh: &mesh, outside, around: &around, water };
            write(waiting.tile, gzipped_mesh(&encode(&surface, steps)))
        })
    }

    /// Returns the borders of the tiles around one.
    fn around(&self, tile: Tile, places: &HashMap<Tile, u64>) -> Result<Vec<([i32; 2], Vec<BorderNormal>)>> {
        let mut around = Vec::new();
        for offset in offsets() {
            if let Some(at) = places.get(&tile.beside(offset)) {
                around.push((offset, self.file.border(*at)?));
            }
        }
        Ok(around)
    }

    /// Removes its meshes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn discard(self) -> Result<()> {
        self.file.discard()
    }
}

impl WaitingTile {
    /// Adds a mesh with this bound to a file.
    fn add(file: &WaitingRecords, tile: Tile, mesh: &TileMesh, bound: u64) -> Result<WaitingTile> {
        let at = file.add_mesh(mesh, &border_normals(mesh, tile))?;
        let ground = mesh.nodes.iter().map(|node| node.h).filter(|h| *h != OUTSIDE);
        let heights = ground.fold([i32::MAX, i32::MIN], |[low, high], h| [low.min(h), high.max(h)]);
        let has_surroundings = mesh.nodes.iter().any(|node| node.h == OUTSIDE);
        let edge = if has_surroundings { edge_of(mesh) } else { [0, 0] };
        let [vertices, triangles] = [mesh.nodes.len(), mesh.triangles.len()].map(|count| count as u64);
        Ok(WaitingTile { tile, at, heights, has_surroundings, vertices, triangles, bound, edge })
    }
}

/// Returns the sum and the number of the heights of vertices of the terrain beside others.
fn edge_of(mesh: &TileMesh) -> [i64; 2] {
    let height = |v: u32| mesh.nodes[v as usize].h;
    let is_beside = |triangle: &&[u32; 3]| triangle.iter().any(|&v| height(v) == OUTSIDE);
    let mut edge: Vec<u32> = mesh.triangles.iter().filter(is_beside).flatten().copied().collect();
    edge.sort_unstable();
    edge.dedup();
    let heights = edge.into_iter().map(height).filter(|h| *h != OUTSIDE);
    heights.fold([0, 0], |[sum, count], h| [sum + i64::from(h), count + 1])
}

/// Returns where the tiles around one are: so many columns east and rows north.
fn offsets() -> impl Iterator<Item = [i32; 2]> {
    (-1..=1).flat_map(|north| (-1..=1).map(move |east| [east, north])).filter(|offset| *offset != [0, 0])
}

fn broken(error: delaunay::Error) -> Error {
    match error {
        error if error.is_stopped() => Error::Interrupted,
        error => Error::Broken(format!("a terrain tile: {error}")),
    }
}
