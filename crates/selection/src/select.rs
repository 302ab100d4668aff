//! Selecting points from a cloud, or from its regions first.

use crate::error_bound::ErrorBound;
use crate::hull::hull_corners;
use crate::regions::{Division, RegionSizes, divide};
use crate::rounds::{BlockState, Rounds, Selection};
use crate::seeds::Seeds;
use crate::source::{BlockPoints, PointSource};
use delaunay::geometry::Bounds;
use rayon::prelude::*;

/// Selects points from the blocks of `source` until every point is within `bound` of the triangulation of the selected ones.
///
/// Of points on one line all are selected: there is no triangle.
///
/// # Errors
/// Those of `source`.
pub fn select<S: PointSource>(source: &S, bound: ErrorBound) -> Result<Selection, S::Error> {
    // Points are counted here, because a caller may not know which of them share a place.
    let block = |block| Ok(BlockState::of(&source.load(block)?.points));
    let found = (0..source.blocks()).into_par_iter().with_max_len(1).map(block);
    let found = found.collect::<Result<Vec<BlockState>, S::Error>>()?;
    let bounds = found.iter().filter_map(|state| state.bounds).reduce(Bounds::union);
    let points = found.iter().map(|state| state.points).sum();
    let bounds = bounds.unwrap_or(Bounds::of_point([0, 0]));
    select_by_regions(source, bounds, points, bound, RegionSizes::USUAL)
}

/// As [`select`], of `points` points in `bounds`. A cloud of many points is divided into regions by the lattice, and points are selected from
/// each of these by itself first.
pub(crate) fn select_by_regions<E: Send>(
    source: &dyn PointSource<Error = E>,
    bounds: Bounds<2>,
    points: u64,
    bound: ErrorBound,
    sizes: RegionSizes,
) -> Result<Selection, E> {
    let mut rounds = Rounds::new(source, bounds, points);
    if points > sizes.undivided {
        let Division { blocks, regions } = divide(source, bounds, points, sizes)?;
        let (mut selected, mut most) = (Vec::new(), 0);
        for region in &regions {
            let of_region = select_by_regions(region, region.bounds, region.points, bound, sizes)?;
            most = most.max(of_region.figures.rounds);
            selected.extend(of_region.sites.within(region.bounds));
            source.after_round(most, selected.len() as u64)?;
        }
        rounds.begin(blocks, hull_corners(selected.clone()), selected, most);
    } else {
        let seed = |block| {
            let BlockPoints { points: of_block, fixed } = source.load(block)?;
            let mut seeds = Seeds::none(bounds, points, source.offset());
            seeds.add(&of_block, &fixed);
            Ok((seeds, BlockState::of(&of_block)))
        };
        let found: Vec<(Seeds, BlockState)> =
            (0..source.blocks()).into_par_iter().with_max_len(1).map(seed).collect::<Result<_, E>>()?;
        let (seeds, blocks): (Vec<Seeds>, Vec<BlockState>) = found.into_iter().unzip();
        let seeds = seeds.into_iter().fold(Seeds::none(bounds, points, source.offset()), Seeds::join);
        let outline = seeds.hull().to_vec();
        rounds.begin(blocks, outline, seeds.into_points(), 0);
    }
    rounds.run(bound)
}
