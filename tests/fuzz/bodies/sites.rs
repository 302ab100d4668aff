//! The triangulator on sites that provoke ties: coordinates have few bits, so many sites are cocircular or collinear.

use std::collections::BTreeSet;

use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::reference;
use delaunay_gpu::triangulation_options::{Backend, TriangulationOptions};
use delaunay_gpu::triangulator::Triangulator;

use super::judge;

/// The most sites of a case, because judging more is slow.
const MAX_SITES: usize = 1500;

/// Judges the triangulation of the sites in `bytes`. The first byte says how the others become sites: how many bits a coordinate has,
/// how far apart the sites are, and whether they are sheared, which turns squares into parallelograms.
pub(crate) fn sites(bytes: &[u8]) {
    let sites = sites_of(bytes);
    let wanted = TriangulationOptions { backend: Backend::Cpu, ..TriangulationOptions::default() };
    let triangulator = Triangulator::new(&wanted, &delaunay_gpu::options::GpuOptions::default(), 1 << 28)
        .expect("the CPU is always there");
    let (mesh, _) = triangulator.triangulate(&sites).expect("a mesh of distinct sites");
    judge::judge(&sites, &mesh);
    let expected = reference::triangulate(&sites).expect("a mesh of distinct sites");
    assert!(triangles(&mesh) == triangles(&expected), "the pipeline and the reference differ");
}

fn sites_of(bytes: &[u8]) -> Vec<Site> {
    let Some((&choice, bytes)) = bytes.split_first() else { return Vec::new() };
    let (bits, far, shear) = (choice & 7, choice >> 3 & 3, choice >> 5);
    // The farthest site is within `geometry::REACH`, as all sites of a job are.
    let step = [1, 3, 1 << 12, 1 << 19][far as usize];
    let coordinate = |byte: u8| (byte >> (7 - bits)) as i32 - (1 << bits >> 1);
    let site = |pair: &[u8]| {
        let [x, y] = [coordinate(pair[0]), coordinate(pair[1])];
        [step * (x + shear as i32 * y / 2), step * (y - shear as i32 * x / 3)]
    };
    // Sites are distinct and in rows, as in a leaf.
    let distinct: BTreeSet<[i32; 2]> = bytes.chunks_exact(2).take(MAX_SITES).map(site).map(|[x, y]| [y, x]).collect();
    distinct.into_iter().map(|[y, x]| [x, y]).collect()
}

fn triangles(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    let turned = |corners: &[u32; 3]| {
        let least = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
        [0, 1, 2].map(|i| corners[(least + i) % 3])
    };
    mesh.corners().iter().map(turned).collect()
}
