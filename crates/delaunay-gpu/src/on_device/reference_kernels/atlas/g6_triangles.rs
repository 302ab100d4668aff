//! Step G6 in an atlas: the twin of `shaders/atlas/g6_triangles.wgsl`, which describes arms, half-edges and the order of the records.

use crate::on_device::atlas::BLOCK_SIDE;
use crate::on_device::leaf_flags::{LONG_EDGE, TOO_MANY_TRIANGLES};
use crate::on_device::reference_kernels::atlas::corners::{
    AtlasDiagram, Corner, EAST, LeafDiagram, NORTH, SOUTH, STEPS, WEST,
};

/// A record without a triangle, a half-edge without a twin.
const FREE: u32 = u32::MAX;
/// The longest Voronoi edge that is followed, in corners.
const MAX_STEPS: usize = 4096;

/// Returns the records of all leaves. Adds to the flags of each leaf.
pub fn make_triangles(diagram: AtlasDiagram<'_>, flags: &mut [u32]) -> Vec<u32> {
    let mut records = [FREE, FREE, FREE, 0, FREE, FREE, FREE, 0].repeat(diagram.atlas.records as usize);
    for (leaf, flags) in diagram.leaves().zip(flags) {
        let linker = Linker::new(leaf);
        if linker.end - leaf.leaf.first_record > leaf.leaf.records() {
            *flags |= TOO_MANY_TRIANGLES;
            continue;
        }
        for corner in linker.corners() {
            linker.write(corner, &mut records, flags);
        }
    }
    records
}

/// The corners of a leaf with the numbers of their triangles.
struct Linker<'a> {
    leaf: LeafDiagram<'a>,
    /// The number of the first triangle of each corner, row by row.
    first: Vec<u32>,
    /// The number after that of the last triangle.
    end: u32,
}

impl Linker<'_> {
    fn new(leaf: LeafDiagram<'_>) -> Linker<'_> {
        let room = leaf.leaf.stride * leaf.leaf.blocks_y() * BLOCK_SIDE;
        let mut linker = Linker { leaf, first: vec![0; room as usize], end: leaf.leaf.first_record };
        for corner in linker.corners() {
            let place = linker.place(corner);
            linker.first[place] = linker.end;
            linker.end += leaf.count(corner);
        }
        linker
    }

    /// Returns all corners in the order of their triangles.
    fn corners(&self) -> impl Iterator<Item = Corner> + use<> {
        let rows: Vec<Corner> = self.leaf.rows().collect();
        rows.into_iter().flat_map(|[x, y]| (x..x + BLOCK_SIDE as i32).map(move |x| [x, y]))
    }

    fn place(&self, [x, y]: Corner) -> usize {
        (y as u32 * self.leaf.leaf.stride + x as u32) as usize
    }

    /// Returns the half-edge that crosses the `arm` of a corner, or the arm with which it is connected if the corner has no triangle.
    fn across(&self, corner: Corner, arm: usize) -> Result<u32, usize> {
        let ([sw, _, ne, _], arms) = (self.leaf.around(corner), self.leaf.arms(corner));
        let t = 8 * self.first[self.place(corner)];
        let all = arms.iter().filter(|&&arm| arm).count();
        match (all, self.leaf.count(corner)) {
            (3, _) => Ok(t + [0, arms[SOUTH] as u32, 2 - arms[WEST] as u32, 2][arm]),
            (_, 2) if self.leaf.is_cut_northeast(corner) => Ok(t + [0, 1, 9, 10][arm]),
            (_, 2) => Ok(t + [0, 8, 9, 2][arm]),
            (4, _) if sw == ne => Err([EAST, SOUTH, WEST, NORTH][arm]),
            (4, _) => Err([WEST, NORTH, EAST, SOUTH][arm]),
            _ => Err((0..4).find(|&other| other != arm && arms[other]).unwrap_or(arm)),
        }
    }

    /// Follows the Voronoi edge that leaves `corner` along `arm`; returns the half-edge at its other end, or `None` if that is too far.
    fn walk(&self, mut corner: Corner, mut arm: usize) -> Option<u32> {
        for _ in 0..MAX_STEPS {
            corner = [corner[0] + STEPS[arm][0], corner[1] + STEPS[arm][1]];
            match self.across(corner, (arm + 2) % 4) {
                Ok(half_edge) => return Some(half_edge),
                Err(next) => arm = next,
            }
        }
        None
    }

    /// Writes the records of the triangles of a corner.
    fn write(&self, corner: Corner, records: &mut [u32], flags: &mut u32) {
        let t = 8 * self.first[self.place(corner)] as usize;
        let triangles = self.leaf.triangles(corner);
        for (i, corners) in triangles.iter().enumerate() {
            records[t + 8 * i..][..3].copy_from_slice(corners);
        }
        if triangles.is_empty() {
            return;
        }
        for arm in (0..4).filter(|&arm| self.leaf.arms(corner)[arm]) {
            let twin = self.walk(corner, arm);
            *flags |= if twin.is_none() { LONG_EDGE } else { 0 };
            if let Ok(half_edge) = self.across(corner, arm) {
                records[half_edge as usize + 4] = twin.unwrap_or(FREE);
            }
        }
        if triangles.len() == 2 {
            let (a, b) = if self.leaf.is_cut_northeast(corner) { (t + 2, t + 8) } else { (t + 1, t + 10) };
            records[a + 4] = b as u32;
            records[b + 4] = a as u32;
        }
    }
}
