//! Steps G4 to G6 in one scan: find the corners of the texture where three or four colours meet, and make their triangles,
//! linked to their neighbours from the start.
//!
//! Between any two pixels of different colours runs a piece of a Voronoi edge: an *arm* of the corners at both its ends. A corner
//! with two arms is a bend of an edge. A corner with three arms is a Voronoi vertex, that is, a triangle, and each half-edge of the
//! triangle crosses one arm. The scan meets the corners row by row from the south, and each row from the west. It keeps the end of
//! every open edge in a slot: one slot per column for the arm that goes north from there. A slot is a half-edge like those of
//! triangles, and its twin is the other end of the Voronoi edge, which may be a slot too. So following an edge, joining two ends and
//! linking two triangles are all the same two writes. The end of the one edge that goes east is at hand, and only where four arms
//! meet is it in a slot too.
//!
//! The frame around the texture counts as the colour "infinity". Its triangles are the ghosts that close the sphere. Step G5's
//! prefix sums are needed only where rows are processed in parallel.
//!
//! Step C2's tests of what a row has made, and most flips of step C4, follow at once, while the row is in the cache. Flips work with
//! open edges too, because slots are half-edges.

use crate::geometry::Site;
use crate::geometry::predicates::seems_delaunay;
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g2_voronoi::LabelRows;
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;
use crate::voronoi::triangle_writer::TriangleWriter;
use multiversion::multiversion;
use std::hint::select_unpredictable;

/// Buffers of the scan.
#[derive(Default)]
pub(super) struct TextureScan {
    south: Vec<VertexIndex>,
    north: Vec<VertexIndex>,
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
        let infinity = VertexIndex((texture.sites.len() - 1) as u32);
        let words = texture.width / 64 + 1;
        mesh.reset(words * 64 + 3, texture.placed, infinity);
        for row in [&mut self.south, &mut self.north] {
            row.clear();
            row.resize(words * 64 + 1, infinity);
        }
        for walls in [&mut self.south_walls, &mut self.north_walls, &mut self.floors] {
            walls.clear();
            walls.resize(words + 1, 0);
        }
        self.starts.clear();
        scan_rows(self, texture, labels, mesh, shift, flips)?;
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
    #[inline(always)]
    fn scan_row(&mut self, sites: &[Site], mesh: &mut ClosedMesh, suspects: &mut Vec<ClosedEdge>) {
        let words = self.floors.len() - 1;
        for word in 0..words {
            let (north, south) = (&self.north[word * 64..][..65], &self.south[word * 64..][..65]);
            self.north_walls[word] = differences(&north[..64], &north[1..]);
            self.floors[word] = differences(&south[..64], &north[..64]);
        }
        let mut writer = mesh.writer(2 * 64 * words);
        // The other end of the Voronoi edge that goes east at the moment.
        let mut open = UNUSED;
        for word in 0..words {
            self.starts.push(writer.end());
            let arms = self.arms(word);
            let first = writer.end();
            self.add_triangles(arms, &mut writer);
            open = self.join_arms(arms, first, open, sites, &mut writer, suspects);
        }
    }

    #[inline(always)]
    fn arms(&self, word: usize) -> Arms {
        let west = self.floors[word];
        let east = west >> 1 | self.floors[word + 1] << 63;
        Arms { first: word * 64, west, south: self.south_walls[word], east, north: self.north_walls[word] }
    }

