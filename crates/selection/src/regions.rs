//! Clouds of many points: each region of the plane by itself, and then all together.
//!
//! Every round of a whole cloud reads all of it, if the memory does not hold it. So points are selected from each region as if it were a cloud
//! of its own. After that only triangles across the borders of regions have points that exceed the bound. So points are selected next from strips
//! along these borders, for each corner of regions from the strips that meet there. Few rounds over the whole cloud are left.
//!
//! Regions are cells of the lattice, and how large they are depends on the number of the points and their box alone. So does the result.

use crate::area::{Area, is_in};
use crate::hull::hull_corners;
use crate::lattice_cells::LatticeCells;
use crate::memory::BlockMemory;
use crate::outline::MarkedCells;
use crate::rounds::{BlockState, FinishedBlock};
use crate::selected_sites::SelectedSites;
use crate::source::{BlockPoints, PointSource, SelectionStore};
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

/// How clouds are divided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionSizes {
    /// Clouds of at most so many points are selected from without samples. A region never is.
    pub(crate) unsampled: u64,
    /// Clouds of at most so many points are not divided: at least 16 times as many as a region has, so that a region is a part of them.
    pub(crate) undivided: u64,
    /// A region has at least so many points on average, and less than four times as many.
    pub(crate) points: u64,
    /// Strips along borders are so wide that about as many rows of selected points lie on either side.
    pub(crate) rows_of_strip: u32,
}

impl RegionSizes {
    /// The sizes of all jobs. Points at the borders of regions are superfluous in the end: with regions of a million to four million points,
    /// some percent of the vertices. A region takes some hundred megabytes. Without samples, selecting takes up to half as long
    /// again. It usually selects fewer vertices, up to a sixth fewer where walls are.
    pub(crate) const USUAL: RegionSizes =
        RegionSizes { unsampled: 1 << 20, undivided: 1 << 24, points: 1 << 20, rows_of_strip: 32 };
}

/// A cloud in regions.
pub(crate) struct Division<'a, E> {
    /// Its bays, if they were looked for.
    pub(crate) bays: Option<MarkedCells>,
    /// What is known of all blocks of the cloud.
    pub(crate) blocks: Vec<BlockState>,
    /// The regions that have points, each with its cell.
    pub(crate) regions: Vec<([i32; 2], Region<'a, E>)>,
    /// Their borders.
    pub(crate) borders: Borders<'a, E>,
}

/// Divides a cloud, which has `points` points in `bounds`. Points of its blocks that are in `memory` do not stay there. Looks for bays if there are
/// `cells_of_bays`, none of which is marked.
///
/// # Errors
/// Those of `source`.
pub(crate) fn divide<'a, E: Send + From<sys::Error>>(
    source: &'a dyn PointSource<Error = E>,
    blocks: Vec<BlockState>,
    memory: &BlockMemory,
    bounds: Bounds<2>,
    points: u64,
    sizes: RegionSizes,
    cells_of_bays: Option<MarkedCells>,
) -> Result<Division<'a, E>, E> {
    let cells = LatticeCells::new(bounds, points, sizes.points, source.offset());
    let marked = cells_of_bays.map(|cells| Mutex::new((cells, Vec::new())));
    let share = |(number, mut state): (usize, BlockState)| {
        let points = state.take_points(source, memory, number)?;
        let mut shares = BTreeMap::<[i32; 2], (Bounds<2>, u64)>::new();
        for &[x, y, _] in &points {
            let (bounds, count) = shares.entry(cells.of(x, y)).or_insert((Bounds::of_point([x, y]), 0));
            bounds.include([x, y]);
            *count += 1;
        }
        if let Some(marked) = &marked {
            let corners = hull_corners(points.clone());
            let (marked, hull) = &mut *marked.lock().unwrap_or_else(PoisonError::into_inner);
            marked.add(&points);
            *hull = hull_corners([std::mem::take(hull), corners].concat());
        }
        Ok((state, shares))
    };
    let found = blocks.into_par_iter().enumerate().with_max_len(1).map(share).collect::<Result<Vec<_>, E>>()?;
    let mut regions = BTreeMap::<[i32; 2], (Bounds<2>, u64, Vec<usize>)>::new();
    let mut blocks = Vec::with_capacity(found.len());
    for (block, (state, shares)) in found.into_iter().enumerate() {
        blocks.push(state);
        for (cell, (share, points)) in shares {
            let (bounds, count, of_region) = regions.entry(cell).or_insert((share, 0, Vec::new()));
            *bounds = bounds.union(share);
            *count += points;
            of_region.push(block);
        }
    }
    let crowded = regions.iter().filter(|(_, (_, count, _))| *count > sizes.undivided).map(|(cell, _)| *cell).collect();
    let of_blocks = blocks.iter().map(|block| block.bounds).collect();
    let borders = Borders { source, cells, bounds, blocks: of_blocks, crowded, rows: sizes.rows_of_strip };
    let region = |(cell, (of_points, _, blocks))| {
        let parts = vec![cells.about_middle(cell, [cells.side() / 2; 2], bounds)];
        (cell, Region { source, parts, blocks, bounds: of_points, taken: 0 })
    };
    let regions = regions.into_iter().map(region).collect();
    let bays = marked.map(|marked| {
        let (marked, hull) = marked.into_inner().unwrap_or_else(PoisonError::into_inner);
        marked.bays(&hull)
    });
    Ok(Division { bays, blocks, regions, borders })
}

