//! What can be checked in one part (one mesh of a tile) alone, and what it leaves to be matched with others.

use bytemuck::cast_slice;
use xxhash_rust::xxh3::xxh3_64;

use crate::geometry::Site;
use crate::output::gltf::read::Part;
use crate::verify::digest::Digest;
use crate::verify::exact::{EdgeState, double_area, edge_state, side};
use crate::verify::rim::{RimEdge, RimVertex};
use crate::verify::source::Source;
use crate::verify::verdict::{Fault, Faults};

/// The sum of what was found in many parts.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub(super) faults: Faults,
    pub(super) triangles: u64,
    /// Those of them that are left out of the terrain.
    pub(super) cut: u64,
    /// Vertices that are on no one-sided edge.
    pub(super) inner_sites: u64,
    /// Edges with both triangles in one part.
    pub(super) inner_edges: u64,
    /// Edges whose four corners lie on one circle.
    pub(super) ties: u64,
    /// Twice the area, square lattice steps.
    pub(super) area: i128,
    pub(super) digest: Digest,
}

impl Findings {
    pub(super) fn merge(mut self, other: Findings) -> Findings {
        self.faults.merge(other.faults);
        Findings {
            faults: self.faults,
            triangles: self.triangles + other.triangles,
            cut: self.cut + other.cut,
            inner_sites: self.inner_sites + other.inner_sites,
            inner_edges: self.inner_edges + other.inner_edges,
            ties: self.ties + other.ties,
            area: self.area + other.area,
            digest: self.digest.join(other.digest),
        }
    }
}

/// What other parts have to be asked about.
#[derive(Default)]
pub(super) struct Records {
    pub(super) edges: Vec<RimEdge>,
    pub(super) vertices: Vec<RimVertex>,
}

/// Checks `part` of tile number `tile`.
pub(super) fn check(part: &Part, tile: u32, source: &Source, findings: &mut Findings) -> Records {
    let Some(points) = lattice_points(part, tile, source, findings) else { return Records::default() };
    let sites: Vec<Site> = points.iter().map(|p| [p[0], p[1]]).collect();
    check_triangles(part, &points, &sites, tile, source, findings);
    let mut star = Star::new(&part.triangles, sites.len());
    check_edges(&mut star, &sites, tile, source, findings);
    let records = one_sided(&star, part, &sites, tile);
    let unused = (0..sites.len()).filter(|&v| star.degree(v) == 0).map(|v| source.site_text(sites[v]));
    let mut unused_count = 0;
    for site in unused {
        unused_count += 1;
        findings.faults.note(Fault::Unused, tile, || site);
    }
    findings.inner_sites += sites.len() as u64 - unused_count - records.vertices.len() as u64;
    records
}

/// The lattice integers of the vertices; `None` where some are not on the lattice.
fn lattice_points(part: &Part, tile: u32, source: &Source, findings: &mut Findings) -> Option<Vec<[i32; 3]>> {
    let mut points = Vec::with_capacity(part.positions.len());
    let plain = part.scale == [1.0; 3];
    for v in 0..part.positions.len() {
        let world = part.world(v);
        let point = if plain { source.integers(world) } else { source.integers_on(world, part.scale) };
        match point {
            Some(point) => points.push(point),
            None => findings.faults.note(Fault::OffLattice, tile, || format!("{world:?} m")),
        }
    }
    (points.len() == part.positions.len()).then_some(points)
}

fn check_triangles(
    part: &Part,
    points: &[[i32; 3]],
    sites: &[Site],
    tile: u32,
    source: &Source,
    findings: &mut Findings,
) {
    let coordinates: Vec<[f64; 3]> = points.iter().map(|&p| source.coordinates(p)).collect();
    for &triangle in &part.triangles {
        let [a, b, c] = triangle.map(|v| sites[v as usize]);
        if side(a, b, c).is_le() {
            let corners = [a, b, c].map(|site| source.site_text(site)).join(" ");
            findings.faults.note(Fault::NotCounterclockwise, tile, || corners);
        }
        findings.area += double_area(a, b, c);
        findings.digest.add(triangle.map(|v| coordinates[v as usize]));
    }
    findings.triangles += part.triangles.len() as u64;
}

/// Half-edges by the vertex where they start.
struct Star {
    /// The half-edges of vertex v are `out[start[v]..start[v + 1]]`.
    start: Vec<u32>,
    out: Vec<Spoke>,
}

