//! The rounds: triangulate what is selected, and select the worst points of the triangles where they exceed the bound ([`Proposal`]).
//!
//! A block has some hundred thousand points. It triangulates what is selected in it and around it, and takes selected points of other blocks
//! until the circle of no triangle that holds its points has one ([`crate::block`]). So these triangles are those of the whole triangulation.
//! A triangle that reaches out of a block may hold points of others: their worst points are compared.

use crate::block::{Block, BlockErrors, Proposal, SharedCandidate, TriangleKey, Undecided, far_above};
use crate::error_bound::{Candidate, ErrorBound};
use crate::selected_sites::SelectedSites;
use crate::source::PointSource;
use delaunay::geometry::{Bounds, Site};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// What a selection has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// The points that were selected from.
    pub points: u64,
    /// The points that were selected.
    pub selected: u64,
    /// The rounds that selected some.
    pub rounds: u32,
    /// The greatest distance of a point, in 2^-20 lattice steps of height, rounded down.
    pub greatest: u64,
    /// The point at that distance; none if all are selected.
    pub worst: Option<[i32; 3]>,
    /// The mean distance of all points, in lattice steps of height.
    pub mean: f64,
}

/// Selected points, and what is known of them.
#[derive(Debug)]
pub struct Selection {
    /// The selected points.
    pub sites: SelectedSites,
    /// Its figures.
    pub figures: Figures,
    /// The triangles that hold points, of those that the source asks about, in order: their corners in ascending order, and how many.
    pub holding: Vec<([Site; 3], u64)>,
}

/// What is known of a block between rounds.
#[derive(Default)]
pub(crate) struct BlockState {
    pub(crate) bounds: Option<Bounds<2>>,
    pub(crate) points: u64,
    block: Option<Block>,
    /// If the block has nothing to propose: where points must be selected before that changes.
    settled: Option<Bounds<2>>,
}

impl BlockState {
    /// Returns the state of a block of these points that is not triangulated.
    pub(crate) fn of(points: &[[i32; 3]]) -> BlockState {
        let bounds = Bounds::of_points(points.iter().map(|p| [p[0], p[1]]));
        BlockState { bounds, points: points.len() as u64, ..BlockState::default() }
    }
}

/// A selection under way.
pub(crate) struct Rounds<'a, E> {
    source: &'a dyn PointSource<Error = E>,
    /// The corners of the hull of the cloud.
    outline: Vec<[i32; 3]>,
    blocks: Vec<Mutex<BlockState>>,
    selected: SelectedSites,
    /// What the last round selected, by the cells of `selected`.
    newly_selected: Vec<[i32; 3]>,
    figures: Figures,
}

