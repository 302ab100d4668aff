//! Steps G4 to G6 in one scan: find the corners of the texture where three or four colours meet, and make their triangles,
//! linked to their neighbours from the start.
//!
//! Between any two pixels of different colours runs a piece of a Voronoi edge: an *arm* of the corners at both its ends. A corner
//! with two arms is a bend of an edge. A corner with three arms is a Voronoi vertex, that is, a triangle, and each half-edge of the
//! triangle crosses one arm. The scan meets the corners row by row from the south, and each row from the west. It keeps the end of
//! every open edge in a slot: one slot per column for the arm that goes north from there, and one for the arm that goes east. A slot
//! is a half-edge like those of triangles, and its twin is the other end of the Voronoi edge, which may be a slot too. So following
//! an edge, joining two ends and linking two triangles are all the same two writes.
//!
//! The frame around the texture counts as the colour "infinity". Its triangles are the ghosts that close the sphere. Step G5's
//! prefix sums are needed only where rows are processed in parallel.
//!
//! Step C2's tests of what a row has made, and most flips of step C4, follow at once, while the row is in the cache. Flips work with
//! open edges too, because slots are half-edges.

use crate::geometry::predicates::{in_circle, orient2d};
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g2_voronoi::{FRAME, LabelRows};
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;

/// Buffers of the scan.
#[derive(Default)]
pub(super) struct TextureScan {
    south: Vec<u32>,
    north: Vec<u32>,
    south_walls: Vec<u64>,
    north_walls: Vec<u64>,
    floors: Vec<u64>,
    /// The first triangle made in each word of the texture, where the search for a site of that word starts.
    starts: Vec<ClosedEdge>,
}

/// The slot of the open arm that goes east.
const EAST: ClosedEdge = ClosedMesh::slot(0);
/// A slot for links that are not needed.
const UNUSED: ClosedEdge = ClosedMesh::slot(1);

/// Returns the slot of the open arm that goes north from corner `x`.
#[inline(always)]
fn column(x: usize) -> ClosedEdge {
    ClosedMesh::slot(x + 2)
}

impl TextureScan {
    /// Fills `mesh` with the triangles of the discrete Voronoi diagram of `texture`.
    pub(super) fn run(
        &mut self,
        texture: &SiteTexture,
        labels: &mut LabelRows,
        mesh: &mut ClosedMesh,
        shift: &mut ShiftRepair,
        flips: &mut FlipQueue,
    ) -> Result<(), Rejection> {
        mesh.reset(texture.width + 3, texture.placed, VertexIndex((texture.sites.len() - 1) as u32));
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
        let mut tested = mesh.front().get();
        for y in 0..=texture.height {
            if y < texture.height {
                labels.row(texture, y, &mut self.north);
            } else {
                self.north.fill(FRAME);
            }
            self.scan_row(texture, mesh, &mut flips.suspects);
            tested = shift.test(mesh, &texture.sites, tested, y == texture.height, &mut flips.suspects);
            flips.run_early(mesh, &texture.sites)?;
            std::mem::swap(&mut self.south, &mut self.north);
            std::mem::swap(&mut self.south_walls, &mut self.north_walls);
        }
        std::mem::swap(&mut flips.later, &mut shift.suspects);
        Ok(())
    }

    /// Returns a triangle near the site of a pixel (y << 16 | x).
    pub(super) fn start_near(&self, pixel: u32) -> ClosedEdge {
        let (words, x) = (self.floors.len() - 1, pixel & 0xffff);
        let word = (pixel >> 16) as usize * words + x as usize / 64;
        let (first, end) = (self.starts[word], self.starts[word + 1]);
        // The triangles of a word were made from the west to the east.
        let made = (end.0 - first.0) / 8;
        ClosedEdge(first.0 + made * (x % 64) / 64 * 8)
    }

    /// Visits the corners between two rows. To the west of corner x lies pixel x - 1, which has index x in a row.
    fn scan_row(&mut self, texture: &SiteTexture, mesh: &mut ClosedMesh, suspects: &mut Vec<ClosedEdge>) {
        let words = self.floors.len() - 1;
        for word in 0..words {
            let (north, south) = (&self.north[word * 64..][..65], &self.south[word * 64..][..65]);
            self.north_walls[word] = differences(&north[..64], &north[1..]);
            self.floors[word] = differences(&south[..64], &north[..64]);
        }
        for word in 0..words {
            self.starts.push(mesh.end());
            let (s, n, w) = (self.south_walls[word], self.north_walls[word], self.floors[word]);
            let e = w >> 1 | self.floors[word + 1] << 63;
            // All corners except those without arms and those that an edge passes straight through.
            let mut corners = (s ^ n) | (w ^ e) | (s & n & w & e);
            while corners != 0 {
                let bit = corners.trailing_zeros();
                let arms = (w >> bit & 1) | (s >> bit & 1) << 1 | (e >> bit & 1) << 2 | (n >> bit & 1) << 3;
                self.corner(texture, mesh, word * 64 + bit as usize, arms as u32, suspects);
                corners &= corners - 1;
            }
        }
    }

