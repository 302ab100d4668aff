//! The coarser tiles above the parts of a job, and what is beside the tiles.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::levels::hierarchy::Hierarchy;
use crate::levels::make_level::{Child, LevelStats};
use crate::merge_records::Seam;
use crate::mesh::leaf::LeafStats;
use crate::publish::side_files::{EachTile, StoredTiles};
use crate::publish::tileset_tree::TilesOfTree;
use crate::records::Store;
use crate::report::job_report::{Report, SlowestPart};
use crate::run::levels_step::{hierarchy_of, level_sizes, make_levels};
use crate::run::part_entries::{StepsOfParts, entries_of};
use crate::run::parts::done::{Done, PartProgress};
use crate::run::parts::join::JoinedParts;
use crate::run::parts::meshed_part::MeshedPart;
use crate::run::parts::part_journal::PartSession;
use crate::run::parts::part_store::PartStores;
use crate::run::parts::parts_job::PartsJob;
use crate::run::parts::read_phase::sum_up;
use crate::run::publish_step::{
    MeshFigures, TilesetContent, WrittenFiles, publish, some_triangles, wants_tileset, write_report,
};
use crate::run::run_context::RunContext;
use crate::tiles::write_tile::TileStats;
use std::sync::PoisonError;
use sys::{Error, Result};
use tiles::tiles3d::tileset::TilesetNode;

/// Makes the coarser tiles above the parts, writes what is beside the tiles, and the report.
///
/// # Errors
/// Those of the steps.
pub(crate) fn publish_parts(
    run: &RunContext,
    job: &PartsJob,
    stores: &PartStores,
    joined: &JoinedParts,
) -> crate::Result<Report> {
    let plan = job.plan;
    let parts = job.parts.all().map(|part| PartProgress::of(&job.directory.part(part), job.header(part)));
    let parts = parts.collect::<Result<Vec<PartProgress>>>()?;
    let figures = PartFigures::of(&parts)?;
    some_triangles(&figures.tiles, plan)?;
    let (summary, bounds) = sum_up(job, parts.iter().filter_map(|part| Some(&part.read.as_ref()?.figures)))?;
    add_stages(run, joined, &parts);
    let tileset = wants_tileset(plan, &figures.tiles).then(|| levels_and_root(run, job, stores, joined, &figures));
    let all = TilesOfParts { job, stores };
    let written =
        WrittenFiles { stats: figures.tiles, hull: Seam::hull_count(&joined.store, NodeIndex::ROOT)?, tiles: &all };
    let published = publish(run, plan, bounds, &written, &joined.appearance, tileset.transpose()?)?;
    let figures = MeshFigures {
        points: summary.counts,
        leaves: figures.leaves,
        tiles: figures.tiles,
        temporary: figures.temporary,
        files: StepsOfParts::of(job.directory, job.job_id)?.files,
        parts: parts.len() as u64,
        slowest_part: slowest(&parts),
        peak_memory: parts.iter().map(PartProgress::peak_memory).max().flatten().max(joined.peak_memory),
        cpu_s_of_tasks: if figures.by_tasks { processor_seconds(&parts) } else { 0.0 },
    };
    Ok(write_report(run, plan, figures, published)?)
}

/// What all parts hold together.
struct PartFigures {
    leaves: LeafStats,
    tiles: TileStats,
    levels: LevelStats,
    /// The points of each part.
    points: Vec<u64>,
    temporary: u64,
    /// Whether tasks meshed the parts.
    by_tasks: bool,
}

impl PartFigures {
    fn of(parts: &[PartProgress]) -> Result<PartFigures> {
        fn figures<T>(part: usize, done: &Option<Done<T>>) -> Result<&T> {
            let done = done.as_ref().map(|done| &done.figures);
            done.ok_or_else(|| Error::Broken(format!("part {part} is not complete")))
        }
        let (mut leaves, mut tiles, mut levels) = (LeafStats::default(), TileStats::default(), LevelStats::default());
        let mut meshed: Vec<&MeshedPart> = Vec::with_capacity(parts.len());
        for (part, progress) in parts.iter().enumerate() {
            let mesh = figures(part, &progress.mesh)?;
            leaves += mesh.leaves;
            tiles += mesh.tiles;
            tiles += *figures(part, &progress.tiles)?;
            levels += *figures(part, &progress.levels)?;
            meshed.push(mesh);
        }
        let temporary = meshed.iter().map(|mesh| mesh.temporary);
        // All tasks together may have had as much at the same time.
        let by_tasks = meshed.iter().any(|mesh| mesh.by_task);
        let temporary = if by_tasks { temporary.sum() } else { temporary.max().unwrap_or(0) };
        let points = meshed.iter().map(|mesh| mesh.points).collect();
        Ok(PartFigures { leaves, tiles, levels, points, temporary, by_tasks })
    }
}

