//! Step G3: islands. A thin Voronoi region can fall apart into pixels that do not touch. Each piece then looks like a region of its
//! own, and the scan makes a second fan of triangles around the same site in another place.
//!
//! The paper recolours such pixels before it looks for corners. Here they are rare, so the surplus fan is removed from the mesh. The
//! result is the same as if its pixels had taken the colours around them. The site lies outside its island, so some triangle of the
//! surplus fan is not counterclockwise: only fans with such triangles are examined.

use crate::geometry::Site;
use crate::voronoi::c2_shift::{ShiftRepair, is_inverted};
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::counts::PipelineCounts;
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;
use std::cmp::Reverse;

/// Fans with as many triangles as this are not followed.
const MAX_TRIANGLES: usize = 64;

/// Buffers of the search.
#[derive(Default)]
pub(super) struct IslandSearch {
    /// The number of triangles that have a vertex as a corner, by vertex.
    degrees: Vec<u32>,
    fans: Vec<TriangleFan>,
}

/// A closed fan of triangles around a vertex that has several fans. The least fan is most likely the one that contains the site.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct TriangleFan {
    vertex: VertexIndex,
    /// The number of triangles that are not counterclockwise.
    inverted: usize,
    degree: Reverse<usize>,
    /// The least half-edge that starts at the vertex.
    outgoing: ClosedEdge,
}

impl IslandSearch {
    /// Removes all surplus fans. A sphere of `v` vertices has `2 v - 4` triangles, and every island adds two.
    pub(super) fn remove(
        &mut self,
        mesh: &mut ClosedMesh,
        sites: &[Site],
        placed: usize,
        shift: &mut ShiftRepair,
        counts: &mut PipelineCounts,
    ) -> Result<(), Rejection> {
        // No vertex has been removed yet.
        let mut expected = 2 * placed - 2;
        if mesh.len() > expected {
            self.count_degrees(mesh, sites.len());
        }
        self.fans.clear();
        // After the first round, only what is new is looked at, and what was found before.
        let mut seen = 0;
        while mesh.len() > expected {
            let (before, is_whole) = (mesh.len(), seen == 0);
            self.find_fans(mesh, sites, &shift.inverted[seen..]);
            seen = shift.inverted.len();
            self.remove_apart(mesh, sites, shift, counts);
            expected = 2 * (placed - shift.removed.len()) - 2;
            if mesh.len() == before {
                if is_whole {
                    return Err(Rejection::NotAccepted("an island could not be removed"));
                }
                // A fan that was too large to follow may have become smaller.
                seen = 0;
            }
        }
        match mesh.len() == expected {
            true => Ok(()),
            false => Err(Rejection::NotAccepted("the discrete Voronoi diagram is not a sphere")),
        }
    }

    /// Removes the surplus fans that contain no other fan. An island may lie within an island, and so may a whole region.
    fn remove_apart(
        &mut self,
        mesh: &mut ClosedMesh,
        sites: &[Site],
        shift: &mut ShiftRepair,
        counts: &mut PipelineCounts,
    ) {
        let fans = std::mem::take(&mut self.fans);
        let mut changes = DegreeChanges::default();
        for fans in fans.chunk_by(|a, b| a.vertex == b.vertex) {
            // If every fan of the vertex is listed, the first is the best and stays.
            let listed: usize = fans.iter().map(|fan| fan.degree.0).sum();
            let all = listed == self.degrees[fans[0].vertex.get()] as usize;
            for found in &fans[all as usize..] {
                // A neighbouring fan may have been removed, and this one with it.
                if fan(mesh, sites, found.outgoing).as_ref() != Some(found) {
                    continue;
                }
                let h = found.outgoing;
                if changes.note(mesh, shift, h, |mesh, shift| shift.remove_island(mesh, sites, h)) {
                    counts.islands += 1;
                } else if let Some(h) = self.enclosed(mesh, found) {
                    changes.note(mesh, shift, h, |mesh, shift| shift.remove(mesh, sites, h, true));
                }
            }
        }
        changes.apply(&mut self.degrees);
        self.fans = fans;
        #[cfg(test)]
        self.check_degrees(mesh, sites);
    }

    /// Checks the degrees of all finite vertices.
    #[cfg(test)]
    fn check_degrees(&self, mesh: &ClosedMesh, sites: &[Site]) {
        let mut again = IslandSearch::default();
        again.count_degrees(mesh, sites.len());
        let infinity = mesh.infinity().get();
        assert!(self.degrees[..infinity] == again.degrees[..infinity], "{sites:?}");
    }

