//! The mesh that a device has made of a leaf: steps G1 to G6, C2's test and most flips of C4. This takes the place of those steps, and
//! what the device has left goes through the others.
//!
//! The device need not be trusted. Here every number is checked that the steps use as an index: a corner must be a vertex, a twin a
//! half-edge. The steps write nothing else either, so no index is ever out of bounds. The links between the triangles are left to `accept`,
//! which proves the result. If they are wrong, the steps make nonsense, in a time that is bounded: walks, flips and repairs are counted.

use crate::geometry::REACH;
use crate::geometry::Site;
use crate::voronoi::c2_shift::{ShiftRepair, is_inverted};
use crate::voronoi::c3_insert::MissingSite;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::g1_write_sites::MAX_MISSING;
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;
use multiversion::multiversion;

/// If more triangles than one for so many sites are inverted, the leaf is rejected: C2 would take too long.
const SITES_PER_INVERTED: usize = 8;
/// Small leaves may have as many inverted triangles.
const FEW: usize = 64;
/// So many records are copied at a time.
const PART: usize = 256;

/// What a device returns for a leaf. Sites have the numbers of their positions in the input. The vertex at infinity comes after them.
#[derive(Clone, Copy)]
pub struct DeviceMesh<'a> {
    /// Eight numbers for each triangle: three corners (counterclockwise) and an unused number, three twins and an unused number.
    /// Half-edge `8 t + i` of triangle `t` starts at corner `i`. Ghost triangles join the hull to the vertex at infinity. A record without
    /// a triangle has `u32::MAX` as its first corner.
    pub records: &'a [u32],
    /// A bit for each site, 32 to a number: whether the site is not in the mesh.
    pub missing: &'a [u32],
    /// A bit for each record, 32 to a number: whether its triangle may be inverted, or may have an edge that is not Delaunay. All other
    /// edges between finite triangles are Delaunay.
    pub unfinished: &'a [u32],
    /// The first record of each block of pixels.
    pub block_starts: &'a [u32],
    /// Returns the number of the block that a site belongs to.
    pub block_of: &'a dyn Fn(Site) -> u32,
}

impl<'a> DeviceMesh<'a> {
    /// Copies the triangles to `mesh`, and lists in `shift` what the device has left to do. Returns the number of missing sites.
    pub(super) fn load(
        &self,
        sites: &[Site],
        mesh: &mut ClosedMesh,
        shift: &mut ShiftRepair,
    ) -> Result<usize, Rejection> {
        let n = sites.len() - 1;
        if self.missing.len() < n.div_ceil(32) || self.unfinished.len() < self.records.len().div_ceil(256) {
            return Err(Rejection::NotAccepted("the device's answer is too short"));
        }
        let missing = self.missing_sites(n).count();
        if missing > (MAX_MISSING * n as f64) as usize {
            return Err(Rejection::Crowded);
        }
        self.copy_triangles(n, mesh)?;
        if n - missing < 3 || mesh.len() != 2 * (n - missing) - 2 {
            return Err(Rejection::NotAccepted("the device's mesh is not a sphere"));
        }
        self.list_unfinished(sites, mesh, shift)?;
        Ok(missing)
    }

    /// Copies and checks the records.
    fn copy_triangles(&self, n: usize, mesh: &mut ClosedMesh) -> Result<(), Rejection> {
        let wrong = Rejection::NotAccepted("the device's triangles do not fit");
        let (records, rest) = self.records.as_chunks::<8>();
        let unused = records.iter().rev().take_while(|record| record[0] == VertexIndex::NONE.0).count();
        let records = &records[..records.len() - unused];
        // There are twice as many triangles as sites. Some more records are harmless, if they have none.
        if !rest.is_empty() || records.len() > 4 * n {
            return Err(wrong);
        }
        let limits = Limits { infinity: n as u32, end: 8 * records.len() as u32 };
        let room = mesh.start_with(8 * records.len(), VertexIndex(n as u32)).as_chunks_mut().0;
        let parts = records.chunks(PART).zip(room.chunks_mut(PART));
        let strange = parts.map(|(records, room)| !copy(records, room, limits)).collect::<Vec<bool>>();
        for (part, _) in strange.into_iter().enumerate().filter(|&(_, is_strange)| is_strange) {
            for (t, record) in (0..).step_by(8).map(ClosedEdge).zip(records).skip(part * PART).take(PART) {
                match record[0] == VertexIndex::NONE.0 {
                    true => mesh.isolate(t),
                    false if copy(&[*record], &mut [[0; 8]], limits) => (),
                    false => return Err(wrong),
                }
            }
        }
        Ok(())
    }

