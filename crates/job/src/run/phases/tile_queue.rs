//! Running steps 5 and 6, each tile as soon as it can be done: while other tiles are still triangulated, or once other parts are meshed.

use crate::index::{NodeIndex, TileIndex};
use crate::merge_records::SeamOfTile;
use crate::partition::result::Partition;
use crate::preflight::stage_costs::triangulated_share;
use crate::progress::activity::Activity;
use crate::progress::stage::Stage;
use crate::progress::stats::StageStats;
use crate::records::FinishedBorder;
use crate::run::folder::Folder;
use crate::run::job::Job;
use crate::run::meshed_part::{SomeTiles, WaitedTile};
use crate::run::phases::join::JoinedParts;
use crate::tiles::appearance::TileAppearance;
use crate::tiles::border_normals::finish_border_normals;
use crate::tiles::dependencies::{FinishedTile, TileDependencies};
use crate::tiles::seam::seam_of;
use crate::tiles::write_tile::{TileStats, write_tile};
use rayon::Scope;
use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use sys::{Result, fault, interrupt};

/// The tiles of a part that are not written yet, each with the tiles that must be finished before it, if they are known.
pub(crate) type TilesBefore = BTreeMap<TileIndex, Option<Vec<TileIndex>>>;

/// Finishes and writes tiles. Any thread may call its methods.
pub(crate) struct TileQueue<'a> {
    job: &'a Job<'a>,
    folder: &'a Folder,
    partition: &'a Partition,
    stage: &'a Stage,
    /// Whether what a tile needs is given up once it is written.
    frees: bool,
    /// What finishing and writing take, while tiles are triangulated.
    activities: Option<[Activity; 2]>,
    /// How tiles look; `None` if none may be written yet.
    appearance: Option<Arc<TileAppearance>>,
    /// The merges above the parts, and the tiles that they may still change; `None` while the part itself is merged.
    joined: Option<(&'a JoinedParts, &'a HashSet<TileIndex>)>,
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
    /// With `--update`, what is known of tiles that have waited for other parts.
    waited: Vec<WaitedTile>,
}

