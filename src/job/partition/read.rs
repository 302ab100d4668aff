//! Step 2 of a job: decode every input once, spill the points to buckets of a grid, and build the tree whose leaves are
//! the tiles. A bucket with more points than a tile may hold is spilled again to a finer grid of its own.

use crate::geometry::Site;
use crate::input::options::OnBadFile;
use crate::input::{Point, PointCounts, PointRules, Source};
use crate::job::durable::columns::{ColumnReader, ColumnWriter};
use crate::job::durable::directory::Directory;
use crate::job::durable::store::{Key, Store, Stored};
use crate::job::partition::grid::{Grid, Span, Sums};
use crate::job::partition::point_file::{Block, Bucket, Buckets, Spill};
use crate::job::partition::tree::{Cell, Kind, Node, Tree};
use crate::job::progress::stage::Stage;
use crate::{Error, Result, interrupt};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::{AddAssign, Range};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// What a leaf's cell is cut into before the leaves are chosen: enough that leaves come out even.
const BUCKETS_PER_TILE: u64 = 8;
/// More buckets than this and their buffers become too small to write well; crowded ones are spilled again anyway.
const MOST_BUCKETS: u64 = 16_384;

/// The result of this step: the tree, where each leaf's points are, and what was met on the way.
#[derive(Clone, Debug, Default)]
pub struct Partition {
    /// The tree over all points.
    pub tree: Tree,
    /// Where the spill holds the points of each tile.
    pub blocks: Vec<Vec<Block>>,
    /// What was read and what was left out.
    pub summary: Summary,
    /// The size of the spill in bytes.
    pub spilled: u64,
    /// The inputs that proved bad on the way and were left out, all of them; nothing else here counts them.
    pub skipped: Vec<Skipped>,
}

/// An input that was left out because it is bad.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

impl Partition {
    /// Points in `tile`.
    pub fn points(&self, tile: usize) -> u64 {
        self.blocks[tile].iter().map(|block| block.points as u64).sum()
    }

    /// Writes it down for a run that goes on.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store) -> Result<Stored> {
        let rest = serde_json::to_vec(&(&self.tree, &self.summary, self.spilled, &self.skipped));
        let rest = rest.map_err(|e| Error::Broken(format!("the tree cannot be written down: {e}")))?;
        let counts: Vec<u64> = self.blocks.iter().map(|blocks| blocks.len() as u64).collect();
        ColumnWriter::default().push(&rest).push(&counts).push(&self.blocks.concat()).write(store, Key::Partition)
    }

    /// Reads what an earlier run has written down.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store) -> Result<Partition> {
        let mut columns = ColumnReader::open(store, Key::Partition)?;
        let (rest, counts): (Vec<u8>, Vec<u64>) = (columns.column()?, columns.column()?);
        let broken = |e: serde_json::Error| Error::Broken(format!("{}: {e}", store.path(Key::Partition).display()));
        let (tree, summary, spilled, skipped) = serde_json::from_slice(&rest).map_err(broken)?;
        let mut blocks = columns.column::<Block>()?.into_iter();
        let blocks = counts.iter().map(|&count| blocks.by_ref().take(count as usize).collect()).collect();
        Ok(Partition { tree, blocks, summary, spilled, skipped })
    }
}

/// What all inputs together held.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// Counts of records by what became of them.
    pub tally: PointCounts,
    /// The least and greatest lattice integers x, y, z of the kept points; `None` without points.
    pub bounds: Option<[[i32; 3]; 2]>,
}

impl AddAssign for Summary {
    fn add_assign(&mut self, other: Summary) {
        self.tally += other.tally;
        self.bounds = match (self.bounds, other.bounds) {
            (Some(a), Some(b)) => Some(around(a, b)),
            (a, b) => a.or(b),
        };
    }
}

/// The least box [min, max] around two of them.
pub(crate) fn around<const N: usize>(a: [[i32; N]; 2], b: [[i32; N]; 2]) -> [[i32; N]; 2] {
    [std::array::from_fn(|axis| a[0][axis].min(b[0][axis])), std::array::from_fn(|axis| a[1][axis].max(b[1][axis]))]
}

