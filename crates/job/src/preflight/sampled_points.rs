//! Points of some chunks of the inputs, for estimates of what the mesh will be like.

use crate::mesh::selection::metric_lattice;
use crate::plan::budget::working_memory;
use crate::plan::job_plan::Plan;
use ground::{BYTES_PER_CELL, Ground};
use points::Point;
use rayon::prelude::*;
use sys::{Error, Result, interrupt};

/// Chunks that are looked at: a second of reading and computing.
const CHUNKS: usize = 8;
/// Points of a chunk that are looked at.
const POINTS: u64 = 50_000;

/// Returns the first points of some chunks at equal distances, chunk by chunk: those that the job keeps, one for each x and y.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn sampled_points(plan: &Plan) -> Result<Vec<Vec<[i32; 3]>>> {
    let chunks = |index: usize| (0..plan.inputs[index].source.chunks()).map(move |chunk| (index, chunk));
    let all: Vec<(usize, usize)> = (0..plan.inputs.len()).flat_map(chunks).collect();
    let step = all.len().div_ceil(CHUNKS).max(1);
    let of_chunk = |&(index, chunk): &(usize, usize)| {
        interrupt::check()?;
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
    wanted.par_iter().map(of_chunk).collect()
}

/// Returns those of some points that vertices are selected from: all, or those on the ground as far as these points alone tell. All stay where their
/// ground takes too much memory.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn wanted_of(plan: &Plan, mut points: Vec<[i32; 3]>) -> Result<Vec<[i32; 3]>> {
    let input = &plan.options.input;
    if !input.finds_ground() {
        return Ok(points);
    }
    let most = working_memory(&plan.options) / BYTES_PER_CELL / rayon::current_num_threads() as u64;
    let all = points.iter().copied();
    if let Some(ground) = Ground::of_points(metric_lattice(plan), all, input.bare_earth, most, interrupt::check)? {
        points.retain(|point| ground.has(*point));
    }
    Ok(points)
}
