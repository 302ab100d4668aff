//! Going on with a job that was interrupted: which of its steps stay, and what must be done again.
//!
//! A step stays if what it left is there and whole, or if nothing needs that any more. Steps depend on nothing but the job,
//! so a step that is done again leaves the same as before, and the steps after it stay.

use crate::job::Options;
use crate::job::durable::directory::Directory;
use crate::job::durable::journal::{self, Entry, Journal, Step};
use crate::job::durable::store::{Store, Stored};
use crate::job::options::JobOptions;
use crate::job::partition::point_file::Spill;
use crate::job::partition::read::Partition;
use crate::job::plan::fingerprint::{Change, Fingerprint, Head};
use crate::job::plan::lattice_choice::Coarser;
use crate::job::progress::stage::{Progress, Stage};
use crate::job::report::Report;
use crate::output::options::MaxEdge;
use crate::{Error, Result, interrupt};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

/// Where a run begins.
pub struct Start<'a> {
    /// Holds what the finished steps have left.
    pub store: Store,
    /// Knows which steps are finished.
    pub journal: Journal<'a>,
    /// What step 2 came to, if that is one of them.
    pub partition: Option<Partition>,
    /// The files, by name, that finished steps have left and that stay.
    pub files: HashSet<PathBuf>,
    /// Whether finished steps have left a part of the results.
    pub parts: bool,
}

/// How much coarser than at first the lattice of the interrupted job became, if it is the same job.
///
/// # Errors
/// [`Error::Io`] if its journal cannot be read.
pub fn coarser(directory: &Directory, fingerprint: &Fingerprint) -> Result<Coarser> {
    let same = |head: &Head| !matches!(fingerprint.since(&head.fingerprint), Change::Mesh(_));
    let head = journal::read(directory)?.map(|(head, _)| head);
    Ok(head.filter(same).map(|head| head.coarser).unwrap_or_default())
}

/// The report of the job `head`, if the run that the directory holds was interrupted only while it cleaned up.
///
/// # Errors
/// [`Error::Io`] if its journal cannot be read.
pub fn complete(directory: &Directory, head: &Head) -> Result<Option<Report>> {
    let Some((old, entries)) = journal::read(directory)? else { return Ok(None) };
    let is_written = entries
        .iter()
        .any(|entry| entry.step == Step::Report && entry.results.iter().all(|file| file.is_whole(directory)));
    if !is_written || old.coarser != head.coarser || head.fingerprint.since(&old.fingerprint) != Change::Nothing {
        return Ok(None);
    }
    let text = std::fs::read(directory.report()).map_err(Error::io("read", directory.report()))?;
    Ok(serde_json::from_slice(&text).ok())
}

/// Begins the run of the job `head`, that of `config`, in its locked directory: goes on with the one that the directory holds, as
/// far as it is the same and whole, and removes all else.
///
/// # Errors
/// [`Error::Io`] on the job directory.
pub fn start<'a>(directory: &'a Directory, head: &Head, config: &JobOptions, options: Options) -> Result<Start<'a>> {
    let progress = options.progress;
    let kept = if options.fresh { None } else { kept(directory, head, config, progress)? };
    let kept = kept.unwrap_or_default();
    let parts = has_parts(directory)?;
    if parts && kept.entries.is_empty() {
        // Once the old journal is gone nobody knows whose they are.
        directory.sweep_results(&HashSet::new())?;
    }
    if !kept.entries.is_empty() {
        progress.note(&format!("going on with an interrupted run: {} steps are done", kept.entries.len()));
    }
    let stored: Vec<Stored> = kept.entries.iter().flat_map(|entry| &entry.stored).copied().collect();
    let journal = Journal::begin(directory, head, kept.entries)?;
    directory.sweep_job(&kept.files)?;
    let paths = directory.store();
    let store = if stored.is_empty() { Store::create(paths)? } else { Store::open(paths, stored.iter())? };
    Ok(Start { store, journal, partition: kept.partition, files: kept.files, parts })
}

/// Whether an interrupted run has left a part of its results. Before that, those of an earlier job have made way, report and all.
fn has_parts(directory: &Directory) -> Result<bool> {
    let is_export = |entry: &Entry| matches!(entry.step, Step::Export(_));
    let exported = journal::read(directory)?.is_some_and(|(_, entries)| entries.iter().any(is_export));
    Ok(exported && !directory.report().exists())
}

/// What stays.
#[derive(Default)]
struct Kept {
    entries: Vec<Entry>,
    /// The files, by name, that the steps to come need.
    files: HashSet<PathBuf>,
    partition: Option<Partition>,
}

