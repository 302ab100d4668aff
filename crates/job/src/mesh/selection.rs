//! Step 2a, for jobs that leave points out of the mesh: the points of all parts, as [`ground`] and [`selection`] take them, and writing those that
//! are left.

use crate::durable::directory::JobDirectory;
use crate::index::{PartIndex, TileIndex};
use crate::mesh::hull_rule::HullRule;
use crate::mesh::selection_file::SelectionFile;
use crate::mesh::sites::load_sites;
use crate::partition::bucket_sorter::BucketSorter;
use crate::partition::buckets::Buckets;
use crate::partition::part_points::{ReadBlocks, file_of_selected};
use crate::partition::parts::Parts;
use crate::partition::point_file::{PointFile, PointFiles};
use crate::partition::result::Partition;
use crate::plan::budget::{read_buffer_memory, selection_memory};
use crate::plan::ground_cells::{too_many_cells, too_many_squares};
use crate::plan::job_plan::Plan;
use crate::{Error, Result};
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay_gpu::triangulator::Triangulator;
use ground::{CoveredArea, Ground, LowestHeights, MetricLattice, PointCollector};
use points::Point;
use rayon::prelude::*;
use rust_decimal::Decimal;
use selection::{BYTES_PER_POINT, BlockPoints, ErrorBound, HeldPoints, PointSource, SelectedSites, SelectionStore};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use sys::{fault, interrupt};
use tiles::options::MaxError;

/// The most points of a block. With fewer, more of them lie at its border; with more, fewer threads share the work, and caches hold less.
const POINTS_PER_BLOCK: u64 = 1 << 17;

/// Returns the most points of a block of a job of `points` points, which each thread has in memory and triangulates. `memory` is that of the selection.
pub(crate) fn points_per_block(points: u64, memory: u64, threads: usize) -> u64 {
    let threads = threads as u64;
    // The other half is for what stays in memory.
    let fits = memory / 2 / threads / BYTES_PER_POINT;
    (points / (4 * threads)).min(fits).clamp(1 << 12, POINTS_PER_BLOCK)
}

/// Returns the bound on vertical distances, in steps of the lattice; `None` if all points are vertices.
///
/// # Errors
/// [`sys::Error::Config`] if it has too many digits.
pub(crate) fn error_bound(plan: &Plan) -> Result<Option<ErrorBound>> {
    let MaxError::Units(units) = plan.options.output.max_error else { return Ok(None) };
    Ok(Some(bound_in_steps(plan, units)?))
}

/// Returns a bound of so many source units of height in steps of the lattice.
///
/// # Errors
/// [`sys::Error::Config`] if it has too many digits.
pub(crate) fn bound_in_steps(plan: &Plan, units: f64) -> sys::Result<ErrorBound> {
    let steps = lattice::shortest_decimal(units).and_then(|bound| fraction_of(bound, plan.lattice.resolution_z));
    steps.ok_or_else(|| {
        sys::Error::Config(format!("[output] max_error = {units} cannot be compared exactly with heights in steps of {}: give a number such as 0.1", plan.lattice.resolution_z))
    })
}

/// Returns `bound / step`, rounded down where the fraction has too many digits.
fn fraction_of(bound: Decimal, step: Decimal) -> Option<ErrorBound> {
    let digits = bound.scale().max(step.scale());
    let whole = |value: Decimal| {
        let factor = 10u128.checked_pow(digits - value.scale())?;
        u128::try_from(value.mantissa()).ok()?.checked_mul(factor)
    };
    let (bound, step) = (whole(bound)?, whole(step)?);
    let mut divisor = (bound, step);
    while divisor.1 > 0 {
        divisor = (divisor.1, divisor.0 % divisor.1);
    }
    let (bound, step) = (bound / divisor.0.max(1), step / divisor.0.max(1));
    match (u64::try_from(bound), u32::try_from(step)) {
        (Ok(steps), Ok(per)) => Some(ErrorBound::new(steps, per)),
        _ => {
            const PER: u32 = 1 << 20;
            let steps = bound.checked_mul(u128::from(PER))? / step.max(1);
            Some(ErrorBound::new(u64::try_from(steps).unwrap_or(u64::MAX), PER))
        }
    }
}

/// Returns the lattice of a job in metres.
pub(crate) fn metric_lattice(plan: &Plan) -> MetricLattice {
    let [horizontal, vertical] = plan.frame.resolution_metres();
    MetricLattice { horizontal, vertical, offset: plan.lattice.steps_from_zero() }
}

/// A part whose points have all been read, cut into blocks.
pub(crate) struct PartInBlocks {
    pub(crate) part: PartIndex,
    pub(crate) partition: Partition,
    /// The numbers and the paths of its point files. They are opened for each block: all parts together may have many.
    pub(crate) files: Vec<(u16, PathBuf)>,
}

