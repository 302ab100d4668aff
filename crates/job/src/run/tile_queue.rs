//! Running steps 5 and 6, each tile as soon as it can be done: while other tiles are still triangulated, once writing has begun.

use crate::index::TileIndex;
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::progress::activity::Activity;
use crate::progress::stage::Stage;
use crate::records::{FinishedBorder, JobStep};
use crate::run::freeing::Freeing;
use crate::run::run_context::RunContext;
use crate::run::stage_costs::triangulated_share;
use crate::tiles::border_normals::finish_border_normals;
use crate::tiles::dependencies::{FinishedTile, TileDependencies};
use crate::tiles::max_edge::MaxEdgeRule;
use crate::tiles::seam::seam_of;
use crate::tiles::style::TileStyle;
use crate::tiles::write_tile::{TileStats, write_tile};
use delaunay::geometry::Bounds;
use rayon::Scope;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use sys::{Error, Result};
use tiles::color::HeightRange;
use tiles::preview::canvas::Canvas;

/// Finishes and writes tiles. Any thread may call its methods.
pub(crate) struct TileQueue<'a> {
    run: &'a RunContext<'a>,
    partition: &'a Partition,
    stage: &'a Stage,
    /// Takes the leaves that are not needed any more.
    freeing: &'a Freeing<'a>,
    border_normals: Activity,
    write: Activity,
    /// Set when tiles may be written.
    appearance: OnceLock<Arc<TileAppearance>>,
    state: Mutex<QueueState>,
    has_failed: AtomicBool,
}

struct QueueState {
    /// Tiles that were finished before tiles may be written.
    held: Vec<FinishedTile>,
    dependencies: TileDependencies,
    /// Which tiles of the part no merge can change any more.
    finished: Vec<bool>,
    /// Which tiles of the part are written.
    written: Vec<bool>,
    stats: TileStats,
    /// The first error.
    failure: Option<crate::Error>,
}

/// How tiles look, and what they are drawn on.
pub(crate) struct TileAppearance {
    pub(crate) style: TileStyle,
    pub(crate) canvas: Canvas,
}

/// What became of the tiles of a part.
pub(crate) struct WrittenTiles {
    /// How they look; `None` if none may be written yet.
    pub(crate) appearance: Option<Arc<TileAppearance>>,
    /// Totals over those that are written.
    pub(crate) stats: TileStats,
    /// Those that wait for other parts, ascending.
    pub(crate) waiting: Vec<TileIndex>,
    /// Those among them that merges above the part may change.
    pub(crate) open: Vec<TileIndex>,
}

impl TileAppearance {
    /// Returns the appearance of a job whose points are within `bounds`, and whose greatest colour is `max_rgb`.
    ///
    /// # Errors
    /// Those of [`TileStyle::new`].
    pub(crate) fn new(plan: &Plan, max_rgb: u16, bounds: Bounds<3>, max_edge: MaxEdgeRule) -> Result<TileAppearance> {
        let heights = plan.heights.unwrap_or(HeightRange::of(bounds));
        let style = TileStyle::new(plan, max_rgb, bounds, heights, max_edge)?;
        let canvas = Canvas::new(&style.frame, bounds, heights);
        Ok(TileAppearance { style, canvas })
    }
}

