//! Step 2a, for jobs with `[output] max_error`: the points of all parts as [`selection`] takes them, and writing those that it selects.

use crate::durable::directory::JobDirectory;
use crate::index::{PartIndex, TileIndex};
use crate::mesh::hull_rule::HullRule;
use crate::mesh::sites::load_sites;
use crate::options::JobOptions;
use crate::partition::bucket_sorter::BucketSorter;
use crate::partition::buckets::Buckets;
use crate::partition::part_points::{ReadBlocks, file_of_selected};
use crate::partition::parts::Parts;
use crate::partition::point_file::{PointFile, PointFiles};
use crate::partition::result::Partition;
use crate::plan::budget::{BYTES_PER_LEAF_SITE, read_buffer_memory, working_memory};
use crate::plan::job_plan::Plan;
use crate::progress::number_text::grouped;
use crate::{Error, Result};
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay_gpu::triangulator::Triangulator;
use points::Point;
use rayon::prelude::*;
use rust_decimal::Decimal;
use selection::{
    BYTES_PER_LISTED, BYTES_PER_POINT, BYTES_PER_SELECTED, BlockPoints, ErrorBound, PointSource, SelectedSites,
};
use std::collections::HashSet;
use std::path::PathBuf;
use sys::{fault, interrupt};
use tiles::options::MaxError;

/// The most points of a block. With fewer, more of them lie at its border; with more, fewer threads share the work, and caches hold less.
const POINTS_PER_BLOCK: u64 = 1 << 17;

/// Returns the most points of a block of a job of `points` points, which each thread has in memory and triangulates.
pub(crate) fn points_per_block(points: u64, memory: u64, threads: usize) -> u64 {
    let threads = threads as u64;
    let fits = memory / threads / (BYTES_PER_LEAF_SITE + BYTES_PER_SELECTED);
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

/// Returns what is wrong if the memory has no room for so many selected points.
pub(crate) fn too_many_vertices(options: &JobOptions, selected: u64) -> Option<String> {
    let has_room = selected.saturating_mul(BYTES_PER_LISTED) <= working_memory(options) / 2;
    (!has_room).then(|| {
        format!(
            "[output] max_error selects {} points or more, for which [limits] memory = \"{}\" has no room: set more memory or a greater \
             max_error, or leave max_error out for a mesh of all points",
            grouped(selected),
            options.limits.memory
        )
    })
}

/// A part whose points have all been read, cut into blocks.
pub(crate) struct PartInBlocks {
    pub(crate) part: PartIndex,
    pub(crate) partition: Partition,
    /// The numbers and the paths of its point files. They are opened for each block: all parts together may have many.
    pub(crate) files: Vec<(u16, PathBuf)>,
}

/// The points of all parts.
pub(crate) struct PointsInBlocks<'a> {
    plan: &'a Plan,
    triangulator: &'a Triangulator,
    parts: &'a [PartInBlocks],
    blocks: Vec<(usize, TileIndex)>,
    /// Triangles that flow by it may be slivers along the hull, unless they are on ground.
    rule: HullRule,
}

impl<'a> PointsInBlocks<'a> {
    pub(crate) fn new(plan: &'a Plan, triangulator: &'a Triangulator, parts: &'a [PartInBlocks]) -> PointsInBlocks<'a> {
        let blocks =
            |(number, part): (usize, &'a PartInBlocks)| part.partition.tree.tiles().map(move |tile| (number, tile));
        let blocks = parts.iter().enumerate().flat_map(blocks).collect();
        PointsInBlocks { plan, triangulator, parts, blocks, rule: HullRule::of_lengths(plan) }
    }

    /// Returns the number of points, with those of which another has the same x and y.
    pub(crate) fn points(&self) -> u64 {
        self.parts.iter().map(|part| part.partition.kept).sum()
    }

    /// Returns the triangles on ground among those that hold so many points.
    pub(crate) fn on_ground(&self, holding: Vec<([Site; 3], u64)>) -> Vec<[Site; 3]> {
        let has_ground = |(corners, count): &([Site; 3], u64)| self.rule.has_ground(*corners, *count);
        holding.into_iter().filter(has_ground).map(|(corners, _)| corners).collect()
    }

    fn sites(&self, part: usize, tile: TileIndex) -> Result<Vec<Point>> {
        interrupt::check()?;
        let PartInBlocks { partition, files, .. } = &self.parts[part];
        let files = PointFiles::open(files)?;
        Ok(load_sites(&files, &partition.blocks[tile.get()], self.plan.options.input.duplicates)?.0)
    }

    /// Tells whether a point is the site of a line, which every triangulation of the job has.
    fn is_of_line(&self, point: &Point) -> bool {
        point.order() >= self.plan.records
    }

    /// Writes the points of one part that are selected to a file of their own, without the sites of lines. `directory` is that of the part.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on point files.
    pub(crate) fn write_selected(
        &self,
        number: usize,
        selected: &SelectedSites,
        parts: &Parts,
        directory: &JobDirectory,
        sync: bool,
    ) -> Result<ReadBlocks> {
        let part = &self.parts[number];
        let file = file_of_selected(parts);
        let file = PointFile::create(&directory.point_file(file), file)?;
        let buckets = Buckets::new(&file, parts.grid.buckets(), read_buffer_memory(&self.plan.options));
        let tiles: Vec<TileIndex> = part.partition.tree.tiles().collect();
        tiles.into_par_iter().with_max_len(1).try_for_each(|tile| -> Result<()> {
            let mut sites = self.sites(number, tile)?;
            let Some(bounds) = delaunay::geometry::Bounds::of_points(sites.iter().map(|site| site.position)) else {
                return Ok(());
            };
            let selected: HashSet<Site> = selected.within(bounds).map(|[x, y, _]| [x, y]).collect();
            sites.retain(|site| selected.contains(&site.position) && !self.is_of_line(site));
            Ok(BucketSorter::new(&parts.grid, &buckets).add(&sites)?)
        })?;
        let blocks = ReadBlocks::of(buckets.finish()?);
        if sync {
            file.sync()?;
        }
        Ok(blocks)
    }
}

impl PointSource for PointsInBlocks<'_> {
    type Error = Error;

    fn blocks(&self) -> usize {
        self.blocks.len()
    }

    fn load(&self, block: usize) -> Result<BlockPoints> {
        let (part, tile) = self.blocks[block];
        let sites = self.sites(part, tile)?;
        let fixed = sites.iter().filter(|point| self.is_of_line(point)).map(Point::corner).collect();
        Ok(BlockPoints { points: sites.iter().map(Point::corner).collect(), fixed })
    }

    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh> {
        Ok(self.triangulator.triangulate(sites)?.0)
    }

    fn keeps_blocks(&self, points: u64, selected: u64) -> bool {
        points * BYTES_PER_POINT + selected * (BYTES_PER_SELECTED + BYTES_PER_LISTED)
            < working_memory(&self.plan.options)
    }

    fn asks_about(&self, corners: [Site; 3]) -> bool {
        self.rule.flow(corners).is_some()
    }

    fn after_round(&self, _: u32, selected: u64) -> Result<()> {
        fault::point("select");
        interrupt::check()?;
        match too_many_vertices(&self.plan.options, selected) {
            Some(why) => Err(sys::Error::Config(why).into()),
            None => Ok(()),
        }
    }
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