fn kept(directory: &Directory, head: &Head, config: &JobOptions, progress: Progress) -> Result<Option<Kept>> {
    let Some((old, mut entries)) = journal::read(directory)? else { return Ok(None) };
    if entries.is_empty() || old.coarser != head.coarser {
        return Ok(None);
    }
    match head.fingerprint.since(&old.fingerprint) {
        Change::Nothing => {}
        Change::Look(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; the tiles are written again"));
            entries.retain(|entry| matches!(entry.step, Step::Partition | Step::Leaf(_) | Step::Node(_)));
        }
        Change::Mesh(what) => {
            progress.note(&format!("changed since the interrupted run: {what}; starting over"));
            return Ok(None);
        }
    }
    if head.fingerprint.memory != old.fingerprint.memory {
        // Coarser tiles for which the memory does not suffice are left out.
        entries.retain(|entry| !matches!(entry.step, Step::Level(_) | Step::Finish | Step::Report));
    }
    let stage = progress.stage("check", entries.len() as u64, "steps");
    let counted_again = config.output.max_edge == MaxEdge::Auto;
    let kept = Review::of(directory, entries, counted_again, &stage)?.map(Review::kept);
    stage.finish();
    if kept.is_none() {
        progress.note("what the interrupted run has left is not whole; starting over");
    }
    Ok(kept)
}

/// The interrupted run, looked at.
struct Review {
    directory: Directory,
    partition: Partition,
    entries: HashMap<Step, Entry>,
    /// Steps of which all that they have left is there and whole.
    whole: HashSet<Step>,
    /// Whether the step of every tile's export is one of them.
    exported: bool,
    /// Whether the sites of all leaves are counted before the next tile is written.
    counted_again: bool,
}

impl Review {
    /// `None` if its points are not there any more, though they are needed.
    fn of(directory: &Directory, entries: Vec<Entry>, counted_again: bool, stage: &Stage) -> Result<Option<Review>> {
        let stored = entries.iter().flat_map(|entry| &entry.stored);
        let Ok(store) = Store::open(directory.store(), stored) else { return Ok(None) };
        let is_whole = |entry: &Entry| {
            entry.stored.iter().all(|stored| store.is_whole(stored))
                && entry.results.iter().all(|file| file.is_whole(directory))
        };
        let check = |entry: &Entry| {
            interrupt::check()?;
            stage.advance(1);
            Ok(is_whole(entry).then_some(entry.step))
        };
        let whole =
            entries.par_iter().filter_map(|entry| check(entry).transpose()).collect::<Result<HashSet<Step>>>()?;
        if !whole.contains(&Step::Partition) {
            return Ok(None);
        }
        let partition = Partition::load(&store)?;
        let entries = entries.into_iter().map(|entry| (entry.step, entry)).collect();
        let directory = directory.clone();
        let mut review = Review { directory, partition, entries, whole, exported: false, counted_again };
        review.exported = review.tiles().all(|tile| review.whole.contains(&Step::Export(tile)));
        Ok(review.has_its_points().then_some(review))
    }

    fn tiles(&self) -> std::ops::Range<usize> {
        0..self.partition.tree.leaves.len()
    }

    /// Whether `step` is finished, and what it left is whole where that is `needed`.
    fn stays(&self, step: Step, needed: bool) -> bool {
        if needed { self.whole.contains(&step) } else { self.entries.contains_key(&step) }
    }

    fn node_stays(&self, node: usize) -> bool {
        self.stays(Step::Node(node), !self.exported)
    }

    fn stitch_stays(&self, tile: usize) -> bool {
        self.stays(Step::Stitch(tile), !self.exported)
    }

    fn leaf_stays(&self, tile: usize) -> bool {
        let tree = &self.partition.tree;
        let mut above = tree.merges_above(tree.leaves[tile]);
        let is_used_up = self.whole.contains(&Step::Export(tile))
            && (self.exported || !self.counted_again)
            && self.stitch_stays(tile)
            && above.next().is_none_or(|node| self.node_stays(node));
        self.stays(Step::Leaf(tile), !is_used_up)
    }

    /// Whether the spill still holds the points of all leaves that are to be done.
    fn has_its_points(&self) -> bool {
        let mut missing = self.tiles().filter(|&tile| !self.leaf_stays(tile)).peekable();
        if missing.peek().is_none() {
            return true;
        }
        let Ok(spill) = Spill::open(&self.directory.spill()) else { return false };
        missing.par_bridge().all(|tile| self.partition.blocks[tile].par_iter().all(|&block| spill.is_whole(block)))
    }

    fn step_stays(&self, step: Step) -> bool {
        match step {
            Step::Leaf(tile) => self.leaf_stays(tile),
            Step::Node(node) => self.node_stays(node),
            Step::Stitch(tile) => self.stitch_stays(tile),
            Step::Partition | Step::Export(_) | Step::Level(_) => self.whole.contains(&step),
            Step::Finish | Step::Report => self.exported && self.whole.contains(&step),
        }
    }

    fn kept(self) -> Kept {
        let stays: HashSet<Step> = self.entries.keys().copied().filter(|&step| self.step_stays(step)).collect();
        let mut files = HashSet::new();
        if !self.tiles().all(|tile| stays.contains(&Step::Leaf(tile))) {
            files.insert(self.directory.name(&self.directory.spill()));
        }
        let mut kept: Vec<Entry> = self.entries.into_values().filter(|entry| stays.contains(&entry.step)).collect();
        files.extend(kept.iter().flat_map(|entry| &entry.results).map(|file| file.name.clone()));
        files.extend(self.directory.store().iter().map(|path| self.directory.name(path)));
        // The journal does not depend on the order of a hash map.
        kept.sort_by_key(|entry| entry.step);
        Kept { entries: kept, files, partition: Some(self.partition) }
    }
}
