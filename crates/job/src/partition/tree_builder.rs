//! Growing the tree over the buckets. A bucket with more points than a tile may hold goes to a finer grid of its own.

use crate::index::{NodeIndex, PartIndex};
use crate::partition::bucket_sorter::BucketSorter;
use crate::partition::buckets::{Bucket, Buckets};
use crate::partition::grid::{Grid, GridSpan, GridSums};
use crate::partition::point_file::{PointBlock, PointFiles};
use crate::partition::tree::{Cell, NodeKind, Tree, TreeNode};
use delaunay::geometry::Bounds;
use rayon::prelude::*;
use sys::{Result, interrupt};

/// The number of buckets for each tile: enough that tiles come out even.
const BUCKETS_PER_TILE: u64 = 8;
/// With more buckets than this at a time their buffers would be too small to write well. Crowded buckets are divided again anyway.
pub(crate) const MAX_BUCKETS: u64 = 16_384;
/// With more buckets than this in a job, what is known of each would take too much memory: some ten bytes.
const MAX_BUCKETS_OF_JOB: u64 = 1 << 20;

/// Returns the number of buckets for `points` points that are sorted at a time.
pub(crate) fn wanted_buckets(points: u64, max_points_per_tile: u64) -> u64 {
    wanted_buckets_of_job(points, max_points_per_tile).min(MAX_BUCKETS)
}

/// Returns the number of buckets for a job of `points` points.
pub(crate) fn wanted_buckets_of_job(points: u64, max_points_per_tile: u64) -> u64 {
    (points.saturating_mul(BUCKETS_PER_TILE) / max_points_per_tile).clamp(4, MAX_BUCKETS_OF_JOB)
}

/// Returns the bytes of buffers for a job of `points` points, within `memory`.
pub fn buffer_bytes(points: u64, max_points_per_tile: u64, memory: u64) -> u64 {
    memory.min(wanted_buckets(points, max_points_per_tile) * Buckets::largest_buffer())
}

/// Grows the tree.
pub(crate) struct TreeBuilder<'a> {
    files: &'a PointFiles,
    max_points_per_tile: u64,
    /// Bytes for buffers.
    memory: u64,
    tree: Tree,
    blocks: Vec<Vec<PointBlock>>,
}

impl<'a> TreeBuilder<'a> {
    pub(crate) fn new(files: &'a PointFiles, max_points_per_tile: u64, memory: u64) -> TreeBuilder<'a> {
        TreeBuilder { files, max_points_per_tile, memory, tree: Tree::default(), blocks: Vec::new() }
    }

    /// Grows the tree of `part`, which decides `cell`, over the buckets of `grid`.
    pub(crate) fn grow_root(&mut self, part: PartIndex, cell: Cell, grid: &Grid, buckets: Vec<Bucket>) -> Result<()> {
        self.tree.part = part;
        self.grow(cell, None, grid, buckets).map(|_| ())
    }

    /// Returns the tree and the blocks of each tile.
    pub(crate) fn finish(self) -> (Tree, Vec<Vec<PointBlock>>) {
        (self.tree, self.blocks)
    }

    /// Grows the part of the tree over all of `grid` and returns its root.
    fn grow(
        &mut self,
        cell: Cell,
        parent: Option<NodeIndex>,
        grid: &Grid,
        mut buckets: Vec<Bucket>,
    ) -> Result<NodeIndex> {
        let sums = GridSums::new(*grid, buckets.iter().map(|bucket| bucket.points));
        self.divide(cell, parent, grid, &sums, &mut buckets, grid.span())
    }

    fn divide(
        &mut self,
        cell: Cell,
        parent: Option<NodeIndex>,
        grid: &Grid,
        sums: &GridSums,
        buckets: &mut [Bucket],
        span: GridSpan,
    ) -> Result<NodeIndex> {
        if sums.points(span) <= self.max_points_per_tile {
            return Ok(self.add_leaf(cell, parent, take(grid, buckets, span)));
        }
        let Some(halves) = sums.cut(span, cell) else {
            return self.refine(cell, parent, take(grid, buckets, span));
        };
        let node = self.add_inner(cell, parent);
        let mut children = [NodeIndex::ROOT; 2];
        for (child, (half, half_cell)) in children.iter_mut().zip(halves) {
            *child = self.divide(half_cell, Some(node), grid, sums, buckets, half)?;
        }
        self.tree.nodes[node.get()].kind = NodeKind::Inner(children);
        Ok(node)
    }

    /// Divides one bucket with more points than a tile may hold, by a finer grid over where its points are.
    fn refine(&mut self, cell: Cell, parent: Option<NodeIndex>, bucket: Bucket) -> Result<NodeIndex> {
        let bounds = self.bounds(&bucket.blocks)?;
        let Some(bounds) = bounds.filter(|bounds| bounds.min != bounds.max) else {
            return Ok(self.add_leaf(cell, parent, bucket));
        };
        let grid = Grid::over(bounds, wanted_buckets(bucket.points, self.max_points_per_tile));
        let finer = Buckets::new(self.files.growing()?, grid.buckets(), self.memory);
        bucket.blocks.par_iter().try_for_each(|&block| {
            interrupt::check()?;
            let mut points = Vec::new();
            self.files.read(block, &mut points)?;
            BucketSorter::new(&grid, &finer).add(&points)
        })?;
        // The points of the bucket stay, so that the tree can be grown again after an interruption.
        self.grow(cell, parent, &grid, finer.finish()?)
    }

    /// Returns the box of the points in `blocks`.
    fn bounds(&self, blocks: &[PointBlock]) -> Result<Option<Bounds<2>>> {
        let of_block = |&block: &PointBlock| {
            let mut points = Vec::new();
            self.files.read(block, &mut points)?;
            Ok(Bounds::of_points(points.iter().map(|p| p.position)))
        };
        let union = |a: Option<Bounds<2>>, b| Ok(a.into_iter().chain(b).reduce(Bounds::union));
        blocks.par_iter().map(of_block).try_reduce(|| None, union)
    }

    fn add_leaf(&mut self, cell: Cell, parent: Option<NodeIndex>, bucket: Bucket) -> NodeIndex {
        let node = self.add(TreeNode { cell, parent, kind: NodeKind::Leaf(self.tree.part.tile(self.blocks.len())) });
        self.tree.leaves.push(node);
        self.blocks.push(bucket.blocks);
        node
    }

    fn add_inner(&mut self, cell: Cell, parent: Option<NodeIndex>) -> NodeIndex {
        self.add(TreeNode { cell, parent, kind: NodeKind::Inner([NodeIndex::ROOT; 2]) })
    }

    fn add(&mut self, node: TreeNode) -> NodeIndex {
        self.tree.nodes.push(node);
        NodeIndex::new(self.tree.nodes.len() - 1)
    }
}

/// Joins the buckets of `span` into one and leaves them empty.
fn take(grid: &Grid, buckets: &mut [Bucket], span: GridSpan) -> Bucket {
    let mut joined = Bucket::default();
    for bucket in grid.in_span(span) {
        joined.points += buckets[bucket].points;
        joined.blocks.append(&mut buckets[bucket].blocks);
    }
    joined
}
