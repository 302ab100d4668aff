//! Tests that verification finds every kind of fault.

use tiles::Tile;
use verify::{Verdict, verify};

use crate::model::{COMPRESSIONS, cloud, cut_by_place, edges, grid, terrain, utm, write_tiles, write_tiles_as};
use sys::ErrorKind;

/// Returns what verification finds in nine good tiles after `harm`. It is the same for every compression.
fn failures(harm: impl FnOnce(&mut Vec<Tile>)) -> String {
    let frame = utm();
    let mut tiles = cut_by_place(&terrain(&frame, &cloud(11, 900, 20_000)), 3);
    harm(&mut tiles);
    let [plain, quantized, packed] = COMPRESSIONS.map(|compression| {
        let directory = tempfile::tempdir().unwrap();
        write_tiles_as(compression, directory.path(), &frame, &tiles);
        let verdict = verify(directory.path(), 1 << 28).unwrap();
        assert_eq!(verdict.holds(), verdict.failures.is_empty());
        verdict
    });
    // An example is the first that was found, and packing changes the order.
    let kinds = |verdict: &Verdict| {
        let kind = |failure: &String| failure.split(':').next().unwrap().to_owned();
        verdict.failures.iter().map(kind).collect::<Vec<_>>()
    };
    assert!(kinds(&quantized) == kinds(&plain) && kinds(&packed) == kinds(&plain), "{plain}{quantized}{packed}");
    assert!(quantized.digest == plain.digest && packed.digest == plain.digest);
    plain.failures.join("\n")
}

#[track_caller]
fn says(failures: &str, expected: &[&str]) {
    assert!(expected.iter().all(|text| failures.contains(text)), "{failures}");
}

/// Returns a vertex of tile 4 that another tile has too.
fn shared_vertex(tiles: &[Tile]) -> usize {
    let shared = |p: &[i32; 3]| tiles.iter().filter(|tile| tile.positions.contains(p)).count() > 1;
    tiles[4].positions.iter().position(shared).unwrap()
}

/// Returns a vertex of tile 4 that no other tile has.
fn inner_vertex(tiles: &[Tile]) -> usize {
    let shared = |p: &[i32; 3]| tiles.iter().filter(|tile| tile.positions.contains(p)).count() > 1;
    tiles[4].positions.iter().position(|p| !shared(p)).unwrap()
}

#[test]
fn good_tiles_have_no_fault() {
    assert_eq!(failures(|_| {}), "");
}

#[test]
fn a_flipped_edge_is_found() {
    let flip = |tiles: &mut Vec<Tile>| {
        let tile = &mut tiles[4];
        let edges = edges(&tile.triangles);
        let site = |v: u32| [tile.positions[v as usize][0], tile.positions[v as usize][1]];
        let left = |a, b, c| delaunay::geometry::predicates::orient2d(site(a), site(b), site(c)) > 0;
        let convex = |&(&(u, v), &(_, apex)): &(&(u32, u32), &(usize, u32))| {
            edges.get(&(v, u)).is_some_and(|&(_, other)| left(apex, u, other) && left(other, v, apex))
        };
        let (&(u, v), &(t, apex)) = edges.iter().find(convex).unwrap();
        let (s, other) = edges[&(v, u)];
        (tile.triangles[t], tile.triangles[s]) = ([apex, u, other], [other, v, apex]);
    };
    says(&failures(flip), &["1 edges not Delaunay"]);
}

#[test]
fn a_flipped_tie_is_found() {
    let frame = utm();
    let mut mesh = terrain(&frame, &grid(3, 3, 10));
    let edges = edges(&mesh.triangles);
    let diagonal = |&(u, v): &(u32, u32)| {
        let (p, q) = (mesh.positions[u as usize], mesh.positions[v as usize]);
        p[0] != q[0] && p[1] != q[1]
    };
    let &(u, v) = edges.keys().find(|edge| diagonal(edge)).unwrap();
    let ((t, apex), (s, other)) = (edges[&(u, v)], edges[&(v, u)]);
    (mesh.triangles[t], mesh.triangles[s]) = ([apex, u, other], [other, v, apex]);
    let directory = tempfile::tempdir().unwrap();
    write_tiles(directory.path(), &frame, &[mesh]);
    says(&verify(directory.path(), 1 << 28).unwrap().failures.join("\n"), &["1 edges not Delaunay"]);
}

