//! About how many vertices `[output] max_error` selects, by some chunks of the inputs.

use crate::mesh::selection::bound_in_steps;
use crate::plan::job_plan::Plan;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::canonical;
use points::Point;
use rayon::prelude::*;
use selection::{BlockPoints, ErrorBound, PointSource, Selection, select};
use sys::{Error, Result, interrupt};

/// Chunks that are looked at: a second of reading and selecting.
const CHUNKS: usize = 8;
/// Points of a chunk that are looked at.
const POINTS: u64 = 50_000;

/// Returns about how many of `kept` points each of the `bounds`, in source units of height, selects. Where files are sorted otherwise than by
/// place, or several flights cover one place, the true numbers are lower.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Config`] if a bound has too many digits.
pub fn estimated_vertices(plan: &Plan, kept: u64, bounds: &[f64]) -> Result<Vec<u64>> {
    let chunks = |index: usize| (0..plan.inputs[index].source.chunks()).map(move |chunk| (index, chunk));
    let all: Vec<(usize, usize)> = (0..plan.inputs.len()).flat_map(chunks).collect();
    let step = all.len().div_ceil(CHUNKS).max(1);
    let of_chunk = |&(index, chunk): &(usize, usize)| {
        let input = &plan.inputs[index];
        let mut points: Vec<[i32; 3]> = Vec::new();
        let decoded = input.source.decode_start(chunk, POINTS, &input.rules, &mut |some| {
            points.extend(some.iter().map(Point::corner));
            Ok(())
        });
        match decoded {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // Reading all points says what is wrong.
            Err(_) => points.clear(),
            Ok(_) => {}
        }
        points.sort_unstable();
        points.dedup_by_key(|point| [point[0], point[1]]);
        Ok(points)
    };
    let wanted: Vec<(usize, usize)> = all.into_iter().skip(step / 2).step_by(step).collect();
    let samples = wanted.par_iter().map(of_chunk).collect::<Result<Vec<_>>>()?;
    let points: u64 = samples.iter().map(|points| points.len() as u64).sum();
    let estimate = |&units: &f64| {
        let bound = bound_in_steps(plan, units)?;
        let selected = samples.par_iter().map(|points| selected_of(points, bound)).sum::<Result<u64>>()?;
        Ok((kept as f64 * selected as f64 / points.max(1) as f64).round() as u64)
    };
    bounds.iter().map(estimate).collect()
}

/// Returns how many of some points are selected.
fn selected_of(points: &[[i32; 3]], bound: ErrorBound) -> Result<u64> {
    let Selection { figures, .. } = select(&Sample(points), bound)?;
    Ok(figures.selected)
}

/// The points of a chunk, as one block.
struct Sample<'a>(&'a [[i32; 3]]);

impl PointSource for Sample<'_> {
    type Error = Error;

    fn blocks(&self) -> usize {
        1
    }

    fn load(&self, _: usize) -> Result<BlockPoints> {
        Ok(BlockPoints { points: self.0.to_vec(), fixed: Vec::new() })
    }

    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh> {
        canonical(sites).map_err(|error| Error::Broken(error.to_string()))
    }

    fn keeps_blocks(&self, _: u64, _: u64) -> bool {
        true
    }

    fn asks_about(&self, _: [Site; 3]) -> bool {
        false
    }

    fn after_round(&self, _: u32, _: u64) -> Result<()> {
        interrupt::check()
    }
}