impl<'a> TileQueue<'a> {
    /// Returns a queue for the tiles of a part that is being meshed.
    pub(crate) fn new(
        job: &'a Job<'a>,
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
            waited: Vec::new(),
        };
        TileQueue {
            job,
            folder,
            partition,
            stage,
            frees: !job.plan.keeps_mesh(),
            activities: Some([
                job.progress.activity("border normals", "tiles"),
                job.progress.activity("write", "points"),
            ]),
            appearance,
            joined: None,
            state: Mutex::new(state),
            failure: OnceLock::new(),
        }
    }

    /// Returns a queue for tiles that have waited for other parts: no merge changes a tile that is not `open`.
    pub(crate) fn after_merges(
        job: &'a Job<'a>,
        folder: &'a Folder,
        partition: &'a Partition,
        stage: &'a Stage,
        joined: &'a JoinedParts,
        open: &'a HashSet<TileIndex>,
        frees: bool,
    ) -> TileQueue<'a> {
        let queue = TileQueue::new(job, folder, partition, stage, Some(joined.appearance.clone()));
        TileQueue { joined: Some((joined, open)), activities: None, frees, ..queue }
    }

    /// Takes a finished tile.
    pub(crate) fn push<'s>(&'s self, scope: &Scope<'s>, tile: FinishedTile) {
        self.state().finished[tile.tile.get()] = true;
        let Some(appearance) = &self.appearance else { return };
        scope.spawn(move |scope| {
            let ready = self.attempt(|| self.finish_border(appearance, tile)).unwrap_or_default();
            self.spawn_writing(scope, appearance, ready);
        });
    }

    /// Takes the tiles that have waited for other parts. All others of the part are written.
    pub(crate) fn push_waiting<'s>(&'s self, scope: &Scope<'s>, waiting: &TilesBefore) {
        let (Some(appearance), Some((_, open))) = (&self.appearance, self.joined) else { return };
        let finished = |tile| FinishedTile { tile, last_merge: NodeIndex::ROOT };
        for tile in self.partition.tree.tiles().filter(|tile| !waiting.contains_key(tile)) {
            self.state().dependencies.border_done(finished(tile), &[]);
        }
        for (&tile, before) in waiting {
            match before {
                Some(neighbours) => {
                    let ready = self.border_done(finished(tile), neighbours.clone());
                    self.spawn_writing(scope, appearance, ready);
                }
                None if open.contains(&tile) => {}
                None => self.push(scope, finished(tile)),
            }
        }
    }

    fn spawn_writing<'s>(&'s self, scope: &Scope<'s>, appearance: &'s TileAppearance, tiles: Vec<FinishedTile>) {
        for ready in tiles {
            scope.spawn(move |_| {
                self.attempt(|| self.write(appearance, ready));
            });
        }
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
        let QueueState { finished, stats, mut written, with_border, mut waited, .. } =
            self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        stages.extend(self.activities.into_iter().flatten().map(Activity::finish));
        let open = self.partition.tree.tiles().zip(finished).filter(|(_, finished)| !finished).map(|(tile, _)| tile);
        // The journal must not depend on the order in which threads end.
        written.sort_unstable();
        waited.sort_unstable_by_key(|waited| waited.tile);
        Ok((SomeTiles { stats, written, with_border: with_border.into_iter().collect(), waited }, open.collect()))
    }

    /// Finishes the border normals of a tile and returns the tiles that can be written now.
    fn finish_border(&self, appearance: &TileAppearance, finished: FinishedTile) -> Result<Vec<FinishedTile>> {
        interrupt::check()?;
        let (store, tree) = (&self.folder.store, &self.partition.tree);
        let work = || finish_border_normals(store, tree, &appearance.style, finished.tile, &self.seam(finished)?);
        let neighbours = match &self.activities {
            Some([border_normals, _]) => border_normals.time(1, work)?,
            None => work()?,
        };
        Ok(self.border_done(finished, neighbours))
    }

    /// Notes that the border of a tile with these neighbours is finished, and returns the tiles that can be written now.
    fn border_done(&self, finished: FinishedTile, neighbours: Vec<TileIndex>) -> Vec<FinishedTile> {
        let waits = self.joined.is_some_and(|(_, open)| neighbours.iter().any(|other| open.contains(other)));
        let is_own = |other: &TileIndex| !waits && other.part() == finished.tile.part();
        let own: Vec<TileIndex> = neighbours.iter().copied().filter(is_own).collect();
        let mut state = self.state();
        let mut ready = state.dependencies.border_done(finished, &own);
        ready.retain(|ready| !waits || ready.tile != finished.tile);
        state.with_border.insert(finished.tile, neighbours);
        ready
    }

    fn write(&self, TileAppearance { style, canvas }: &TileAppearance, finished: FinishedTile) -> Result<()> {
        interrupt::check()?;
        let Folder { directory, store, journal, .. } = self.folder;
        let (tile, points) = (finished.tile, self.partition.points(finished.tile));
        let border_of = |other: TileIndex| match self.joined {
            Some((joined, _)) if other.part() != tile.part() => joined.border_of(self.job, other),
            _ => FinishedBorder::load(store, other),
        };
        let work = || write_tile(directory, store, style, canvas, tile, &self.seam(finished)?, &border_of);
        let ((stats, files), done) = match &self.activities {
            Some([_, write]) => (write.time(points, work)?, points - triangulated_share(points)),
            None => (work()?, 1),
        };
        journal.add_files(&files);
        fault::point("tile");
        if self.frees {
            self.partition.records_of_leaf(tile).try_for_each(|record| store.free(record))?;
        }
        let joined = self.joined.filter(|_| self.job.plan.options.updates);
        let key = joined.map(|(joined, _)| joined.key_of_tile(self.job, tile)).transpose()?;
        let mut state = self.state();
        state.stats += stats;
        state.written.push(tile);
        let neighbours = state.with_border.remove(&tile).unwrap_or_default();
        state.waited.extend(key.map(|key| WaitedTile { tile, stats, key, neighbours }));
        drop(state);
        self.stage.advance(done);
        Ok(())
    }

    /// Returns what all seams have of a tile.
    fn seam(&self, finished: FinishedTile) -> Result<SeamOfTile> {
        let mut seam = seam_of(&self.folder.store, &self.partition.tree, finished)?;
        self.joined.map_or(Ok(()), |(joined, _)| joined.add_seams(self.job, finished.tile, &mut seam))?;
        Ok(seam)
    }

    fn state(&self) -> MutexGuard<'_, QueueState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
