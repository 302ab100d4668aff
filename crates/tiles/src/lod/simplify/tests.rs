//! Tests that simplified terrains cover the ground of the original, hide its outline, and are no further from it than they say.

use proptest::prelude::*;

use crate::frame::Frame;
use crate::lod::join::Joining;
use crate::lod::simplify::simplify;
use crate::tile::Tile;
use breaklines::{BreaklineOptions, Breaklines, Feature, FeatureId, FeatureKind, Vertex};
use delaunay::geometry::predicates::orient2d;
use delaunay::triangulation::reference::triangulate;
use lattice::{Lattice, shortest_decimal};
use std::collections::{HashMap, HashSet};

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

/// A simplified terrain.
struct Simple {
    /// What viewers get, with its skirts.
    shown: Tile,
    /// What viewers get, without skirts.
    surface: Tile,
    /// The mesh with the whole outline.
    working: Tile,
    greatest_error: f64,
}

fn simplified(tile: &Tile, triangles: usize, lines: Option<&Breaklines>) -> Simple {
    let frame = frame();
    let mut joining = Joining::new(&frame, tile.positions.len());
    joining.add_mesh(tile.clone());
    let joined = joining.finish();
    let simple = simplify(&frame, &joined.terrain(), triangles, lines).unwrap();
    assert!(simple.working_error <= simple.shown_error);
    let surface = Tile::of(&simple.shown.mesh.positions, simple.shown.mesh.triangles.clone());
    let [shown, working] = joined.tiles(simple.shown, simple.working);
    Simple { shown, surface, working, greatest_error: simple.shown_error }
}

