//! Coarser tiles of a job of several parts, and what is beside the tiles.

use crate::Result;
use crate::job::index::{PartIndex, TileIndex};
use crate::job::levels::hierarchy::Hierarchy;
use crate::job::levels::make_level::{Child, LevelStats};
use crate::job::mesh::leaf::LeafStats;
use crate::job::plan::no_points::no_point_is_left;
use crate::job::publish::side_files::{EachTile, StoredTiles};
use crate::job::publish::tileset_tree::TilesOfTree;
use crate::job::records::Store;
use crate::job::report::job_report::Report;
use crate::job::run::levels_step::{hierarchy_of, level_sizes, make_levels};
use crate::job::run::part_entries::{PartHeader, StepsOfParts, entries_of};
use crate::job::run::parts::join::JoinedParts;
use crate::job::run::parts::mesh_phase::MeshedParts;
use crate::job::run::parts::part_journal::PartSession;
use crate::job::run::parts::part_store::PartStores;
use crate::job::run::parts::parts_job::PartsJob;
use crate::job::run::publish_step::{
    MeshFigures, TilesetContent, WrittenFiles, publish, some_triangles, wants_tileset, write_report,
};
use crate::job::run::tile_queue::TileLook;
use crate::job::tiles::write_tile::TileStats;
use crate::output::tiles3d::tileset::TilesetNode;

/// Makes the coarser tiles, writes what is beside the tiles, and the report.
///
/// # Errors
/// Those of the steps.
pub(crate) fn publish_parts(
    job: &PartsJob,
    stores: &PartStores,
    joined: &JoinedParts,
    look: &TileLook,
    meshed: &MeshedParts,
    late: TileStats,
) -> Result<Report> {
    let PartsJob { run, plan, .. } = *job;
    let (mut tiles, mut leaves) = (late, LeafStats::default());
    for part in &meshed.parts {
        tiles += part.tiles;
        leaves += part.leaves;
    }
    some_triangles(&tiles, plan)?;
    let bounds = meshed.summary.bounds.ok_or_else(|| no_point_is_left(plan, &meshed.summary.counts))?;
    let tileset =
        wants_tileset(plan, &tiles).then(|| levels_and_root(job, stores, joined, look, meshed)).transpose()?;
    let all = TilesOfParts { job, stores };
    let published = publish(run, plan, bounds, &WrittenFiles { stats: tiles, tiles: &all }, look, tileset)?;
    let figures = MeshFigures {
        points: meshed.summary.counts.clone(),
        leaves,
        tiles,
        temporary: meshed.parts.iter().map(|part| part.temporary).max().unwrap_or(0),
        files: StepsOfParts::of(run.directory, run.job_id)?.files,
    };
    write_report(run, plan, figures, published)
}

/// Makes the coarser tiles of all parts, then those above, and returns the root of all.
fn levels_and_root(
    job: &PartsJob,
    stores: &PartStores,
    joined: &JoinedParts,
    look: &TileLook,
    meshed: &MeshedParts,
) -> Result<TilesetContent> {
    let PartsJob { run, plan, parts } = *job;
    let mut stats = LevelStats::default();
    for part in parts.all() {
        stats += levels_of_part(job, stores, look, part)?;
    }
    let points: Vec<u64> = meshed.parts.iter().map(|part| part.points).collect();
    let hierarchy = Hierarchy::above_parts(&parts.tree, &points, level_sizes(plan));
    let session = PartSession::begin(&joined.directory, joined.header, entries_of(&joined.directory, joined.header)?)?;
    let context = session.context(run);
    let top_of = |part: PartIndex| {
        let open = stores.open(part)?;
        Child::top(run.directory, &open.store, &open.partition.tree)
    };
    let above = make_levels(&context, plan, parts.tree.part, hierarchy, &look.style, &top_of)?;
    run.add_stages(context);
    stats += above.stats;
    let part_root = |part: PartIndex| root_of_part(job, stores, part);
    let hierarchy = &above.hierarchy;
    let root = TilesOfTree { store: &session.store, tree: &parts.tree, hierarchy, part_root: &part_root }.root()?;
    session.end()?;
    TilesetContent::new(root, stats)
}

fn levels_of_part(job: &PartsJob, stores: &PartStores, look: &TileLook, part: PartIndex) -> Result<LevelStats> {
    let open = stores.open(part)?;
    stores.close(part);
    let directory = job.run.directory.part(part);
    let header = PartHeader { job: job.run.job_id, part };
    let session = PartSession::begin(&directory, header, entries_of(&directory, header)?)?;
    let context = session.context(job.run);
    let hierarchy = hierarchy_of(job.plan, &open.partition);
    let no_other = |other: PartIndex| Err(crate::Error::Broken(format!("part {part} has no tile of part {other}")));
    let made = make_levels(&context, job.plan, part, hierarchy, &look.style, &no_other)?;
    job.run.add_stages(context);
    session.end()?;
    Ok(made.stats)
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