/// Adds the stages of all parts to the report, in the order of the phases.
fn add_stages(run: &RunContext, joined: &JoinedParts, parts: &[PartProgress]) {
    for (phase, after) in [(0, false), (1, true), (2, false), (3, false)] {
        parts.iter().flat_map(|part| part.stages()[phase]).for_each(|stage| run.add_stage(stage.clone()));
        if after {
            joined.stages.iter().for_each(|stage| run.add_stage(stage.clone()));
        }
    }
}

/// Returns the seconds of processor time of all phases of parts. The stages of meshing are kinds of work that go on at the same time.
fn processor_seconds(parts: &[PartProgress]) -> f64 {
    parts.iter().flat_map(PartProgress::stages).flatten().map(|stage| stage.cpu_s).sum()
}

fn slowest(parts: &[PartProgress]) -> Option<SlowestPart> {
    let (part, slowest) = parts.iter().enumerate().max_by(|(_, a), (_, b)| a.seconds().total_cmp(&b.seconds()))?;
    let points = slowest.mesh.as_ref()?.figures.points;
    Some(SlowestPart { part: part as u64, seconds: slowest.seconds(), points })
}

/// Makes the coarser tiles above the parts, and returns the root of all.
fn levels_and_root(
    run: &RunContext,
    job: &PartsJob,
    stores: &PartStores,
    joined: &JoinedParts,
    figures: &PartFigures,
) -> crate::Result<TilesetContent> {
    let PartsJob { plan, parts, .. } = *job;
    let hierarchy = Hierarchy::above_parts(&parts.tree, &figures.points, level_sizes(plan));
    let lock = joined.directory.lock_within()?;
    let entries = entries_of(&joined.directory, joined.header)?;
    let session = PartSession::begin(&joined.directory, lock, joined.header, entries)?;
    let context = session.context(job);
    let top_of = |part: PartIndex| {
        let open = stores.open(part)?;
        Child::top(job.directory, &open.store, &open.partition.tree)
    };
    let above = make_levels(&context, plan, parts.tree.part, hierarchy, &joined.appearance.style, &top_of)?;
    let stages = context.stages.into_inner().unwrap_or_else(PoisonError::into_inner);
    stages.into_iter().for_each(|stage| run.add_stage(stage));
    let mut stats = figures.levels;
    stats += above.stats;
    let part_root = |part: PartIndex| root_of_part(job, stores, part);
    let hierarchy = &above.hierarchy;
    let root = TilesOfTree { store: &session.store, tree: &parts.tree, hierarchy, part_root: &part_root }.root()?;
    session.end()?;
    Ok(TilesetContent::new(root, stats)?)
}

fn root_of_part(job: &PartsJob, stores: &PartStores, part: PartIndex) -> Result<Option<TilesetNode>> {
    let open = stores.open(part)?;
    let hierarchy = &hierarchy_of(job.plan, &open.partition);
    let (store, tree) = (&open.store, &open.partition.tree);
    TilesOfTree { store, tree, hierarchy, part_root: &|_| Ok(None) }.root()
}

/// The tiles of all parts.
struct TilesOfParts<'a> {
    job: &'a PartsJob<'a>,
    stores: &'a PartStores,
}

impl EachTile for TilesOfParts<'_> {
    fn visit(&self, visit: &mut dyn FnMut(&Store, TileIndex) -> Result<()>) -> Result<()> {
        self.job.parts.all().try_for_each(|part| {
            let open = self.stores.open(part)?;
            StoredTiles { store: &open.store, tree: &open.partition.tree }.visit(visit)
        })
    }
}
