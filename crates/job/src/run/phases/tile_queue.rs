//! Running steps 5 and 6, each tile as soon as it can be done: while other tiles are still triangulated.

use crate::index::TileIndex;
use crate::partition::result::Partition;
use crate::preflight::stage_costs::triangulated_share;
use crate::progress::activity::Activity;
use crate::progress::stage::Stage;
use crate::progress::stats::StageStats;
use crate::records::FinishedBorder;
use crate::run::folder::Folder;
use crate::run::job::Job;
use crate::run::meshed_part::SomeTiles;
use crate::tiles::appearance::TileAppearance;
use crate::tiles::border_normals::finish_border_normals;
use crate::tiles::dependencies::{FinishedTile, TileDependencies};
use crate::tiles::seam::seam_of;
use crate::tiles::write_tile::{TileStats, write_tile};
use rayon::Scope;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use sys::{Result, fault, interrupt};

/// Finishes and writes tiles. Any thread may call its methods.
pub(crate) struct TileQueue<'a> {
    folder: &'a Folder,
    partition: &'a Partition,
    stage: &'a Stage,
    /// Whether all that the tiles need stays once they are written.
    keeps_mesh: bool,
    border_normals: Activity,
    write: Activity,
    /// How tiles look; `None` if none may be written yet.
    appearance: Option<Arc<TileAppearance>>,
    state: Mutex<QueueState>,
    /// The first error.
    failure: OnceLock<crate::Error>,
}

struct QueueState {
    dependencies: TileDependencies,
    /// Which tiles of the part no merge can change any more.
    finished: Vec<bool>,
    stats: TileStats,
    written: Vec<TileIndex>,
    /// The tiles that are not written, but their borders are finished, and the neighbours of each.
    with_border: BTreeMap<TileIndex, Vec<TileIndex>>,
}

impl<'a> TileQueue<'a> {
    pub(crate) fn new(
        job: &Job,
        folder: &'a Folder,
        partition: &'a Partition,
        stage: &'a Stage,
        appearance: Option<Arc<TileAppearance>>,
    ) -> TileQueue<'a> {
        let tiles = partition.tree.leaves.len();
        let state = QueueState {
            dependencies: TileDependencies::new(tiles),
            finished: vec![false; tiles],
            stats: TileStats::default(),
            written: Vec::new(),
            with_border: BTreeMap::new(),
        };
        TileQueue {
            folder,
            partition,
            stage,
            keeps_mesh: job.plan.keeps_mesh(),
            border_normals: job.progress.activity("border normals", "tiles"),
            write: job.progress.activity("write", "points"),
            appearance,
            state: Mutex::new(state),
            failure: OnceLock::new(),
        }
    }

    /// Takes a finished tile.
    pub(crate) fn push<'s>(&'s self, scope: &Scope<'s>, tile: FinishedTile) {
        self.state().finished[tile.tile.get()] = true;
        let Some(appearance) = &self.appearance else { return };
        scope.spawn(move |scope| {
            for ready in self.attempt(|| self.finish_border(appearance, tile)).unwrap_or_default() {
                scope.spawn(move |_| {
                    self.attempt(|| self.write(appearance, ready));
                });
            }
        });
    }

    /// Runs `work` unless something failed before. Keeps the first error for [`TileQueue::finish`].
    pub(crate) fn attempt<T, E: Into<crate::Error>>(
        &self,
        work: impl FnOnce() -> std::result::Result<T, E>,
    ) -> Option<T> {
        if self.failure.get().is_some() {
            return None;
        }
        work().map_err(|error| _ = self.failure.set(error.into())).ok()
    }

    /// Ends the queue. Returns what became of the tiles, and those that merges above the part may change. Adds its stages.
    ///
    /// # Errors
    /// The first error of all.
    pub(crate) fn finish(self, stages: &mut Vec<StageStats>) -> crate::Result<(SomeTiles, Vec<TileIndex>)> {
        if let Some(failure) = self.failure.into_inner() {
            return Err(failure);
        }
        let QueueState { finished, stats, mut written, with_border, .. } =
            self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        stages.extend([self.border_normals.finish(), self.write.finish()]);
        let open = self.partition.tree.tiles().zip(finished).filter(|(_, finished)| !finished).map(|(tile, _)| tile);
        // The journal must not depend on the order in which threads end.
        written.sort_unstable();
        let with_border = with_border.into_iter().collect();
        Ok((SomeTiles { stats, written, with_border, waited: Vec::new() }, open.collect()))
    }

    /// Finishes the border normals of a tile and returns the tiles that can be written now.
    fn finish_border(&self, appearance: &TileAppearance, finished: FinishedTile) -> Result<Vec<FinishedTile>> {
        interrupt::check()?;
        let (store, tree) = (&self.folder.store, &self.partition.tree);
        let work = || {
            let seam = seam_of(store, tree, finished)?;
            finish_border_normals(store, tree, &appearance.style, finished.tile, &seam)
        };
        let neighbours = self.border_normals.time(1, work)?;
        let mut state = self.state();
        let ready = state.dependencies.border_done(finished, &neighbours);
        state.with_border.insert(finished.tile, neighbours);
        Ok(ready)
    }

    fn write(&self, TileAppearance { style, canvas }: &TileAppearance, finished: FinishedTile) -> Result<()> {
        interrupt::check()?;
        let Folder { directory, store, journal, .. } = self.folder;
        let (tile, points) = (finished.tile, self.partition.points(finished.tile));
        let border_of = |tile| FinishedBorder::load(store, tile);
        let work = || {
            let seam = seam_of(store, &self.partition.tree, finished)?;
            write_tile(directory, store, style, canvas, tile, &seam, &border_of)
        };
        let (stats, files) = self.write.time(points, work)?;
        journal.add_files(&files);
        fault::point("tile");
        if !self.keeps_mesh {
            self.partition.records_of_leaf(tile).try_for_each(|record| store.free(record))?;
        }
        let mut state = self.state();
        state.stats += stats;
        state.written.push(tile);
        state.with_border.remove(&tile);
        drop(state);
        self.stage.advance(points - triangulated_share(points));
        Ok(())
    }

    fn state(&self) -> MutexGuard<'_, QueueState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
