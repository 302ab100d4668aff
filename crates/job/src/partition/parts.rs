//! The parts of a job: the plane is cut along the buckets of the grid into cells of about the wanted number of points, as far as the
//! headers tell. So a part is complete as soon as every input whose box meets its cell has been read ("spatial finalization", Isenburg
//! et al. 2006, "Streaming Computation of Delaunay Triangulations"). What a part really holds decides only how its own tree is cut.

use crate::index::{NodeIndex, PartIndex};
use crate::partition::grid::{Grid, GridSpan, GridSums};
use crate::partition::tree::{Cell, NodeKind, Tree, TreeNode};
use crate::partition::tree_builder::{MAX_BUCKETS, wanted_buckets_of_job};
use crate::plan::job_plan::Plan;
use crate::plan::plan_cut::CutInput;
use delaunay::geometry::Bounds;

/// The parts of a job. They depend on its plan alone.
pub struct Parts {
    /// The buckets that points are sorted into while they are read. A bucket belongs to one part.
    pub grid: Grid,
    /// The tree above the parts. Its leaves are the parts, in the order in which they are done.
    pub tree: Tree,
    spans: Vec<GridSpan>,
    part_of: Vec<PartIndex>,
    /// The buckets that each input may have points in.
    reach: Vec<GridSpan>,
    readers: Readers,
    /// How many points each part is expected to have.
    expected: Vec<u64>,
}

/// What each part reads.
struct Readers {
    /// The inputs that each part is the first to need.
    new_inputs: Vec<Vec<usize>>,
    /// The rectangle of the buckets that these may have points in.
    reach: Vec<Option<GridSpan>>,
}

impl Readers {
    /// Returns what the parts with these buckets read of inputs that have points in the buckets of `reach`.
    fn of(parts: &[GridSpan], reach: &[GridSpan]) -> Readers {
        let mut readers = Readers { new_inputs: vec![Vec::new(); parts.len()], reach: vec![None; parts.len()] };
        for (input, &reach) in reach.iter().enumerate() {
            // Every bucket belongs to a part.
            let first = parts.iter().position(|span| reach.meets(*span)).unwrap_or(0);
            readers.new_inputs[first].push(input);
            let joined = &mut readers.reach[first];
            *joined = Some(joined.map_or(reach, |before| before.joined(reach)));
        }
        readers
    }

    /// Returns the most buckets that a part sorts points into.
    fn most_buckets(&self) -> u64 {
        self.reach.iter().flatten().map(|span| span.buckets()).max().unwrap_or(0)
    }
}

/// Returns the buckets that inputs with these boxes may have points in.
fn reach_of(grid: &Grid, claimed: impl Iterator<Item = Bounds<2>>) -> Vec<GridSpan> {
    claimed.map(|claimed| grid.span_of(claimed)).collect()
}

impl Parts {
    /// Cuts the plane for the job of `plan`.
    pub fn of(plan: &Plan) -> Parts {
        let (per_tile, cut) = (plan.options.triangulation.max_points_per_tile.0, plan.cut());
        let claimed: Vec<Bounds<2>> = cut.inputs.iter().map(|input| input.claimed).collect();
        let mut wanted = wanted_buckets_of_job(cut.records, per_tile);
        let (grid, cutter) = loop {
            let grid = Grid::over(cut.extent, wanted);
            let cutter = PartCutter::cut_plane(expected_points(&grid, &cut.inputs), &grid, plan.points_per_part());
            // Of the first run: parts do not change where files come or go.
            let most = Readers::of(&cutter.spans, &reach_of(&grid, claimed.iter().copied())).most_buckets();
            if most <= MAX_BUCKETS || wanted <= MAX_BUCKETS {
                break (grid, cutter);
            }
            wanted = (wanted * MAX_BUCKETS / most).min(wanted - wanted / 16).max(MAX_BUCKETS);
        };
        let PartCutter { mut tree, spans, sums, .. } = cutter;
        let expected = spans.iter().map(|&span| sums.points(span)).collect();
        // The nodes above the parts have numbers of their own.
        tree.part = PartIndex::new(spans.len());
        let mut part_of = vec![PartIndex::FIRST; grid.buckets()];
        for (part, &span) in spans.iter().enumerate() {
            grid.in_span(span).for_each(|bucket| part_of[bucket] = PartIndex::new(part));
        }
        let reach = reach_of(&grid, plan.inputs.iter().map(|input| input.claimed));
        let readers = Readers::of(&spans, &reach);
        Parts { grid, tree, spans, part_of, reach, readers, expected }
    }

    /// Returns all parts in the order in which they are done.
    pub fn all(&self) -> impl ExactSizeIterator<Item = PartIndex> + Clone {
        (0..self.spans.len()).map(PartIndex::new)
    }

