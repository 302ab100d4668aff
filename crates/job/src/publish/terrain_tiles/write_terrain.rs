//! Writing `terrain/`.

use crate::durable::atomic_file::{PendingFile, create_folder_of, write_pending};
use crate::durable::directory::JobDirectory;
use crate::plan::budget::working_memory;
use crate::plan::job_plan::Plan;
use crate::plan::terrain_crowd::{TerrainCrowd, scheme_of};
use crate::publish::raster::tile_meshes::{TileBox, boxes, lattice_mesh};
use crate::publish::side_files::EachTile;
use crate::publish::terrain_tiles::check::globe_of;
use crate::publish::terrain_tiles::globe_grid::{GlobeGrid, Place};
use crate::publish::terrain_tiles::lakes::{shore_memory, shores_of};
use crate::publish::terrain_tiles::limits::refused;
use crate::publish::terrain_tiles::room::Room;
use crate::publish::terrain_tiles::waiting::WaitingRecords;
use crate::publish::terrain_tiles::zooms::{WaitingPiece, Zoom};
use crate::tiles::write_tile::TileStats;
use delaunay::geometry::Bounds;
use quantized_mesh::{HEIGHT_STEPS, LayerAbout, Scheme, Shore, Tile, Water, ZoomTiles, cut, finest_zoom, layer};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use sys::{Error, Result, interrupt};
use tiles::frame::Frame;
use tiles::tiles3d::globe::Globe;

/// What came of terrain tiles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TerrainStats {
    /// The number of tiles.
    pub tiles: u64,
    /// Bytes of all files.
    pub bytes: u64,
    /// The height above the ellipsoid in metres around the terrain.
    pub surroundings: f64,
    /// The zooms, from 0 on.
    pub zooms: Vec<ZoomStats>,
}

/// The tiles of a zoom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ZoomStats {
    /// The number of tiles.
    pub tiles: u64,
    /// Their triangles.
    pub triangles: u64,
    /// How far in metres the vertices of the next finer zoom may be from them, along the vertical; 0 at the finest zoom.
    pub error_to_finer: f64,
    /// The step that heights on borders are rounded to, in metres; others have that or a finer one.
    pub height_step: f64,
}

/// Terrain tiles that are to be written.
pub(crate) struct TerrainWork<'a> {
    plan: &'a Plan,
    scheme: Scheme,
    frame: &'a Frame,
    tiles: Vec<TileBox>,
    /// Figures of all tiles together.
    stats: &'a TileStats,
    globe: Globe,
}

/// The zooms take as long as so many readings of the tiles.
const STEPS_OF_ZOOMS: u64 = 8;

/// The steps of the zooms.
struct ZoomSteps<'a> {
    done: &'a (dyn Fn(u64) + Sync),
    /// All steps, and the tiles that they are divided among.
    steps: u64,
    tiles: u64,
    /// The tiles so far.
    finished: AtomicU64,
}

impl ZoomSteps<'_> {
    fn finish_tile(&self) {
        let before = self.finished.fetch_add(1, Ordering::Relaxed).min(self.tiles);
        let steps = |tiles: u64| self.steps * tiles / self.tiles.max(1);
        let after = (before + 1).min(self.tiles);
        (self.done)(steps(after) - steps(before));
    }
}

