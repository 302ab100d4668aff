//! Step G4 in an atlas: the twin of `shaders/atlas/g4_vertices.wgsl`.

use crate::on_device::atlas::BLOCK_SIDE;
use crate::on_device::reference_kernels::atlas::corners::{AtlasDiagram, LeafDiagram};

/// Returns four numbers for each row of corners of each block, as the shader describes them, and the number of triangles of each block.
pub fn find_vertices(diagram: AtlasDiagram<'_>) -> (Vec<u32>, Vec<u32>) {
    let (mut rows, mut counts) = (Vec::new(), Vec::new());
    for leaf in diagram.leaves() {
        let all: Vec<_> = leaf.rows().map(|first| row(leaf, first)).collect();
        for block in all.chunks(BLOCK_SIDE as usize) {
            let mut before = 0;
            for &(bits, count) in block {
                rows.extend(bits);
                rows.push(before);
                before += count;
            }
            counts.push(before);
        }
    }
    (rows, counts)
}

/// Returns the bits of a row of corners, and the number of their triangles.
fn row(leaf: LeafDiagram<'_>, [x, y]: [i32; 2]) -> ([u32; 3], u32) {
    let (mut bits, mut all) = ([0; 3], 0);
    for i in 0..BLOCK_SIDE {
        let corner = [x + i as i32, y];
        let count = leaf.count(corner);
        bits[0] |= ((count > 0) as u32) << i;
        bits[1] |= ((count == 2) as u32) << i;
        bits[2] |= ((count == 2 && leaf.is_cut_northeast(corner)) as u32) << i;
        all += count;
    }
    (bits, all)
}
