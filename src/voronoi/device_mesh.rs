//! The mesh that a device has made of a leaf: steps G1 to G6, C2's test and most flips of C4. This takes the place of those steps, and
//! what the device has left goes through the others.
//!
//! The device need not be trusted. Here every number is checked that the steps use as an index. After that the records are a closed
//! surface in the sense of `closed_mesh`:
//! - each half-edge has another one as its twin, which has it as its twin, and both have the same two ends;
//! - the corners of a triangle are three different vertices.
//!
//! The steps keep that up whatever the sites are, so they never look at a record without a triangle. Where their work depends on what the
//! device has made, it is counted and bounded. `accept` proves the result.

use crate::geometry::Site;
use crate::geometry::lattice::REACH;
use crate::voronoi::c2_shift::{ShiftRepair, is_inverted};
use crate::voronoi::c3_insert::MissingSite;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::g1_write_sites::MAX_MISSING;
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;

/// If more triangles than one for so many sites are inverted, the leaf is rejected: C2 would take too long.
const SITES_PER_INVERTED: usize = 8;
/// Small leaves may have as many inverted triangles.
const FEW: usize = 64;

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
        let infinity = VertexIndex(n as u32);
        let room = mesh.start_with(8 * records.len(), infinity);
        let mut is_whole = true;
        let mut free = Vec::new();
        for (t, (record, copy)) in (0..).step_by(8).map(ClosedEdge).zip(records.iter().zip(room.as_chunks_mut().0)) {
            *copy = *record;
            if record[0] == VertexIndex::NONE.0 {
                is_whole &= !has_twin(records.as_flattened(), t, record);
                free.push(t);
            } else {
                is_whole &= fits(records.as_flattened(), t, record, infinity);
            }
        }
        free.into_iter().for_each(|t| mesh.note_free(t));
        if is_whole { Ok(()) } else { Err(wrong) }
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

/// Returns whether the triangle `t` of a mesh with `records` has three corners, and twins that fit.
#[inline(always)]
fn fits(records: &[u32], t: ClosedEdge, record: &[u32; 8], infinity: VertexIndex) -> bool {
    let [a, b, c, _, twins @ .., _] = *record;
    let mut fits = (a.max(b).max(c) <= infinity.0) & (a != b) & (b != c) & (c != a);
    for (i, (g, end)) in (0..).zip(twins.into_iter().zip([b, c, a])) {
        // A corner of the neighbour, or the unused number, would be taken for a twin otherwise.
        let there = records.get(g as usize).is_some_and(|&origin| origin == end);
        let back = records.get(g as usize + 4).is_some_and(|&twin| twin == t.0 + i);
        fits &= there & back & (g & 7 < 3);
    }
    fits
}

/// Returns whether some half-edge takes one of the record `t`, which holds no triangle, for its twin, and the other way round.
#[cold]
fn has_twin(records: &[u32], t: ClosedEdge, record: &[u32; 8]) -> bool {
    let links = t.sides().into_iter().zip(&record[4..7]);
    links.into_iter().any(|(h, &g)| records.get(g as usize).is_some() && records.get(g as usize + 4) == Some(&h.0))
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
