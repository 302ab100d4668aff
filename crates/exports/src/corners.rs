//! The places of the corners of triangles, which may be anywhere among the vertices. Most are close together.

use crate::mesh::MeshSource;
use sys::{Error, Result};

/// Vertices that nobody needs are read as well if they are no more than this between two that are needed.
const READ_OVER: u32 = 512;

/// Returns the places of the corners of `triangles`, in lattice steps.
///
/// # Errors
/// Those of the source, and [`Error::Broken`] if it has no such vertex.
pub(crate) fn corners(source: &dyn MeshSource, triangles: &[[u32; 3]]) -> Result<Vec<[[i32; 3]; 3]>> {
    let mut numbers: Vec<u32> = triangles.iter().flatten().copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let runs = numbers.chunk_by(|a, b| b - a <= READ_OVER);
    let read = |run: &[u32]| {
        let (first, last) = (run[0], run[run.len() - 1]);
        Ok((first, source.vertices(u64::from(first)..u64::from(last) + 1)?))
    };
    let runs: Vec<(u32, Vec<[i32; 3]>)> = runs.map(read).collect::<Result<_>>()?;
    let place = |number: u32| {
        let run = runs.partition_point(|(first, _)| *first <= number).checked_sub(1)?;
        let (first, places) = &runs[run];
        places.get((number - first) as usize).copied()
    };
    let missing = |number: u32| Error::Broken(format!("a mesh to export has no vertex {number}"));
    let mut found = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let mut places = [[0; 3]; 3];
        for (corner, &number) in places.iter_mut().zip(triangle) {
            *corner = place(number).ok_or_else(|| missing(number))?;
        }
        found.push(places);
    }
    Ok(found)
}
