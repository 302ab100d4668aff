//! The merges above the parts.

use crate::durable::directory::JobDirectory;
use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::merge_records::{Seam, SeamOfTile};
use crate::mesh::merge::merge_frontiers;
use crate::partition::tree::{NodeKind, Tree};
use crate::plan::budget::merge_memory;
use crate::progress::stats::StageStats;
use crate::records::{JobStep, JournalEntry, StepRecord, Store};
use crate::run::part_entries::{PartHeader, entries_of, is_whole, open_store, records_of};
use crate::run::parts::appearance::{SitesOfParts, count_sites, final_appearance};
use crate::run::parts::done::Done;
use crate::run::parts::part_journal::PartSession;
use crate::run::parts::part_store::{OpenPart, PartStores};
use crate::run::parts::parts_job::PartsJob;
use crate::run::run_context::RunContext;
use crate::run::tile_queue::TileAppearance;
use std::sync::Arc;
use sys::Result;

/// The merges above the parts, done.
pub(crate) struct JoinedParts {
    pub(crate) directory: JobDirectory,
    pub(crate) store: Store,
    pub(crate) header: PartHeader,
    /// How tiles look, now that all sites are known.
    pub(crate) appearance: Arc<TileAppearance>,
    pub(crate) stages: Vec<StageStats>,
    /// The largest resident set of the process that merged, in bytes.
    pub(crate) peak_memory: Option<u64>,
}

/// Merges what the parts send up, or what an interrupted run left of it. `all` is what the parts hold.
///
/// # Errors
/// Those of [`merge_frontiers`]; [`crate::Error::InUse`] if another process does it.
pub(crate) fn join_parts(job: &PartsJob, stores: &PartStores, all: SitesOfParts) -> crate::Result<()> {
    let parts = job.parts.all().len() as u64;
    let directory = &job.directory.join();
    let lock = directory.lock_within()?;
    let header = job.header(job.above());
    let entries = whole_entries(directory, entries_of(directory, header)?)?;
    if entries.iter().any(|entry| entry.step == JobStep::Join) {
        return Ok(());
    }
    let session = PartSession::begin(directory, lock, header, entries)?;
    let stage = job.progress.stage("join", parts, "parts");
    merge_below(job, stores, &session.context(job), NodeIndex::ROOT)?;
    let counts = count_sites(job, stores, all, &session.store)?;
    stage.advance(parts);
    session.finish(JobStep::Join, all, vec![stage.finish()], counts.into_iter().collect())?;
    Ok(())
}

/// Merges at those nodes above the parts for which only part `last` was missing: all parts before it are meshed. Returns the tiles that
/// no merge can change from now on.
///
/// # Errors
/// As [`join_parts`].
pub(crate) fn merge_through(job: &PartsJob, stores: &PartStores, last: PartIndex) -> crate::Result<Vec<TileIndex>> {
    let complete = nodes_completed_by(&job.parts.tree, job.parts.node(last));
    if complete.is_empty() {
        return Ok(Vec::new());
    }
    let directory = &job.directory.join();
    let lock = directory.lock_within()?;
    let header = job.header(job.above());
    let session = PartSession::begin(directory, lock, header, entries_of(directory, header)?)?;
    let context = &session.context(job);
    let merges = complete.into_iter().map(|node| merge_at(job, stores, context, node));
    let finished = merges.collect::<crate::Result<Vec<_>>>()?;
    // What the tiles needed that these merges finish may go now.
    session.store.sync()?;
    session.end()?;
    Ok(finished.into_iter().flatten().collect())
}

/// Returns the merge nodes above `leaf` that have no later leaf, children first.
fn nodes_completed_by(tree: &Tree, leaf: NodeIndex) -> Vec<NodeIndex> {
    let (mut complete, mut node) = (Vec::new(), leaf);
    while let Some(parent) = tree.node(node).parent {
        match tree.node(parent).kind {
            NodeKind::Inner([_, high]) if high == node => node = parent,
            _ => break,
        }
        complete.extend(tree.is_merge(node).then_some(node));
    }
    complete
}

/// Removes from the journal of the merges what a power failure has damaged: it can be done again.
///
/// # Errors
/// [`sys::Error::Io`] on its folder, [`crate::Error::InUse`] if another process has it.
pub(crate) fn drop_damaged_merges(job: &PartsJob) -> crate::Result<()> {
    let (directory, header) = (&job.directory.join(), job.header(job.above()));
    let lock = directory.lock_within()?;
    let entries = whole_entries(directory, entries_of(directory, header)?)?;
    Ok(PartSession::begin(directory, lock, header, entries)?.end()?)
}

