//! Selecting points from a cloud, or from its regions first.

use crate::error_bound::ErrorBound;
use crate::hull::hull_corners;
use crate::memory::BlockMemory;
use crate::outline::MarkedCells;
use crate::regions::{Division, RegionSizes, Strips, divide};
use crate::rounds::{BlockState, Finished, FinishedBlock, Rounds, Selection};
use crate::sample::Samples;
use crate::seeds::Seeds;
use crate::selected_sites::SelectedSites;
use crate::source::{BYTES_PER_LISTED, BlockPoints, PointSource};
use delaunay::geometry::Bounds;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Selects points from the blocks of `source` until every point is within `bound` of the triangulation of the selected ones.
///
/// Of points on one line all are selected: there is no triangle.
///
/// # Errors
/// Those of `source`.
pub fn select<S: PointSource>(source: &S, bound: ErrorBound) -> Result<Selection<'_>, S::Error> {
    Ok(select_by_regions(source, bound, RegionSizes::USUAL, None)?.into_selection())
}

/// As [`select`], for some points of a cloud that has `points_of_cloud`: the share that is selected is about that of the cloud.
///
/// # Errors
/// Those of `source`.
pub fn select_like<S: PointSource>(
    source: &S,
    points_of_cloud: u64,
    bound: ErrorBound,
) -> Result<Selection<'_>, S::Error> {
    let unsampled = if points_of_cloud <= RegionSizes::USUAL.unsampled { u64::MAX } else { 0 };
    Ok(select_by_regions(source, bound, RegionSizes { unsampled, ..RegionSizes::USUAL }, None)?.into_selection())
}

/// As [`select`]. A cloud of many points is divided into regions by the lattice, and points are selected from each of these by itself first. The
/// `bays` are those of the whole cloud, if this is a part of it.
pub(crate) fn select_by_regions<'a, E: Send + From<sys::Error>>(
    source: &'a dyn PointSource<Error = E>,
    bound: ErrorBound,
    sizes: RegionSizes,
    bays: Option<&MarkedCells>,
) -> Result<Finished<'a>, E> {
    let memory = BlockMemory::new(source.memory());
    let blocks = load_blocks(source, &memory)?;
    let bounds = blocks.iter().filter_map(|state| state.bounds).reduce(Bounds::union);
    let bounds = bounds.unwrap_or(Bounds::of_point([0, 0]));
    let points = blocks.iter().map(|state| state.points).sum();
    if points <= sizes.undivided {
        let cells = MarkedCells::none(bounds, points, source.offset());
        let samples = if points <= sizes.unsampled { Samples::Unneeded } else { Samples::Growing };
        let none = Seeds::none(samples, bounds, points, source.offset(), bays.unwrap_or(&cells));
        let seeds = seeds_of(source, &blocks, none)?;
        let own;
        let bays = match bays {
            Some(bays) => bays,
            None => {
                own = seeds.bays(cells);
                &own
            }
        };
        let hull = seeds.hull().to_vec();
        let mut rounds = Rounds::new(source, blocks, bounds, memory);
        rounds.add(seeds.into_points(bays))?;
        return rounds.run(hull, 0, bound, samples);
    }
    let cells = bays.is_none().then(|| MarkedCells::none(bounds, points, source.offset()));
    let Division { bays: own, blocks, regions, borders } =
        divide(source, blocks, &memory, bounds, points, sizes, cells)?;
    let bays = bays.or(own.as_ref());
    let mut known: Vec<Vec<Option<FinishedBlock>>> = blocks.iter().map(|_| Vec::new()).collect();
    let mut rounds = Rounds::new(source, blocks, bounds, memory);
    let (mut corners, mut selected_by_cell, mut most, mut most_of_strips) = (Vec::new(), BTreeMap::new(), 0, 0);
    let sizes = RegionSizes { unsampled: 0, ..sizes };
    for (cell, region) in &regions {
        let region = region.after(rounds.selected().bytes());
        let of_region = select_by_regions(&region, bound, sizes, bays)?;
        most = most.max(of_region.rounds);
        let selected = of_region.sites.within(region.bounds)?;
        of_region.sites.free()?;
        region.undisturbed(of_region.blocks, bounds).for_each(|(block, part)| known[block].push(part));
        selected_by_cell.insert(*cell, selected.len() as u64);
        corners.extend(hull_corners(selected.clone()));
        rounds.add(selected)?;
    }
    let hull = hull_corners(corners);
    if hull.len() > 2 {
        for strips in borders.strips(&selected_by_cell) {
            let (newly, done) = select_beside(&strips, rounds.selected(), &hull, bound)?;
            most_of_strips = most_of_strips.max(done);
            let Some(area) = Bounds::of_points(newly.iter().map(|p| [p[0], p[1]])) else { continue };
            rounds.add(newly)?;
            for part in known.iter_mut().flatten() {
                part.take_if(|part| part.has_newly(rounds.selected(), &area));
            }
        }
    }
    // What was selected so far disturbs none of the blocks that are left.
    rounds.add(Vec::new())?;
    for (block, parts) in known.into_iter().enumerate() {
        let whole = parts.into_iter().reduce(|a, b| a.zip(b).map(|(a, b)| a.join(b)));
        whole.flatten().into_iter().for_each(|whole| rounds.take_over(block, whole));
    }
    rounds.run(hull, most + most_of_strips, bound, Samples::AfterRegions)
}

/// Selects points of strips beside those that are `selected` around them, and returns them with the number of rounds. The `hull` is that of the
/// whole cloud.
pub(crate) fn select_beside<E: Send + From<sys::Error>>(
    strips: &Strips<E>,
    selected: &SelectedSites,
    hull: &[[i32; 3]],
    bound: ErrorBound,
) -> Result<(Vec<[i32; 3]>, u32), E> {
    let known = strips.around(selected)?;
    let strips = &strips.points.after(selected.bytes() + known.len() as u64 * BYTES_PER_LISTED);
    let memory = BlockMemory::new(strips.memory());
    let blocks = load_blocks(strips, &memory)?;
    let mut rounds = Rounds::new(strips, blocks, strips.bounds, memory);
    rounds.add(known)?;
    rounds.select_more(hull.to_vec(), bound)
}

/// Loads all blocks once. Points are counted here, because a caller may not know which of them share a place. They stay in `memory` if it holds
/// them.
fn load_blocks<E: Send + From<sys::Error>>(
    source: &dyn PointSource<Error = E>,
    memory: &BlockMemory,
) -> Result<Vec<BlockState>, E> {
    let block = |block| {
        let points = source.load(block)?;
        let mut state = BlockState::of(&points.points);
        state.loaded = Some(points).filter(|_| memory.keeps_points(state.points));
        Ok(state)
    };
    (0..source.blocks()).into_par_iter().with_max_len(1).map(block).collect()
}

/// Returns the seeds in all `blocks`.
fn seeds_of<E: Send + From<sys::Error>>(
    source: &dyn PointSource<Error = E>,
    blocks: &[BlockState],
    none: Seeds,
) -> Result<Seeds, E> {
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