/// What the step needs to know.
pub struct Task<'a> {
    /// The inputs, each with the rules for its points.
    pub sources: &'a [(Source, PointRules)],
    /// The least and greatest lattice point expected, to lay the first grid; points outside are no error.
    pub extent: [Site; 2],
    /// The most points in a tile.
    pub points_per_tile: u64,
    /// Bytes for buffers.
    pub memory: u64,
    /// The share of malformed records that is put up with: of all inputs together, or where bad ones are left out, of each.
    pub max_malformed_fraction: f64,
    /// What becomes of an input with more of them.
    pub on_bad_file: OnBadFile,
}

/// Runs the step: leaves the spill in the job directory and returns what the steps after it need to know of it.
///
/// # Errors
/// [`Error::Input`] if too much of the inputs is malformed and bad ones are not to be left out, [`Error::Io`] if an input
/// cannot be read or the spill cannot be written.
pub fn run(task: &Task, directory: &Directory, stage: &Stage) -> Result<Partition> {
    let spill = Spill::create(&directory.spill())?;
    let records: u64 = task.sources.iter().map(|(source, _)| source.records).sum();
    let grid = Grid::over(task.extent[0], task.extent[1], wanted_buckets(records, task.points_per_tile));
    let buckets = Buckets::new(&spill, grid.buckets(), task.memory);
    let by_source = decode_all(task, records, &grid, &buckets, stage)?;
    let mut buckets = buckets.finish()?;
    let Judgement { summary, skipped, orders } = judge(task, by_source);
    if !orders.is_empty() {
        buckets.par_iter_mut().try_for_each(|bucket| spill.sift(bucket, &orders))?;
    }
    let mut divider = Divider { task, spill: &spill, tree: Tree::default(), blocks: Vec::new() };
    if summary.tally.kept > 0 {
        divider.grow(Cell::PLANE, None, &grid, buckets)?;
    }
    let Divider { tree, blocks, .. } = divider;
    Ok(Partition { tree, blocks, summary, spilled: spill.bytes(), skipped })
}

/// What the inputs held, those apart that are to be left out.
struct Judgement {
    summary: Summary,
    skipped: Vec<Skipped>,
    /// The numbers of the records of those left out.
    orders: Vec<Range<u64>>,
}

/// Sums up the inputs. Each is judged by itself, so that it does not depend on the others whether it is left out.
fn judge(task: &Task, by_source: BySource) -> Judgement {
    let mut judgement = Judgement { summary: Summary::default(), skipped: Vec::new(), orders: Vec::new() };
    for (index, summary) in by_source.0 {
        let (source, rules) = &task.sources[index];
        let is_bad = summary.tally.malformed > allowed(task.max_malformed_fraction, source.records);
        if is_bad && task.on_bad_file == OnBadFile::Skip {
            let why = max_malformed_fraction_exceeded(&summary.tally, summary.tally.malformed, source.records);
            judgement.skipped.push(Skipped { file: source.path.clone(), why });
            judgement.orders.push(rules.first_order..rules.first_order + source.records);
        } else {
            judgement.summary += summary;
        }
    }
    judgement
}

fn allowed(max_malformed_fraction: f64, records: u64) -> u64 {
    (max_malformed_fraction * records as f64) as u64
}

/// The bytes of buffers for a job of `points` points, within `memory`.
pub fn buffer_bytes(points: u64, points_per_tile: u64, memory: u64) -> u64 {
    let buckets = wanted_buckets(points, points_per_tile);
    memory.min(buckets * Buckets::largest_buffer())
}

fn wanted_buckets(points: u64, points_per_tile: u64) -> u64 {
    (points.saturating_mul(BUCKETS_PER_TILE) / points_per_tile).clamp(4, MOST_BUCKETS)
}

/// What each input held, in their order; those without pieces have none.
#[derive(Default)]
struct BySource(Vec<(usize, Summary)>);

impl BySource {
    /// Adds what the pieces after these held.
    fn append(mut self, later: BySource) -> BySource {
        let mut later = later.0.into_iter();
        match (self.0.last_mut(), later.next()) {
            (Some((last, summary)), Some((first, more))) if *last == first => *summary += more,
            (_, next) => self.0.extend(next),
        }
        self.0.extend(later);
        self
    }
}

