//! Steps 3 to 6 of a job, woven into each other: tiles that need no node above are stitched and written while others are still
//! triangulated and merged.

use crate::Result;
use crate::job::Job;
use crate::job::durable::journal::{Mark, Step};
use crate::job::mesh::leaf::LeafFigures;
use crate::job::mesh::precision_limit::Longest;
use crate::job::partition::point_file::Spill;
use crate::job::partition::read::Partition;
use crate::job::plan::scan::Plan;
use crate::job::preflight::check;
use crate::job::progress::stage::StageFigures;
use crate::job::run::tile_queue::{TileWriter, WrittenTiles};
use crate::job::run::tree_walk::Grower;
use crate::job::tiles::max_edge::Cut;
use crate::job::{beside, look};
use crate::output::options::MaxEdge;
use crate::output::preview::canvas::Canvas;

/// The whole mesh, in tiles.
pub(crate) struct Mesh {
    pub(crate) leaves: LeafFigures,
    pub(crate) tiles: WrittenTiles,
    pub(crate) triangulated: StageFigures,
    /// Where the journal has all leaves and merges.
    pub(crate) grown: Mark,
}

impl Job<'_> {
    /// Triangulates all leaves, merges their frontiers and writes the tiles.
    pub(crate) fn weave(
        &self,
        plan: &Plan,
        partition: &Partition,
        bounds: [[i32; 3]; 2],
        longest: Longest,
    ) -> Result<Mesh> {
        let stage = self.progress.stage("mesh", partition.summary.tally.kept, "points");
        let strand = self.progress.strand("triangulate", "points");
        let writer = TileWriter::new(self, partition, &stage);
        let grower = Grower {
            job: self,
            partition,
            spill: self.spill(partition)?,
            longest,
            stage: &stage,
            strand: &strand,
            writer: &writer,
        };
        let style = |sites| {
            let cut = self.cut(plan, partition, bounds, sites)?;
            let look = look(self.config, plan, &partition.summary, bounds, cut);
            let canvas = Canvas::new(&look.frame, bounds);
            Ok((look, canvas))
        };
        let at_once = self.may_write_at_once(plan);
        let leaves = rayon::scope(|scope| {
            if at_once {
                // How many sites there are matters only to what has to wait.
                writer.attempt(|| writer.begin(scope, style(0)?))?;
            }
            let leaves = grower.grow(scope, 0)?;
            let grown = self.journal.mark();
            // With it the points are closed: an open file is not freed when it is removed.
            drop(grower);
            if !at_once {
                // Not beside the writing: where the disk is small, the results need the room.
                let style = || beside(|| self.give_up_points(grown), || style(leaves.sites));
                writer.attempt(|| writer.begin(scope, style()?))?;
            }
            Some((leaves, grown))
        });
        let tiles = writer.finish()?;
        let (leaves, grown) = leaves.unwrap_or_default();
        let triangulated = strand.finish();
        stage.finish();
        Ok(Mesh { leaves, tiles, triangulated, grown })
    }

    /// The points, as long as there is a leaf to be done.
    fn spill(&self, partition: &Partition) -> Result<Option<Spill>> {
        let all_there = (0..partition.tree.leaves.len()).all(|tile| self.journal.has(Step::Leaf(tile)));
        if all_there { Ok(None) } else { Spill::open(&self.directory.spill()).map(Some) }
    }

    /// Whether tiles may be written before all are triangulated: not where that takes the place of what an earlier job has made, as
    /// this one may still fail; nor where how tiles look depends on all of them; nor where the disk has no room for them beside
    /// the points.
    fn may_write_at_once(&self, plan: &Plan) -> bool {
        !self.directory.report().exists()
            && self.config.output.max_edge != MaxEdge::Auto
            && check::has_room_beside_points(plan, self.config)
    }

    /// Which triangles are left out.
    fn cut(&self, plan: &Plan, partition: &Partition, bounds: [[i32; 3]; 2], sites: u64) -> Result<Cut> {
        let tiles = partition.tree.leaves.len();
        if (0..tiles).all(|tile| self.journal.has(Step::Export(tile))) {
            // Nobody asks, and what there is to count may be gone.
            return Ok(Cut::Nothing);
        }
        Cut::new(self.config.output.max_edge, &plan.frame, self.store, [tiles as u64, sites], bounds)
    }
}
