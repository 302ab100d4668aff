//! What a sample of the points tells about the area of a job: whether a header is wrong about it, and whether a few points stretch it.

use crate::options::JobOptions;
use crate::plan::extent::Extent;
use crate::plan::far_points::is_finer;
use crate::plan::height_range::HeightSample;
use crate::plan::job_plan::Plan;
use crate::plan::lattice_choice::{LatticeRequest, fineness};
use crate::plan::stretch::{Hint, stretch_hint};
use delaunay::geometry::Bounds;
use lattice::Lattice;
use points::Source;
use sys::Result;

/// An area may be stretched if it is so many times as long as the middle of its points.
const STRETCHED: u64 = 5;

/// The area of a job, before its points are read.
pub(crate) struct AreaHint<'a> {
    pub(crate) sources: &'a [Source],
    pub(crate) options: &'a JobOptions,
    pub(crate) extent: &'a Extent,
    /// The lattice box of the extent.
    pub(crate) clipped: Bounds<2>,
    pub(crate) lattice: &'a Lattice,
    pub(crate) wish: &'a LatticeRequest,
}

impl AreaHint<'_> {
    /// Tells whether points of the sample lie so far outside what the headers claim that a lattice for all points would be coarser, and
    /// not all points have been looked at yet.
    pub(crate) fn shows_far_points(&self, sample: &HeightSample) -> bool {
        let Some(found) = sample.bounds().filter(|_| !self.wish.coarsening.far_points) else { return false };
        let value = |corner: [i32; 3]| [0, 1, 2].map(|axis| self.lattice.world(axis, corner[axis]));
        let claimed = [self.extent.min, self.extent.max];
        let all = Extent::around(vec![Some(claimed), Some([value(found.min), value(found.max)])], &self.options.input);
        is_finer(self.sources, self.wish, [self.extent, &all])
    }

    /// Returns a sentence about points that stretch the area, if there are some.
    ///
    /// # Errors
    /// Those of reading.
    pub(crate) fn stretch(&self, sample: &HeightSample) -> Result<Option<String>> {
        let hint = |hint| stretch_hint(self.sources.iter(), &self.options.input, Some(&self.extent.boxes), hint);
        let longest = self.clipped.extent(0).max(self.clipped.extent(1));
        let may_be = sample.middle().is_some_and(|middle| longest as u64 > STRETCHED.saturating_mul(middle));
        let few = if may_be { hint(Hint::Few)? } else { None };
        if few.is_some() || fineness(self.sources, self.extent, self.wish).is_meaningful() {
            return Ok(few);
        }
        hint(Hint::Many)
    }
}

/// Returns a sentence about points that stretch the area far beyond what the headers claim, now that all are read and lie in `found`.
///
/// # Errors
/// Those of reading.
pub(crate) fn stretch_of_read(plan: &Plan, found: Bounds<3>) -> Result<Option<String>> {
    let length = |bounds: &dyn Fn(usize) -> i64| bounds(0).max(bounds(1));
    let (claimed, found) = (length(&|axis| plan.extent.extent(axis)), length(&|axis| found.extent(axis)));
    if plan.stretch.is_some() || found / STRETCHED as i64 <= claimed {
        return Ok(None);
    }
    stretch_hint(plan.inputs.iter().map(|input| &input.source), &plan.options.input, None, Hint::Few)
}
