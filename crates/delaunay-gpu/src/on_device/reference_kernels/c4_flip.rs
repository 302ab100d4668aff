//! Steps C2 and C4 as rounds of flips: the twin of `shaders/c4_flip.wgsl`, which describes a round.

use crate::on_device::flip_marks::FlipMarks;
use crate::on_device::reference_kernels::predicates::{in_circle, orientation};
use delaunay::geometry::Site;

/// The x of the vertex at infinity in a list of sites.
pub const AT_INFINITY: i32 = i32::MIN;

const FREE: u32 = u32::MAX;
const SPREAD: u32 = 0x0851_f42d;

/// A mesh between two rounds: the contents of the buffers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlipState {
    /// Eight numbers for each triangle: three corners, the note, three twins, the partner.
    pub records: Vec<u32>,
    /// The highest claim on each triangle so far.
    pub claims: Vec<u32>,
    /// Bits for each triangle; see [`FlipMarks`].
    pub marks: Vec<u32>,
}

/// Returns the half-edge after `h` in its triangle.
fn next(h: u32) -> u32 {
    (h & !3) | (0b00_10_01 >> (2 * (h & 3)) & 3)
}

/// Returns the half-edge before `h` in its triangle.
fn previous(h: u32) -> u32 {
    (h & !3) | (0b01_00_10 >> (2 * (h & 3)) & 3)
}

/// Returns what an edge claims its triangles with.
fn key(round: u32, h: u32) -> u32 {
    let edge = h >> 3 << 2 | (h & 3);
    round << 28 | (edge.wrapping_mul(SPREAD) & 0x0fff_ffff)
}

/// Does round number `round`, from 1 to at most 15.
pub fn flip_round(state: &mut FlipState, sites: &[Site], round: u32) {
    let triangles = state.claims.len() as u32;
    (0..triangles).for_each(|t| state.claim(sites, round, t));
    (0..triangles).for_each(|t| state.commit(round, t));
    (0..triangles).for_each(|t| state.relink(round, t));
}

impl FlipState {
    /// Returns the state before the first round. Number 3 of every record must be 0.
    pub fn new(records: Vec<u32>) -> FlipState {
        let triangles = records.len() / 8;
        FlipState { claims: vec![0; triangles], marks: vec![0; FlipMarks::of(triangles).numbers()], records }
    }

    /// Returns the sections of the marks.
    pub fn sections(&self) -> FlipMarks {
        FlipMarks::of(self.claims.len())
    }

    fn is_dirty(&self, round: u32, t: u32) -> bool {
        let word = self.marks[self.sections().dirty(round)][t as usize / 32];
        round == 1 || word >> (t % 32) & 1 != 0
    }

    fn set_dirty(&mut self, round: u32, t: u32) {
        let section = self.sections().dirty(round);
        self.marks[section][t as usize / 32] |= 1 << (t % 32);
    }

    fn note_inverted(&mut self, t: u32, is_inverted: bool) {
        let section = self.sections().inverted();
        let word = &mut self.marks[section][t as usize / 32];
        *word = *word & !(1 << (t % 32)) | (is_inverted as u32) << (t % 32);
    }

    /// Phase 1.
    fn claim(&mut self, sites: &[Site], round: u32, t: u32) {
        if t.is_multiple_of(32) {
            let section = self.sections().dirty(round + 2);
            self.marks[section][t as usize / 32] = 0;
        }
        let first = 8 * t as usize;
        if !self.is_dirty(round, t) || self.records[first] == FREE {
            return;
        }
        let corners = [0, 1, 2].map(|i| sites[self.records[first + i] as usize]);
        if corners.iter().any(|corner| corner[0] == AT_INFINITY) {
            return;
        }
        let [mut u, mut v, mut w] = corners;
        self.note_inverted(t, orientation(u, v, w) <= 0);
        for h in 8 * t..8 * t + 3 {
            let g = self.records[h as usize + 4];
            let n = g >> 3;
            if self.is_triangle(n) && n != t && !(n > t && self.is_dirty(round, n)) {
                let z = sites[self.records[previous(g) as usize] as usize];
                if z[0] != AT_INFINITY && should_flip(u, v, w, z) {
                    for t in [t, n] {
                        let claim = &mut self.claims[t as usize];
                        *claim = key(round, h).max(*claim);
                    }
                    self.set_dirty(round + 1, t);
                    return;
                }
            }
            (u, v, w) = (v, w, u);
        }
    }