    /// Makes the triangles of the corners with three arms in a word, and links them to the south and the north.
    #[inline(always)]
    fn add_triangles(&self, arms: Arms, writer: &mut TriangleWriter) {
        // Rows are whole words and one label more. Arrays of one length need no bounds checks.
        let labels = [&self.south, &self.north].map(|row| row[arms.first..].first_chunk::<65>());
        let [Some(south_row), Some(north_row)] = labels else { return };
        let mut corners = arms.three();
        // All shapes are treated alike, because no processor can predict which shape comes next.
        while corners != 0 {
            let bit = corners.trailing_zeros();
            let (i, column) = (bit as usize % 64, column(arms.first + bit as usize));
            let (west, south) = (arms.west >> bit & 1, arms.south >> bit & 1 != 0);
            let (sw, se, ne, nw) = (south_row[i], south_row[i + 1], north_row[i + 1], north_row[i]);
            let (b, c) = (select_unpredictable(south, se, ne), select_unpredictable(west != 0, nw, ne));
            let from_south = writer.twin(column);
            // The half-edges across the arms lie counterclockwise from the south. What is not right here, links to the west and the east
            // overwrite.
            let t = writer.push([sw, b, c], [from_south, column, column]);
            writer.set_twin(select_unpredictable(south, from_south, UNUSED), t);
            writer.set_twin(column, t.side(2 - west as u32));
            corners &= corners - 1;
        }
    }

    /// Joins the arms of the corners of a word to the west and the east. The word's triangles begin at `t`. `open` is the other end of the
    /// Voronoi edge that comes from the west; returns that of the edge that leaves to the east.
    #[inline(always)]
    fn join_arms(
        &self,
        arms: Arms,
        mut t: ClosedEdge,
        mut open: ClosedEdge,
        sites: &[Site],
        writer: &mut TriangleWriter,
        suspects: &mut Vec<ClosedEdge>,
    ) -> ClosedEdge {
        let (three, four) = (arms.three(), arms.four());
        let mut joined = [UNUSED; 64];
        let mut count = 0;
        let mut corners = arms.corners();
        while corners != 0 {
            let bit = corners.trailing_zeros();
            corners &= corners - 1;
            let x = arms.first + bit as usize;
            if four >> bit & 1 != 0 {
                open = self.four_arms(x, open, sites, writer, suspects);
                continue;
            }
            let is_triangle = (three >> bit & 1) as u32;
            let (west, south) = ((arms.west >> bit & 1) as u32, (arms.south >> bit & 1) as u32);
            let along = select_unpredictable(south != 0, writer.twin(column(x)), column(x));
            let to_west = select_unpredictable(is_triangle != 0, t.side(1 + west), along);
            let to_east = select_unpredictable(is_triangle != 0, t.side(south), along);
            // Where no arm goes west, this writes only what the arm to the east overwrites.
            writer.link(open, to_west);
            // If both ends are triangles that were there before, they were tested before they had this edge, so it is a suspect.
            joined[count % 64] = to_west;
            count += ((is_triangle == 0) & (open.0.min(to_west.0) >= writer.front().0)) as usize;
            open = select_unpredictable(arms.east >> bit & 1 != 0, to_east, UNUSED);
            t = ClosedEdge(t.0 + 8 * is_triangle);
        }
        suspects.extend_from_slice(&joined[..count]);
        open
    }

    /// Handles a corner with four arms; returns the other end of the Voronoi edge that leaves to the east. If two pixels of one colour face
    /// each other across the corner, they are connected there, and no three colours meet. Otherwise four colours meet.
    #[inline(never)]
    fn four_arms(
        &self,
        x: usize,
        open: ClosedEdge,
        sites: &[Site],
        writer: &mut TriangleWriter,
        suspects: &mut Vec<ClosedEdge>,
    ) -> ClosedEdge {
        let labels = [self.south[x], self.south[x + 1], self.north[x + 1], self.north[x]];
        // The edges from the west and from the south may be one.
        writer.link(EAST, open);
        let (from_west, from_south) = (writer.twin(EAST), writer.twin(column(x)));
        if labels[0] == labels[2] {
            writer.link(column(x), from_west);
            writer.link(EAST, from_south);
        } else if labels[1] == labels[3] {
            writer.link(from_west, from_south);
            if from_west.0.min(from_south.0) >= writer.front().0 {
                suspects.push(from_west);
            }
            writer.link(EAST, column(x));
        } else {
            let [s, e, n, w] = two_triangles(writer, sites, labels);
            writer.link(from_south, s);
            writer.link(from_west, w);
            writer.link(e, EAST);
            writer.link(n, column(x));
        }
        writer.twin(EAST)
    }
}

