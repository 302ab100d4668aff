//! The merges above the parts.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::merge_records::{HullCount, Seam, SeamOfTile};
use crate::mesh::merge::merge_frontiers;
use crate::partition::result::Partition;
use crate::partition::tree::{NodeKind, Tree};
use crate::plan::budget::merge_memory;
use crate::records::{FinishedBorder, JobStep, StepRecord, Store};
use crate::run::folder::{Folder, once};
use crate::run::job::{Job, OpenPart};
use crate::run::meshed_part::MeshedPart;
use crate::run::phases::appearance::{SitesOfParts, count_sites, early_appearance, final_appearance};
use crate::run::phases::read_phase::sum_up;
use crate::tiles::appearance::TileAppearance;
use crate::tiles::border_normals::finished_border;
use crate::tiles::dependencies::FinishedTile;
use crate::tiles::seam::seam_of;
use serde::de::IgnoredAny;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use sys::Result;
use tiles::options::MaxEdge;
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// How many borders of other parts stay in memory, some ten kilobytes each.
const MOST_KNOWN: usize = 1000;

/// The merges above the parts, done.
pub(crate) struct JoinedParts {
    /// What they left; `None` if there was nothing to do.
    store: Option<Store>,
    /// How tiles look, now that all sites are known.
    pub(crate) appearance: Arc<TileAppearance>,
    /// The key of the rule for long triangles, with `--update`.
    key_of_rule: u64,
    /// Finished borders of tiles that tiles of other parts have asked for.
    borders: Mutex<HashMap<TileIndex, FinishedBorder>>,
}

/// Tells whether there is anything to do once all parts are meshed.
fn is_needed(job: &Job) -> bool {
    job.parts.all().len() > 1 || job.plan.options.output.max_edge == MaxEdge::Auto
}

/// Merges what the parts send up, or what an interrupted run left of it. All of them are meshed.
///
/// # Errors
/// Those of [`sum_up`] and [`merge_frontiers`]; [`crate::Error::InUse`] if another process does it.
pub(crate) fn join_parts(job: &Job) -> crate::Result<()> {
    if !is_needed(job) {
        return Ok(());
    }
    let key = job.key(|| key_of_meshes(job))?;
    once(job, job.above(), JobStep::Join, key, |folder| {
        let parts = job.parts.all().len() as u64;
        let stage = job.progress.stage("join", parts, "parts");
        let sites = |part| Ok(job.entries(part)?.figures::<MeshedPart>(JobStep::Mesh)?.leaves.sites);
        let all = SitesOfParts { sites: job.parts.all().map(sites).sum::<Result<_>>()?, bounds: sum_up(job)?.1 };
        merge_below(job, folder, NodeIndex::ROOT)?;
        count_sites(job, all, &folder.store)?;
        stage.advance(parts);
        Ok(folder.record(JobStep::Join, all, vec![stage.finish()])?)
    })
    .map(|_| ())
}

/// Returns the key of the merges above the parts: a hash of the keys of all meshes.
fn key_of_meshes(job: &Job) -> Result<u64> {
    let mut keys = Vec::new();
    for part in job.parts.all() {
        keys.extend(job.entries(part)?.done::<IgnoredAny>(JobStep::Mesh)?.map(|mesh| mesh.key));
    }
    Ok(xxh3_64(bytemuck::cast_slice(&keys)))
}