/// Decodes all pieces of all sources in parallel and hands the points to the buckets of the grid.
fn decode_all(task: &Task, records: u64, grid: &Grid, buckets: &Buckets, stage: &Stage) -> Result<BySource> {
    let pieces: Vec<(usize, usize)> = task
        .sources
        .iter()
        .enumerate()
        .flat_map(|(s, (source, _))| (0..source.chunks()).map(move |piece| (s, piece)))
        .collect();
    let allowed = allowed(task.max_malformed_fraction, records);
    let malformed = AtomicU64::new(0);
    let decode = |&(s, piece): &(usize, usize)| -> Result<BySource> {
        interrupt::check()?;
        let (source, rules) = &task.sources[s];
        let mut scatter = Scatter::new(grid, buckets);
        let tally = source.decode(piece, rules, &mut |points| scatter.spill(points))?;
        stage.advance(tally.read);
        let so_far = malformed.fetch_add(tally.malformed, Ordering::Relaxed) + tally.malformed;
        // The piece that goes beyond says so: another may be sound.
        if task.on_bad_file == OnBadFile::Stop && tally.malformed > 0 && so_far > allowed {
            return Err(too_many_malformed(source, &tally, so_far, records));
        }
        Ok(BySource(vec![(s, Summary { tally, bounds: scatter.bounds })]))
    };
    // The reduction keeps the order of the pieces.
    pieces.par_iter().with_max_len(1).map(decode).try_reduce(BySource::default, |a, b| Ok(a.append(b)))
}

fn too_many_malformed(source: &Source, tally: &PointCounts, malformed: u64, records: u64) -> Error {
    let what = max_malformed_fraction_exceeded(tally, malformed, records);
    Error::input(
        &source.path,
        format!(
            "{what}. Repair the file, leave it out (on_bad_file = \"skip\"), or raise max_malformed_fraction to read the rest"
        ),
    )
}

fn max_malformed_fraction_exceeded(tally: &PointCounts, malformed: u64, records: u64) -> String {
    let examples = tally.examples.join("; ");
    format!(
        "{malformed} of {records} records are malformed, more than [input] max_malformed_fraction allows: {examples}"
    )
}

/// Sorts slices of points by bucket before they go to the shared buffers, so that a lock is taken once a bucket.
struct Scatter<'a> {
    grid: &'a Grid,
    buckets: &'a Buckets<'a>,
    bucket_of: Vec<u32>,
    ends: Vec<u32>,
    sorted: Vec<Point>,
    bounds: Option<[[i32; 3]; 2]>,
}

impl<'a> Scatter<'a> {
    fn new(grid: &'a Grid, buckets: &'a Buckets<'a>) -> Scatter<'a> {
        Scatter { grid, buckets, bucket_of: Vec::new(), ends: Vec::new(), sorted: Vec::new(), bounds: None }
    }

    fn spill(&mut self, points: &[Point]) -> Result<()> {
        self.count(points);
        self.sorted.resize(points.len(), bytemuck::Zeroable::zeroed());
        for (point, &bucket) in points.iter().zip(&self.bucket_of).rev() {
            let end = &mut self.ends[bucket as usize];
            *end -= 1;
            self.sorted[*end as usize] = *point;
        }
        // Each "end" has now come down to where its bucket starts.
        self.ends.push(points.len() as u32);
        for bucket in 0..self.grid.buckets() {
            let run = self.ends[bucket] as usize..self.ends[bucket + 1] as usize;
            if !run.is_empty() {
                self.buckets.extend(bucket, &self.sorted[run])?;
            }
        }
        Ok(())
    }

    /// The bucket of every point, where each bucket's run ends in sorted order, and the box around all.
    fn count(&mut self, points: &[Point]) {
        self.ends.clear();
        self.ends.resize(self.grid.buckets(), 0);
        self.bucket_of.clear();
        let Some(first) = points.first().map(Point::corner) else { return };
        let [mut low, mut high] = self.bounds.unwrap_or([first; 2]);
        for point in points {
            let bucket = self.grid.bucket(point.position);
            self.bucket_of.push(bucket);
            self.ends[bucket as usize] += 1;
            for (axis, value) in point.corner().into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        self.bounds = Some([low, high]);
        let mut end = 0;
        for count in &mut self.ends {
            end += *count;
            *count = end;
        }
    }
}

/// Grows the tree over the buckets.
struct Divider<'a> {
    task: &'a Task<'a>,
    spill: &'a Spill,
    tree: Tree,
    blocks: Vec<Vec<Block>>,
}

impl Divider<'_> {
    /// Grows the part of the tree over all of `grid`; returns its root's number.
    fn grow(&mut self, cell: Cell, parent: Option<usize>, grid: &Grid, mut buckets: Vec<Bucket>) -> Result<usize> {
        let sums = Sums::new(*grid, buckets.iter().map(|bucket| bucket.points));
        self.divide(cell, parent, grid, &sums, &mut buckets, grid.span())
    }