#[test]
fn a_missing_triangle_is_found() {
    let drop = |tiles: &mut Vec<Tile>| {
        let tile = &mut tiles[4];
        let v = (0..tile.positions.len() as u32)
            .max_by_key(|v| tile.triangles.iter().filter(|t| t.contains(v)).count())
            .unwrap();
        let dropped = tile.triangles.iter().position(|t| t.contains(&v)).unwrap();
        tile.triangles.remove(dropped);
    };
    says(&failures(drop), &["boundary", "Euler"]);
}

#[test]
fn a_missing_tile_is_found() {
    says(&failures(|tiles| drop(tiles.remove(4))), &["boundary"]);
    says(&failures(|tiles| drop(tiles.remove(0))), &["boundary is not convex"]);
}

#[test]
fn a_repeated_triangle_is_found() {
    says(&failures(|tiles| tiles[4].triangles.extend_from_within(..1)), &["used more than once", "Euler"]);
    let elsewhere = |tiles: &mut Vec<Tile>| {
        let copy = Tile { triangles: vec![[0, 1, 2]], ..Tile::default() };
        let t = tiles[4].triangles[0];
        let tile = &tiles[4];
        let pick = |v: u32| v as usize;
        tiles.push(Tile {
            positions: t.map(|v| tile.positions[pick(v)]).to_vec(),
            normals: tile.normals.as_ref().map(|n| t.map(|v| n[pick(v)]).to_vec()),
            colors: tile.colors.as_ref().map(|c| t.map(|v| c[pick(v)]).to_vec()),
            ..copy
        });
    };
    // The copy is in another tile. Its edges are in use on both sides in the first one, so here they are left over.
    says(&failures(elsewhere), &["Euler", "area"]);
}

#[test]
fn a_repeated_tile_is_found() {
    says(&failures(|tiles| tiles.push(tiles[4].clone())), &["used more than once"]);
}

#[test]
fn a_clockwise_triangle_is_found() {
    says(&failures(|tiles| tiles[4].triangles[0].swap(0, 1)), &["not counterclockwise"]);
}

#[test]
fn a_vertex_moved_by_one_step_is_found() {
    let moved = |tiles: &mut Vec<Tile>| {
        let v = shared_vertex(tiles);
        tiles[4].positions[v][0] += 1;
    };
    says(&failures(moved), &["boundary"]);
}

#[test]
fn a_different_height_normal_or_colour_in_one_tile_is_found() {
    let height = |tiles: &mut Vec<Tile>| {
        let v = shared_vertex(tiles);
        tiles[4].positions[v][2] += 1;
    };
    says(&failures(height), &["1 sites at different places"]);
    let normal = |tiles: &mut Vec<Tile>| {
        let v = shared_vertex(tiles);
        tiles[4].normals.as_mut().unwrap()[v] = [0.6, 0.0, 0.8];
    };
    says(&failures(normal), &["1 sites with different normals, colours"]);
    let color = |tiles: &mut Vec<Tile>| {
        let v = shared_vertex(tiles);
        tiles[4].colors.as_mut().unwrap()[v][1] ^= 1 << 15;
    };
    says(&failures(color), &["1 sites with different normals, colours"]);
    let carrying = |tiles: &mut Vec<Tile>| {
        for tile in tiles.iter_mut() {
            tile.attributes.classification = Some(vec![2; tile.positions.len()]);
            tile.attributes.intensity = Some(vec![300; tile.positions.len()]);
        }
    };
    assert_eq!(failures(carrying), "");
    let class = |tiles: &mut Vec<Tile>| {
        carrying(tiles);
        let v = shared_vertex(tiles);
        tiles[4].attributes.classification.as_mut().unwrap()[v] = 3;
    };
    says(&failures(class), &["1 sites with different normals, colours, classes"]);
    let intensity = |tiles: &mut Vec<Tile>| {
        carrying(tiles);
        let v = shared_vertex(tiles);
        tiles[4].attributes.intensity.as_mut().unwrap()[v] = 300 + 256;
    };
    says(&failures(intensity), &["1 sites with different normals, colours, classes or intensities"]);
}