    /// Returns a half-edge that starts at a vertex whose only triangles are two of `fan`.
    fn enclosed(&self, mesh: &ClosedMesh, fan: &TriangleFan) -> Option<ClosedEdge> {
        let mut behind = around(mesh, fan.outgoing).map(|outgoing| mesh.twin(outgoing.next()));
        behind.find(|&h| mesh.origin(h) != mesh.infinity() && self.degrees[mesh.origin(h).get()] == 2)
    }

    fn count_degrees(&mut self, mesh: &ClosedMesh, sites: usize) {
        self.degrees.clear();
        self.degrees.resize(sites, 0);
        for record in mesh.records()[mesh.front().get()..].as_chunks::<8>().0 {
            for &vertex in &record[..3] {
                self.degrees[vertex as usize] += 1;
            }
        }
    }

    /// Lists the fans that have one of the `inverted` triangles, or were listed before, and are not the only fan of their vertex.
    fn find_fans(&mut self, mesh: &ClosedMesh, sites: &[Site], inverted: &[ClosedEdge]) {
        // Another triangle may have taken the record of one that is gone.
        let before = std::mem::take(&mut self.fans).into_iter();
        let before = before.filter(|fan| mesh.origin(fan.outgoing) == fan.vertex).map(|fan| fan.outgoing);
        for h in before.chain(inverted.iter().flat_map(|t| t.sides())).filter(|&h| !mesh.is_free(h)) {
            // Nearly all fans are the only one.
            if around(mesh, h).count() < self.degrees[mesh.origin(h).get()] as usize {
                self.fans.extend(fan(mesh, sites, h).filter(|fan| fan.inverted > 0));
            }
        }
        self.fans.sort_unstable();
        self.fans.dedup();
    }
}

/// How the degrees of vertices change while fans are removed.
#[derive(Default)]
struct DegreeChanges {
    /// The corners of triangles that are gone.
    gone: Vec<[VertexIndex; 3]>,
    /// The corners of those that have taken their place.
    new: Vec<[VertexIndex; 3]>,
}

impl DegreeChanges {
    /// Notes what changes if `remove` removes the fan around the origin of `h`; returns whether it does.
    fn note(
        &mut self,
        mesh: &mut ClosedMesh,
        shift: &mut ShiftRepair,
        h: ClosedEdge,
        remove: impl FnOnce(&mut ClosedMesh, &mut ShiftRepair) -> bool,
    ) -> bool {
        let (gone, first) = (self.gone.len(), shift.suspects.len());
        self.gone.extend(around(mesh, h).filter_map(|outgoing| mesh.corners(outgoing)));
        let removed = remove(mesh, shift);
        if !removed {
            self.gone.truncate(gone);
        }
        // Three sides of each new triangle, and then the seam.
        let (new, _) = shift.suspects[first..].as_chunks::<3>();
        self.new.extend(new.iter().filter_map(|sides| mesh.corners(sides[0])));
        removed
    }

    fn apply(self, degrees: &mut [u32]) {
        // First what is new: some of it is gone again.
        for vertex in self.new.into_iter().flatten() {
            degrees[vertex.get()] += 1;
        }
        for vertex in self.gone.into_iter().flatten() {
            degrees[vertex.get()] -= 1;
        }
    }
}

/// Returns the half-edges that start where `h` starts, `h` first, but not more than [`MAX_TRIANGLES`].
fn around(mesh: &ClosedMesh, h: ClosedEdge) -> impl Iterator<Item = ClosedEdge> {
    let turn = move |outgoing: &ClosedEdge| Some(mesh.twin(outgoing.previous())).filter(|&next| next != h);
    std::iter::successors(Some(h), turn).take(MAX_TRIANGLES)
}

/// Returns the fan around the origin of `h`, if the triangle of `h` still exists and the fan is small.
fn fan(mesh: &ClosedMesh, sites: &[Site], h: ClosedEdge) -> Option<TriangleFan> {
    if mesh.is_free(h) {
        return None;
    }
    let mut fan = TriangleFan { vertex: mesh.origin(h), inverted: 0, degree: Reverse(0), outgoing: h };
    for outgoing in around(mesh, h) {
        fan.inverted += is_inverted(mesh, sites, outgoing) as usize;
        fan.degree.0 += 1;
        fan.outgoing = fan.outgoing.min(outgoing);
    }
    (fan.degree.0 < MAX_TRIANGLES).then_some(fan)
}
