//! Giving the space of what no step needs any more back to the disk while the job goes on: the points of a tile once it is
//! triangulated, and what its leaf left once it is written.
//!
//! What takes their place must outlast a power failure first. So a thread waits until the journal and the store are on the disk, and
//! it does so for many tiles at a time. After that the next run takes their steps as done (`resume.rs`).

use crate::index::TileIndex;
use crate::partition::point_file::{PointBlock, pages_of};
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::records::StepRecord;
use crate::run::run_context::RunContext;
use std::io::ErrorKind;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use sys::{Error, Result, disk, fault};
use tiles::options::MaxEdge;

/// About this many bytes are freed at a time. Each time, everything in the store is brought to the disk.
const AT_A_TIME: u64 = 64 << 20;
/// In small jobs, this share of the points.
const SHARE: u64 = 32;

/// What no step needs any more.
#[derive(Default)]
struct Unneeded {
    /// The tiles whose points are not needed.
    points: Vec<TileIndex>,
    /// The tiles whose leaves are not needed.
    leaves: Vec<TileIndex>,
    bytes: u64,
}

/// Takes what no step needs any more. Any thread may call its methods.
pub(crate) struct Freeing<'a> {
    run: &'a RunContext<'a>,
    partition: &'a Partition,
    is_on: bool,
    /// Whether leaves are freed too: with "auto" the next run counts the sites of all of them again.
    frees_leaves: bool,
    /// How many bytes are freed at a time.
    at_a_time: u64,
    /// Whether what is left in the end is freed too.
    frees_rest: bool,
    state: Mutex<FreeingState>,
    /// Wakes the thread, and those who wait for it.
    changed: Condvar,
}

#[derive(Default)]
struct FreeingState {
    waiting: Unneeded,
    /// Nobody adds anything any more, or the thread has ended.
    is_over: bool,
}

impl Freeing<'_> {
    /// Notes that the journal has the leaf of `tile`: its points are not needed any more.
    pub(crate) fn leaf_done(&self, tile: TileIndex) {
        if self.is_on {
            let bytes = self.partition.points_bytes(tile);
            self.add(bytes, |waiting| waiting.points.push(tile));
        }
    }

    /// Notes that the journal has that `tile` is written: what its leaf left is not needed any more.
    pub(crate) fn tile_written(&self, tile: TileIndex) {
        if self.is_on && self.frees_leaves {
            let bytes = records_of_leaf(self.partition, tile).iter().map(|&record| self.run.store.length(record)).sum();
            self.add(bytes, |waiting| waiting.leaves.push(tile));
        }
    }

    fn add(&self, bytes: u64, add: impl FnOnce(&mut Unneeded)) {
        // On a slow disk the steps wait, or they would fill it.
        let is_much = |state: &mut FreeingState| state.waiting.bytes > 2 * self.at_a_time && !state.is_over;
        let mut state = self.changed.wait_while(self.state(), is_much).unwrap_or_else(PoisonError::into_inner);
        add(&mut state.waiting);
        state.waiting.bytes += bytes;
        self.changed.notify_all();
    }

    /// Frees what is added until it is over. What is left by then goes soon, with its file, unless other parts are still to be done.
    fn free_all(&self) -> Result<()> {
        loop {
            let is_little = |state: &mut FreeingState| state.waiting.bytes <= self.at_a_time && !state.is_over;
            let state = self.changed.wait_while(self.state(), is_little);
            let mut state = state.unwrap_or_else(PoisonError::into_inner);
            let is_over = state.is_over;
            if is_over && !self.frees_rest {
                return Ok(());
            }
            let unneeded = std::mem::take(&mut state.waiting);
            drop(state);
            if is_over {
                return self.free(unneeded);
            }
            self.changed.notify_all();
            self.free(unneeded)?;
        }
    }

    /// Brings what replaces `unneeded` to the disk, and frees it.
    fn free(&self, unneeded: Unneeded) -> Result<()> {
        let Freeing { run, partition, .. } = *self;
        run.journal.commit_to(run.journal.position())?;
        run.store.sync()?;
        run.temporary.measure(partition, run.store);
        fault::point("freeing");
        let records = unneeded.leaves.iter().flat_map(|&tile| records_of_leaf(partition, tile));
        records.into_iter().try_for_each(|record| run.store.free(record))?;
        let blocks = unneeded.points.iter().flat_map(|tile| &partition.blocks[tile.get()]);
        let blocks: Vec<PointBlock> = blocks.copied().collect();
        for (file, pages) in pages_of(&blocks) {
            let path = run.directory.point_file(file);
            // It is opened each time, because an open file is not freed when it is removed.
            let freed = match disk::open(&path) {
                Err(e) if e.kind() == ErrorKind::NotFound => Ok(0),
                file => file.and_then(|file| disk::free(&file, &pages)),
            };
            run.temporary.points_freed(freed.map_err(Error::io("write", &path))?);
        }
        fault::point("freed");
        Ok(())
    }

    fn end(&self) {
        self.state().is_over = true;
        self.changed.notify_all();
    }

    fn state(&self) -> MutexGuard<'_, FreeingState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the records that the leaf of `tile` writes. Only steps of the tile itself, and the merge above it, read them.
pub(crate) fn records_of_leaf(partition: &Partition, tile: TileIndex) -> [StepRecord; 3] {
    [StepRecord::Leaf(tile), StepRecord::PartialNormals(tile), StepRecord::Frontier(partition.tree.leaf(tile))]
}

/// Ends the freeing even if there is a panic, so that nobody waits for ever.
struct EndOfFreeing<'a>(&'a Freeing<'a>);

impl Drop for EndOfFreeing<'_> {
    fn drop(&mut self) {
        self.0.end();
    }
}

/// Tells whether a part gives space back while it is done. A job of several parts cannot go on with another style anyway.
pub(crate) fn frees(plan: &Plan, partition: &Partition) -> bool {
    !plan.is_one_part() || !plan.options.limits.keep_steps.keeps(partition.summary.counts.kept)
}

/// Does `work`, and frees what it no longer needs, unless the job keeps its steps.
///
/// # Errors
/// Those of `work`; [`Error::Io`] if something cannot be brought to the disk or freed.
pub(crate) fn while_freeing<T>(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    work: impl FnOnce(&Freeing) -> crate::Result<T>,
) -> crate::Result<T> {
    let options = &plan.options;
    let freeing = &Freeing {
        run,
        partition,
        is_on: frees(plan, partition),
        frees_leaves: options.output.max_edge != MaxEdge::Auto,
        at_a_time: if plan.is_one_part() { (partition.point_bytes / SHARE).min(AT_A_TIME) } else { AT_A_TIME },
        frees_rest: !plan.is_one_part(),
        state: Mutex::default(),
        changed: Condvar::new(),
    };
    if !freeing.is_on {
        return work(freeing);
    }
    std::thread::scope(|scope| {
        let free = || {
            let _end = EndOfFreeing(freeing);
            freeing.free_all()
        };
        let thread = Builder::new().name("freeing".into()).spawn_scoped(scope, free);
        let thread = thread.map_err(|e| Error::Memory(format!("cannot start a thread: {e}")))?;
        let end = EndOfFreeing(freeing);
        let outcome = work(freeing);
        drop(end);
        let freed = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        outcome.and_then(|outcome| Ok(freed.map(|()| outcome)?))
    })
}
