//! Tests that verification accepts exact meshes, however they are cut, and that its digest depends on the triangles alone.

use tiles::Compression;
use tiles::frame::Frame;
use verify::{GrowingProof, Verdict, verify};

use crate::model::{cloud, cut, cut_by_place, grid, lattice, terrain, utm, write_tiles, write_tiles_as};
use crate::random::Random;

const MEMORY: u64 = 1 << 28;

fn verdict_of(frame: &Frame, tiles: &[tiles::Tile]) -> Verdict {
    let directory = tempfile::tempdir().unwrap();
    write_tiles(directory.path(), frame, tiles);
    verify(directory.path(), MEMORY).unwrap()
}

#[test]
fn every_tiling_has_the_same_verdict_except_for_the_borders() {
    let frame = utm();
    let mesh = terrain(&frame, &cloud(7, 2_000, 100_000));
    let mut random = Random(1);
    let whole = verdict_of(&frame, std::slice::from_ref(&mesh));
    assert_eq!(whole.failures, Vec::<String>::new());
    assert_eq!((whole.sites, whole.triangles), (mesh.positions.len() as u64, mesh.triangles.len() as u64));
    assert_eq!((whole.tiles, whole.edges_across_tiles), (1, 0));
    let scattered = cut(&mesh, 9, |_| random.below(9) as usize);
    for (tiles, borders) in [(cut_by_place(&mesh, 4), 100..2_000), (scattered, 4_000..6_000)] {
        let verdict = verdict_of(&frame, &tiles);
        assert!(borders.contains(&verdict.edges_across_tiles), "{verdict}");
        let same = Verdict { tiles: 1, edges_across_tiles: 0, ..verdict };
        assert_eq!(same, whole);
    }
}

#[test]
fn tiles_that_go_as_soon_as_they_are_checked_have_the_same_verdict() {
    let frame = utm();
    let directory = tempfile::tempdir().unwrap();
    let mut tiles = cut_by_place(&terrain(&frame, &cloud(7, 2_000, 100_000)), 4);
    for is_broken in [false, true] {
        if is_broken {
            let [a, b, c] = tiles[2].triangles[5];
            tiles[2].triangles[5] = [a, c, b];
        }
        write_tiles(directory.path(), &frame, &tiles);
        let expected = verify(directory.path(), MEMORY).unwrap();
        assert_eq!(expected.failures.is_empty(), !is_broken, "{expected}");
        let names: Vec<String> = (0..tiles.len()).map(|number| format!("tiles/{number:05}.glb")).collect();
        let path = |name: &str| directory.path().join(name);
        let proof = GrowingProof::begin(&path(&names[0]), directory.path(), MEMORY).unwrap();
        for name in &names {
            proof.check(&path(name), name).unwrap();
            std::fs::write(path(name), "").unwrap();
        }
        assert_eq!(proof.conclude(directory.path()).unwrap(), expected);
    }
}

#[test]
fn ties_are_counted_and_accepted() {
    let frame = utm();
    let mesh = terrain(&frame, &grid(30, 20, 100));
    for tiles in [vec![mesh.clone()], cut_by_place(&mesh, 3)] {
        let verdict = verdict_of(&frame, &tiles);
        assert_eq!(verdict.failures, Vec::<String>::new());
        assert_eq!((verdict.ties, verdict.hull_edges), (29 * 19, 2 * (29 + 19)));
    }
}

#[test]
fn the_digest_does_not_depend_on_the_lattice() {
    let points = cloud(8, 400, 10_000);
    let coarse = lattice([273357.145, 5274357.144, 788.993], 0.00025, 0.001);
    let fine = lattice([273357.0, 5274358.0, 700.0], 0.00001, 0.00001);
    // The same places in both: offset + resolution * integer.
    let moved: Vec<[i32; 3]> =
        points.iter().map(|p| [14_500 + 25 * p[0], -85_600 + 25 * p[1], 8_899_300 + 100 * p[2]]).collect();
    let digests = [(coarse, points), (fine, moved)].map(|(lattice, points)| {
        let frame = Frame::new(&lattice, 1.0, 1.0, None).unwrap();
        let verdict = verdict_of(&frame, &cut_by_place(&terrain(&frame, &points), 2));
        assert_eq!(verdict.failures, Vec::<String>::new());
        verdict.digest
    });
    assert_eq!(digests[0], digests[1]);
}

#[test]
fn parts_are_verified_like_tiles() {
    let frame = Frame::new(&lattice([0.0; 3], 1e-6, 0.001), 1.0, 1.0, None).unwrap();
    let verdict = verdict_of(&frame, &cut_by_place(&terrain(&frame, &grid(40, 25, 1_000_000)), 2));
    assert_eq!(verdict.failures, Vec::<String>::new());
    assert_eq!((verdict.sites, verdict.triangles), (1_000, 2 * 39 * 24));
}

#[test]
fn quantized_steps_of_one_metre_are_not_taken_for_plain_positions() {
    let frame = Frame::new(&lattice([0.0; 3], 1.5, 1.25), 1.0, 1.0, None).unwrap().packed();
    let tiles = cut_by_place(&terrain(&frame, &cloud(11, 500, 100_000)), 2);
    for compression in [Compression::Quantized, Compression::Meshopt] {
        let directory = tempfile::tempdir().unwrap();
        write_tiles_as(compression, directory.path(), &frame, &tiles);
        let verdict = verify(directory.path(), MEMORY).unwrap();
        assert_eq!(verdict.failures, Vec::<String>::new());
        assert_eq!(verdict.sites, 500);
    }
}

#[test]
fn records_that_do_not_fit_in_memory_go_to_files() {
    let frame = utm();
    let mesh = terrain(&frame, &cloud(9, 8_000, 100_000));
    let directory = tempfile::tempdir().unwrap();
    let mut random = Random(3);
    write_tiles(directory.path(), &frame, &cut(&mesh, 300, |_| random.below(300) as usize));
    let (roomy, tight) = (verify(directory.path(), MEMORY).unwrap(), verify(directory.path(), 1 << 18).unwrap());
    assert_eq!(tight.failures, Vec::<String>::new());
    assert_eq!(tight, roomy);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1, "nothing is left behind");
    assert!(verify(directory.path(), 1 << 10).unwrap_err().to_string().contains("--memory"));
}