    /// Returns the half-edge of triangle `t` with whose key the triangle is claimed, if it is.
    fn own_claim(&self, round: u32, t: u32) -> Option<u32> {
        let claim = self.claims[t as usize];
        (8 * t..8 * t + 3).find(|&h| claim == key(round, h))
    }

    /// Phase 2.
    fn commit(&mut self, round: u32, t: u32) {
        if !self.is_dirty(round, t) {
            return;
        }
        let Some(h) = self.own_claim(round, t) else { return };
        let g = self.records[h as usize + 4];
        let n = g >> 3;
        if self.claims[n as usize] == self.claims[t as usize] {
            self.note_flip(round, h, g);
            self.note_flip(round, g, h);
            self.set_dirty(round + 1, n);
        }
    }

    fn note_flip(&mut self, round: u32, h: u32, partner: u32) {
        let first = (h & !7) as usize;
        self.records[first + 3] = round << 2 | (h & 3);
        self.records[first + 7] = partner;
    }

    fn is_triangle(&self, t: u32) -> bool {
        t < self.claims.len() as u32
    }

    /// Returns whether the triangle of half-edge `h` is flipped in this round.
    fn is_flipped(&self, round: u32, h: u32) -> bool {
        self.records[(h & !7) as usize + 3] >> 2 == round
    }

    /// Returns where half-edge `h` of a neighbour is after this round.
    fn place(&self, round: u32, h: u32) -> u32 {
        let first = h & !7;
        let is_moved = self.is_triangle(h >> 3)
            && self.is_flipped(round, h)
            && h == next(first | (self.records[first as usize + 3] & 3));
        if is_moved { self.records[first as usize + 7] } else { h }
    }

    /// Links half-edge `h` of a neighbour to its new twin, unless its triangle is flipped too and does that itself.
    fn link_back(&mut self, round: u32, h: u32, twin: u32) {
        if self.is_triangle(h >> 3) && !self.is_flipped(round, h) {
            self.records[h as usize + 4] = twin;
        }
    }

    /// Phase 3.
    fn relink(&mut self, round: u32, t: u32) {
        if !self.is_dirty(round, t) {
            return;
        }
        let Some(h) = self.own_claim(round, t) else { return };
        if !self.is_flipped(round, h) {
            return;
        }
        let g = self.records[8 * t as usize + 7];
        let (h_next, g_next, h_previous, g_previous) = (next(h), next(g), previous(h), previous(g));
        let [outer_h, outer_g, side_h, side_g] =
            [h_next, g_next, h_previous, g_previous].map(|h| self.records[h as usize + 4]);
        self.records[h_next as usize] = self.records[g_previous as usize];
        self.records[g_next as usize] = self.records[h_previous as usize];
        let twins = [
            (h, self.place(round, outer_g)),
            (g, self.place(round, outer_h)),
            (h_next, g_next),
            (g_next, h_next),
            (h_previous, self.place(round, side_h)),
            (g_previous, self.place(round, side_g)),
        ];
        for (h, twin) in twins {
            self.records[h as usize + 4] = twin;
        }
        self.link_back(round, outer_g, h);
        self.link_back(round, outer_h, g);
    }
}

/// Returns whether edge uv of the triangles uvw and vuz should be flipped.
fn should_flip(u: Site, v: Site, w: Site, z: Site) -> bool {
    in_circle(u, v, w, z) && orientation(z, w, u) > 0 && orientation(w, z, v) > 0
}