/// The points of a part that are left, in a file.
pub(crate) struct WrittenPoints {
    pub(crate) blocks: ReadBlocks,
    /// The points that vertices were selected from: all, or those on the ground.
    pub(crate) wanted: u64,
    /// Those of them that were dropped because another has the same x and y.
    pub(crate) duplicates: u64,
    /// The digest of the points that were written, with `--update`.
    pub(crate) digest: u64,
}

/// The points of all parts.
pub(crate) struct PointsInBlocks<'a> {
    plan: &'a Plan,
    triangulator: &'a Triangulator,
    parts: &'a [PartInBlocks],
    blocks: Vec<(usize, TileIndex)>,
    /// Where waits what the memory does not hold.
    waiting: &'a SelectionFile,
    /// The ground, where only its points are wanted.
    ground: Option<Ground>,
    /// Triangles that flow by it may be slivers along the hull, unless they are on ground.
    rule: HullRule,
}

impl<'a> PointsInBlocks<'a> {
    pub(crate) fn new(
        plan: &'a Plan,
        triangulator: &'a Triangulator,
        parts: &'a [PartInBlocks],
        waiting: &'a SelectionFile,
    ) -> PointsInBlocks<'a> {
        let blocks =
            |(number, part): (usize, &'a PartInBlocks)| part.partition.tree.tiles().map(move |tile| (number, tile));
        let blocks = parts.iter().enumerate().flat_map(blocks).collect();
        PointsInBlocks { plan, triangulator, parts, blocks, waiting, ground: None, rule: HullRule::of_lengths(plan) }
    }

    /// Leaves only the points on the ground, which it finds.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on point files; [`sys::Error::Config`] if the memory does not hold the heights of all cells.
    pub(crate) fn on_found_ground(mut self, advance: impl Fn(u64) + Sync) -> Result<PointsInBlocks<'a>> {
        let (options, known) = (&self.plan.options, self.plan.ground_cells);
        let area = CoveredArea::new(metric_lattice(self.plan));
        let area = self.collect(&area, &|area| too_many_squares(options, area, known))?;
        too_many_cells(options, area.cell_count()).map_or(Ok(()), |why| Err(sys::Error::Config(why)))?;
        let lowest = LowestHeights::new(&area);
        drop(area);
        let lowest = self.collect(&lowest, &|_| None)?;
        let points: u64 = self.parts.iter().map(|part| part.partition.kept).sum();
        advance(points / 2);
        fault::point("ground");
        self.ground = Some(Ground::find(lowest, self.plan.options.input.bare_earth, interrupt::check)?);
        advance(points - points / 2);
        Ok(self)
    }

    /// Adds all points but the sites of lines to a collector such as the `empty` one. `refusal` tells what speaks against going on.
    fn collect<C: PointCollector + Sync>(
        &self,
        empty: &C,
        refusal: &(dyn Fn(&C) -> Option<String> + Sync),
    ) -> Result<C> {
        let all = Mutex::new(empty.emptied());
        self.blocks.par_iter().with_max_len(1).try_for_each(|&(part, tile)| -> Result<()> {
            interrupt::check()?;
            let PartInBlocks { partition, files, .. } = &self.parts[part];
            let files = PointFiles::open(files)?;
            let (mut found, mut points) = (empty.emptied(), Vec::new());
            for &block in &partition.blocks[tile.get()] {
                points.clear();
                files.read(block, &mut points)?;
                found.add(points.iter().filter(|point| !self.is_of_line(point)).map(Point::corner));
            }
            let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
            all.join(&found);
            refusal(&all).map_or(Ok(()), |why| Err(sys::Error::Config(why).into()))
        })?;
        Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns the ground, if only its points are wanted.
    pub(crate) fn ground(&self) -> Option<&Ground> {
        self.ground.as_ref()
    }

    /// Returns the triangles on ground among those that hold points.
    pub(crate) fn on_ground(&self, holding: &[HeldPoints]) -> Vec<[Site; 3]> {
        holding.iter().filter(|held| self.rule.has_ground(held)).map(|held| held.corners).collect()
    }

    /// Returns the sites of a block, and how many points were dropped because another has the same x and y.
    fn sites(&self, part: usize, tile: TileIndex) -> Result<(Vec<Point>, u64)> {
        interrupt::check()?;
        let PartInBlocks { partition, files, .. } = &self.parts[part];
        let (files, rule) = (PointFiles::open(files)?, self.plan.options.input.duplicates);
        let is_on_ground = |point: &Point| {
            self.ground.as_ref().is_none_or(|ground| ground.has(point.corner())) || self.is_of_line(point)
        };
        let is_wanted = self.ground.as_ref().map(|_| &is_on_ground as &dyn Fn(&Point) -> bool);
        Ok(load_sites(&files, &partition.blocks[tile.get()], rule, is_wanted)?)
    }

    /// Tells whether a point is the site of a line, which every triangulation of the job has.
    fn is_of_line(&self, point: &Point) -> bool {
        point.order() >= self.plan.records
    }

    /// Writes the points of one part that are selected to a file of their own, without the sites of lines; without `selected` all that are on the
    /// ground. `directory` is that of the part.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on point files.
    pub(crate) fn write_selected(
        &self,
        number: usize,
        selected: Option<&SelectedSites>,
        parts: &Parts,
        directory: &JobDirectory,
        sync: bool,
    ) -> Result<WrittenPoints> {
        let part = &self.parts[number];
        let file = file_of_selected(parts);
        let file = PointFile::create(&directory.point_file(file), file)?;
        let span = parts.span(PartIndex::new(number));
        let grid = parts.grid.within(span);
        let buckets = Buckets::new(&file, grid.buckets(), read_buffer_memory(&self.plan.options));
        let buckets = buckets.with_digests(self.plan.options.updates);
        let tiles: Vec<TileIndex> = part.partition.tree.tiles().collect();
        let write = |tile| -> Result<[u64; 2]> {
            let (mut sites, duplicates) = self.sites(number, tile)?;
            sites.retain(|site| !self.is_of_line(site));
            let wanted = sites.len() as u64 + duplicates;
            let bounds = delaunay::geometry::Bounds::of_points(sites.iter().map(|site| site.position));
            if let Some((bounds, selected)) = bounds.zip(selected) {
                leave_selected(&mut sites, selected.within(bounds)?);
            }
            BucketSorter::new(&grid, &buckets).add(&sites)?;
            Ok([wanted, duplicates])
        };
        let sum = |a: [u64; 2], b: [u64; 2]| Ok([a[0] + b[0], a[1] + b[1]]);
        let [wanted, duplicates] = tiles.into_par_iter().with_max_len(1).map(write).try_reduce(|| [0; 2], sum)?;
        let buckets = buckets.finish()?;
        let digest = buckets.iter().fold(0, |all, bucket| bucket.digest.wrapping_add(all));
        let mut blocks = ReadBlocks::default();
        parts.grid.in_span(span).zip(&buckets).for_each(|(number, bucket)| blocks.add(number, &bucket.blocks));
        if sync {
            file.sync()?;
        }
        Ok(WrittenPoints { blocks, wanted, duplicates, digest })
    }
}

