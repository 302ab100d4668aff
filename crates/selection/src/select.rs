//! Selecting points from a cloud, or from its regions first.

use crate::error_bound::ErrorBound;
use crate::hull::hull_corners;
use crate::regions::{Division, RegionSizes, divide};
use crate::rounds::{BlockState, Rounds, Selection};
use crate::sample::Sample;
use crate::seeds::Seeds;
use crate::source::{BlockPoints, PointSource};
use delaunay::geometry::Bounds;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Selects points from the blocks of `source` until every point is within `bound` of the triangulation of the selected ones.
///
/// Of points on one line all are selected: there is no triangle.
///
/// # Errors
/// Those of `source`.
pub fn select<S: PointSource>(source: &S, bound: ErrorBound) -> Result<Selection, S::Error> {
    select_by_regions(source, bound, RegionSizes::USUAL)
}

/// As [`select`]. A cloud of many points is divided into regions by the lattice, and points are selected from each of these by itself first.
pub(crate) fn select_by_regions<E: Send>(
    source: &dyn PointSource<Error = E>,
    bound: ErrorBound,
    sizes: RegionSizes,
) -> Result<Selection, E> {
    let blocks = load_blocks(source)?;
    let bounds = blocks.iter().filter_map(|state| state.bounds).reduce(Bounds::union);
    let bounds = bounds.unwrap_or(Bounds::of_point([0, 0]));
    let points = blocks.iter().map(|state| state.points).sum();
    let mut rounds = Rounds::new(source, bounds, points);
    if points <= sizes.undivided {
        let seeds = seeds_of(source, &blocks, Seeds::none(bounds, points, source.offset()))?;
        let outline = seeds.hull().to_vec();
        rounds.begin(blocks, outline, seeds.into_points(), 0);
        return rounds.run(bound, Sample::ladder(source.offset()));
    }
    let Division { blocks, regions } = divide(source, blocks, bounds, points, sizes)?;
    let (mut selected, mut most) = (Vec::new(), 0);
    for region in &regions {
        let of_region = select_by_regions(region, bound, sizes)?;
        most = most.max(of_region.figures.rounds);
        selected.extend(of_region.sites.within(region.bounds));
        source.after_round(most, selected.len() as u64)?;
    }
    rounds.begin(blocks, hull_corners(selected.clone()), selected, most);
    rounds.run(bound, std::iter::once(Sample::all(source.offset())))
}

/// Loads all blocks once. Points are counted here, because a caller may not know which of them share a place. They stay in memory if it holds
/// them.
fn load_blocks<E: Send>(source: &dyn PointSource<Error = E>) -> Result<Vec<BlockState>, E> {
    let loaded = AtomicU64::new(0);
    let block = |block| {
        let points = source.load(block)?;
        let count = points.points.len() as u64;
        let mut state = BlockState::of(&points.points);
        let stays = source.keeps_blocks(loaded.fetch_add(count, Ordering::Relaxed) + count, 0);
        state.loaded = Some(points).filter(|_| stays);
        Ok(state)
    };
    (0..source.blocks()).into_par_iter().with_max_len(1).map(block).collect()
}

/// Returns the seeds in all `blocks`.
fn seeds_of<E: Send>(source: &dyn PointSource<Error = E>, blocks: &[BlockState], none: Seeds) -> Result<Seeds, E> {
    let seeds = blocks.par_iter().enumerate().with_max_len(1).map(|(number, state)| {
        let mut seeds = none.clone();
        match &state.loaded {
            Some(BlockPoints { points, fixed }) => seeds.add(points, fixed),
            None => {
                let BlockPoints { points, fixed } = source.load(number)?;
                seeds.add(&points, &fixed);
            }
        }
        Ok(seeds)
    });
    Ok(seeds.collect::<Result<Vec<Seeds>, E>>()?.into_iter().fold(none.clone(), Seeds::join))
}
