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

use super::g1_write_sites::Texture;
use super::g2_voronoi::{FRAME, Voronoi};
use super::sphere::Sphere;
use crate::geometry::predicates::{in_circle, orient2d};

/// Buffers of the scan.
#[derive(Default)]
pub(super) struct Scan {
    south: Vec<u32>,
    north: Vec<u32>,
    south_walls: Vec<u64>,
    north_walls: Vec<u64>,
    floors: Vec<u64>,
    /// By word of the texture, the first triangle made there: where to start looking for a site of that word.
    starts: Vec<u32>,
}

/// The half-edge that stands for the open arm going east.
const EAST: usize = 0;

impl Scan {
    /// Fills `sphere` with the triangles of the discrete Voronoi diagram of `texture`.
    pub(super) fn run(&mut self, texture: &Texture, voronoi: &mut Voronoi, sphere: &mut Sphere) {
        sphere.reset(texture.width + 2, texture.placed, (texture.sites.len() - 1) as u32);
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
        for y in 0..=texture.height {
            if y < texture.height {
                voronoi.row(texture, y, &mut self.north);
            } else {
                self.north.fill(FRAME);
            }
            self.scan_row(texture, sphere);
            std::mem::swap(&mut self.south, &mut self.north);
            std::mem::swap(&mut self.south_walls, &mut self.north_walls);
        }
    }

    /// A triangle near the site of a pixel (y << 16 | x).
    pub(super) fn start_near(&self, pixel: u32) -> u32 {
        let words = self.floors.len() - 1;
        self.starts[(pixel >> 16) as usize * words + (pixel & 0xffff) as usize / 64]
    }

    /// Visits the corners between two rows. Corner x has pixel x - 1, at index x of a row, in its west.
    fn scan_row(&mut self, texture: &Texture, sphere: &mut Sphere) {
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
                self.corner(texture, sphere, word * 64 + bit as usize, arms as u32);
                corners &= corners - 1;
            }
        }
    }

    #[inline(always)]
    fn corner(&self, texture: &Texture, sphere: &mut Sphere, x: usize, arms: u32) {
        const W: u32 = 1;
        const S: u32 = 2;
        const E: u32 = 4;
        const N: u32 = 8;
        let (east, north) = (Sphere::slot(EAST), Sphere::slot(x + 1));
        let number = |label: u32| if label == FRAME { sphere.infinity() } else { texture.number(label) };
        let (sw, se, ne, nw) = (self.south[x], self.south[x + 1], self.north[x + 1], self.north[x]);
        const WS: u32 = W | S;
        const SE: u32 = S | E;
        const EN: u32 = E | N;
        const NW: u32 = N | W;
        const WSE: u32 = W | S | E;
        const SEN: u32 = S | E | N;
        const ENW: u32 = E | N | W;
        const NWS: u32 = N | W | S;
        match arms {
            WS => join(sphere, east, north),
            SE => carry(sphere, north, east),
            NW => carry(sphere, east, north),
            EN => sphere.link(east, north),
            WSE => {
                let t = [number(sw), number(se), number(ne)];
                let t = sphere.push(t[0], t[1], t[2]);
                receive(sphere, north, t);
                receive(sphere, east, t + 2);
                sphere.link(t + 1, east);
            }
            SEN => {
                let t = [number(sw), number(se), number(ne)];
                let t = sphere.push(t[0], t[1], t[2]);
                receive(sphere, north, t);
                sphere.link(t + 1, east);
                sphere.link(t + 2, north);
            }
            ENW => {
                let t = [number(sw), number(ne), number(nw)];
                let t = sphere.push(t[0], t[1], t[2]);
                receive(sphere, east, t + 2);
                sphere.link(t, east);
                sphere.link(t + 1, north);
            }
            NWS => {
                let t = [number(sw), number(se), number(nw)];
                let t = sphere.push(t[0], t[1], t[2]);
                receive(sphere, north, t);
                receive(sphere, east, t + 2);
                sphere.link(t + 1, north);
            }
            // Four arms. Pixels of one colour across the corner hang together there, so that no three colours meet.
            _ if sw == ne => {
                let (from_west, from_south) = (sphere.twin(east), sphere.twin(north));
                sphere.link(north, from_west);
                sphere.link(east, from_south);
            }
            _ if se == nw => {
                join(sphere, east, north);
                sphere.link(east, north);
            }
            _ => {
                let quad = [number(sw), number(se), number(ne), number(nw)];
                let [s, e, n, w] = two_triangles(texture, sphere, quad);
                receive(sphere, north, s);
                receive(sphere, east, w);
                sphere.link(e, east);
                sphere.link(n, north);
            }
        }
    }
}

/// The Voronoi edges that come in at two slots are one.
#[inline(always)]
fn join(sphere: &mut Sphere, a: u32, b: u32) {
    let (from_a, from_b) = (sphere.twin(a), sphere.twin(b));
    sphere.link(from_a, from_b);
}

/// The Voronoi edge that came in at slot `a` goes on at slot `b`.
#[inline(always)]
fn carry(sphere: &mut Sphere, a: u32, b: u32) {
    let from = sphere.twin(a);
    sphere.link(b, from);
}

/// The Voronoi edge that came in at a slot ends at half-edge `h`.
#[inline(always)]
fn receive(sphere: &mut Sphere, slot: u32, h: u32) {
    let from = sphere.twin(slot);
    sphere.link(h, from);
}

/// Two triangles for four colours around a corner; the half-edges on its south, east, north and west arm.
fn two_triangles(texture: &Texture, sphere: &mut Sphere, [sw, se, ne, nw]: [u32; 4]) -> [u32; 4] {
    let [a, b, c, d] = [sw, se, ne, nw].map(|i| texture.sites[i as usize]);
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

/// Bit i: `a[i] != b[i]`, of 64.
#[inline(always)]
fn differences(a: &[u32], b: &[u32]) -> u64 {
    let mut bytes = [0u8; 64];
    for ((byte, a), b) in bytes.iter_mut().zip(a).zip(b) {
        *byte = (a != b) as u8;
    }
    // A product that gathers the low bits of eight bytes into one.
    let gather = |eight: &[u8]| {
        let eight = eight.try_into().expect("chunks of eight");
        u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56
    };
    bytes.chunks_exact(8).rev().fold(0, |bits, eight| bits << 8 | gather(eight))
}
