//! Compares the rounds of flips with their twin, on a mesh that needs many.

use crate::on_device::buffer_id::BufferId;
use crate::on_device::buffers::BufferSet;
use crate::on_device::engine::GpuEngine;
use crate::on_device::error::GpuError;
use crate::on_device::mesh_steps::FLIP_ROUNDS;
use crate::on_device::recording::Recording;
use crate::on_device::reference_kernels::c4_flip::{AT_INFINITY, FlipState, flip_round};
use crate::on_device::selftest::compare::StepComparison;
use delaunay::geometry::Site;
use std::collections::HashMap;

/// Sites along a side of the mesh.
const SIDE: u32 = 300;
/// The distance between two rows of sites, before each is moved by at most as much.
const SPACING: u32 = 100;

/// Compares the records and the marks after all rounds.
///
/// # Errors
/// [`GpuError`] of the device.
pub(super) fn compare_flips(engine: &mut GpuEngine, buffers: &mut BufferSet) -> Result<[StepComparison; 2], GpuError> {
    let (records, sites) = shaken_lattice();
    let mut twin = FlipState::new(records);
    let mut recording = Recording::default();
    recording.upload_mesh(&twin.records, &sites);
    recording.flip(twin.claims.len() as u32);
    engine.start(buffers, &recording)?;
    (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut twin, &sites, round));
    let records = engine.numbers(buffers, BufferId::Records, twin.records.len() as u64)?;
    let marks = engine.numbers(buffers, BufferId::Marks, twin.marks.len() as u64)?;
    Ok([StepComparison::new("flips", &records, &twin.records), StepComparison::new("flip marks", &marks, &twin.marks)])
}

/// Returns the records and the sites of a lattice of triangles whose sites were moved, so that many edges must be flipped and some
/// triangles are inverted.
fn shaken_lattice() -> (Vec<u32>, Vec<Site>) {
    let moved = |v: u32, salt: u32| v.wrapping_mul(0x9e37_79b1).rotate_left(salt).wrapping_mul(0x85eb_ca77) >> 16;
    let coordinate = |row: u32, v: u32, salt: u32| (row * SPACING + moved(v, salt) % SPACING) as i32;
    let all = SIDE * SIDE;
    let mut sites: Vec<Site> = (0..all).map(|v| [coordinate(v % SIDE, v, 15), coordinate(v / SIDE, v, 9)]).collect();
    sites.push([AT_INFINITY, 0]);
    let mut triangles = Vec::new();
    for a in (0..all - SIDE).filter(|a| a % SIDE + 1 < SIDE) {
        triangles.extend([[a, a + 1, a + SIDE + 1], [a, a + SIDE + 1, a + SIDE]]);
    }
    let (east, north) = (SIDE - 1, all - SIDE);
    for i in 0..SIDE - 1 {
        let border = [
            [i, i + 1],
            [east + i * SIDE, east + (i + 1) * SIDE],
            [north + i + 1, north + i],
            [(i + 1) * SIDE, i * SIDE],
        ];
        triangles.extend(border.map(|[a, b]| [b, a, all]));
    }
    (linked(&triangles), sites)
}

/// Returns the records of triangles that close a surface.
fn linked(triangles: &[[u32; 3]]) -> Vec<u32> {
    let edges = |t: usize| [0, 1, 2].map(|i| (triangles[t][i], triangles[t][(i + 1) % 3]));
    let half_edges: HashMap<(u32, u32), u32> =
        (0..triangles.len()).flat_map(|t| (8 * t as u32..).zip(edges(t)).map(|(h, edge)| (edge, h))).collect();
    let record = |t: usize| {
        let twins = edges(t).map(|(a, b)| half_edges.get(&(b, a)).copied().unwrap_or(u32::MAX));
        let ([a, b, c], [d, e, f]) = (triangles[t], twins);
        [a, b, c, 0, d, e, f, 0]
    };
    (0..triangles.len()).flat_map(record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lattice_is_closed_and_needs_flips_of_both_kinds() {
        let (records, sites) = shaken_lattice();
        assert!(records.chunks_exact(8).all(|record| record[4..7].iter().all(|&twin| twin != u32::MAX)));
        let mut state = FlipState::new(records.clone());
        flip_round(&mut state, &sites, 1);
        let inverted: u32 = state.marks[state.sections().inverted()].iter().map(|word| word.count_ones()).sum();
        let flipped = state.records.chunks_exact(8).filter(|record| record[3] != 0).count();
        assert!(inverted > 100 && flipped > 10_000, "{inverted} {flipped}");
    }
}
