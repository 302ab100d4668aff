//! The pipeline on its own: textures, rejections and labels.

use crate::geometry::REACH;
use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::voronoi::counts::PipelineCounts;
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g2_voronoi::LabelRows;
use crate::voronoi::index::VertexIndex;
use crate::voronoi::rejection::Rejection;
use crate::voronoi::test_cases::{Random, case};
use crate::voronoi::texture_request::{TextureRequest, TextureResolution};
use crate::voronoi::{PipelineBuffers, triangulate};
use std::collections::BTreeSet;

/// Returns the set of triangles, each from its least corner.
fn triangles(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    mesh.corners().iter().map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()).collect()
}

#[test]
fn the_mesh_is_the_same_with_any_texture() {
    let mut random = Random(7);
    let sites: Vec<Site> = (0..5000).map(|i| [200 * i, random.below(1 << 20)]).collect();
    let expected = triangles(&triangulate(&sites, &mut PipelineBuffers::default()).unwrap().0);
    let mut missing = Vec::new();
    for side in [80, 300, 1000] {
        let request = TextureRequest { resolution: TextureResolution::Side(side), ..TextureRequest::default() };
        let (mesh, counts) = triangulate(&sites, &mut PipelineBuffers::with_texture(request)).unwrap();
        assert!(triangles(&mesh) == expected, "{side}");
        missing.push(counts.missing);
    }
    assert!(missing.is_sorted_by(|finer, coarser| finer > coarser), "{missing:?}");
}

#[test]
fn uniform_sites_are_never_rejected() {
    let mut random = Random(42);
    let mut buffers = PipelineBuffers::default();
    for n in [1000, 3000, 10_000, 30_000] {
        for side in [1 << 10, 1 << 20, 1 << 28] {
            let mut sites: Vec<Site> = (0..n).map(|_| [random.below(side), random.below(side / 3)]).collect();
            sites.sort_unstable();
            sites.dedup();
            let (_, counts) = triangulate(&sites, &mut buffers).unwrap();
            eprintln!("{counts:?}");
        }
    }
}

/// In square pixels, nearly all sites of a spot would share a few.
#[test]
fn a_leaf_with_dense_spots_is_accepted() {
    let mut random = Random(3);
    let spots: Vec<Site> = (0..3).map(|_| [random.below(1 << 25), random.below(1 << 25)]).collect();
    let mut offset = || (0..4).map(|_| random.below(1 << 18)).sum::<i32>();
    let sites: BTreeSet<Site> = (0..20_000).map(|i| spots[i % 3].map(|c| c + offset())).collect();
    let sites: Vec<Site> = sites.into_iter().collect();
    let (_, counts) = triangulate(&sites, &mut PipelineBuffers::default()).unwrap();
    assert!(counts.missing < counts.sites / 3, "{counts:?}");
}

/// Every site of a raster has a pixel of its own, whatever the length of the rows has in common with the number of sites that are looked at.
#[test]
fn sites_of_a_raster_keep_their_pixels() {
    for side in [40, 100, 120, 128, 150, 200, 216, 300] {
        let sites: Vec<Site> = (0..side * side).map(|i| [i % side * 100, i / side * 100]).collect();
        let (_, counts) = triangulate(&sites, &mut PipelineBuffers::default()).unwrap();
        assert_eq!((counts.missing, counts.moved), (0, 0), "{side}: {counts:?}");
    }
}

/// Between two sites far out on a circle a region is thin and falls apart. Its pieces lie within pieces of the next region.
#[test]
fn islands_within_islands_are_removed() {
    let mut random = Random(11);
    let mut buffers = PipelineBuffers::default();
    let mut islands = 0;
    for round in 0..400 {
        let sites = case("circle", 100 + 3 * round, &mut random);
        match triangulate(&sites, &mut buffers) {
            Ok((_, counts)) => islands += counts.islands,
            Err(why) => assert_eq!(why, Rejection::Crowded, "{sites:?}"),
        }
    }
    assert!(islands > 50, "{islands}");
}

#[test]
fn sites_without_a_triangle_are_rejected() {
    let mut buffers = PipelineBuffers::default();
    assert_eq!(triangulate(&[[0, 0], [1, 1]], &mut buffers).unwrap_err(), Rejection::TooFew);
    let line: Vec<Site> = (0..1000).map(|i| [3 * i, 7 * i]).collect();
    assert!(triangulate(&line, &mut buffers).is_err());
    let twice = [[0, 0], [10, 0], [0, 10], [0, 0]];
    assert!(triangulate(&twice, &mut buffers).is_err());
    for far in [i32::MAX, i32::MIN, REACH + 1, -REACH - 1] {
        assert_eq!(triangulate(&[[0, 0], [far, 0], [0, 10]], &mut buffers).unwrap_err(), Rejection::OutOfReach);
    }
}

/// Nearly all sites of a narrow parabola are on the hull of the discrete mesh, and most of them must leave it. To walk around the hull for
/// each would take quadratic time: here billions of steps.
#[test]
fn c1_gives_up_where_looking_for_vertices_would_take_quadratic_time() {
    const COUNT: i64 = 100_000;
    let place = |i: i64| [2 * i - COUNT, (2 * i - COUNT).pow(2) / 200].map(|c| c as i32);
    let sites: Vec<Site> = (0..COUNT).map(place).collect();
    let rejection = triangulate(&sites, &mut PipelineBuffers::default()).unwrap_err();
    assert_eq!(rejection, Rejection::NotAccepted("too many vertices must leave the hull"));
}

#[test]
fn labels_are_the_pixels_of_the_nearest_sites() {
    let mut random = Random(5);
    for n in [1, 2, 3, 10, 100, 1000] {
        for [wide, high] in [[300, 300], [1, 900], [900, 1], [70, 2000]] {
            // In some textures one half is empty, so that some labels are far away.
            let part = 1 + random.below(2);
            let sites: Vec<Site> = (0..n).map(|_| [random.below(wide) / part, random.below(high)]).collect();
            let ends = [[0, 0], [wide - 1, high - 1]];
            check_labels(&[&sites[..], &ends].concat());
        }
    }
}

/// Compares the rows of labels with the distances to all sites.
fn check_labels(sites: &[Site]) {
    let (mut texture, mut rows) = (SiteTexture::default(), LabelRows::default());
    // It does not matter here whether too many sites are missing.
    let _ = texture.write(sites, &TextureRequest::default(), &mut PipelineCounts::default());
    let occupied = |x: usize, y: usize| texture.occupied[y * texture.words + x / 64] >> (x % 64) & 1 != 0;
    let pixels = (0..texture.width).flat_map(|x| (0..texture.height).map(move |y| (x, y)));
    let placed: Vec<(usize, usize)> = pixels.filter(|&(x, y)| occupied(x, y)).collect();
    rows.start(&texture);
    let mut labels = vec![VertexIndex::NONE; texture.width + 2];
    for y in 0..texture.height {
        rows.row(&texture, y, &mut labels);
        for x in 0..texture.width {
            let key = |&(sx, sy): &(usize, usize)| (sx.abs_diff(x).pow(2) + sy.abs_diff(y).pow(2), sx, sy);
            let (_, sx, sy) = placed.iter().map(key).min().unwrap();
            assert_eq!(labels[x + 1], texture.vertices[64 * texture.words * sy + sx], "pixel ({x}, {y}) of {sites:?}");
        }
    }
}