/// Merges at those nodes above the parts for which only part `last` was missing: all parts before it are meshed. Returns the tiles that
/// no merge can change from now on.
///
/// # Errors
/// As [`join_parts`].
pub(crate) fn merge_through(job: &Job, last: PartIndex) -> crate::Result<Vec<TileIndex>> {
    let complete = nodes_completed_by(&job.parts.tree, job.parts.node(last));
    if complete.is_empty() {
        return Ok(Vec::new());
    }
    let folder = Folder::open(job, job.above(), 0)?;
    // Nothing else goes on meanwhile.
    let merges = complete.into_iter().map(|node| merge_at(job, &folder, node, 1));
    Ok(merges.collect::<crate::Result<Vec<_>>>()?.concat())
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

/// Merges at all merge nodes at and below `node`, children first.
fn merge_below(job: &Job, folder: &Folder, node: NodeIndex) -> crate::Result<()> {
    let tree = &job.parts.tree;
    let NodeKind::Inner([low, high]) = tree.node(node).kind else { return Ok(()) };
    let below = |child| merge_below(job, folder, child);
    let (low, high) = rayon::join(|| below(low), || below(high));
    low.and(high)?;
    if !tree.is_merge(node) {
        return Ok(());
    }
    merge_at(job, folder, node, job.threads).map(|_| ())
}

/// Merges at `node`, unless that is done, in the share of the memory that one of `threads` threads has. Returns the tiles that this
/// finishes.
fn merge_at(job: &Job, folder: &Folder, node: NodeIndex, threads: usize) -> crate::Result<Vec<TileIndex>> {
    if let Some(finished) = folder.done(JobStep::Merge(node))? {
        return Ok(finished);
    }
    let tree = &job.parts.tree;
    let below = tree.merged_by(node);
    let open = |child: &NodeIndex| match tree.node(*child).kind {
        NodeKind::Leaf(tile) => job.open(tile.part()).map(Some),
        NodeKind::Inner(_) => Ok(None),
    };
    let opened: Vec<Option<Arc<OpenPart>>> = below.iter().map(open).collect::<Result<_>>()?;
    let sources: Vec<(&Store, NodeIndex)> = below
        .iter()
        .zip(&opened)
        .map(|(&child, part)| part.as_ref().map_or((&folder.store, child), |part| (&part.store, NodeIndex::ROOT)))
        .collect();
    let memory = merge_memory(&job.plan.options, node == NodeIndex::ROOT, threads);
    let finished = merge_frontiers(job.plan, tree.node(node).cell, &sources, &folder.store, memory, node)?;
    Ok(folder.record(JobStep::Merge(node), finished, Vec::new())?)
}

impl JoinedParts {
    /// Opens what [`join_parts`] has left.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on its folder, also if that is not complete.
    pub(crate) fn open(job: &Job) -> Result<JoinedParts> {
        if let (false, Some(appearance)) = (is_needed(job), early_appearance(job)?) {
            return Ok(JoinedParts { store: None, appearance, key_of_rule: 0, borders: Mutex::default() });
        }
        let entries = job.entries(job.above())?;
        let (all, store) = (entries.figures(JobStep::Join)?, entries.store()?);
        let tree = &job.parts.tree;
        // Without the seam of a node, that node and those above it would be holes in the terrain.
        let merges = (0..tree.nodes.len()).map(NodeIndex::new).filter(|&node| tree.is_merge(node));
        if let Some(node) = merges.into_iter().find(|&node| !store.has(StepRecord::Seam(node))) {
            return Err(sys::Error::Broken(format!("the seam of node {node} above the parts is gone")));
        }
        let appearance = final_appearance(job, all, &store)?;
        let rule = if job.plan.options.updates { format!("{:?}", appearance.style.max_edge) } else { String::new() };
        let key_of_rule = xxh3_64(rule.as_bytes());
        Ok(JoinedParts { store: Some(store), appearance, key_of_rule, borders: Mutex::default() })
    }

    /// Returns what is merged while parts are still to come.
    ///
    /// # Errors
    /// As [`JoinedParts::open`].
    pub(crate) fn so_far(job: &Job, appearance: Arc<TileAppearance>) -> Result<JoinedParts> {
        let store = is_needed(job).then(|| job.entries(job.above())?.store()).transpose()?;
        Ok(JoinedParts { store, appearance, key_of_rule: 0, borders: Mutex::default() })
    }

    /// Returns the finished border of a tile of another part than that which is written. One that is not stored yet is computed: a part's folder
    /// has one writer.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on a store.
    pub(crate) fn border_of(&self, job: &Job, tile: TileIndex) -> Result<FinishedBorder> {
        let known = || self.borders.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(border) = known().get(&tile) {
            return Ok(border.clone());
        }
        let OpenPart { store, partition: Partition { tree, .. }, .. } = &*job.open(tile.part())?;
        // Another machine may be writing it. But what a written tile needed may be gone, and then it is whole.
        let border = match store.has_whole(StepRecord::FinishedBorder(tile))? {
            true => FinishedBorder::load(store, tile)?,
            false => {
                let mut seam = seam_of(store, tree, FinishedTile { tile, last_merge: NodeIndex::ROOT })?;
                self.add_seams(job, tile, &mut seam)?;
                finished_border(store, tree, &self.appearance.style, tile, &seam)?
            }
        };
        let mut known = known();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(tile, border.clone());
        Ok(border)
    }

    /// Adds what the seams above the parts have of `tile`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store.
    pub(crate) fn add_seams(&self, job: &Job, tile: TileIndex, seam: &mut SeamOfTile) -> Result<()> {
        let Some(joined) = &self.store else { return Ok(()) };
        let above = job.parts.tree.merges_above(job.parts.node(tile.part()));
        // A tile that is finished before all parts are merged has no seam above.
        for node in above.take_while(|node| joined.has(StepRecord::Seam(*node))) {
            seam.add(Seam::touching(joined, node, tile)?);
        }
        seam.sort();
        Ok(())
    }

    /// Returns the key of `tile`: a hash of what the merges above the parts have of it, and of the rule for long triangles.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on the store.
    pub(crate) fn key_of_tile(&self, job: &Job, tile: TileIndex) -> Result<u64> {
        let mut seam = SeamOfTile::default();
        self.add_seams(job, tile, &mut seam)?;
        let mut hasher = Xxh3::with_seed(self.key_of_rule);
        hasher.update(&seam.triangles.len().to_le_bytes());
        hasher.update(bytemuck::cast_slice(&seam.triangles));
        hasher.update(bytemuck::cast_slice(&seam.trimmed));
        Ok(hasher.digest())
    }

    /// Returns how many slivers along the hull the whole mesh has.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Broken`] on a store.
    pub(crate) fn hull_count(&self, job: &Job) -> Result<HullCount> {
        match (&self.store, &job.parts.tree.node(NodeIndex::ROOT).kind) {
            (Some(store), NodeKind::Inner(_)) => Seam::hull_count(store, NodeIndex::ROOT),
            // The root of its tree is that of all.
            _ => Seam::hull_count(&job.open(PartIndex::FIRST)?.store, NodeIndex::ROOT),
        }
    }
}
