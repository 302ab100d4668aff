//! Giving the room of what no step needs any more back to the disk while the job goes on: the points of a tile once it is
//! triangulated, and its sites and triangles once it is written.
//!
//! What takes their place must outlast a power failure first. So a thread waits until the journal and the store are on the disk, and
//! it does so for many tiles at a time. After that the next run takes their steps as done (`resume.rs`).

use crate::job::index::TileIndex;
use crate::job::partition::point_file::{PointBlock, pages_of};
use crate::job::partition::result::Partition;
use crate::job::plan::job_plan::Plan;
use crate::job::records::StepRecord;
use crate::job::run::run_context::RunContext;
use crate::output::options::MaxEdge;
use crate::{Error, Result, disk, fault};
use std::io::ErrorKind;
use std::ops::Range;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::Builder;

/// At most about this many bytes wait to be freed. Each time, everything in the store is brought to the disk.
const MOST_WAITING: u64 = 64 << 20;
/// In small jobs, this share of the points.
const WAITING_SHARE: u64 = 16;

/// What no step needs any more.
enum Unneeded {
    /// The points of a tile.
    Points(TileIndex),
    /// The [`crate::job::records::Leaf`] of a tile.
    Leaf(TileIndex),
}

/// Takes what no step needs any more. Any thread may call its methods.
pub(crate) struct Freeing {
    /// `None` if everything is kept.
    sender: Option<Sender<Unneeded>>,
    /// Whether nothing counts the sites of all leaves again after an interruption.
    frees_leaves: bool,
}

impl Freeing {
    /// Tells whether anything is freed.
    pub(crate) fn is_on(&self) -> bool {
        self.sender.is_some()
    }

    /// Notes that the journal has the leaf of `tile`: its points are not needed any more.
    pub(crate) fn leaf_done(&self, tile: TileIndex) {
        self.send(Unneeded::Points(tile));
    }

    /// Notes that the journal has that `tile` is written: its leaf is not needed any more.
    pub(crate) fn tile_written(&self, tile: TileIndex) {
        if self.frees_leaves {
            self.send(Unneeded::Leaf(tile));
        }
    }

    fn send(&self, unneeded: Unneeded) {
        if let Some(sender) = &self.sender {
            // If the thread has failed, its error comes at the end.
            let _ = sender.send(unneeded);
        }
    }
}

/// Does `work`, and frees what it no longer needs, unless the job keeps its steps.
///
/// # Errors
/// Those of `work`; [`Error::Io`] if something cannot be brought to the disk or freed.
pub(crate) fn while_freeing<T>(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    work: impl FnOnce(&Freeing) -> Result<T>,
) -> Result<T> {
    let options = &plan.options;
    let frees_leaves = options.output.max_edge != MaxEdge::Auto;
    if options.limits.keep_steps.keeps(partition.summary.counts.kept) {
        return work(&Freeing { sender: None, frees_leaves });
    }
    std::thread::scope(|scope| {
        let (sender, receiver) = channel();
        let free = move || free_all(run, partition, receiver);
        let thread = Builder::new().name("freeing".into()).spawn_scoped(scope, free);
        let thread = thread.map_err(|e| Error::Memory(format!("cannot start a thread: {e}")))?;
        let freeing = Freeing { sender: Some(sender), frees_leaves };
        let outcome = work(&freeing);
        // This ends the thread.
        drop(freeing);
        let freed = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        outcome.and_then(|outcome| freed.map(|()| outcome))
    })
}

/// What waits until it may be freed.
#[derive(Default)]
struct Waiting {
    points: Vec<TileIndex>,
    leaves: Vec<TileIndex>,
    bytes: u64,
}

/// Frees what `receiver` gets until nobody can send any more. What waits by then goes soon, with its file.
fn free_all(run: &RunContext, partition: &Partition, receiver: Receiver<Unneeded>) -> Result<()> {
    let most_waiting = (partition.point_bytes / WAITING_SHARE).min(MOST_WAITING);
    let mut waiting = Waiting::default();
    for unneeded in receiver {
        match unneeded {
            Unneeded::Points(tile) => {
                waiting.points.push(tile);
                waiting.bytes += pages_of(&partition.blocks[tile.get()]).iter().map(length).sum::<u64>();
            }
            Unneeded::Leaf(tile) => {
                waiting.leaves.push(tile);
                waiting.bytes += run.store.place(StepRecord::Leaf(tile))?.length;
            }
        }
        if waiting.bytes > most_waiting {
            free(run, partition, std::mem::take(&mut waiting))?;
        }
    }
    Ok(())
}

/// Brings what replaces `unneeded` to the disk, and frees it.
fn free(run: &RunContext, partition: &Partition, unneeded: Waiting) -> Result<()> {
    run.journal.commit_to(run.journal.position())?;
    run.store.sync()?;
    run.temporary.measure(partition, run.store);
    fault::point("freeing");
    unneeded.leaves.into_iter().try_for_each(|tile| run.store.free(StepRecord::Leaf(tile)))?;
    let blocks: Vec<PointBlock> =
        unneeded.points.iter().flat_map(|tile| &partition.blocks[tile.get()]).copied().collect();
    let path = run.directory.points();
    // It is opened each time, because an open file is not freed when it is removed.
    let freed = match disk::open(&path) {
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(0),
        file => file.and_then(|file| disk::free(&file, &pages_of(&blocks))),
    };
    run.temporary.points_freed(freed.map_err(Error::io("write", &path))?);
    fault::point("freed");
    Ok(())
}

fn length(range: &Range<u64>) -> u64 {
    range.end - range.start
}