#[test]
fn a_vertex_without_a_triangle_is_found() {
    let unused = |tiles: &mut Vec<Tile>| {
        tiles[4].positions.push([7, 7, 7]);
        tiles[4].normals.as_mut().unwrap().push([0.0, 0.0, 1.0]);
        tiles[4].colors.as_mut().unwrap().push([0; 3]);
    };
    says(&failures(unused), &["1 vertices without a triangle"]);
}

#[test]
fn a_missing_site_is_found() {
    let taken_out = |tiles: &mut Vec<Tile>| {
        let v = inner_vertex(tiles) as u32;
        let star: Vec<[u32; 3]> = tiles[4].triangles.iter().copied().filter(|t| t.contains(&v)).collect();
        tiles[4].triangles.retain(|t| !t.contains(&v));
        assert!(star.len() > 2);
    };
    says(&failures(taken_out), &["boundary", "vertices without a triangle"]);
}

#[test]
fn wrong_numbers_in_the_report_are_found() {
    let frame = utm();
    let directory = tempfile::tempdir().unwrap();
    let mesh = terrain(&frame, &cloud(12, 50, 20_000));
    write_tiles(directory.path(), &frame, std::slice::from_ref(&mesh));
    let verdict = |report: String| {
        std::fs::write(directory.path().join("report.json"), report).unwrap();
        verify(directory.path(), 1 << 28).unwrap()
    };
    let (sites, triangles) = (mesh.positions.len(), mesh.triangles.len());
    assert!(verdict(format!(r#"{{"sites": {sites}, "triangles": {triangles}, "more": []}}"#)).holds());
    says(&verdict(format!(r#"{{"sites": {}}}"#, sites + 1)).failures.join("\n"), &["sites, where report.json says"]);
    let wrong = verdict(format!(r#"{{"triangles": {}}}"#, triangles - 1));
    says(&wrong.to_string(), &["triangles, where report.json says", "FAILS"]);
}

#[test]
fn a_damaged_tile_and_a_tile_of_another_job_are_found() {
    let frame = utm();
    let mesh = terrain(&frame, &cloud(13, 200, 20_000));
    let directory = tempfile::tempdir().unwrap();
    write_tiles(directory.path(), &frame, &cut_by_place(&mesh, 2));
    let first = directory.path().join("tiles/00000.glb");
    let good = std::fs::read(&first).unwrap();
    std::fs::write(&first, &good[..good.len() / 2]).unwrap();
    let verdict = verify(directory.path(), 1 << 28).unwrap();
    says(&verdict.failures.join("\n"), &["1 tiles that cannot be used", "00000.glb", "its header says"]);
    let text = String::from_utf8_lossy(&good).into_owned();
    let place = text.find("[273357.14").unwrap() + 1;
    let mut other = good.clone();
    other[place] = b'9';
    std::fs::write(&first, &other).unwrap();
    says(&verify(directory.path(), 1 << 28).unwrap().failures.join("\n"), &["another job"]);
}

#[test]
fn a_directory_without_tiles_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let refused = |path: &std::path::Path, words: &str| {
        let error = verify(path, 1 << 28).unwrap_err();
        assert!(error.kind() == ErrorKind::Usage && error.to_string().contains(words), "{error}");
        assert!(error.to_string().contains("output directory of a finished job"), "{error}");
    };
    refused(&directory.path().join("none"), "none is not there");
    refused(directory.path(), "has no folder named tiles");
    std::fs::write(directory.path().join("file"), "").unwrap();
    refused(&directory.path().join("file"), "file is not a directory");
    std::fs::create_dir(directory.path().join("tiles")).unwrap();
    refused(directory.path(), "tiles has no .glb file");
}
