//! The rounds: triangulate what is selected, and select the worst points of the triangles where they exceed the bound ([`Proposal`]).
//!
//! A block has some hundred thousand points. It triangulates what is selected in it and around it, and takes selected points of other blocks
//! until the circle of no triangle that holds its points has one ([`crate::block`]). So these triangles are those of the whole triangulation.
//! A triangle that reaches out of a block may hold points of others: their worst points are compared.

use crate::area::area_of;
use crate::block::{Block, BlockErrors, Proposal, SharedCandidate};
use crate::concern::Concern;
use crate::error_bound::{ErrorBound, RoundBound};
use crate::held_points::HeldPoints;
use crate::memory::BlockMemory;
use crate::mesh_of_points::TriangleKey;
use crate::near_points::PointsByPlace;
use crate::sample::{Sample, Samples, very_far_above};
use crate::selected_sites::SelectedSites;
use crate::source::{BYTES_PER_LISTED, BlockPoints, PointSource};
use crate::swap::{Place, SwapSpace, SwappedBlock};
use delaunay::geometry::{Bounds, Site};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, PoisonError};

/// What a selection has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// The points that were selected from.
    pub points: u64,
    /// The points that were selected.
    pub selected: u64,
    /// The rounds that selected some. Of those of regions, and of those along their borders, the most that one has taken.
    pub rounds: u32,
    /// The greatest distance of a point, in 2^-20 lattice steps of height, rounded down.
    pub greatest: u64,
    /// The point at that distance; none if all are selected.
    pub worst: Option<[i32; 3]>,
    /// The mean distance of all points, in lattice steps of height.
    pub mean: f64,
}

/// What is known of a block in the end.
#[derive(Debug)]
pub(crate) struct FinishedBlock {
    /// Where points must be selected before any of its points exceeds the bound again, or is at another distance.
    concern: Option<Concern>,
    /// The distances of its points.
    errors: BlockErrors,
}

impl FinishedBlock {
    /// Tells whether only points in a box that is a part of the box of `all` points can concern it.
    pub(crate) fn concerns_only(&self, part: Bounds<2>, all: Bounds<2>) -> bool {
        self.concern.as_ref().is_some_and(|concern| concern.lies_in(part, all))
    }

    /// Tells whether one of the points that were added last to what is `selected`, all of which lie in the box `newly`, may concern it.
    pub(crate) fn has_newly(&self, selected: &SelectedSites, newly: &Bounds<2>) -> bool {
        self.concern.as_ref().is_none_or(|concern| concern.meets(newly) && concern.has_newly(selected))
    }

    /// Adds what is known of another part of the block.
    pub(crate) fn join(self, other: FinishedBlock) -> FinishedBlock {
        let concern = self.concern.zip(other.concern).map(|(a, b)| a.join(b));
        FinishedBlock { concern, errors: self.errors.join(other.errors) }
    }
}

/// What rounds have come to.
pub(crate) struct Finished<'a> {
    /// The selected points.
    pub(crate) sites: SelectedSites<'a>,
    points: u64,
    /// The number of rounds.
    pub(crate) rounds: u32,
    /// For each block what is known of it; `None` if it has no points. Nothing is known if all points of the cloud are selected without rounds.
    pub(crate) blocks: Vec<Option<FinishedBlock>>,
}

impl<'a> Finished<'a> {
    /// Returns what all blocks come to.
    pub(crate) fn into_selection(self) -> Selection<'a> {
        let errors = self.blocks.into_iter().flatten().map(|block| block.errors);
        let BlockErrors { greatest, sum, mut holding } = errors.reduce(BlockErrors::join).unwrap_or_default();
        let steps = (1u64 << crate::VerticalError::FRACTION_BITS) as f64;
        holding.sort_unstable();
        // Several blocks may hold points of one.
        holding.dedup_by(|other, first| {
            let is_same = other.corners == first.corners;
            if is_same {
                first.join(other);
            }
            is_same
        });
        let figures = Figures {
            points: self.points,
            selected: self.sites.count(),
            rounds: self.rounds,
            greatest: greatest.map_or(0, |(error, _)| error),
            worst: greatest.map(|(_, point)| point),
            mean: sum as f64 / steps / self.points.max(1) as f64,
        };
        Selection { sites: self.sites, figures, holding }
    }
}

/// Selected points, and what is known of them.
#[derive(Debug)]
pub struct Selection<'a> {
    /// The selected points.
    pub sites: SelectedSites<'a>,
    /// Its figures.
    pub figures: Figures,
    /// The triangles with points inside, of those that the source asks about, in the order of their corners.
    pub holding: Vec<HeldPoints>,
}