/// Returns the entries whose records hold what was written.
fn whole_entries(directory: &JobDirectory, mut entries: Vec<JournalEntry>) -> Result<Vec<JournalEntry>> {
    let (records, all) = (records_of(&entries), entries.len());
    if !records.is_empty() {
        let store = open_store(directory, &records)?;
        entries.retain(|entry| is_whole(directory, &store, entry));
    }
    if entries.len() < all {
        // What is complete no longer is.
        entries.retain(|entry| entry.step != JobStep::Join);
    }
    Ok(entries)
}

/// Merges at all merge nodes at and below `node`, children first.
fn merge_below(job: &PartsJob, stores: &PartStores, context: &RunContext, node: NodeIndex) -> crate::Result<()> {
    let tree = &job.parts.tree;
    let NodeKind::Inner([low, high]) = tree.node(node).kind else { return Ok(()) };
    let below = |child| merge_below(job, stores, context, child);
    let (low, high) = rayon::join(|| below(low), || below(high));
    low.and(high)?;
    if !tree.is_merge(node) {
        return Ok(());
    }
    merge_at(job, stores, context, node).map(|_| ())
}

/// Merges at `node`, unless that is done. Returns the tiles that this finishes.
fn merge_at(
    job: &PartsJob,
    stores: &PartStores,
    context: &RunContext,
    node: NodeIndex,
) -> crate::Result<Vec<TileIndex>> {
    let tree = &job.parts.tree;
    let merge = || {
        let below = tree.merged_by(node);
        let open = |child: &NodeIndex| match tree.node(*child).kind {
            NodeKind::Leaf(tile) => stores.open(tile.part()).map(Some),
            NodeKind::Inner(_) => Ok(None),
        };
        let opened: Vec<Option<Arc<OpenPart>>> = below.iter().map(open).collect::<Result<_>>()?;
        let sources: Vec<(&Store, NodeIndex)> = below
            .iter()
            .zip(&opened)
            .map(|(&child, part)| part.as_ref().map_or((context.store, child), |part| (&part.store, NodeIndex::ROOT)))
            .collect();
        let memory = merge_memory(&job.plan.options, node == NodeIndex::ROOT, context.threads);
        merge_frontiers(job.plan, tree.node(node).cell, &sources, context.store, memory, node)
    };
    context.journal.step(JobStep::Merge(node), merge)
}

impl JoinedParts {
    /// Opens what [`join_parts`] has left; `None` if it is not complete.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on its folder.
    pub(crate) fn open(job: &PartsJob) -> Result<Option<JoinedParts>> {
        let (directory, header) = (job.directory.join(), job.header(job.above()));
        let entries = entries_of(&directory, header)?;
        let Some(Done { figures: all, stages, peak_memory, .. }) = Done::<SitesOfParts>::find(&entries, JobStep::Join)?
        else {
            return Ok(None);
        };
        let store = open_store(&directory, &records_of(&entries))?;
        Ok(Some(JoinedParts {
            appearance: final_appearance(job, all, &store)?,
            store,
            directory,
            header,
            stages,
            peak_memory,
        }))
    }

    /// Opens what there is of the merges while parts are still to be done.
    ///
    /// # Errors
    /// As [`JoinedParts::open`].
    pub(crate) fn so_far(job: &PartsJob, appearance: Arc<TileAppearance>) -> Result<JoinedParts> {
        let (directory, header) = (job.directory.join(), job.header(job.above()));
        let store = open_store(&directory, &records_of(&entries_of(&directory, header)?))?;
        Ok(JoinedParts { appearance, store, directory, header, stages: Vec::new(), peak_memory: None })
    }

    /// Returns what all seams have of `tile` of the part with `store` and `tree`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on a store.
    pub(crate) fn seam_of(&self, job: &PartsJob, store: &Store, tree: &Tree, tile: TileIndex) -> Result<SeamOfTile> {
        let above = &job.parts.tree;
        let mut seam = SeamOfTile::default();
        for node in tree.merges_above(tree.leaf(tile)) {
            seam.add(Seam::touching(store, node, tile)?);
        }
        // A tile that is finished before all parts are merged has no seam above.
        let is_merged = |node: &NodeIndex| self.store.has(StepRecord::Seam(*node));
        for node in above.merges_above(job.parts.node(tile.part())).take_while(is_merged) {
            seam.add(Seam::touching(&self.store, node, tile)?);
        }
        Ok(seam)
    }
}
