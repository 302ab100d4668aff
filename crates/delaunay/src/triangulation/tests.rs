//! The pipeline, and divide and conquer, against the reference on random sites of every kind that is known to be hard.

use crate::Result;
use crate::geometry::Site;
use crate::mesh::flip::fails;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::triangulation::{divide_and_conquer, reference};
use crate::voronoi::test_cases::{KINDS, Random, case};
use crate::voronoi::{PipelineBuffers, triangulate};
use std::collections::{BTreeMap, BTreeSet};

/// Returns the set of triangles, each from its least corner.
fn triangles(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    mesh.corners().iter().map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()).collect()
}

#[test]
fn random_cases_are_canonical_or_rejected() {
    let cases = std::env::var("GDT_CASES").ok().and_then(|s| s.parse().ok()).unwrap_or(2000);
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut buffers = PipelineBuffers::default();
    let mut rejected: BTreeMap<(&str, String), usize> = BTreeMap::new();
    let mut refused = 0;
    for i in 0..cases {
        let kind = KINDS[i % KINDS.len()];
        let n = 3 + (2000.0f64.powf(random.unit()) - 1.0) as usize;
        let sites = case(kind, n, &mut random);
        let expected = triangles(&reference::triangulate(&sites).unwrap());
        let divided = divide_and_conquer::triangulate(&sites).unwrap();
        assert_eq!(triangles(&divided), expected, "divide and conquer, case {i}, {kind}: {sites:?}");
        match triangulate(&sites, &mut buffers) {
            Ok((mesh, _)) => assert_eq!(triangles(&mesh), expected, "case {i}, {kind}: {sites:?}"),
            Err(why) => {
                refused += (kind == "uniform" && sites.len() >= 1000) as usize;
                *rejected.entry((kind, why.to_string())).or_default() += 1;
            }
        }
    }
    eprintln!("of {} cases of each kind, rejected: {rejected:#?}", cases / KINDS.len());
    assert_eq!(refused, 0, "large uniform cases were rejected");
}

type Triangulate = fn(&[Site]) -> Result<HalfEdgeMesh>;

/// What triangulates besides the pipeline.
const OTHERS: [Triangulate; 2] = [reference::triangulate, divide_and_conquer::triangulate];

#[test]
fn no_edge_fails_among_cocircular_sites() {
    let circle: Vec<Site> = (-65..=65)
        .flat_map(|x: i32| (-65..=65).map(move |y: i32| [x, y]))
        .filter(|[x, y]| x * x + y * y == 65 * 65)
        .collect();
    for triangulate in OTHERS {
        let mesh = triangulate(&circle).unwrap();
        assert_eq!(mesh.triangles.len(), circle.len() - 2);
        assert!(mesh.half_edges().all(|h| !fails(&mesh, &circle, h)));
    }
}

#[test]
fn sites_on_a_line_make_no_triangle() {
    let vertical: Vec<Site> = (0..100).map(|i| [7, 3 * i]).collect();
    for triangulate in OTHERS {
        for line in [&[][..], &[[3, 4]], &[[0, 0], [1, 1], [5, 5]], &vertical] {
            assert!(triangulate(line).unwrap().triangles.is_empty());
        }
    }
}

/// Parts are halved along both axes here, and most of their hulls have sites in line.
#[test]
fn strips_along_borders_are_canonical() {
    let is_near = |v: i32, gap: i32| v.rem_euclid(40).min(40 - v.rem_euclid(40)) < gap;
    let square = |size: i32| (0..size).flat_map(move |x| (0..size).map(move |y| [x, y]));
    for gap in 1..4 {
        let strips: Vec<Site> = square(81).filter(|p| p.iter().any(|&v| is_near(v, gap))).collect();
        for [x, y] in [[1, 1], [1, 50], [50, 1], [-3, 2]] {
            let sites: Vec<Site> = strips.iter().map(|p| [p[0] * x, p[1] * y]).collect();
            let [expected, divided] = OTHERS.map(|triangulate| triangles(&triangulate(&sites).unwrap()));
            assert_eq!(divided, expected, "{gap} {x} {y}");
        }
    }
}