/// What is known of a block between rounds.
#[derive(Default)]
pub(crate) struct BlockState {
    pub(crate) bounds: Option<Bounds<2>>,
    pub(crate) points: u64,
    /// Its points, if they stay in memory until it is triangulated.
    pub(crate) loaded: Option<BlockPoints>,
    block: Option<Block>,
    /// What that takes of the memory.
    block_bytes: u64,
    /// The block, if the memory does not hold it.
    swapped: Option<SwappedBlock>,
    /// Its place in the file.
    place: Option<Place>,
    /// If the block has nothing to propose: where points must be selected before that changes.
    settled: Option<Concern>,
    /// The distances of its points, if it has nothing to propose and waits nowhere.
    errors: Option<BlockErrors>,
}

impl BlockState {
    /// Returns the state of a block of these points that is not triangulated.
    pub(crate) fn of(points: &[[i32; 3]]) -> BlockState {
        let bounds = Bounds::of_points(points.iter().map(|p| [p[0], p[1]]));
        BlockState { bounds, points: points.len() as u64, ..BlockState::default() }
    }

    /// Returns the points of the block with this number, from `memory` if they wait there.
    ///
    /// # Errors
    /// Those of the source.
    pub(crate) fn take_points<E: Send + From<sys::Error>>(
        &mut self,
        source: &dyn PointSource<Error = E>,
        memory: &BlockMemory,
        index: usize,
    ) -> Result<Vec<[i32; 3]>, E> {
        let Some(loaded) = self.loaded.take() else { return Ok(source.load(index)?.points) };
        memory.take_points(self.points);
        Ok(loaded.points)
    }
}

/// One of so many bytes of the memory is for the list of selected points; those that it does not hold wait in a file.
const LISTED_SHARE: u64 = 4;

/// A selection under way.
pub(crate) struct Rounds<'a, E> {
    source: &'a dyn PointSource<Error = E>,
    /// The corners of the hull of the cloud.
    outline: Vec<[i32; 3]>,
    blocks: Vec<Mutex<BlockState>>,
    selected: SelectedSites<'a>,
    memory: BlockMemory,
    swap: SwapSpace,
    /// The points that are looked at.
    sample: Sample,
    /// The area of the box of the points, in square lattice steps.
    area: f64,
    /// Whether points have been selected from the regions of the cloud already.
    is_after_regions: bool,
    /// The number of points, and of rounds.
    points: u64,
    rounds: u32,
}