/// Returns the edges around a tile, which is on their left.
fn outline(tile: &Tile) -> Vec<[[i32; 3]; 2]> {
    let sides: Vec<[u32; 2]> = tile.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    let known: HashSet<[u32; 2]> = sides.iter().copied().collect();
    let outer = sides.into_iter().filter(|&[a, b]| !known.contains(&[b, a]));
    outer.map(|edge| edge.map(|v| tile.positions[v as usize])).collect()
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
fn a_plane_keeps_its_corners_and_has_no_error() {
    let plane = terrain((0..400).map(|i| [i % 20 * 10, i / 20 * 10, i % 20 * 3 + i / 20 * 7]).collect());
    let simple = simplified(&plane, 1, None);
    assert!(simple.greatest_error < 1e-8, "{}", simple.greatest_error);
    // The 76 vertices of the boundary, and the triangles between them.
    assert_eq!(area(&simple.working), area(&plane));
    assert_eq!((simple.working.positions.len(), simple.working.triangles.len()), (76, 74));
    assert_eq!(area(&simple.surface), area(&plane));
    assert_eq!((simple.surface.positions.len(), simple.surface.triangles.len()), (4, 2));
}

#[test]
fn a_tile_without_inner_vertices_stays_as_it_is() {
    let fan = terrain(vec![[0, 0, 5], [9, 0, 5], [0, 9, 1]]);
    let simple = simplified(&fan, 1, None);
    assert_eq!((simple.shown, simple.working, simple.greatest_error), (fan.clone(), fan, 0.0));
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
    let simple = |share: usize| simplified(&tile, tile.triangles.len() / share, Some(&lines));
    for of_simple in [|simple: Simple| simple.working, |simple: Simple| simple.surface] {
        assert_eq!(line_in(&of_simple(simple(5)), &lines), (all, true), "there is room for all");
        let (some, joined) = line_in(&of_simple(simple(200)), &lines);
        assert!(joined && (all / 12..all / 2).contains(&some), "{some} of {all}");
    }
    assert_eq!(area(&simple(200).working), area(&tile));
    let (without, _) = line_in(&simplified(&tile, tile.triangles.len() / 5, None).working, &lines);
    assert!(without < all / 2, "{without}: this test would prove nothing");
}

/// Returns a square with holes and a ragged outline: the triangles of a lattice with uneven heights whose middle is in a rectangle and not in
/// one of the `holes` (middle and radius).
fn ragged(side: i32, holes: &[([i32; 2], i32)], height: impl Fn(i32, i32) -> i32) -> Tile {
    let jitter = |i: i32, salt: i32| (i.wrapping_mul(7919).wrapping_add(salt) % 17 - 8) / 2;
    let point = |i: i32| {
        let [x, y] = [i % side * 10 + jitter(i, 3), i / side * 10 + jitter(i, 11)];
        [x, y, height(x, y) + jitter(i, 5)]
    };
    let all = terrain((0..side * side).map(point).collect());
    let middle = |t: &[u32; 3]| [0, 1].map(|axis| t.iter().map(|&v| all.positions[v as usize][axis]).sum::<i32>() / 3);
    let is_inside = |t: &[u32; 3]| {
        let [x, y] = middle(t);
        let ends = [40, side * 10 - 50];
        let in_hole = |&([hx, hy], radius): &([i32; 2], i32)| (x - hx).pow(2) + (y - hy).pow(2) < radius * radius;
        [x, y].iter().all(|v| (ends[0]..ends[1]).contains(v)) && !holes.iter().any(in_hole)
    };
    Tile::of(&all.positions, all.triangles.iter().filter(|t| is_inside(t)).copied().collect())
}

/// Returns the place on an edge that is nearest to a point in the plane.
fn nearest_place([from, to]: &[[i32; 3]; 2], point: [i32; 3]) -> [f64; 3] {
    let along = |p: &[i32; 3], axis: usize| f64::from(p[axis] - from[axis]);
    let length: f64 = (0..2).map(|axis| along(to, axis).powi(2)).sum();
    let share = ((0..2).map(|axis| along(to, axis) * along(&point, axis)).sum::<f64>() / length).clamp(0.0, 1.0);
    [0, 1, 2].map(|axis| f64::from(from[axis]) + share * along(to, axis))
}

/// Returns the square of the distance of a place from a point in the plane.
fn distance([x, y, _]: [f64; 3], point: [i32; 3]) -> f64 {
    (x - f64::from(point[0])).powi(2) + (y - f64::from(point[1])).powi(2)
}

#[test]
fn the_border_is_not_below_the_outline() {
    // Level ground, all of whose unevenness is noise.
    let tile = ragged(64, &[([300, 260], 90)], |x, y| (x.wrapping_mul(31) ^ y.wrapping_mul(17)) % 23);
    let simple = simplified(&tile, tile.triangles.len() / 6, None);
    let (fine, coarse) = (outline(&tile), outline(&simple.surface));
    let missing = |edge: &[[i32; 3]; 2]| {
        let places = coarse.iter().map(|border| nearest_place(border, edge[0]));
        let of_border = places.min_by(|a, b| distance(*a, edge[0]).total_cmp(&distance(*b, edge[0]))).unwrap();
        f64::from(edge[0][2]) - of_border[2]
    };
    // What is beside the border leans a little to one side or the other.
    let below = |least: f64| fine.iter().filter(|edge| missing(edge) > least).count();
    assert!([below(2.0), below(8.0)] <= [fine.len() / 20, fine.len() / 100], "{} {}", below(2.0), below(8.0));
    // What is beside it makes up for that, over the ground.
    let mut areas = vec![0.0; tile.positions.len()];
    for t in &tile.triangles {
        let [a, b, c] = t.map(|v| tile.positions[v as usize]).map(|p| [p[0], p[1]]);
        t.iter().for_each(|&v| areas[v as usize] += orient2d(a, b, c) as f64);
    }
    let above = |p: &[i32; 3]| height(&simple.surface, [p[0], p[1]].map(f64::from)).unwrap() - f64::from(p[2]);
    let mean = |of: fn(f64) -> f64| {
        let sum: f64 = tile.positions.iter().zip(&areas).map(|(p, area)| area * of(above(p))).sum();
        sum / areas.iter().sum::<f64>()
    };
    assert!(mean(|off| off).abs() < 0.11 * mean(f64::abs), "{} of {}", mean(|off| off), mean(f64::abs));
    // The border is not lifted for nothing either.
    let lifted = fine.iter().map(missing).sum::<f64>() / fine.len() as f64;
    assert!(lifted > -20.0, "{lifted}");
}

#[test]
fn what_viewers_get_covers_ragged_terrain_with_few_vertices_and_hides_its_outline() {
    let hill = |x: i32, y: i32| ((x * x + 3 * y * y) / 700 + (x * y) / 300) % 211;
    for holes in [vec![], vec![([300, 260], 90)], vec![([200, 200], 60), ([420, 380], 8), ([40, 300], 70)]] {
        let tile = ragged(64, &holes, hill);
        let simple = simplified(&tile, tile.triangles.len() / 6, None);
        let (fine, coarse) = (outline(&tile), outline(&simple.surface));
        assert!(2 * coarse.len() < fine.len(), "{} of {}", coarse.len(), fine.len());
        let more = area(&simple.surface) as f64 / area(&tile) as f64;
        assert!((1.0..1.06).contains(&more), "{more}");
        for t in &tile.triangles {
            let corners = t.map(|v| tile.positions[v as usize].map(f64::from));
            let middle = [0, 1].map(|axis| corners.iter().map(|p| p[axis]).sum::<f64>() / 3.0);
            assert!(height(&simple.surface, middle).is_some(), "{middle:?} is not covered");
        }
    }
}

/// Long triangles span ground without points, and their corners decide more of the ground than the vertices of a dense row do.
#[test]
fn ground_without_points_is_nearer_than_ground_with_uneven_ones() {
    let has_points = |x: i32, y: i32| !(150..450).contains(&x) || !(150..450).contains(&y);
    let uneven = |i: i32| (i.wrapping_mul(7919) ^ (i / 60 * 31)) % 23;
    let points = (0..60 * 60).map(|i| [i % 60 * 10 + i % 3, i / 60 * 10 + i % 7, uneven(i)]);
    let tile = terrain(points.filter(|&[x, y, _]| has_points(x, y)).collect());
    let simple = simplified(&tile, tile.triangles.len() / 5, None);
    let square = |x: i32, y: i32| {
        let [exact, coarse] = [&tile, &simple.surface].map(|of| height(of, [f64::from(x), f64::from(y)]).unwrap());
        (exact - coarse).powi(2)
    };
    let mean = |is_with_points: bool| {
        let places = (0..50 * 50).map(|i| [50 + i % 50 * 10, 50 + i / 50 * 10]);
        let squares: Vec<f64> =
            places.filter(|&[x, y]| has_points(x, y) == is_with_points).map(|[x, y]| square(x, y)).collect();
        squares.iter().sum::<f64>() / squares.len() as f64
    };
    assert!(4.0 * mean(false) < mean(true), "{} and {}", mean(false), mean(true));
}

/// What looks across the border from above sees no gap: the skirts join the border all around, and end below the outline.
#[test]
fn skirts_hang_below_the_whole_border() {
    let tile = ragged(48, &[([200, 200], 60)], |x, y| (x * x + y * y) / 900 % 97);
    let Simple { shown, surface, .. } = simplified(&tile, tile.triangles.len() / 6, None);
    let skirts = &shown.triangles[surface.triangles.len()..];
    let border = outline(&surface);
    assert_eq!(skirts.len(), 2 * border.len());
    let place = |v: u32| shown.positions[v as usize];
    let sites = |t: &[u32; 3]| t.iter().map(|&v| [place(v)[0], place(v)[1]]).collect::<HashSet<_>>();
    assert!(skirts.iter().all(|t| sites(t).len() == 2), "a skirt is not vertical");
    // Only the lower ends of the skirts are edges of a single triangle.
    let lowest = |[x, y, z]: [i32; 3]| shown.positions.iter().any(|p| p[0] == x && p[1] == y && p[2] > z);
    assert!(outline(&shown).iter().flatten().all(|&p| lowest(p)), "the border has gaps");
    for edge in outline(&tile) {
        let [x, y, z] = edge[0];
        let near = |p: &&[i32; 3]| (p[0] - x).pow(2) + (p[1] - y).pow(2) < 400;
        let around = shown.positions[surface.positions.len()..].iter().filter(near).map(|p| p[2]).min();
        assert!(around.is_none_or(|bottom| bottom < z + 20), "{x} {y}");
    }
}

/// A neighbour ends at the outline. Where the border passes by a bay whose bank has vertices of the border too, its edges do not follow the outline
/// from one to the next.
#[test]
fn skirts_reach_below_the_outline_beside_every_edge() {
    let mut seen = 0;
    for salt in 0..24 {
        let noise = |x: i32, y: i32| (x.wrapping_mul(31 + salt) ^ y.wrapping_mul(17)) % 60;
        let holes = [([200, 200], 60), ([300, 160], 25), ([120, 290], 30), ([40, 120], 60), ([300, 40], 25)];
        let tile = ragged(40 + salt, &holes, noise);
        let Simple { shown, surface, .. } = simplified(&tile, tile.triangles.len() / 5, None);
        // Where parts of the border meet, the lower ends differ by a step.
        let mut bottoms = HashMap::<[i32; 2], i32>::new();
        for &[x, y, z] in &shown.positions[surface.positions.len()..] {
            bottoms.entry([x, y]).and_modify(|bottom| *bottom = (*bottom).max(z)).or_insert(z);
        }
        let skirts = outline(&surface).into_iter().map(|edge| edge.map(|[x, y, _]| [x, y, bottoms[&[x, y]]]));
        let skirts: Vec<[[i32; 3]; 2]> = skirts.collect();
        for [vertex, _] in outline(&tile) {
            let beside = skirts.iter().map(|skirt| nearest_place(skirt, vertex));
            let place = beside.min_by(|a, b| distance(*a, vertex).total_cmp(&distance(*b, vertex))).unwrap();
            let middle = [0, 1].map(|axis| (place[axis] + f64::from(vertex[axis])) / 2.0);
            // Where the terrain itself is between them, another edge is across from the vertex.
            if height(&tile, middle).is_none() {
                seen += 1;
                assert!(place[2] <= f64::from(vertex[2]), "{salt}: {} below {vertex:?}", place[2]);
            }
        }
    }
    assert!(seen > 1000, "{seen}");
}

/// A neighbour may show the outline as it is. Where one of its vertices lies just inside the border, the surface must not be below it either.
#[test]
fn vertices_of_the_outline_inside_the_border_are_not_lowered() {
    let tile = ragged(64, &[([300, 260], 90)], |x, y| (x.wrapping_mul(31) ^ y.wrapping_mul(17)) % 23);
    let surface = simplified(&tile, tile.triangles.len() / 6, None).surface;
    let ends = |tile: &Tile| outline(tile).into_iter().map(|edge| edge[0]).collect::<HashSet<_>>();
    let border: HashSet<[i32; 2]> = ends(&surface).into_iter().map(|[x, y, _]| [x, y]).collect();
    let exact = ends(&tile);
    let inside = surface.positions.iter().filter(|[x, y, _]| !border.contains(&[*x, *y]));
    let found: Vec<i32> = inside.filter_map(|p| exact.iter().find(|e| e[..2] == p[..2]).map(|e| p[2] - e[2])).collect();
    assert!(found.len() > 3 && found.iter().all(|above| *above >= 0), "{found:?}");
}

/// The border is beyond the outline, over ground of neighbours, which may fall away from it as this one does.
#[test]
fn skirts_end_below_a_neighbours_slope() {
    // A crater in a plain, of whose middle a neighbour has the ground.
    let crater = |x: i32, y: i32| (4.0 * f64::from(x - 320).hypot(f64::from(y - 320)).min(160.0)) as i32;
    let tile = ragged(64, &[([320, 320], 120)], crater);
    let Simple { shown, surface, .. } = simplified(&tile, tile.triangles.len() / 6, None);
    let bottom = |[x, y, _]: [i32; 3]| {
        let below = &shown.positions[surface.positions.len()..];
        below.iter().filter(|p| p[0] == x && p[1] == y).map(|p| p[2]).min().unwrap()
    };
    for [from, to] in outline(&surface) {
        let middle = [0, 1].map(|axis| (from[axis] + to[axis]) / 2);
        let (skirt, ground) = ((bottom(from) + bottom(to)) / 2, crater(middle[0], middle[1]));
        assert!(skirt <= ground, "{skirt} above {ground} at {middle:?}");
    }
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
        let Simple { surface, working, greatest_error, .. } = simplified(&tile, tile.triangles.len() / share, None);
        prop_assert_eq!(area(&working), area(&tile));
        prop_assert!(working.triangles.len() <= tile.triangles.len());
        prop_assert_eq!(outline(&working).into_iter().collect::<HashSet<_>>(), outline(&tile).into_iter().collect());
        let mut greatest = 0.0f64;
        for place in places {
            if let Some(fine) = height(&tile, place) {
                for simple in [&surface, &working] {
                    let coarse = height(simple, place);
                    prop_assert!(coarse.is_some(), "{:?} is not covered", place);
                    greatest = greatest.max((fine - coarse.unwrap()).abs());
                }
            }
        }
        prop_assert!(greatest <= greatest_error + 1e-9, "{} of {}", greatest, greatest_error);
        // The error is measured, not bounded by the range of all heights.
        let vertices = tile.positions.iter().filter_map(|p| {
            Some((height(&surface, [p[0] as f64, p[1] as f64])? - p[2] as f64).abs())
        });
        let at_vertices = vertices.fold(0.0, f64::max);
        prop_assert!(greatest_error == 0.0 || greatest_error < 60.0 || at_vertices > 0.0);
    }
}