    /// Lists the inverted triangles, and the edges that may not be Delaunay.
    fn list_unfinished(&self, sites: &[Site], mesh: &ClosedMesh, shift: &mut ShiftRepair) -> Result<(), Rejection> {
        let unfinished = bits(self.unfinished).map(|t| ClosedEdge(8 * t)).take_while(|&t| t < mesh.end());
        for t in unfinished.filter(|&t| !mesh.is_free(t)) {
            if is_inverted(mesh, sites, t) {
                shift.inverted.push(t);
            }
            shift.suspects.extend(t.sides());
        }
        match shift.inverted.len() > sites.len() / SITES_PER_INVERTED + FEW {
            true => Err(Rejection::NotAccepted("the device has left too many triangles")),
            false => Ok(()),
        }
    }

    /// Returns the numbers of the missing sites among `n`.
    fn missing_sites(&self, n: usize) -> impl Iterator<Item = u32> + use<'a> {
        bits(self.missing).take_while(move |&v| v < n as u32)
    }

    /// Returns the missing ones of `sites`.
    pub(super) fn missing(&self, sites: &'a [Site]) -> impl Iterator<Item = MissingSite> + use<'a> {
        let block_of = self.block_of;
        let missing = self.missing_sites(sites.len());
        missing.map(move |v| MissingSite { vertex: VertexIndex(v), place: block_of(sites[v as usize]) })
    }

    /// Returns a half-edge near a block of pixels, which need not exist.
    pub(super) fn start_near(&self, block: u32) -> ClosedEdge {
        ClosedEdge(self.block_starts.get(block as usize).map_or(0, |&start| start.saturating_mul(8)))
    }
}

/// What the numbers of a record may be.
#[derive(Clone, Copy)]
struct Limits {
    /// The greatest number of a vertex.
    infinity: u32,
    /// The number after the last half-edge.
    end: u32,
}

/// Copies records; returns whether their corners are vertices and their twins half-edges.
#[multiversion(targets("x86_64+avx2"), attrs(inline(never)))]
fn copy(records: &[[u32; 8]], room: &mut [[u32; 8]], limits: Limits) -> bool {
    let (v, h) = (limits.infinity, limits.end - 1);
    // The unused numbers may be anything.
    let greatest = [v, v, v, u32::MAX, h, h, h, u32::MAX];
    let corner = [0, 0, 0, 0, 7, 7, 7, 0];
    let mut strange = [false; 8];
    for (record, room) in records.iter().zip(room) {
        *room = *record;
        for i in 0..8 {
            strange[i] |= (record[i].max(greatest[i]) != greatest[i]) | (record[i] & corner[i] > 2);
        }
    }
    strange == [false; 8]
}

/// Returns the numbers of the bits that are set.
fn bits(words: &[u32]) -> impl Iterator<Item = u32> + use<'_> {
    (0..).zip(words).flat_map(|(i, &word)| {
        let rest = |bits: &u32| Some(bits & (bits - 1)).filter(|&bits| bits != 0);
        let all = std::iter::successors(Some(word).filter(|&word| word != 0), rest);
        all.map(move |bits| 32 * i + bits.trailing_zeros())
    })
}

/// Copies the sites of the input to `vertices`, and adds an entry for the vertex at infinity.
pub(super) fn copy_sites(sites: &[Site], vertices: &mut Vec<Site>) -> Result<(), Rejection> {
    vertices.clear();
    vertices.reserve(sites.len() + 1);
    vertices.extend_from_slice(sites);
    vertices.push([0; 2]);
    let within_reach = |site: &Site| site.iter().all(|c| (-REACH..=REACH).contains(c));
    match sites.iter().all(within_reach) {
        true => Ok(()),
        false => Err(Rejection::OutOfReach),
    }
}