impl<'a, E: Send + From<sys::Error>> Rounds<'a, E> {
    /// Returns the rounds for a cloud in `bounds`. The points of its blocks may wait in `memory`.
    pub(crate) fn new(
        source: &'a dyn PointSource<Error = E>,
        blocks: Vec<BlockState>,
        bounds: Bounds<2>,
        memory: BlockMemory,
    ) -> Rounds<'a, E> {
        let points = blocks.iter().map(|state| state.points).sum();
        let most_in_memory = source.memory() / LISTED_SHARE / BYTES_PER_LISTED;
        Rounds {
            source,
            outline: Vec::new(),
            blocks: blocks.into_iter().map(Mutex::new).collect(),
            selected: SelectedSites::none(bounds, points, source.store(), most_in_memory),
            memory,
            swap: SwapSpace::default(),
            sample: Sample::all(source.offset()),
            area: area_of(bounds),
            is_after_regions: false,
            points,
            rounds: 0,
        }
    }

    /// Takes what is known of a block over from rounds that ended with the same triangles there.
    pub(crate) fn take_over(&mut self, block: usize, known: FinishedBlock) {
        let state = self.blocks[block].get_mut().unwrap_or_else(PoisonError::into_inner);
        (state.settled, state.errors) = (known.concern, Some(known.errors));
    }

    /// Selects points before the first round.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(crate) fn add(&mut self, first: Vec<[i32; 3]>) -> sys::Result<()> {
        self.selected.add(first)
    }

    /// Returns the points that are selected so far.
    pub(crate) fn selected(&self) -> &SelectedSites<'a> {
        &self.selected
    }

    /// Does all rounds, over `samples` one after the other, and returns what they select. Of points on one line that is all of them. `outline` are
    /// the corners of the hull of the cloud; so many `rounds` have been done.
    ///
    /// # Errors
    /// Those of the source.
    pub(crate) fn run(
        mut self,
        outline: Vec<[i32; 3]>,
        rounds: u32,
        bound: ErrorBound,
        samples: Samples,
    ) -> Result<Finished<'a>, E> {
        (self.outline, self.rounds) = (outline, rounds);
        self.is_after_regions = samples == Samples::AfterRegions;
        if self.outline.len() < 3 {
            return self.select_all();
        }
        for (number, sample) in samples.ladder(self.source.offset()).enumerate() {
            self.sample = sample;
            if number > 0 {
                for state in &mut self.blocks {
                    state.get_mut().unwrap_or_else(PoisonError::into_inner).settled = None;
                }
                self.add_beyond(very_far_above(bound))?;
            }
            self.down_to(&samples.bound(sample.bound(bound, self.points, self.area)), |_| ())?;
        }
        self.finish()
    }

    /// Selects all points of the sample that exceed `bound`.
    fn add_beyond(&mut self, bound: ErrorBound) -> Result<(), E> {
        let beyond = (0..self.blocks.len()).into_par_iter().with_max_len(1).map(|index| {
            let mut state = self.blocks[index].lock().unwrap_or_else(PoisonError::into_inner);
            self.with_block(index, &mut state, |block| block.beyond(bound))
        });
        let beyond = beyond.collect::<Result<Vec<_>, E>>()?;
        self.add_round(beyond.into_iter().flatten()).map(|_| ())
    }

    /// Does rounds over all points, and returns what they select and how many there were. `outline` are the corners of the hull of the cloud, three at
    /// least.
    ///
    /// # Errors
    /// Those of the source.
    pub(crate) fn select_more(mut self, outline: Vec<[i32; 3]>, bound: ErrorBound) -> Result<(Vec<[i32; 3]>, u32), E> {
        self.outline = outline;
        let mut more = Vec::new();
        self.down_to(&RoundBound::everywhere(bound), |found| more.push(found))?;
        for state in &self.blocks {
            self.free_place(&mut state.lock().unwrap_or_else(PoisonError::into_inner))?;
        }
        self.selected.free()?;
        Ok((more, self.rounds))
    }

    /// Does rounds until no point of the sample exceeds `bound`. Hands over what they select.
    fn down_to(&mut self, bound: &RoundBound, mut take: impl FnMut([i32; 3])) -> Result<(), E> {
        loop {
            self.memory.begin_round();
            let proposals =
                (0..self.blocks.len()).into_par_iter().with_max_len(1).map(|block| self.proposal_of(block, bound));
            let proposals = proposals.collect::<Result<Vec<_>, E>>()?;
            let found = accepted(&proposals, bound.far).inspect(|found| take(*found));
            if !self.add_round(found)? {
                return Ok(());
            }
        }
    }

    /// Selects what a round has found. Tells whether that is any point.
    fn add_round(&mut self, found: impl Iterator<Item = [i32; 3]>) -> Result<bool, E> {
        let before = self.selected.count();
        self.selected.add(found)?;
        if self.selected.count() == before {
            return Ok(false);
        }
        self.rounds += 1;
        self.source.after_round()?;
        Ok(true)
    }

    /// Returns what a block proposes to select. A block that has nothing to propose is left alone until points are selected near it.
    fn proposal_of(&self, index: usize, bound: &RoundBound) -> Result<Proposal, E> {
        let mut state = self.blocks[index].lock().unwrap_or_else(PoisonError::into_inner);
        if state.settled.as_ref().is_some_and(|concern| !concern.has_newly(&self.selected)) {
            return Ok(Proposal::default());
        }
        let is_new = state.block.is_none() && state.swapped.is_none();
        let Some(mut block) = self.block(index, &mut state)? else { return Ok(Proposal::default()) };
        let proposal = block.propose(bound);
        self.memory.note_proposal(proposal.bytes());
        state.settled = block.settled_within();
        if is_new && self.is_after_regions && state.settled.is_some() {
            // Most of these are far from the borders of regions, and not needed again.
            self.memory.note_block(state.points, block.sites(), block.bytes());
            state.errors = Some(self.errors_of(&block));
        } else {
            self.put_block(block, &mut state)?;
        }
        Ok(proposal)
    }

    /// Lends `work` a block that knows all that is selected. Returns a default for a block without points.
    fn with_block<T: Default>(
        &self,
        index: usize,
        state: &mut BlockState,
        work: impl FnOnce(&mut Block) -> T,
    ) -> Result<T, E> {
        let Some(mut block) = self.block(index, state)? else { return Ok(T::default()) };
        let done = work(&mut block);
        self.put_block(block, state)?;
        Ok(done)
    }

    /// Returns a block that knows all that is selected; `None` for one without points.
    fn block(&self, index: usize, state: &mut BlockState) -> Result<Option<Block>, E> {
        let Some(bounds) = state.bounds else { return Ok(None) };
        state.errors = None;
        let triangulated = |points, afar: &[[i32; 3]]| {
            let triangulate = |sites: &[Site]| self.source.triangulate(sites);
            Block::new(points, bounds, self.sample, &self.selected, afar, triangulate)
        };
        let mut block = match self.take_block(state)? {
            Some(block) if block.grows_by_far(&self.selected) => {
                let (points, mut afar) = block.into_points();
                // A corner of the hull that was in the surroundings may lie outside the new ones.
                afar.extend(&self.outline);
                triangulated(points, &afar)?
            }
            Some(mut block) => {
                block.update(&self.selected)?;
                block
            }
            None => {
                let points = state.take_points(self.source, &self.memory, index)?;
                triangulated(PointsByPlace::of(&points, bounds, self.sample), &self.outline)?
            }
        };
        block.look_at(self.sample, &self.selected)?;
        Ok(Some(block))
    }

    /// Takes a block from where it waits.
    fn take_block(&self, state: &mut BlockState) -> Result<Option<Block>, E> {
        self.memory.release(std::mem::take(&mut state.block_bytes));
        let swapped = state.swapped.take().zip(self.source.store());
        let Some((swapped, store)) = swapped else { return Ok(state.block.take()) };
        Ok(Some(swapped.read(store)?))
    }

    /// Lets a block wait in memory, or in the file if the memory does not hold it. If that has no space either, the block is made again when it is
    /// needed.
    fn put_block(&self, mut block: Block, state: &mut BlockState) -> Result<(), E> {
        block.rest();
        let bytes = block.bytes();
        if self.memory.keeps_block(state.points, block.sites(), bytes, self.selected.bytes()) {
            (state.block, state.block_bytes) = (Some(block), bytes);
        } else if let Some(store) = self.source.store() {
            state.place = self.swap.place(bytes, state.place.take(), store)?;
            state.swapped = state.place.map(|place| SwappedBlock::write(block, place, store)).transpose()?;
        }
        Ok(())
    }

    /// Gives the place of a block in the file back.
    fn free_place(&self, state: &mut BlockState) -> Result<(), E> {
        if let Some((place, store)) = state.place.take().zip(self.source.store()) {
            self.swap.free(place, store)?;
        }
        Ok(())
    }

    /// Returns the distances of the points of a block.
    fn errors_of(&self, block: &Block) -> BlockErrors {
        block.errors(|corners| self.source.asks_about(corners))
    }

    fn finish(self) -> Result<Finished<'a>, E> {
        let blocks = (0..self.blocks.len()).into_par_iter().with_max_len(1).map(|index| {
            let mut state = self.blocks[index].lock().unwrap_or_else(PoisonError::into_inner);
            let errors = match state.errors.take() {
                Some(errors) => Some(errors),
                None => self.block(index, &mut state)?.map(|block| self.errors_of(&block)),
            };
            // Nothing needs it any more.
            self.free_place(&mut state)?;
            Ok::<_, E>(errors.map(|errors| FinishedBlock { concern: state.settled.take(), errors }))
        });
        let blocks = blocks.collect::<Result<Vec<_>, E>>()?;
        Ok(Finished { sites: self.selected, points: self.points, rounds: self.rounds, blocks })
    }

    /// Selects all points.
    fn select_all(self) -> Result<Finished<'a>, E> {
        let mut sites = self.selected.emptied();
        for block in 0..self.source.blocks() {
            sites.add(self.source.load(block)?.points)?;
        }
        let blocks = self.blocks.iter().map(|_| None).collect();
        Ok(Finished { sites, points: self.points, rounds: 0, blocks })
    }
}