impl<'a> TileQueue<'a> {
    pub(crate) fn new(
        run: &'a RunContext<'a>,
        partition: &'a Partition,
        stage: &'a Stage,
        freeing: &'a Freeing<'a>,
    ) -> TileQueue<'a> {
        let tiles = partition.tree.leaves.len();
        let state = QueueState {
            held: Vec::new(),
            dependencies: TileDependencies::new(tiles),
            finished: vec![false; tiles],
            written: vec![false; tiles],
            stats: TileStats::default(),
            failure: None,
        };
        TileQueue {
            run,
            partition,
            stage,
            freeing,
            border_normals: run.progress.activity("border normals", "tiles"),
            write: run.progress.activity("write", "points"),
            appearance: OnceLock::new(),
            state: Mutex::new(state),
            has_failed: AtomicBool::new(false),
        }
    }

    /// Lets tiles be written from now on, beginning with those that are finished already.
    pub(crate) fn begin<'s>(&'s self, scope: &Scope<'s>, appearance: Arc<TileAppearance>) {
        let mut state = self.state();
        // The lock is held here, so that no thread holds back a tile after these are taken.
        self.appearance.get_or_init(|| appearance);
        let held = std::mem::take(&mut state.held);
        drop(state);
        held.into_iter().for_each(|tile| self.start(scope, tile));
    }

    /// Takes a finished tile.
    pub(crate) fn push<'s>(&'s self, scope: &Scope<'s>, tile: FinishedTile) {
        let mut state = self.state();
        state.finished[tile.tile.get()] = true;
        if self.appearance.get().is_none() {
            state.held.push(tile);
            return;
        }
        drop(state);
        self.start(scope, tile);
    }

    /// Runs `work` unless something failed before. Keeps the first error for [`TileQueue::finish`].
    pub(crate) fn attempt<T, E: Into<crate::Error>>(
        &self,
        work: impl FnOnce() -> std::result::Result<T, E>,
    ) -> Option<T> {
        if self.has_failed.load(Ordering::Relaxed) {
            return None;
        }
        let keep = |error: E| {
            self.state().failure.get_or_insert(error.into());
            self.has_failed.store(true, Ordering::Relaxed);
        };
        work().map_err(keep).ok()
    }

    /// Ends the queue. Adds its stages to the report.
    ///
    /// # Errors
    /// The first error of all.
    pub(crate) fn finish(self) -> crate::Result<WrittenTiles> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(failure) = state.failure {
            return Err(failure);
        }
        self.run.add_stage(self.border_normals.finish());
        self.run.add_stage(self.write.finish());
        let all_but = |done: &[bool]| {
            let left = self.partition.tree.tiles().zip(done).filter(|(_, done)| !**done);
            left.map(|(tile, _)| tile).collect()
        };
        let (waiting, open) = (all_but(&state.written), all_but(&state.finished));
        Ok(WrittenTiles { appearance: self.appearance.into_inner(), stats: state.stats, waiting, open })
    }

    fn start<'s>(&'s self, scope: &Scope<'s>, tile: FinishedTile) {
        scope.spawn(move |scope| {
            for ready in self.attempt(|| self.finish_border(tile)).unwrap_or_default() {
                scope.spawn(move |_| {
                    self.attempt(|| self.write(ready));
                });
            }
        });
    }

    /// Finishes the border normals of a tile and returns the tiles that can be written now.
    fn finish_border(&self, finished: FinishedTile) -> Result<Vec<FinishedTile>> {
        let RunContext { journal, store, .. } = *self.run;
        let style = &self.appearance()?.style;
        let tree = &self.partition.tree;
        let work = || finish_border_normals(store, tree, style, finished.tile, &seam_of(store, tree, finished)?);
        let step = JobStep::BorderNormals(finished.tile);
        let neighbours = journal.step(step, || self.border_normals.time(1, work))?;
        Ok(self.state().dependencies.border_done(finished, &neighbours))
    }

    fn write(&self, finished: FinishedTile) -> Result<()> {
        let RunContext { journal, directory, store, .. } = *self.run;
        let TileAppearance { style, canvas } = self.appearance()?;
        let seam = || seam_of(store, &self.partition.tree, finished);
        let border_of = |tile| FinishedBorder::load(store, tile);
        let work = || write_tile(directory, store, style, canvas, finished.tile, &seam()?, &border_of);
        let (step, points) = (JobStep::WriteTile(finished.tile), self.partition.points(finished.tile));
        let stats = journal.step(step, || self.write.time(points, work))?;
        self.freeing.tile_written(finished.tile);
        let mut state = self.state();
        state.stats += stats;
        state.written[finished.tile.get()] = true;
        drop(state);
        self.run.count(self.stage, step, points - triangulated_share(points));
        Ok(())
    }

    fn appearance(&self) -> Result<&TileAppearance> {
        self.appearance
            .get()
            .map(|appearance| &**appearance)
            .ok_or_else(|| Error::Broken("a tile is written too early".into()))
    }

    fn state(&self) -> MutexGuard<'_, QueueState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