    /// Does what the arms (west, south, east, north: bits 0 to 3) of corner `x` require.
    #[inline(always)]
    fn corner(
        &self,
        texture: &SiteTexture,
        mesh: &mut ClosedMesh,
        x: usize,
        arms: u32,
        suspects: &mut Vec<ClosedEdge>,
    ) {
        // One branch separates bends from corners with three arms. All shapes of each are treated alike, because no processor can
        // predict which shape comes next.
        match arms.count_ones() {
            2 => bend(mesh, x, arms, suspects),
            3 => self.three_colours(texture, mesh, x, arms),
            _ => self.four_arms(texture, mesh, x, suspects),
        }
    }

    #[inline(always)]
    fn three_colours(&self, texture: &SiteTexture, mesh: &mut ClosedMesh, x: usize, arms: u32) {
        let (west, south, east, north) = (arms & 1 != 0, arms & 2 != 0, arms & 4 != 0, arms & 8 != 0);
        let (sw, se, ne, nw) = (self.south[x], self.south[x + 1], self.north[x + 1], self.north[x]);
        let (b, c) = (if south { se } else { ne }, if north & west { nw } else { ne });
        let t = mesh.push([sw, b, c].map(|label| vertex(texture, mesh, label)));
        let (from_west, from_south) = (mesh.twin(EAST), mesh.twin(column(x)));
        // The half-edges across the arms, counterclockwise from the south. For a missing arm, unused slots are linked.
        let or_unused = |exists: bool, h: ClosedEdge| if exists { h } else { UNUSED };
        mesh.link(or_unused(south, t), or_unused(south, from_south));
        mesh.link(or_unused(west, t.side(2)), or_unused(west, from_west));
        mesh.link(or_unused(east, t.side(south as u32)), or_unused(east, EAST));
        mesh.link(or_unused(north, t.side(2 - west as u32)), or_unused(north, column(x)));
    }

    /// Handles a corner with four arms. If two pixels of one colour face each other across the corner, they are connected there, and
    /// no three colours meet. Otherwise four colours meet.
    fn four_arms(&self, texture: &SiteTexture, mesh: &mut ClosedMesh, x: usize, suspects: &mut Vec<ClosedEdge>) {
        let labels = [self.south[x], self.south[x + 1], self.north[x + 1], self.north[x]];
        let (from_west, from_south) = (mesh.twin(EAST), mesh.twin(column(x)));
        if labels[0] == labels[2] {
            mesh.link(column(x), from_west);
            mesh.link(EAST, from_south);
        } else if labels[1] == labels[3] {
            join(mesh, from_west, from_south, suspects);
            mesh.link(EAST, column(x));
        } else {
            let vertices = labels.map(|label| vertex(texture, mesh, label));
            let [s, e, n, w] = two_triangles(texture, mesh, vertices);
            mesh.link(from_south, s);
            mesh.link(from_west, w);
            mesh.link(e, EAST);
            mesh.link(n, column(x));
        }
    }
}

/// Joins the two arms of a bend: one end of the Voronoi edge lies in the west or east, the other in the south or north.
#[inline(always)]
fn bend(mesh: &mut ClosedMesh, x: usize, arms: u32, suspects: &mut Vec<ClosedEdge>) {
    let across = if arms & 1 != 0 { mesh.twin(EAST) } else { EAST };
    let along = if arms & 2 != 0 { mesh.twin(column(x)) } else { column(x) };
    join(mesh, across, along, suspects);
}

/// Links the ends of a Voronoi edge. If both ends are triangles, they were tested before they had this edge, so it is a suspect.
#[inline(always)]
fn join(mesh: &mut ClosedMesh, a: ClosedEdge, b: ClosedEdge, suspects: &mut Vec<ClosedEdge>) {
    mesh.link(a, b);
    if a.0.min(b.0) >= mesh.front().0 {
        suspects.push(a);
    }
}

#[inline(always)]
fn vertex(texture: &SiteTexture, mesh: &ClosedMesh, label: u32) -> VertexIndex {
    if label == FRAME { mesh.infinity() } else { texture.vertex(label) }
}

/// Makes two triangles for four colours around a corner; returns the half-edges on its south, east, north and west arms.
fn two_triangles(texture: &SiteTexture, mesh: &mut ClosedMesh, [sw, se, ne, nw]: [VertexIndex; 4]) -> [ClosedEdge; 4] {
    let [a, b, c, d] = [sw, se, ne, nw].map(|v| v.site(&texture.sites));
    if orient2d(a, b, c) > 0 && orient2d(a, c, d) > 0 && !in_circle(a, b, c, d) {
        let t = mesh.push([sw, se, ne]);
        let u = mesh.push([sw, ne, nw]);
        mesh.link(t.side(2), u);
        [t, t.side(1), u.side(1), u.side(2)]
    } else {
        let t = mesh.push([sw, se, nw]);
        let u = mesh.push([se, ne, nw]);
        mesh.link(t.side(1), u.side(2));
        [t, u, u.side(1), t.side(2)]
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