/// Returns what all blocks together select.
fn accepted(proposals: &[Proposal], far: u64) -> impl Iterator<Item = [i32; 3]> {
    let mut worst: Vec<&SharedCandidate> = proposals.iter().flat_map(|proposal| &proposal.shared).collect();
    worst.par_sort_unstable_by_key(|shared| shared.triangle);
    worst.dedup_by(|other, first| {
        let is_same = other.triangle == first.triangle;
        if is_same && other.candidate.is_worse_in_triangle(&first.candidate) {
            *first = *other;
        }
        is_same
    });
    let worst_of = move |triangle: TriangleKey| {
        let found = worst.binary_search_by_key(&triangle, |shared| shared.triangle);
        found.ok().map(|index| worst[index].candidate)
    };
    let is_selected = move |shared: &&SharedCandidate| {
        let SharedCandidate { triangle, candidate, is_proposed, is_inside, .. } = *shared;
        *is_proposed
            && (*is_inside || worst_of(*triangle) == Some(*candidate))
            && shared.beside().filter_map(&worst_of).all(|other| candidate.stands_beside(&other, far))
    };
    let shared = proposals.iter().flat_map(|proposal| &proposal.shared).filter(is_selected);
    let of_one_block = proposals.iter().flat_map(|proposal| &proposal.accepted).copied();
    shared.map(|shared| shared.candidate.point).chain(of_one_block)
}
