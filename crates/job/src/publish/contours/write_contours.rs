//! Writing `contours.gpkg` and `contours.dxf`.

use crate::durable::atomic_file::{PendingFile, create_folder_of, find_pending, partial_path, remove_file};
use crate::durable::directory::JobDirectory;
use crate::plan::job_plan::Plan;
use crate::publish::contours::check::TerrainLevels;
use crate::publish::contours::drawing::ContourDrawing;
use crate::publish::contours::line_producer::{LineProducer, WrittenLine};
use crate::publish::contours::waiting_chains::{FinishedChains, WaitingChains};
use crate::publish::raster::system::system_of;
use crate::publish::raster::tile_meshes::{TileBox, boxes, lattice_mesh};
use crate::publish::side_files::EachTile;
use contours::{Plane, trace};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sys::{Error, Result, disk, interrupt};
use tiles::frame::Frame;
use tiles::geopackage::lines::{LayerAbout, LineLayer};

/// What came of contour lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ContourStats {
    /// Lines and rings.
    pub lines: u64,
    /// Their points.
    pub points: u64,
    /// The levels over the heights of the terrain.
    pub levels: u64,
    /// Bytes of the files.
    pub bytes: u64,
}

impl ContourStats {
    /// Returns what the user should know about a file without lines.
    pub(crate) fn warning(&self) -> Option<String> {
        (self.lines == 0).then(|| {
            "contours.gpkg has no line: no level crosses the terrain; fix: [output] contours with a smaller interval, or other levels"
                .into()
        })
    }
}

/// Returns what the user should know about a drawing whose heights are in another unit than x and y.
pub(crate) fn drawing_warning(plan: &Plan) -> Option<String> {
    let extras = plan.frame.extras();
    let has_drawing = plan.options.output.contours.as_ref().is_some_and(|contours| contours.dxf);
    (has_drawing && extras.metres_per_unit != extras.metres_per_unit_z).then(|| {
        "contours.dxf: heights are in another unit than x and y, and programs expect one unit for all; fix: scale the heights there".into()
    })
}

/// Contour lines that are to be written.
pub(crate) struct ContourWork<'a> {
    plan: &'a Plan,
    frame: &'a Frame,
    tiles: Vec<TileBox>,
    levels: TerrainLevels,
    /// Whether the lines are written as DXF too.
    has_drawing: bool,
}

impl<'a> ContourWork<'a> {
    /// Looks at what is to be done for the contour lines of a job whose tiles have the scene of `frame`; `None` if the user wants none.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on a store, [`Error::Config`] if the levels are too many or too close.
    pub(crate) fn of(plan: &'a Plan, frame: &'a Frame, tiles: &dyn EachTile) -> Result<Option<ContourWork<'a>>> {
        let Some(options) = &plan.options.output.contours else { return Ok(None) };
        let tiles = boxes(tiles)?;
        let heights = tiles.iter().map(|tile| tile.heights);
        let heights = heights.reduce(|[low, high], [lower, higher]| [low.min(lower), high.max(higher)]);
        let heights = heights.ok_or_else(|| Error::Broken("there is no tile to make contour lines of".into()))?;
        let levels = TerrainLevels::of(&options.levels, &plan.lattice, heights)?;
        Ok(Some(ContourWork { plan, frame, tiles, levels, has_drawing: options.dxf }))
    }

    /// Returns the number of tiles to trace and of levels to write.
    pub(crate) fn steps(&self) -> u64 {
        (self.tiles.len() + self.levels.heights.len()) as u64
    }

    /// Writes the lines from the tiles, which must have their names. Calls `done` for each of the [steps](ContourWork::steps).
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a file, [`Error::Interrupted`].
    pub(crate) fn write(
        &self,
        directory: &JobDirectory,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<(ContourStats, Vec<PendingFile>)> {
        let mut chains = self.trace(directory, done)?;
        let files = self.write_lines(directory, &mut chains, done);
        chains.discard()?;
        files
    }

    /// Traces all levels through all tiles.
    fn trace(&self, directory: &JobDirectory, done: &(dyn Fn(u64) + Sync)) -> Result<FinishedChains> {
        let waiting = WaitingChains::create(&directory.scratch("contours.chains"))?;
        let extras = self.frame.extras();
        let plane = Plane { offset: [extras.offset[0], extras.offset[1]], step: extras.resolution };
        self.tiles.par_iter().with_max_len(1).try_for_each(|tile| {
            interrupt::check()?;
            let mesh = lattice_mesh(&directory.output().tile(tile.tile.number()), self.frame)?;
            trace(&mesh.positions, &mesh.triangles, &self.levels.levels, plane, &mut |band| waiting.add(band))?;
            done(1);
            Ok::<_, Error>(())
        })?;
        Ok(waiting.finish())
    }

    /// Writes the lines of all levels as the pending files of the contour lines.
    fn write_lines(
        &self,
        directory: &JobDirectory,
        chains: &mut FinishedChains,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<(ContourStats, Vec<PendingFile>)> {
        let (path, boxes_path) = (directory.output().contours(), directory.scratch("contours.boxes"));
        create_folder_of(&path)?;
        let partial = partial_path(&path);
        let create = |path| disk::create(path).map_err(Error::io("create", path));
        let (file, boxes) = (create(&partial)?, create(&boxes_path)?);
        let system = system_of(self.plan);
        let about = LayerAbout { system: &system, copyright: self.plan.options.output.copyright() };
        let mut layer = LineLayer::new(&file, &boxes, about);
        let mut drawing = match self.has_drawing {
            true => {
                Some(ContourDrawing::create(self.plan, self.frame, &self.tiles, &directory.output().contour_drawing())?)
            }
            false => None,
        };
        let mut producer = LineProducer::new(chains, &self.levels, about.system_number(), self.has_drawing);
        let mut stats = ContourStats { levels: self.levels.heights.len() as u64, ..ContourStats::default() };
        let mut lines: Vec<WrittenLine> = Vec::new();
        loop {
            stats.points += lines.iter().map(|line| line.row.points()).sum::<u64>();
            let mut add = || {
                let rows = lines.iter().try_for_each(|line| layer.add(&line.row));
                rows.map_err(Error::io("write", &partial))?;
                drawing.as_mut().map_or(Ok(()), |drawing| lines.iter().try_for_each(|line| drawing.add(&line.drawn)))
            };
            let (added, next) = rayon::join(&mut add, || producer.next());
            added?;
            match next? {
                Some(next) => lines = next,
                None => break,
            }
        }
        stats.lines = layer.finish().map_err(Error::io("write", &partial))?;
        done(stats.levels);
        drop(boxes);
        remove_file(&boxes_path)?;
        disk::begin_sync(&file);
        let mut files = vec![find_pending(&path)?];
        if let Some(drawing) = drawing {
            files.push(drawing.finish()?);
        }
        stats.bytes = files.iter().map(|file| file.bytes).sum();
        Ok((stats, files))
    }
}

/// Returns about how many bytes of memory contour lines take on so many threads, besides the tiles that are read.
pub(crate) fn contour_memory(plan: &Plan, threads: usize) -> u64 {
    // A band of levels with its crossings, chains and points, and the lines that are made and written.
    const PER_THREAD: u64 = 24 << 20;
    const LINES: u64 = 64 << 20;
    match plan.options.output.contours {
        Some(_) => threads as u64 * PER_THREAD + LINES,
        None => 0,
    }
}
