//! What goes back to the CPU: the twin of `shaders/atlas/give_back.wgsl`.

use crate::on_device::atlas::Atlas;
use crate::on_device::flip_marks::FlipMarks;
use crate::on_device::mesh_steps::FLIP_ROUNDS;
use crate::on_device::returned::ReturnedLayout;

/// What the steps leave on the device.
#[derive(Clone, Copy, Debug)]
pub struct MeshOnDevice<'a> {
    /// Eight numbers for each record.
    pub records: &'a [u32],
    /// The bits that the rounds of flips leave.
    pub marks: &'a [u32],
    /// A bit for each site that found no pixel.
    pub missing: &'a [u32],
    /// The number of triangles before each block, and of all.
    pub starts: &'a [u32],
    /// The flags of each leaf.
    pub flags: &'a [u32],
}

/// Returns what the CPU reads.
pub fn give_back(atlas: &Atlas, mesh: MeshOnDevice<'_>) -> Vec<u32> {
    let layout = ReturnedLayout::of(atlas);
    let mut returned = vec![0; layout.numbers()];
    let marks = FlipMarks::of(atlas.records as usize);
    let (dirty, inverted) = (&mesh.marks[marks.dirty(FLIP_ROUNDS + 1)], &mesh.marks[marks.inverted()]);
    let unfinished = dirty.iter().zip(inverted).map(|(a, b)| a | b);
    layout.unfinished.clone().zip(unfinished).for_each(|(at, word)| returned[at] = word);

    for (i, leaf) in atlas.leaves.iter().enumerate() {
        let (first, room) = (8 * leaf.first_record as usize, 8 * leaf.records() as usize);
        for at in (first..first + room).filter(|at| at % 4 != 3) {
            let base = if at % 8 < 4 { leaf.first_site } else { 8 * leaf.first_record };
            let number = mesh.records[at];
            returned[layout.records.start + at] = if number == u32::MAX { number } else { number - base };
        }

        let first_word = layout.missing.start + leaf.first_site as usize / 32 + i;
        for site in 0..leaf.sites {
            let at = (leaf.first_site + site) as usize;
            let bit = mesh.missing[at / 32] >> (at % 32) & 1;
            returned[first_word + site as usize / 32] |= bit << (site % 32);
        }

        let first = leaf.first_block as usize;
        let end = first + (leaf.blocks_x() * leaf.blocks_y()) as usize;
        let before = |block: usize| mesh.starts[block] - mesh.starts[first];
        returned[layout.leaves.start + 2 * i] = before(end);
        returned[layout.leaves.start + 2 * i + 1] = mesh.flags[i];
        (first..end).for_each(|block| returned[layout.block_starts.start + block] = before(block));
    }
    returned
}