/// The borders of regions.
pub(crate) struct Borders<'a, E> {
    source: &'a dyn PointSource<Error = E>,
    cells: LatticeCells,
    /// The box of all points.
    bounds: Bounds<2>,
    /// The boxes of all blocks.
    blocks: Vec<Option<Bounds<2>>>,
    /// Cells with too many points: what is selected around the strips at their corners may not fit in the memory.
    crowded: BTreeSet<[i32; 2]>,
    /// The rows of selected points in a strip on either side.
    rows: u32,
}

impl<'a, E> Borders<'a, E> {
    /// Returns for each corner of regions the strips along the borders that meet there, as far as the middles of these, if they may have points.
    /// So many points are `selected` in each region. There are none at the corners of crowded cells.
    pub(crate) fn strips(&self, selected: &BTreeMap<[i32; 2], u64>) -> Vec<Strips<'a, E>> {
        // The corners of the cells are the middles of these.
        let (shifted, half) = (self.cells.shifted(), self.cells.side() / 2);
        let mut strips = BTreeMap::<[i32; 2], (i64, Vec<usize>)>::new();
        let arms = |corner, [narrow, long]: [i64; 2]| {
            [[narrow, long], [long, narrow]].map(|reach| shifted.about_middle(corner, reach, self.bounds))
        };
        for (number, block) in self.blocks.iter().enumerate() {
            for corner in block.iter().flat_map(|of_block| shifted.of_box(*of_block)) {
                let (narrow, of_corner) =
                    strips.entry(corner).or_insert_with(|| (self.reach(shifted.middle(corner), selected), Vec::new()));
                if block.is_some_and(|block| arms(corner, [*narrow, half]).iter().any(|arm| arm.meets(&block))) {
                    of_corner.push(number);
                }
            }
        }
        strips.retain(|_, (narrow, blocks)| *narrow > 0 && !blocks.is_empty());
        let strips = strips.into_iter().map(|(corner, (narrow, blocks))| {
            let around = arms(corner, [2 * narrow, half + narrow]);
            let bounds = around[0].union(around[1]);
            let parts = arms(corner, [narrow, half]).to_vec();
            Strips { points: Region { source: self.source, parts, blocks, bounds, taken: 0 }, around }
        });
        strips.collect()
    }

    /// Returns how far the strips at a corner reach from the borders, 0 if it has none: so far that there are some rows of selected points.
    fn reach(&self, [x, y]: [i64; 2], selected: &BTreeMap<[i32; 2], u64>) -> i64 {
        let beside = [[x - 1, y - 1], [x, y - 1], [x - 1, y], [x, y]].map(|at| at.map(|along| along as i32));
        let beside = beside.map(|[x, y]| self.cells.of(x, y));
        if beside.iter().any(|cell| self.crowded.contains(cell)) {
            return 0;
        }
        let fewest = beside.iter().filter_map(|cell| selected.get(cell)).min().map_or(1, |&fewest| fewest.max(1));
        (i64::from(self.rows) * self.cells.side() / fewest.isqrt() as i64).clamp(1, self.cells.side() / 8)
    }
}

