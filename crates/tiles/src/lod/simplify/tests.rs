//! Tests that simplified terrains cover the ground of the original and are no further from it than they say.

use proptest::prelude::*;

use crate::frame::Frame;
use crate::lod::simplify::{Terrain, simplify};
use crate::tile::Tile;
use breaklines::{BreaklineOptions, Breaklines, Feature, FeatureId, FeatureKind, Vertex};
use delaunay::geometry::predicates::orient2d;
use delaunay::triangulation::reference::triangulate;
use lattice::{Lattice, shortest_decimal};

/// A frame whose steps are metres.
fn frame() -> Frame {
    let decimal = |v: f64| shortest_decimal(v).unwrap();
    let lattice = Lattice { offset: [decimal(0.0); 3], resolution: decimal(1.0), resolution_z: decimal(1.0) };
    Frame::new(&lattice, 1.0, 1.0, None).unwrap()
}

fn terrain(mut points: Vec<[i32; 3]>) -> Tile {
    points.sort_unstable();
    points.dedup_by_key(|p| [p[0], p[1]]);
    let sites: Vec<[i32; 2]> = points.iter().map(|p| [p[0], p[1]]).collect();
    Tile { triangles: triangulate(&sites).unwrap().corners().to_vec(), positions: points, ..Tile::default() }
}

/// Simplifies a terrain; returns the result and the greatest error.
fn simplified(tile: &Tile, triangles: usize, lines: Option<&Breaklines>) -> (Tile, f64) {
    let terrain = Terrain { positions: &tile.positions, triangles: &tile.triangles, may_be_on_boundary: None };
    let simple = simplify(&frame(), &terrain, triangles, lines).unwrap();
    (Tile::of(&simple.mesh.positions, simple.mesh.triangles), simple.greatest_error)
}

/// Returns twice the area, and asserts that all triangles are counterclockwise.
fn area(tile: &Tile) -> i64 {
    let areas = tile.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| tile.positions[v as usize]).map(|p| [p[0], p[1]]);
        orient2d(a, b, c)
    });
    areas.inspect(|&area| assert!(area > 0)).sum()
}

/// Returns the height of `tile` at a place, or `None` outside.
fn height(tile: &Tile, place: [f64; 2]) -> Option<f64> {
    tile.triangles.iter().find_map(|t| {
        let corners = t.map(|v| tile.positions[v as usize].map(f64::from));
        let side =
            |a: [f64; 3], b: [f64; 3]| (a[0] - place[0]) * (b[1] - place[1]) - (b[0] - place[0]) * (a[1] - place[1]);
        let weights = [side(corners[1], corners[2]), side(corners[2], corners[0]), side(corners[0], corners[1])];
        let total: f64 = weights.iter().sum();
        weights.iter().all(|&w| w >= 0.0).then(|| (0..3).map(|i| weights[i] * corners[i][2]).sum::<f64>() / total)
    })
}

#[test]
fn a_plane_keeps_its_boundary_and_has_no_error() {
    let plane = terrain((0..400).map(|i| [i % 20 * 10, i / 20 * 10, i % 20 * 3 + i / 20 * 7]).collect());
    let (simple, greatest_error) = simplified(&plane, 1, None);
    assert!(greatest_error < 1e-8, "{greatest_error}");
    assert_eq!(area(&simple), area(&plane));
    // The 76 vertices of the boundary, and the triangles between them.
    assert_eq!((simple.positions.len(), simple.triangles.len()), (76, 74));
}

#[test]
fn a_tile_without_inner_vertices_stays_as_it_is() {
    let fan = terrain(vec![[0, 0, 5], [9, 0, 5], [0, 9, 1]]);
    assert_eq!(simplified(&fan, 1, None), (fan, 0.0));
}

/// A field of points every 10 steps with a line through it, as a job makes it: near the line points are dropped.
fn field_with_line() -> (Tile, Breaklines) {
    let vertex = |place| Vertex { place, z: Some(500) };
    let path = vec![vertex([95, 333]), vertex([640, 407]), vertex([1105, 790])];
    let id = FeatureId { file: 0, feature: 0 };
    let feature = Feature { kind: FeatureKind::Line, id, paths: vec![path] };
    let (lines, _) = Breaklines::build(&[feature], &BreaklineOptions::new(10, None)).unwrap();
    let points = (0..120 * 120).map(|i| [i % 120 * 10 + i % 7, i / 120 * 10 + i % 5, 495 + i % 11]);
    let sites = lines.sites().iter().map(|site| [site.place[0], site.place[1], 500]);
    (terrain(points.filter(|p| !lines.drops([p[0], p[1]])).chain(sites).collect()), lines)
}

/// Returns the vertices of the line at its height, and whether the ones that follow each other along it are joined by edges.
fn line_in(tile: &Tile, lines: &Breaklines) -> (usize, bool) {
    let on_line = |p: &[i32; 3]| p[2] == 500 && lines.rank([p[0], p[1]]).is_some();
    let mut line: Vec<u32> = (0..).zip(&tile.positions).filter(|(_, p)| on_line(p)).map(|(v, _)| v).collect();
    line.sort_unstable_by_key(|&v| tile.positions[v as usize][0]);
    let joined = |pair: &[u32]| tile.triangles.iter().any(|t| pair.iter().all(|v| t.contains(v)));
    (line.len(), line.windows(2).all(joined))
}

#[test]
fn breaklines_keep_their_vertices_and_stay_edges() {
    let (tile, lines) = field_with_line();
    let all = lines.sites().len();
    assert_eq!(line_in(&tile, &lines), (all, true));
    let simple = |share: usize| simplified(&tile, tile.triangles.len() / share, Some(&lines)).0;
    assert_eq!(line_in(&simple(5), &lines), (all, true), "there is room for all");
    let (some, joined) = line_in(&simple(200), &lines);
    assert!(joined && (all / 12..all / 2).contains(&some), "{some} of {all}");
    assert_eq!(area(&simple(200)), area(&tile));
    let (without, _) = line_in(&simplified(&tile, tile.triangles.len() / 5, None).0, &lines);
    assert!(without < all / 2, "{without}: this test would prove nothing");
}

proptest! {
    #[test]
    fn simplified_terrains_cover_the_same_ground_within_their_error(
        points in prop::collection::vec([-40i32..40, -40i32..40, 0i32..60], 8..200),
        share in 2usize..8,
        places in prop::collection::vec([-40.0f64..40.0, -40.0f64..40.0], 40),
    ) {
        let tile = terrain(points);
        prop_assume!(!tile.triangles.is_empty());
        let (simple, greatest_error) = simplified(&tile, tile.triangles.len() / share, None);
        prop_assert_eq!(area(&simple), area(&tile));
        prop_assert!(simple.triangles.len() <= tile.triangles.len());
        let mut greatest = 0.0f64;
        for place in places {
            if let (Some(fine), Some(coarse)) = (height(&tile, place), height(&simple, place)) {
                greatest = greatest.max((fine - coarse).abs());
            }
        }
        prop_assert!(greatest <= greatest_error + 1e-9, "{} of {}", greatest, greatest_error);
        // The error is measured, not bounded by the range of all heights.
        let vertices = tile.positions.iter().filter_map(|p| {
            Some((height(&simple, [p[0] as f64, p[1] as f64])? - p[2] as f64).abs())
        });
        let at_vertices = vertices.fold(0.0, f64::max);
        prop_assert!(greatest_error == 0.0 || greatest_error < 60.0 || at_vertices > 0.0);
    }
}
