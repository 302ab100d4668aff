//! About how many vertices `[output] max_error` selects, by some chunks of the inputs.

use crate::mesh::selection::bound_in_steps;
use crate::plan::job_plan::Plan;
use crate::preflight::sampled_points::{sampled_points, wanted_of};
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::canonical;
use rayon::prelude::*;
use selection::{BlockPoints, ErrorBound, PointSource, Selection, SelectionStore, select_like};
use sys::{Error, Result, interrupt};

/// Returns about how many of `kept` points each of the `bounds`, in source units of height, selects. Where files are sorted otherwise than by
/// place, or several flights cover one place, the true numbers are lower.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Config`] if a bound has too many digits.
pub fn estimated_vertices(plan: &Plan, kept: u64, bounds: &[f64]) -> Result<Vec<u64>> {
    let samples = sampled_points(plan)?;
    let points: u64 = samples.iter().map(|points| points.len() as u64).sum();
    let samples = samples.into_par_iter().map(|points| wanted_of(plan, points)).collect::<Result<Vec<_>>>()?;
    let estimate = |&units: &f64| {
        let bound = bound_in_steps(plan, units)?;
        let selected = samples.par_iter().map(|points| selected_of(points, kept, bound)).sum::<Result<u64>>()?;
        Ok((kept as f64 * selected as f64 / points.max(1) as f64).round() as u64)
    };
    bounds.iter().map(estimate).collect()
}

/// Returns how many of some points are selected, of a cloud with `kept` points.
fn selected_of(points: &[[i32; 3]], kept: u64, bound: ErrorBound) -> Result<u64> {
    Ok(select_like(&Sample(points), kept, bound)?.figures.selected)
}

/// Returns those of some points that are selected, of a cloud with `kept` points.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn selected_points(points: &[[i32; 3]], kept: u64, bound: ErrorBound) -> Result<Vec<[i32; 3]>> {
    let Some(bounds) = Bounds::of_points(points.iter().map(|[x, y, _]| [*x, *y])) else { return Ok(Vec::new()) };
    let sample = Sample(points);
    let Selection { sites, .. } = select_like(&sample, kept, bound)?;
    let mut selected = sites.within(bounds)?;
    selected.sort_unstable();
    Ok(selected)
}

/// The points of a chunk, as one block.
struct Sample<'a>(&'a [[i32; 3]]);

impl PointSource for Sample<'_> {
    type Error = Error;

    fn blocks(&self) -> usize {
        1
    }

    fn offset(&self) -> [i64; 2] {
        [0; 2]
    }

    fn load(&self, _: usize) -> Result<BlockPoints> {
        Ok(BlockPoints { points: self.0.to_vec(), fixed: Vec::new() })
    }

    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh> {
        canonical(sites).map_err(|error| Error::Broken(error.to_string()))
    }

    fn memory(&self) -> u64 {
        u64::MAX
    }

    fn store(&self) -> Option<&dyn SelectionStore> {
        None
    }

    fn asks_about(&self, _: [Site; 3]) -> bool {
        false
    }

    fn after_round(&self) -> Result<()> {
        interrupt::check()
    }
}
