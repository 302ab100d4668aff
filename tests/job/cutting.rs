//! `max_edge` leaves long triangles out of the terrain, and the exact mesh loses none.

use std::fs;

use serde_json::Value;

use crate::clouds;
use crate::common::shared;
use crate::levels::{coarser_tiles_cover_their_leaves, errors_are_true};
use crate::program::{Job, gdt_batch, number};
use crate::tileset::{extent, keeps_the_rules, tiles, triangles};

/// Two square fields of points 10 apart, with a void 2,000 wide between them.
fn two_fields() -> clouds::Cloud {
    let field = |west: i64| (0..60 * 60).map(move |i| [west + i % 60 * 10, i / 60 * 10 + i % 3, i % 7]);
    field(0).chain(field(2_600)).collect()
}

/// Removes `cut/` and returns the digest of the remaining triangles.
#[track_caller]
fn digest_of_written(job: &Job) -> String {
    fs::remove_dir_all(job.out().join("cut")).unwrap();
    let said = gdt_batch(job.folder(), &["verify", "out", "--json"]);
    assert_eq!(said.code, 3, "{}", said.err);
    let verdict = said.json();
    assert_eq!(verdict["failures"], serde_json::json!([]));
    assert!(verdict["unproved"].as_str().unwrap().contains("triangles were left out"));
    verdict["digest"].as_str().unwrap().to_owned()
}

#[test]
fn the_triangles_left_out_do_not_depend_on_the_tiles_and_the_whole_mesh_is_exact() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &two_fields());
    let whole = Job::on(&[&file]).digest();
    for max_edge in ["100", "\"auto\""] {
        let mut written: Option<(u64, String)> = None;
        for (sites, compression) in [(300, "meshopt"), (1_000, "none"), (50_000, "quantized")] {
            let line = format!("max_edge = {max_edge}\ncompression = \"{compression}\"");
            let job = Job::on(&[&file]).tiles_of(sites).with("output", &line);
            let report = job.report();
            let verdict = job.verified();
            assert_eq!((verdict["digest"].as_str(), verdict["unproved"].is_null()), (Some(&whole[..]), true));
            let cut = number(&report["cut_triangles"]);
            assert!(cut > 10 && number(&verdict["cut"]) == cut, "{cut} triangles");
            assert_eq!(number(&verdict["triangles"]), cut + number(&report["triangles"]));
            let found = (cut, digest_of_written(&job));
            assert_eq!(*written.get_or_insert(found.clone()), found, "{sites} sites a tile, {max_edge}");
        }
        assert_ne!(written.unwrap().1, whole);
    }
}

#[test]
fn coarser_levels_leave_the_void_empty_too() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &two_fields());
    let job = Job::on(&[&file]).tiles_of(150).with("output", "max_points_per_level_tile = 150\nmax_edge = 100");
    assert!(number(&job.report()["cut_triangles"]) > 10);
    job.verified();
    let tiles = tiles(&job);
    keeps_the_rules(&job, &tiles);
    coarser_tiles_cover_their_leaves(&job, &tiles);
    errors_are_true(&job, &tiles, "two fields");
    let [low, high] = extent(&tiles[0].json);
    let middle = (low[0] + high[0]) / 2.0;
    let mut both_sides = 0;
    for tile in &tiles {
        let mesh = triangles(&job, tile);
        let is_west = |t: &[[f64; 3]; 3]| t.iter().filter(|corner| corner[0] < middle).count();
        assert!(mesh.iter().all(|t| is_west(t) % 3 == 0), "{} bridges the void", tile.json["content"]["uri"]);
        let west = mesh.iter().filter(|t| is_west(t) == 3).count();
        both_sides += usize::from(west > 0 && west < mesh.len());
    }
    assert!(both_sides > 0, "some level has ground on both sides");
}

#[test]
fn the_void_is_empty_in_the_preview() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &two_fields());
    let middle = |job: Job| {
        let job = job.usual_preview();
        job.report();
        let png = fs::read(job.out().join("preview.png")).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        // The strip with the legend is below.
        let (width, height) = (reader.info().width as usize, reader.info().height as usize - 64);
        pixels[4 * (height / 2 * width + width / 2) + 3]
    };
    assert_eq!(middle(Job::on(&[&file])), 255);
    assert_eq!(middle(Job::on(&[&file]).with("output", "max_edge = 100.0")), 0);
}

#[test]
fn verify_notices_a_missing_file_of_triangles_that_were_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &two_fields());
    let job = Job::on(&[&file]).tiles_of(1_000).with("output", "max_edge = \"auto\"");
    job.report();
    let cut = fs::read_dir(job.out().join("cut")).unwrap().next().unwrap().unwrap().path();
    let name = cut.file_name().unwrap().to_string_lossy().into_owned();
    fs::remove_file(cut).unwrap();
    let said = gdt_batch(job.folder(), &["verify", "out"]);
    assert_eq!(said.code, 3);
    assert!(said.out.contains("max_edge left out") && said.out.contains(&name), "{}", said.out);
}

#[test]
fn leaving_out_all_triangles_is_refused_and_leaving_out_none_is_fine() {
    let folder = tempfile::tempdir().unwrap();
    let file = clouds::write(folder.path(), "cloud.csv", &two_fields());
    Job::on(&[&file]).with("output", "max_edge = 1").run().refused(2, &["max_edge", "all", "greater"]);
    let job = Job::on(&[&file]).with("output", "max_edge = 100");
    job.report();
    assert!(job.out().join("cut").is_dir());
    let job = job.with("output", "").with("input", "bounds = [0, 0, 590, 700]");
    let report: Value = job.report();
    assert_eq!(number(&report["cut_triangles"]), 0);
    assert!(!job.out().join("cut").exists(), "no file of an earlier job stays");
    job.verified();
}

#[test]
fn a_real_river_is_left_out_alike_with_any_tiles() {
    let Some(data) = shared().map(|shared| shared.join("data")) else { return };
    let ground = |sites| {
        let job = Job::on(&[data.join("Topography.laz")]).with("input", "classes = [2]").tiles_of(sites);
        job.with("output", "max_edge = \"auto\"")
    };
    let (few, many) = (ground(50_000), ground(700));
    let counts = [&few, &many].map(|job| number(&job.report()["cut_triangles"]));
    assert_eq!(few.verified()["digest"], many.verified()["digest"]);
    assert!(counts[0] == counts[1] && counts[0] > 0, "{counts:?}");
    assert_eq!(digest_of_written(&few), digest_of_written(&many));
}