    /// Returns the node of a part in the tree above the parts.
    pub fn node(&self, part: PartIndex) -> NodeIndex {
        self.tree.leaves[part.get()]
    }

    /// Returns the part of the plane that `part` decides.
    pub fn cell(&self, part: PartIndex) -> Cell {
        self.tree.node(self.node(part)).cell
    }

    /// Returns the buckets of `part`.
    pub fn span(&self, part: PartIndex) -> GridSpan {
        self.spans[part.get()]
    }

    /// Returns the buckets that the inputs which `part` is the first to need may have points in: a rectangle around them, or around its own if
    /// there are none. Headers may be off by a little, so it has the buckets beside these too.
    pub fn read_by(&self, part: PartIndex) -> GridSpan {
        self.grid.with_neighbours(self.readers.reach[part.get()].unwrap_or(self.span(part)))
    }

    /// Tells whether an input may have points in `part`.
    pub fn reaches(&self, input: usize, part: PartIndex) -> bool {
        self.reach[input].meets(self.span(part))
    }

    /// Returns the parts that read inputs which may have points in `part`.
    pub fn readers_of(&self, part: PartIndex) -> impl Iterator<Item = PartIndex> {
        // Later parts are the first to need only inputs that do not reach this one.
        let reaches = move |reader: &PartIndex| self.new_inputs(*reader).iter().any(|&input| self.reaches(input, part));
        self.all().take(part.get() + 1).filter(reaches)
    }

    /// Returns how many points `part` is expected to have.
    pub fn expected_points(&self, part: PartIndex) -> u64 {
        self.expected[part.get()]
    }

    /// Returns the part that a bucket belongs to.
    pub fn part_of(&self, bucket: usize) -> PartIndex {
        self.part_of[bucket]
    }

    /// Returns the inputs that may have points in `part` and in none of the parts before it.
    pub fn new_inputs(&self, part: PartIndex) -> &[usize] {
        &self.readers.new_inputs[part.get()]
    }
}

/// Returns how many points the buckets hold if the points of each input are spread evenly over its box.
fn expected_points(grid: &Grid, inputs: &[CutInput]) -> GridSums {
    let mut points = vec![0u64; grid.buckets()];
    for input in inputs {
        let area = |bounds: Bounds<2>| [0, 1].map(|axis| bounds.extent(axis) as u128 + 1).iter().product::<u128>();
        let whole = area(input.claimed);
        let records = u128::from(input.records);
        for (bucket, shared) in grid.shared_with(input.claimed) {
            points[bucket] += (records * area(shared) / whole) as u64;
        }
    }
    GridSums::new(*grid, points.into_iter())
}

struct PartCutter {
    tree: Tree,
    spans: Vec<GridSpan>,
    sums: GridSums,
    /// The most points that a part is expected to have.
    most: u64,
}

impl PartCutter {
    /// Cuts the plane along the buckets of `grid` into parts that are expected to have at most so many points.
    fn cut_plane(sums: GridSums, grid: &Grid, most: u64) -> PartCutter {
        let mut cutter = PartCutter { tree: Tree::default(), spans: Vec::new(), sums, most };
        cutter.cut(Cell::PLANE, None, grid.span());
        cutter
    }

    fn cut(&mut self, cell: Cell, parent: Option<NodeIndex>, span: GridSpan) -> NodeIndex {
        let node = NodeIndex::new(self.tree.nodes.len());
        let halves = if self.sums.points(span) > self.most { self.sums.halve(span, cell) } else { None };
        let leaf = NodeKind::Leaf(PartIndex::new(self.spans.len()).tile(0));
        self.tree.nodes.push(TreeNode { cell, parent, kind: leaf });
        match halves {
            None => {
                self.tree.leaves.push(node);
                self.spans.push(span);
            }
            Some(halves) => {
                let children = halves.map(|(half, half_cell)| self.cut(half_cell, Some(node), half));
                self.tree.nodes[node.get()].kind = NodeKind::Inner(children);
            }
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_read_by_the_first_part_that_it_reaches() {
        let grid = Grid::over(Bounds { min: [0, 0], max: [99, 99] }, 100);
        let span = |min, max| grid.span_of(Bounds { min, max });
        let parts = [span([0, 0], [49, 99]), span([50, 0], [99, 49]), span([50, 50], [99, 99])];
        let reach =
            [span([60, 60], [69, 69]), span([40, 0], [59, 9]), span([0, 20], [9, 29]), span([70, 90], [99, 99])];
        let readers = Readers::of(&parts, &reach);
        assert_eq!(readers.new_inputs, [vec![1, 2], vec![], vec![0, 3]]);
        assert_eq!(readers.reach, [Some(span([0, 0], [59, 29])), None, Some(span([60, 60], [99, 99]))]);
        assert_eq!(readers.most_buckets(), 18);
    }
}