impl PointSource for PointsInBlocks<'_> {
    type Error = Error;

    fn blocks(&self) -> usize {
        self.blocks.len()
    }

    fn offset(&self) -> [i64; 2] {
        self.plan.lattice.steps_from_zero()
    }

    fn load(&self, block: usize) -> Result<BlockPoints> {
        let (part, tile) = self.blocks[block];
        let (sites, _) = self.sites(part, tile)?;
        let fixed = sites.iter().filter(|point| self.is_of_line(point)).map(Point::corner).collect();
        Ok(BlockPoints { points: sites.iter().map(Point::corner).collect(), fixed })
    }

    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh> {
        Ok(self.triangulator.triangulate(sites)?.0)
    }

    fn memory(&self) -> u64 {
        selection_memory(&self.plan.options)
    }

    fn store(&self) -> Option<&dyn SelectionStore> {
        Some(self.waiting)
    }

    fn asks_about(&self, corners: [Site; 3]) -> bool {
        self.rule.flow(corners).is_some()
    }

    fn after_round(&self) -> Result<()> {
        fault::point("select");
        Ok(interrupt::check()?)
    }
}

/// Removes all but the selected sites. Sites are in the order of [`load_sites`]: by y, then x.
fn leave_selected(sites: &mut Vec<Point>, selected: Vec<[i32; 3]>) {
    // As an unsigned number, a coordinate with the sign bit turned is in the same order.
    let key = |[x, y]: Site| {
        let [y, x] = [y, x].map(|along| u64::from(along.cast_unsigned() ^ 1 << 31));
        y << 32 | x
    };
    let mut selected: Vec<u64> = selected.into_iter().map(|[x, y, _]| key([x, y])).collect();
    radsort::sort(&mut selected);
    let mut next = selected.into_iter().peekable();
    sites.retain(|site| {
        let place = key(site.position);
        while next.next_if(|selected| *selected < place).is_some() {}
        next.next_if_eq(&place).is_some()
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::str::FromStr;

    #[test]
    fn bounds_are_exact_fractions_of_steps() {
        let bound =
            |bound: &str, step: &str| fraction_of(Decimal::from_str(bound).unwrap(), Decimal::from_str(step).unwrap());
        assert_eq!(bound("0.3", "0.01"), Some(ErrorBound::new(30, 1)));
        assert_eq!(bound("1", "0.03"), Some(ErrorBound::new(100, 3)));
        assert_eq!(bound("0.0005", "0.001"), Some(ErrorBound::new(1, 2)));
        assert_eq!(bound("12", "0.00025"), Some(ErrorBound::new(48_000, 1)));
        assert_eq!(bound("0.1", "0.000000000000000123456789"), Some(ErrorBound::new(u64::MAX, 1 << 20)));
    }
}