impl<'a> TerrainWork<'a> {
    /// Looks at what is to be done for the terrain tiles of a job whose tiles have the scene of `frame`; `None` if the user wants none.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on a store, [`Error::Config`] if the terrain has no place on the globe.
    pub(crate) fn of(
        plan: &'a Plan,
        frame: &'a Frame,
        tiles: &dyn EachTile,
        stats: &'a TileStats,
    ) -> Result<Option<TerrainWork<'a>>> {
        let Some(scheme) = scheme_of(&plan.options) else { return Ok(None) };
        Ok(Some(TerrainWork { plan, scheme, frame, tiles: boxes(tiles)?, stats, globe: globe_of(plan)? }))
    }

    /// Returns the number of steps. For each tile there is one to cut it, and what the zooms take together is divided into others.
    pub(crate) fn steps(&self) -> u64 {
        (1 + STEPS_OF_ZOOMS) * self.tiles.len() as u64
    }

    /// Writes the tiles from those of the job, which must have their names. Calls `done` for each of the [steps](TerrainWork::steps).
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a file, [`Error::Config`] if a place is not on the globe or the terrain too wide, [`Error::Interrupted`].
    pub(crate) fn write(
        &self,
        directory: &JobDirectory,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<(TerrainStats, Vec<PendingFile>)> {
        let bounds = self.tiles.iter().map(|tile| tile.bounds).reduce(Bounds::union);
        let bounds = bounds.ok_or_else(|| Error::Broken("there is no triangle for terrain tiles".into()))?;
        let scheme = self.scheme;
        let middle = bounds.middle();
        let place = Place::of(self.plan, &self.globe, middle).map_err(|why| refused(&why))?;
        let grid = |zoom: u8| GlobeGrid::new(self.plan, &self.globe, scheme, zoom, place);
        // Any zoom tells the area of a step.
        let area_of_step = grid(20).area_of_step(middle)?;
        let area = self.stats.double_area as f64 / 2.0 * area_of_step.abs();
        let zoom = finest_zoom(scheme, area, self.stats.triangles / 2, place.latitude);
        let shores = shores_of(self.plan, &grid(zoom))?;
        let (pieces, list) = self.cut(directory, &grid(zoom), area_of_step < 0.0, done)?;
        // Each tile is joined or selected, and written. The coarser zooms have a third as many as the finest.
        let finest_tiles = list.iter().map(|piece| piece.tile).collect::<HashSet<_>>().len() as u64;
        let steps = ZoomSteps {
            done,
            steps: STEPS_OF_ZOOMS * self.tiles.len() as u64,
            tiles: finest_tiles * 8 / 3,
            finished: AtomicU64::new(0),
        };
        let finish_tile = &|| steps.finish_tile();
        let room = &Room::of(self.plan);
        let mut finest = Zoom::finest((scheme, zoom), room, directory, pieces, list, finish_tile)?;
        let outside = finest.surroundings();
        let lakes = shores.map(|shores| Lakes { shores, scheme, finest: zoom });
        let mut pyramid = Pyramid {
            directory,
            room,
            outside,
            lakes,
            stats: TerrainStats::default(),
            files: Vec::new(),
            zooms: Vec::new(),
        };
        pyramid.stats.surroundings = f64::from(outside) / HEIGHT_STEPS;
        let degrees = degrees_of(scheme, &finest.tiles.iter().map(|tile| tile.tile).collect::<Vec<Tile>>());
        while finest.zoom > 0 {
            let coarser = finest.coarser(room, directory, outside, finish_tile)?;
            pyramid.write(finest, finish_tile)?;
            finest = coarser;
        }
        pyramid.write(finest, finish_tile)?;
        let about = LayerAbout {
            scheme,
            has_water: pyramid.lakes.is_some(),
            bounds: degrees,
            attribution: self.plan.options.output.copyright(),
        };
        pyramid.finish(&about)
    }

    /// Cuts all tiles along those of a zoom.
    fn cut(
        &self,
        directory: &JobDirectory,
        grid: &GlobeGrid,
        is_mirrored: bool,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<(WaitingRecords, Vec<WaitingPiece>)> {
        let (file, list) = (WaitingRecords::create(directory, "terrain.pieces")?, Mutex::new(Vec::new()));
        self.tiles.par_iter().with_max_len(1).try_for_each(|tile| {
            interrupt::check()?;
            let mut mesh = lattice_mesh(&directory.output().tile(tile.tile.number()), self.frame)?;
            if is_mirrored {
                mesh.triangles.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
            }
            let points = grid.points(&mesh.positions)?;
            for ([x, y], piece) in cut(&points, &mesh.triangles) {
                let vertices = piece.nodes.len() as u64;
                let piece = WaitingPiece { tile: grid.tile([x, y]), at: file.add_piece(&piece)?, vertices };
                list.lock().unwrap_or_else(PoisonError::into_inner).push(piece);
            }
            done(1);
            Ok::<_, Error>(())
        })?;
        Ok((file, list.into_inner().unwrap_or_else(PoisonError::into_inner)))
    }
}

/// The lakes of the job.
struct Lakes {
    shores: Vec<Shore>,
    scheme: Scheme,
    /// The zoom whose grid the shores are on.
    finest: u8,
}

/// The zooms that are written so far, the finest first.
struct Pyramid<'a> {
    directory: &'a JobDirectory,
    room: &'a Room<'a>,
    /// The height beside the terrain in steps.
    outside: i32,
    lakes: Option<Lakes>,
    stats: TerrainStats,
    files: Vec<PendingFile>,
    zooms: Vec<ZoomTiles>,
}