    fn divide(
        &mut self,
        cell: Cell,
        parent: Option<usize>,
        grid: &Grid,
        sums: &Sums,
        buckets: &mut [Bucket],
        span: Span,
    ) -> Result<usize> {
        if sums.points(span) <= self.task.points_per_tile {
            return Ok(self.leaf(cell, parent, take(grid, buckets, span)));
        }
        let Some(halves) = sums.cut(span, cell) else {
            return self.refine(cell, parent, take(grid, buckets, span));
        };
        let number = self.inner(cell, parent);
        let mut children = [0; 2];
        for (child, (half, half_cell)) in children.iter_mut().zip(halves) {
            *child = self.divide(half_cell, Some(number), grid, sums, buckets, half)?;
        }
        self.tree.nodes[number].kind = Kind::Inner(children);
        Ok(number)
    }

    /// One bucket with more points than a tile may hold: spill it again to a finer grid over where its points really are.
    fn refine(&mut self, cell: Cell, parent: Option<usize>, bucket: Bucket) -> Result<usize> {
        let [min, max] = self.extent(&bucket.blocks)?;
        if min == max {
            return Ok(self.leaf(cell, parent, bucket));
        }
        let grid = Grid::over(min, max, wanted_buckets(bucket.points, self.task.points_per_tile));
        let finer = Buckets::new(self.spill, grid.buckets(), self.task.memory);
        bucket.blocks.par_iter().try_for_each(|&block| {
            interrupt::check()?;
            let mut points = Vec::new();
            self.spill.read(block, &mut points)?;
            Scatter::new(&grid, &finer).spill(&points)
        })?;
        self.grow(cell, parent, &grid, finer.finish()?)
    }

    /// The least and greatest x and y of the points in `blocks`.
    fn extent(&self, blocks: &[Block]) -> Result<[Site; 2]> {
        let empty = || [[i32::MAX; 2], [i32::MIN; 2]];
        blocks
            .par_iter()
            .map(|&block| {
                let mut points = Vec::new();
                self.spill.read(block, &mut points)?;
                Ok(points.iter().fold(empty(), |extent, p| around(extent, [p.position; 2])))
            })
            .try_reduce(empty, |a, b| Ok(around(a, b)))
    }

    fn leaf(&mut self, cell: Cell, parent: Option<usize>, bucket: Bucket) -> usize {
        let number = self.tree.nodes.len();
        self.tree.nodes.push(Node { cell, parent, kind: Kind::Leaf(self.blocks.len()) });
        self.tree.leaves.push(number);
        self.blocks.push(bucket.blocks);
        number
    }

    fn inner(&mut self, cell: Cell, parent: Option<usize>) -> usize {
        self.tree.nodes.push(Node { cell, parent, kind: Kind::Inner([0; 2]) });
        self.tree.nodes.len() - 1
    }
}

/// Joins the buckets of `span` into one and leaves them empty.
fn take(grid: &Grid, buckets: &mut [Bucket], span: Span) -> Bucket {
    let mut joined = Bucket::default();
    for bucket in grid.in_span(span) {
        joined.points += buckets[bucket].points;
        joined.blocks.append(&mut buckets[bucket].blocks);
    }
    joined
}
