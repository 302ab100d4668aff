//! Steps G4 to G6 in one scan: find the corners of the texture where three or four colours meet, and make their triangles,
//! linked to their neighbours from the start.
//!
//! Between any two pixels of different colour runs a piece of a Voronoi edge: an *arm* of the corners at both its ends. A corner
//! with two arms is a bend of an edge, one with three is a Voronoi vertex: a triangle, each half-edge of which crosses
//! one arm. The corners are met row by row from the south, each row from the west. The end of every edge that is still
//! open is kept in a slot: one for each column, for the arm that goes north from there, and one for the arm that goes
//! east. A slot is a half-edge like those of triangles, its twin the other end of the Voronoi edge (maybe another slot), so that following
//! an edge, joining two ends and linking two triangles are all the same two writes.
//!
//! The frame around the texture counts as the colour "infinity": its triangles are the ghosts that close the sphere.
//! Step G5's prefix sums are needed only where rows are done in parallel.
//!
//! Step C2's tests of what a row has made and most flips of step C4 follow at once, while it is in the cache. Flips do not
//! mind open edges, as slots are half-edges too.

use crate::geometry::predicates::{in_circle, orient2d};
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g2_voronoi::{FRAME, LabelRows};
use crate::voronoi::rejection::Rejection;

/// Buffers of the scan.
#[derive(Default)]
pub(super) struct TextureScan {
    south: Vec<u32>,
    north: Vec<u32>,
    south_walls: Vec<u64>,
    north_walls: Vec<u64>,
    floors: Vec<u64>,
    /// By word of the texture, the first triangle made there: where to start looking for a site of that word.
    starts: Vec<u32>,
}

/// The slot of the open arm going east.
const EAST: u32 = ClosedMesh::slot(0);
/// A slot for links that are not needed.
const WASTE: u32 = ClosedMesh::slot(1);

/// The slot of the open arm going north from corner `x`.
#[inline(always)]
fn column(x: usize) -> u32 {
    ClosedMesh::slot(x + 2)
}

impl TextureScan {
    /// Fills `sphere` with the triangles of the discrete Voronoi diagram of `texture`.
    pub(super) fn run(
        &mut self,
        texture: &SiteTexture,
        voronoi: &mut LabelRows,
        sphere: &mut ClosedMesh,
        shift: &mut ShiftRepair,
        flips: &mut FlipQueue,
    ) -> Result<(), Rejection> {
        sphere.reset(texture.width + 3, texture.placed, (texture.sites.len() - 1) as u32);
        let words = texture.width / 64 + 1;
        for row in [&mut self.south, &mut self.north] {
            row.clear();
            row.resize(words * 64 + 1, FRAME);
        }
        for walls in [&mut self.south_walls, &mut self.north_walls, &mut self.floors] {
            walls.clear();
            walls.resize(words + 1, 0);
        }
        self.starts.clear();
        let mut tested = sphere.front() as usize;
        for y in 0..=texture.height {
            if y < texture.height {
                voronoi.row(texture, y, &mut self.north);
            } else {
                self.north.fill(FRAME);
            }
            self.scan_row(texture, sphere, &mut flips.suspects);
            tested = shift.test(sphere, &texture.sites, tested, y == texture.height, &mut flips.suspects);
            flips.run_early(sphere, &texture.sites)?;
            std::mem::swap(&mut self.south, &mut self.north);
            std::mem::swap(&mut self.south_walls, &mut self.north_walls);
        }
        std::mem::swap(&mut flips.later, &mut shift.suspects);
        Ok(())
    }

    /// A triangle near the site of a pixel (y << 16 | x).
    pub(super) fn start_near(&self, pixel: u32) -> u32 {
        let words = self.floors.len() - 1;
        self.starts[(pixel >> 16) as usize * words + (pixel & 0xffff) as usize / 64]
    }

    /// Visits the corners between two rows. Corner x has pixel x - 1, at index x of a row, in its west.
    fn scan_row(&mut self, texture: &SiteTexture, sphere: &mut ClosedMesh, suspects: &mut Vec<u32>) {
        let words = self.floors.len() - 1;
        for word in 0..words {
            let (north, south) = (&self.north[word * 64..][..65], &self.south[word * 64..][..65]);
            self.north_walls[word] = differences(&north[..64], &north[1..]);
            self.floors[word] = differences(&south[..64], &north[..64]);
        }
        for word in 0..words {
            self.starts.push(sphere.end());
            let (s, n, w) = (self.south_walls[word], self.north_walls[word], self.floors[word]);
            let e = w >> 1 | self.floors[word + 1] << 63;
            // Not those without arms, nor those an edge goes straight through.
            let mut corners = (s ^ n) | (w ^ e) | (s & n & w & e);
            while corners != 0 {
                let bit = corners.trailing_zeros();
                let arms = (w >> bit & 1) | (s >> bit & 1) << 1 | (e >> bit & 1) << 2 | (n >> bit & 1) << 3;
                self.corner(texture, sphere, word * 64 + bit as usize, arms as u32, suspects);
                corners &= corners - 1;
            }
        }
    }