impl<'a, E: Send> Rounds<'a, E> {
    /// Returns the rounds for a cloud of `points` points in `bounds`, before anything is known of its blocks.
    pub(crate) fn new(source: &'a dyn PointSource<Error = E>, bounds: Bounds<2>, points: u64) -> Rounds<'a, E> {
        Rounds {
            source,
            outline: Vec::new(),
            blocks: Vec::new(),
            selected: SelectedSites::none(bounds, points),
            newly_selected: Vec::new(),
            figures: Figures::default(),
        }
    }

    /// Tells what is known of all blocks, the corners of the hull of the cloud, what is selected first, and the rounds that this took.
    pub(crate) fn begin(&mut self, blocks: Vec<BlockState>, outline: Vec<[i32; 3]>, first: Vec<[i32; 3]>, rounds: u32) {
        self.figures.points = blocks.iter().map(|state| state.points).sum();
        self.figures.rounds = rounds;
        self.blocks = blocks.into_iter().map(Mutex::new).collect();
        self.outline = outline;
        self.add(first);
    }

    /// Does all rounds, and returns what they select. Of points on one line that is all of them.
    ///
    /// # Errors
    /// Those of the source.
    pub(crate) fn run(mut self, bound: ErrorBound) -> Result<Selection, E> {
        if self.outline.len() < 3 {
            return self.select_all();
        }
        self.down_to(bound)?;
        self.finish()
    }

    fn add(&mut self, mut points: Vec<[i32; 3]>) {
        // Neighbours in the plane one after the other: what a block looks at for one is still in the cache for the next.
        points.par_sort_unstable_by_key(|&point| (self.selected.cell_of(point), point));
        self.selected.add(&points);
        self.newly_selected = points;
    }

    /// Returns the newly selected points in the cells that meet `bounds`.
    fn newly_selected_near(&self, bounds: Bounds<2>) -> impl Iterator<Item = &[i32; 3]> {
        let [rows, columns] = self.selected.rows_and_columns(bounds);
        let from = move |row: usize, column: usize| {
            self.newly_selected.partition_point(|&point| self.selected.cell_of(point) < [row, column])
        };
        rows.flat_map(move |row| &self.newly_selected[from(row, columns.start)..from(row, columns.end)])
    }

    /// Does rounds until no point exceeds `bound`.
    fn down_to(&mut self, bound: ErrorBound) -> Result<(), E> {
        loop {
            let proposals =
                (0..self.blocks.len()).into_par_iter().with_max_len(1).map(|block| self.proposal_of(block, bound));
            let accepted = accept(proposals.collect::<Result<_, E>>()?, far_above(bound));
            self.newly_selected.clear();
            if accepted.is_empty() {
                return Ok(());
            }
            self.add(accepted);
            self.figures.rounds += 1;
            self.source.after_round(self.figures.rounds, self.selected.count())?;
        }
    }

    /// Returns what a block proposes to select. A block that has nothing to propose is left alone until points are selected near it.
    fn proposal_of(&self, index: usize, bound: ErrorBound) -> Result<Proposal, E> {
        let mut state = self.blocks[index].lock().unwrap_or_else(PoisonError::into_inner);
        if state.settled.is_some_and(|reach| self.newly_selected_near(reach).next().is_none()) {
            return Ok(Proposal::default());
        }
        self.with_block(index, &mut state, |block| (block.propose(bound), block.settled_within())).map(
            |(proposal, settled)| {
                state.settled = settled;
                proposal
            },
        )
    }

    /// Lends `work` a block that knows all that is selected. Returns a default for a block without points.
    fn with_block<T: Default>(
        &self,
        index: usize,
        state: &mut BlockState,
        work: impl FnOnce(&mut Block) -> T,
    ) -> Result<T, E> {
        let Some(bounds) = state.bounds else { return Ok(T::default()) };
        let mut block = match state.block.take() {
            Some(mut block) => {
                block.update(self.newly_selected_near(block.reach()), &self.selected);
                block
            }
            None => {
                let points = self.source.load(index)?.points;
                Block::new(points, bounds, &self.selected, &self.outline, |sites| self.source.triangulate(sites))?
            }
        };
        let done = work(&mut block);
        state.block = Some(block).filter(|_| self.source.keeps_blocks(self.figures.points, self.selected.count()));
        Ok(done)
    }

    fn finish(mut self) -> Result<Selection, E> {
        let errors = (0..self.blocks.len()).into_par_iter().with_max_len(1).map(|index| {
            let mut state = self.blocks[index].lock().unwrap_or_else(PoisonError::into_inner);
            let errors =
                self.with_block(index, &mut state, |block| block.errors(|corners| self.source.asks_about(corners)));
            // Nothing needs it any more.
            state.block = None;
            errors
        });
        let errors: BlockErrors = errors.try_reduce(BlockErrors::default, |a, b| Ok(a.join(b)))?;
        let steps = (1u64 << crate::VerticalError::FRACTION_BITS) as f64;
        self.figures.mean = errors.sum as f64 / steps / self.figures.points.max(1) as f64;
        (self.figures.greatest, self.figures.worst) =
            errors.greatest.map_or((0, None), |(error, point)| (error, Some(point)));
        self.figures.selected = self.selected.count();
        let mut holding = errors.holding;
        holding.sort_unstable();
        // Several blocks may hold points of one.
        holding.dedup_by(|other, first| {
            let is_same = other.0 == first.0;
            first.1 += if is_same { other.1 } else { 0 };
            is_same
        });
        Ok(Selection { sites: self.selected, figures: self.figures, holding })
    }

    /// Selects all points.
    fn select_all(self) -> Result<Selection, E> {
        let mut selected = self.selected.emptied();
        for block in 0..self.source.blocks() {
            selected.add(&self.source.load(block)?.points);
        }
        let figures = Figures { points: self.figures.points, selected: selected.count(), ..Figures::default() };
        Ok(Selection { sites: selected, figures, holding: Vec::new() })
    }
}

/// Returns what all blocks together select.
fn accept(proposals: Vec<Proposal>, far: u64) -> Vec<[i32; 3]> {
    let mut worst: HashMap<TriangleKey, Candidate> = HashMap::new();
    for SharedCandidate { triangle, candidate } in proposals.iter().flat_map(|proposal| &proposal.shared) {
        let known = worst.entry(*triangle).or_insert(*candidate);
        if candidate.is_worse_in_triangle(known) {
            *known = *candidate;
        }
    }
    let is_selected = |Undecided { candidate, triangle, beside }: &&Undecided| {
        let is_worst = triangle.is_none_or(|triangle| worst.get(&triangle) == Some(candidate));
        let mut others = beside.iter().flatten().filter_map(|triangle| worst.get(triangle));
        is_worst && others.all(|other| candidate.stands_beside(other, far))
    };
    let undecided = proposals.iter().flat_map(|proposal| &proposal.undecided);
    let mut accepted: Vec<[i32; 3]> =
        undecided.filter(is_selected).map(|undecided| undecided.candidate.point).collect();
    accepted.extend(proposals.iter().flat_map(|proposal| &proposal.accepted));
    accepted
}