/// A half-edge seen from where it starts.
#[derive(Clone, Copy, Default)]
struct Spoke {
    /// Where it ends.
    to: u32,
    /// The third corner of its triangle; [`MATCHED`] once the half-edge in the other direction is found.
    apex: u32,
}

/// The highest bit of [`Spoke::apex`]; a file has fewer vertices.
const MATCHED: u32 = 1 << 31;

impl Star {
    fn new(triangles: &[[u32; 3]], vertices: usize) -> Star {
        // One place further than needed: filling moves every start to the next one's place.
        let mut start = vec![0u32; vertices + 2];
        for &v in triangles.as_flattened() {
            start[v as usize + 2] += 1;
        }
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let mut out = vec![Spoke::default(); 3 * triangles.len()];
        for &[a, b, c] in triangles {
            for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
                let place = &mut start[from as usize + 1];
                out[*place as usize] = Spoke { to, apex };
                *place += 1;
            }
        }
        Star { start, out }
    }

    fn range(&self, v: usize) -> std::ops::Range<usize> {
        self.start[v] as usize..self.start[v + 1] as usize
    }

    fn degree(&self, v: usize) -> usize {
        self.range(v).len()
    }

    /// Marks the unmatched half-edge from `from` to `to` as matched; its apex.
    #[inline(always)]
    fn take(&mut self, from: usize, to: u32) -> Option<u32> {
        let range = self.range(from);
        let spoke = self.out[range].iter_mut().find(|s| s.to == to && s.apex & MATCHED == 0)?;
        let apex = spoke.apex;
        spoke.apex |= MATCHED;
        Some(apex)
    }
}

/// Matches the half-edges within the part and checks the edges between them. What stays unmatched, doubles among it, is
/// matched with those of other parts.
fn check_edges(star: &mut Star, sites: &[Site], tile: u32, source: &Source, findings: &mut Findings) {
    for from in 0..sites.len() {
        let degree = star.degree(from);
        for i in star.range(from) {
            let Spoke { to, apex } = star.out[i];
            // Only towards the vertex with fewer edges, which bounds the search even round a hub of thousands.
            if (star.degree(to as usize), to as usize) >= (degree, from) || apex & MATCHED != 0 {
                continue;
            }
            let Some(opposite) = star.take(to as usize, from as u32) else { continue };
            star.out[i].apex |= MATCHED;
            findings.inner_edges += 1;
            // The triangles (to, apex, from) and (to, from, opposite).
            let [a, b, c, d] = [to, apex, from as u32, opposite].map(|v| sites[v as usize]);
            match edge_state(a, b, c, d) {
                EdgeState::Delaunay => {}
                EdgeState::Tie => findings.ties += 1,
                EdgeState::NotDelaunay => findings.faults.note(Fault::NotDelaunay, tile, || edge_text(source, a, c)),
            }
        }
    }
}

pub(super) fn edge_text(source: &Source, a: Site, b: Site) -> String {
    format!("{} to {}", source.site_text(a), source.site_text(b))
}

/// The half-edges that stayed unmatched, and their ends.
fn one_sided(star: &Star, part: &Part, sites: &[Site], tile: u32) -> Records {
    let mut records = Records::default();
    let mut on_rim = vec![false; sites.len()];
    for from in 0..sites.len() {
        for spoke in star.out[star.range(from)].iter().filter(|s| s.apex & MATCHED == 0) {
            let [to, apex] = [spoke.to, spoke.apex].map(|v| sites[v as usize]);
            records.edges.push(RimEdge::new(sites[from], to, apex, tile));
            on_rim[from] = true;
            on_rim[spoke.to as usize] = true;
        }
    }
    let rim = (0..sites.len()).filter(|&v| on_rim[v]);
    records.vertices = rim.map(|v| fingerprint(part, v, sites[v], tile)).collect();
    records
}

/// The bits of a vertex that have to be the same in every part.
fn fingerprint(part: &Part, v: usize, site: Site, tile: u32) -> RimVertex {
    let position = xxh3_64(cast_slice(&part.world(v).map(f64::to_bits)));
    let normal = part.normals.as_ref().map_or([0; 3], |n| n[v].map(f32::to_bits));
    let color = part.colors.as_ref().map_or([0; 4], |c| c[v]);
    let mut shading = [0; 20];
    shading[..12].copy_from_slice(cast_slice(&normal));
    shading[12..].copy_from_slice(cast_slice(&color));
    RimVertex { site, position, shading: xxh3_64(&shading), tile, unshaded: 0 }
}