/// The strips at a corner of regions.
pub(crate) struct Strips<'a, E> {
    pub(crate) points: Region<'a, E>,
    /// The boxes of what is around them.
    around: [Bounds<2>; 2],
}

impl<'a, E> Strips<'a, E> {
    /// Returns what is `selected` in and around them.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the file of those that are not in memory.
    pub(crate) fn around(&self, selected: &SelectedSites) -> sys::Result<Vec<[i32; 3]>> {
        let [along, across] = self.around;
        let mut around = selected.within(along)?;
        around.extend(selected.within(across)?.iter().filter(|point| !is_in(&along, point)));
        Ok(around)
    }
}

/// The points of a cloud that lie in a cell of the lattice, or in strips of one.
pub(crate) struct Region<'a, E> {
    source: &'a dyn PointSource<Error = E>,
    /// The boxes that its points lie in.
    parts: Vec<Bounds<2>>,
    /// The blocks that may have some.
    blocks: Vec<usize>,
    /// A box that holds its points; of strips, one that holds what is around them too.
    pub(crate) bounds: Bounds<2>,
    /// The bytes of memory that points of other regions take which are selected.
    taken: u64,
}

impl<E> Region<'_, E> {
    /// Returns the number of each of its blocks and what is known of it in the end, if only points in the region can concern it. The region is a cell
    /// of a cloud in the box `all`.
    pub(crate) fn undisturbed(
        &self,
        blocks: Vec<Option<FinishedBlock>>,
        all: Bounds<2>,
    ) -> impl Iterator<Item = (usize, Option<FinishedBlock>)> {
        let cell = self.parts.iter().copied().reduce(Bounds::union).unwrap_or(self.bounds);
        let is_undisturbed = move |known: &FinishedBlock| known.concerns_only(cell, all);
        self.blocks.iter().copied().zip(blocks).map(move |(block, known)| (block, known.filter(is_undisturbed)))
    }

    /// Returns the region when the selected points of others take so many bytes of memory.
    pub(crate) fn after(&self, taken: u64) -> Self {
        Region { parts: self.parts.clone(), blocks: self.blocks.clone(), taken, ..*self }
    }
}

impl<E: Send + From<sys::Error>> PointSource for Region<'_, E> {
    type Error = E;

    fn blocks(&self) -> usize {
        self.blocks.len()
    }

    fn offset(&self) -> [i64; 2] {
        self.source.offset()
    }

    fn load(&self, block: usize) -> Result<BlockPoints, E> {
        let BlockPoints { mut points, mut fixed } = self.source.load(self.blocks[block])?;
        let is_here = |point: &[i32; 3]| self.parts.iter().any(|part| is_in(part, point));
        points.retain(is_here);
        fixed.retain(is_here);
        Ok(BlockPoints { points, fixed })
    }

    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh, E> {
        self.source.triangulate(sites)
    }

    fn memory(&self) -> u64 {
        self.source.memory().saturating_sub(self.taken)
    }

    fn store(&self) -> Option<&dyn SelectionStore> {
        self.source.store()
    }

    fn asks_about(&self, corners: [Site; 3]) -> bool {
        self.source.asks_about(corners)
    }

    fn after_round(&self) -> Result<(), E> {
        self.source.after_round()
    }
}