impl Pyramid<'_> {
    /// Writes the tiles of a zoom.
    fn write(&mut self, zoom: Zoom, finish_tile: &(dyn Fn() + Sync)) -> Result<()> {
        let write = |tile: Tile, bytes: Vec<u8>| {
            let path = self.directory.output().terrain_tile(tile.zoom, [tile.column(), tile.y]);
            create_folder_of(&path)?;
            let written = write_pending(&path, &bytes);
            finish_tile();
            written
        };
        let water = |lakes: &Lakes| Water::new(lakes.scheme, [zoom.zoom, lakes.finest], &lakes.shores);
        let water = self.lakes.as_ref().map(water);
        self.files.extend(zoom.encode(self.room, self.outside, water.as_ref(), &write)?);
        let tiles: Vec<Tile> = zoom.tiles.iter().map(|tile| tile.tile).collect();
        self.zooms.push(ZoomTiles::new(&tiles));
        self.stats.zooms.push(ZoomStats {
            tiles: tiles.len() as u64,
            triangles: zoom.tiles.iter().map(|tile| tile.triangles).sum(),
            error_to_finer: zoom.tiles.iter().map(|tile| tile.bound).max().unwrap_or(0) as f64 / HEIGHT_STEPS,
            height_step: zoom.height_steps(self.outside).metres(),
        });
        zoom.discard()
    }

    /// Writes the list of the tiles.
    fn finish(mut self, about: &LayerAbout) -> Result<(TerrainStats, Vec<PendingFile>)> {
        self.zooms.reverse();
        self.stats.zooms.reverse();
        self.stats.tiles = self.stats.zooms.iter().map(|zoom| zoom.tiles).sum();
        let path = self.directory.output().terrain_layer();
        self.files.push(write_pending(&path, layer(&self.zooms, about).as_bytes())?);
        self.stats.bytes = self.files.iter().map(|file| file.bytes).sum();
        Ok((self.stats, self.files))
    }
}

/// Returns west, south, east and north of tiles in degrees.
fn degrees_of(scheme: Scheme, tiles: &[Tile]) -> [f64; 4] {
    let zoom = tiles.first().map_or(0, |tile| tile.zoom);
    let side = 360.0 / f64::from(scheme.columns(zoom));
    let ends = |along: fn(&Tile) -> i32| {
        let numbers = tiles.iter().map(along);
        let [low, high] = numbers.fold([i32::MAX, i32::MIN], |[low, high], number| [low.min(number), high.max(number)]);
        [low, high.saturating_add(1)]
    };
    let [west, east] = ends(|tile| tile.x).map(|column| f64::from(column) * side - 180.0);
    let [south, north] = ends(|tile| tile.y).map(|row| scheme.degrees(zoom, row));
    // Columns go on beyond the 180th meridian.
    let turned = |degrees: f64| match degrees {
        beyond if beyond > 180.0 => beyond - 360.0,
        beyond if beyond < -180.0 => beyond + 360.0,
        degrees => degrees,
    };
    [turned(west), south, turned(east), north]
}

/// Returns about how many bytes of memory terrain tiles take on so many threads.
pub(crate) fn terrain_memory(plan: &Plan, threads: usize) -> u64 {
    // A tile of the job, its points on the grid and its pieces; or four tiles and the selection from them.
    const PER_THREAD: u64 = 64 << 20;
    let crowd = plan.terrain_crowd.map_or(0, TerrainCrowd::bytes);
    match plan.options.output.terrain {
        Some(_) => ((threads as u64 * PER_THREAD).max(crowd) + shore_memory(plan)).min(working_memory(&plan.options)),
        None => 0,
    }
}