/// Scans all rows, and tests and flips what they make.
// With the instructions of today's processors this takes less time.
#[multiversion(targets("x86_64+avx2+bmi1+bmi2+lzcnt+popcnt"))]
fn scan_rows(
    scan: &mut TextureScan,
    texture: &SiteTexture,
    labels: &mut LabelRows,
    mesh: &mut ClosedMesh,
    shift: &mut ShiftRepair,
    flips: &mut FlipQueue,
) -> Result<(), Rejection> {
    let mut tested = mesh.front().get();
    for y in 0..=texture.height {
        if y < texture.height {
            labels.row(texture, y, &mut scan.north);
        } else {
            scan.north.fill(mesh.infinity());
        }
        scan.scan_row(&texture.sites, mesh, &mut flips.suspects);
        tested = shift.test(mesh, &texture.sites, tested, y == texture.height, &mut flips.suspects);
        flips.run_early(mesh, &texture.sites)?;
        std::mem::swap(&mut scan.south, &mut scan.north);
        std::mem::swap(&mut scan.south_walls, &mut scan.north_walls);
    }
    Ok(())
}

/// The arms of 64 corners: bit i of a word says whether the corner `first + i` has an arm in that direction.
#[derive(Clone, Copy)]
struct Arms {
    first: usize,
    west: u64,
    south: u64,
    east: u64,
    north: u64,
}

impl Arms {
    /// Returns the corners with arms but those that an edge passes straight through.
    #[inline(always)]
    fn corners(self) -> u64 {
        (self.south ^ self.north) | (self.west ^ self.east) | self.four()
    }

    #[inline(always)]
    fn three(self) -> u64 {
        (self.south & self.north & (self.west ^ self.east)) | (self.west & self.east & (self.south ^ self.north))
    }

    #[inline(always)]
    fn four(self) -> u64 {
        self.south & self.north & self.west & self.east
    }
}

/// Makes two triangles for four colours around a corner; returns the half-edges on its south, east, north and west arms. Which diagonal is
/// better cannot be predicted, so both are treated alike.
#[inline(always)]
fn two_triangles(writer: &mut TriangleWriter, sites: &[Site], [sw, se, ne, nw]: [VertexIndex; 4]) -> [ClosedEdge; 4] {
    let [a, b, c, d] = [sw.site(sites), se.site(sites), ne.site(sites), nw.site(sites)];
    let ac = seems_delaunay(a, b, c, d);
    let t = writer.push([sw, se, select_unpredictable(ac, ne, nw)], [UNUSED; 3]);
    let u = writer.push([select_unpredictable(ac, sw, se), ne, nw], [UNUSED; 3]);
    writer.link(select_unpredictable(ac, t.side(2), t.side(1)), select_unpredictable(ac, u, u.side(2)));
    let (east, west) = (select_unpredictable(ac, t.side(1), u), select_unpredictable(ac, u.side(2), t.side(2)));
    [t, east, u.side(1), west]
}

/// Returns a word of 64 bits, in which bit i says whether `a[i] != b[i]`.
#[inline(always)]
fn differences(a: &[VertexIndex], b: &[VertexIndex]) -> u64 {
    let mut bytes = [0u8; 64];
    for ((byte, a), b) in bytes.iter_mut().zip(a).zip(b) {
        *byte = (a != b) as u8;
    }
    // The product gathers the low bits of eight bytes in one byte.
    let gather = |eight: [u8; 8]| u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    bytes.as_chunks::<8>().0.iter().rev().fold(0, |bits, &eight| bits << 8 | gather(eight))
}