    /// Does what the arms (west, south, east, north: bits 0 to 3) of corner `x` ask for.
    #[inline(always)]
    fn corner(&self, texture: &SiteTexture, sphere: &mut ClosedMesh, x: usize, arms: u32, suspects: &mut Vec<u32>) {
        // Three arms, or a bend: told apart by one branch, and each of their shapes treated alike, because no
        // processor can foresee which comes next.
        match arms.count_ones() {
            2 => bend(sphere, x, arms, suspects),
            3 => self.three_colours(texture, sphere, x, arms),
            _ => self.four_arms(texture, sphere, x, suspects),
        }
    }

    #[inline(always)]
    fn three_colours(&self, texture: &SiteTexture, sphere: &mut ClosedMesh, x: usize, arms: u32) {
        let (west, south, east, north) = (arms & 1 != 0, arms & 2 != 0, arms & 4 != 0, arms & 8 != 0);
        let (sw, se, ne, nw) = (self.south[x], self.south[x + 1], self.north[x + 1], self.north[x]);
        let (b, c) = (if south { se } else { ne }, if north & west { nw } else { ne });
        let (sw, b, c) = (number(texture, sphere, sw), number(texture, sphere, b), number(texture, sphere, c));
        let t = sphere.push(sw, b, c);
        let (from_west, from_south) = (sphere.twin(EAST), sphere.twin(column(x)));
        // The half-edges across the arms, from the south one round; where an arm is missing, waste paper is linked.
        let or_waste = |there: bool, h: u32| if there { h } else { WASTE };
        sphere.link(or_waste(south, t), or_waste(south, from_south));
        sphere.link(or_waste(west, t + 2), or_waste(west, from_west));
        sphere.link(or_waste(east, t + south as u32), or_waste(east, EAST));
        sphere.link(or_waste(north, t + 2 - west as u32), or_waste(north, column(x)));
    }

    /// Four colours, or fewer: pixels of one colour across the corner hang together there, so that no three colours meet.
    fn four_arms(&self, texture: &SiteTexture, sphere: &mut ClosedMesh, x: usize, suspects: &mut Vec<u32>) {
        let labels = [self.south[x], self.south[x + 1], self.north[x + 1], self.north[x]];
        let (from_west, from_south) = (sphere.twin(EAST), sphere.twin(column(x)));
        if labels[0] == labels[2] {
            sphere.link(column(x), from_west);
            sphere.link(EAST, from_south);
        } else if labels[1] == labels[3] {
            join(sphere, from_west, from_south, suspects);
            sphere.link(EAST, column(x));
        } else {
            let [sw, se, ne, nw] = labels;
            let (sw, se) = (number(texture, sphere, sw), number(texture, sphere, se));
            let (ne, nw) = (number(texture, sphere, ne), number(texture, sphere, nw));
            let [s, e, n, w] = two_triangles(texture, sphere, [sw, se, ne, nw]);
            sphere.link(from_south, s);
            sphere.link(from_west, w);
            sphere.link(e, EAST);
            sphere.link(n, column(x));
        }
    }
}

/// The Voronoi edge that has one end in the west or east and one in the south or north.
#[inline(always)]
fn bend(sphere: &mut ClosedMesh, x: usize, arms: u32, suspects: &mut Vec<u32>) {
    let across = if arms & 1 != 0 { sphere.twin(EAST) } else { EAST };
    let along = if arms & 2 != 0 { sphere.twin(column(x)) } else { column(x) };
    join(sphere, across, along, suspects);
}

/// Links the ends of a Voronoi edge. If both are triangles, both have been tested before they had this edge.
#[inline(always)]
fn join(sphere: &mut ClosedMesh, a: u32, b: u32, suspects: &mut Vec<u32>) {
    sphere.link(a, b);
    if a.min(b) >= sphere.front() {
        suspects.push(a);
    }
}

#[inline(always)]
fn number(texture: &SiteTexture, sphere: &ClosedMesh, label: u32) -> u32 {
    if label == FRAME { sphere.infinity() } else { texture.number(label) }
}

/// Two triangles for four colours around a corner; the half-edges on its south, east, north and west arm.
fn two_triangles(texture: &SiteTexture, sphere: &mut ClosedMesh, [sw, se, ne, nw]: [u32; 4]) -> [u32; 4] {
    let at = |v: u32| texture.sites[v as usize];
    let (a, b, c, d) = (at(sw), at(se), at(ne), at(nw));
    if orient2d(a, b, c) > 0 && orient2d(a, c, d) > 0 && !in_circle(a, b, c, d) {
        let t = sphere.push(sw, se, ne);
        let u = sphere.push(sw, ne, nw);
        sphere.link(t + 2, u);
        [t, t + 1, u + 1, u + 2]
    } else {
        let t = sphere.push(sw, se, nw);
        let u = sphere.push(se, ne, nw);
        sphere.link(t + 1, u + 2);
        [t, u, u + 1, t + 2]
    }
}

/// Returns a word of 64 bits, in which bit i says whether `a[i] != b[i]`.
#[inline(always)]
fn differences(a: &[u32], b: &[u32]) -> u64 {
    let mut bytes = [0u8; 64];
    for ((byte, a), b) in bytes.iter_mut().zip(a).zip(b) {
        *byte = (a != b) as u8;
    }
    // The product gathers the low bits of eight bytes in one byte.
    let gather = |eight: [u8; 8]| u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    bytes.as_chunks::<8>().0.iter().rev().fold(0, |bits, &eight| bits << 8 | gather(eight))
}
