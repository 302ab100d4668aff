//! Steps 5 and 6 of a job, each tile as soon as it can be done: beside those that are still triangulated, once writing has begun.

use crate::job::Job;
use crate::job::durable::journal::Step;
use crate::job::partition::read::Partition;
use crate::job::progress::stage::{Stage, StageFigures, Strand};
use crate::job::progress::time_left;
use crate::job::tiles::border_normals as stitch;
use crate::job::tiles::dependencies::{Ready, Settled};
use crate::job::tiles::write::{self, Look, TileFigures};
use crate::output::preview::canvas::Canvas;
use crate::{Error, Result};
use rayon::Scope;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Stitches and exports tiles; its methods may be called from any thread.
pub(crate) struct TileWriter<'a> {
    job: &'a Job<'a>,
    partition: &'a Partition,
    stage: &'a Stage,
    stitch: Strand,
    write: Strand,
    /// How tiles are to look and what they are drawn on, from when they may be written.
    style: OnceLock<(Look, Canvas)>,
    state: Mutex<State>,
    failed: AtomicBool,
}

struct State {
    /// Tiles that came before they could be written.
    held: Vec<Settled>,
    ready: Ready,
    exported: usize,
    written: TileFigures,
    /// What went wrong first.
    failure: Option<Error>,
}

/// What has come of all tiles.
pub(crate) struct WrittenTiles {
    pub(crate) style: (Look, Canvas),
    pub(crate) figures: TileFigures,
    pub(crate) stages: [StageFigures; 2],
}

impl<'a> TileWriter<'a> {
    pub(crate) fn new(job: &'a Job<'a>, partition: &'a Partition, stage: &'a Stage) -> TileWriter<'a> {
        let ready = Ready::new(partition.tree.leaves.len());
        let state = State { held: Vec::new(), ready, exported: 0, written: TileFigures::default(), failure: None };
        TileWriter {
            job,
            partition,
            stage,
            stitch: job.progress.strand("stitch", "tiles"),
            write: job.progress.strand("write", "points"),
            style: OnceLock::new(),
            state: Mutex::new(state),
            failed: AtomicBool::new(false),
        }
    }

    /// From here on tiles are written, those first that have come already. What an earlier job has made is removed.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be.
    pub(crate) fn begin<'s>(&'s self, scope: &Scope<'s>, style: (Look, Canvas)) -> Result<()> {
        self.job.parts.store(true, Ordering::Relaxed);
        self.job.directory.sweep_results(&self.job.kept)?;
        let mut state = self.state();
        // Under the lock, so that no tile is held any more after those that are taken here.
        self.style.get_or_init(|| style);
        let held = std::mem::take(&mut state.held);
        drop(state);
        held.into_iter().for_each(|settled| self.start(scope, settled));
        Ok(())
    }

    /// Takes a tile whose triangles are all known.
    pub(crate) fn take<'s>(&'s self, scope: &Scope<'s>, settled: Settled) {
        let mut state = self.state();
        if self.style.get().is_none() {
            state.held.push(settled);
            return;
        }
        drop(state);
        self.start(scope, settled);
    }

    /// Does `work` unless something has failed before. The first error of all is kept for [`TileWriter::finish`].
    pub(crate) fn attempt<T>(&self, work: impl FnOnce() -> Result<T>) -> Option<T> {
        if self.failed.load(Ordering::Relaxed) {
            return None;
        }
        let keep = |error| {
            self.state().failure.get_or_insert(error);
            self.failed.store(true, Ordering::Relaxed);
        };
        work().map_err(keep).ok()
    }

    /// What has come of all tiles.
    ///
    /// # Errors
    /// What went wrong first; [`Error::Broken`] if a tile was not written.
    pub(crate) fn finish(self) -> Result<WrittenTiles> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(failure) = state.failure {
            return Err(failure);
        }
        let style = self.style.into_inner().filter(|_| state.exported == self.partition.tree.leaves.len());
        let style = style.ok_or_else(|| Error::Broken(format!("only {} tiles were written", state.exported)))?;
        Ok(WrittenTiles { style, figures: state.written, stages: [self.stitch.finish(), self.write.finish()] })
    }

    fn start<'s>(&'s self, scope: &Scope<'s>, settled: Settled) {
        scope.spawn(move |scope| {
            for ready in self.attempt(|| self.stitch(settled)).unwrap_or_default() {
                scope.spawn(move |_| {
                    self.attempt(|| self.export(ready));
                });
            }
        });
    }

    /// Returns the tiles that can be exported now.
    fn stitch(&self, settled: Settled) -> Result<Vec<Settled>> {
        let Job { journal, store, .. } = *self.job;
        let (look, _) = self.style()?;
        let run = || self.stitch.time(1, || stitch::run(store, &self.partition.tree, settled, look));
        let neighbours = journal.step(Step::Stitch(settled.tile), run)?;
        Ok(self.state().ready.stitched(settled, &neighbours))
    }

    fn export(&self, settled: Settled) -> Result<()> {
        let Job { journal, directory, store, .. } = *self.job;
        let (look, canvas) = self.style()?;
        let export = || write::run(directory, store, &self.partition.tree, settled, look, canvas);
        let (step, points) = (Step::Export(settled.tile), self.partition.points(settled.tile));
        let figures = journal.step(step, || self.write.time(points, export))?;
        let mut state = self.state();
        state.written += figures;
        state.exported += 1;
        drop(state);
        self.job.count(self.stage, step, points - time_left::triangulated(points));
        Ok(())
    }

    fn style(&self) -> Result<&(Look, Canvas)> {
        self.style.get().ok_or_else(|| Error::Broken("a tile is written too early".into()))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
