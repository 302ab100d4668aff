//! Running steps 5 and 6, each tile as soon as it can be done: while other tiles are still triangulated, once writing has begun.

use crate::job::partition::result::Partition;
use crate::job::progress::activity::Activity;
use crate::job::progress::stage::Stage;
use crate::job::records::JobStep;
use crate::job::run::freeing::Freeing;
use crate::job::run::run_context::RunContext;
use crate::job::run::stage_costs::triangulated_share;
use crate::job::tiles::border_normals::finish_border_normals;
use crate::job::tiles::dependencies::{FinishedTile, TileDependencies};
use crate::job::tiles::style::TileStyle;
use crate::job::tiles::write_tile::{TileStats, write_tile};
use crate::output::preview::canvas::Canvas;
use crate::{Error, Result};
use rayon::Scope;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Finishes and writes tiles. Any thread may call its methods.
pub(crate) struct TileQueue<'a> {
    run: &'a RunContext<'a>,
    partition: &'a Partition,
    stage: &'a Stage,
    /// Takes the leaves that are not needed any more.
    freeing: &'a Freeing<'a>,
    border_normals: Activity,
    write: Activity,
    /// How tiles look and what they are drawn on; set when tiles may be written.
    style: OnceLock<(TileStyle, Canvas)>,
    state: Mutex<QueueState>,
    has_failed: AtomicBool,
}

struct QueueState {
    /// Tiles that were finished before tiles may be written.
    held: Vec<FinishedTile>,
    dependencies: TileDependencies,
    written: usize,
    stats: TileStats,
    /// The first error.
    failure: Option<Error>,
}

/// Totals over all tiles.
pub(crate) struct WrittenTiles {
    pub(crate) style: TileStyle,
    pub(crate) canvas: Canvas,
    pub(crate) stats: TileStats,
}

impl<'a> TileQueue<'a> {
    pub(crate) fn new(
        run: &'a RunContext<'a>,
        partition: &'a Partition,
        stage: &'a Stage,
        freeing: &'a Freeing<'a>,
    ) -> TileQueue<'a> {
        let dependencies = TileDependencies::new(partition.tree.leaves.len());
        let state =
            QueueState { held: Vec::new(), dependencies, written: 0, stats: TileStats::default(), failure: None };
        TileQueue {
            run,
            partition,
            stage,
            freeing,
            border_normals: run.progress.activity("border normals", "tiles"),
            write: run.progress.activity("write", "points"),
            style: OnceLock::new(),
            state: Mutex::new(state),
            has_failed: AtomicBool::new(false),
        }
    }

    /// Lets tiles be written from now on, beginning with those that are finished already.
    pub(crate) fn begin<'s>(&'s self, scope: &Scope<'s>, style: TileStyle, canvas: Canvas) {
        let mut state = self.state();
        // The lock is held here, so that no thread holds back a tile after these are taken.
        self.style.get_or_init(|| (style, canvas));
        let held = std::mem::take(&mut state.held);
        drop(state);
        held.into_iter().for_each(|tile| self.start(scope, tile));
    }

    /// Takes a finished tile.
    pub(crate) fn push<'s>(&'s self, scope: &Scope<'s>, tile: FinishedTile) {
        let mut state = self.state();
        if self.style.get().is_none() {
            state.held.push(tile);
            return;
        }
        drop(state);
        self.start(scope, tile);
    }

    /// Runs `work` unless something failed before. Keeps the first error for [`TileQueue::finish`].
    pub(crate) fn attempt<T>(&self, work: impl FnOnce() -> Result<T>) -> Option<T> {
        if self.has_failed.load(Ordering::Relaxed) {
            return None;
        }
        let keep = |error| {
            self.state().failure.get_or_insert(error);
            self.has_failed.store(true, Ordering::Relaxed);
        };
        work().map_err(keep).ok()
    }

    /// Ends the queue and returns the totals over all tiles. Adds its stages to the report.
    ///
    /// # Errors
    /// The first error of all; [`Error::Broken`] if a tile was not written.
    pub(crate) fn finish(self) -> Result<WrittenTiles> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(failure) = state.failure {
            return Err(failure);
        }
        let style = self.style.into_inner().filter(|_| state.written == self.partition.tree.leaves.len());
        let Some((style, canvas)) = style else {
            return Err(Error::Broken(format!("only {} tiles were written", state.written)));
        };
        self.run.add_stage(self.border_normals.finish());
        self.run.add_stage(self.write.finish());
        Ok(WrittenTiles { style, canvas, stats: state.stats })
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
        let (style, _) = self.style()?;
        let work = || finish_border_normals(store, &self.partition.tree, style, finished);
        let step = JobStep::BorderNormals(finished.tile);
        let neighbours = journal.step(step, || self.border_normals.time(1, work))?;
        Ok(self.state().dependencies.border_done(finished, &neighbours))
    }

    fn write(&self, finished: FinishedTile) -> Result<()> {
        let RunContext { journal, directory, store, .. } = *self.run;
        let (style, canvas) = self.style()?;
        let work = || write_tile(directory, store, &self.partition.tree, style, canvas, finished);
        let (step, points) = (JobStep::WriteTile(finished.tile), self.partition.points(finished.tile));
        let stats = journal.step(step, || self.write.time(points, work))?;
        self.freeing.tile_written(finished.tile);
        let mut state = self.state();
        state.stats += stats;
        state.written += 1;
        drop(state);
        self.run.count(self.stage, step, points - triangulated_share(points));
        Ok(())
    }

    fn style(&self) -> Result<&(TileStyle, Canvas)> {
        self.style.get().ok_or_else(|| Error::Broken("a tile is written too early".into()))
    }

    fn state(&self) -> MutexGuard<'_, QueueState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
