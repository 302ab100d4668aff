//! Jobs of so many tiles that they do not fit one folder, nor their list one file.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use verify::{Conclusion, verify};

use crate::clouds;
use crate::levels::hills;
use crate::program::{Job, number};
use crate::tileset::{files_below, keeps_the_rules, tiles};

const MEMORY: u64 = 1 << 28;

/// The numbers of the tree's nodes go beyond 4000, and 1000 tiles fit one file of the tileset.
fn many_tiles(folder: &Path) -> Job {
    let cloud = clouds::write(folder, "cloud.csv", &hills(40_000, 3));
    Job::on(&[&cloud]).tiles_of(20).with("output", "format = \"3dtiles\"\nmax_points_per_level_tile = 100")
}

/// Returns the number of entries of every folder below `folder`.
fn entries(folder: &Path) -> BTreeMap<PathBuf, usize> {
    let mut found = BTreeMap::new();
    let own: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    own.iter().filter(|path| path.is_dir()).for_each(|path| found.extend(entries(path)));
    found.insert(folder.into(), own.len());
    found
}

fn size(job: &Job, name: &str) -> usize {
    fs::read(job.out().join(name)).unwrap().len()
}

#[test]
fn no_folder_and_no_file_grows_with_the_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let job = many_tiles(folder.path());
    let report = job.report();
    assert!(number(&report["tiles"]) > 2000, "{}", report["tiles"]);
    let tiles = tiles(&job);
    keeps_the_rules(&job, &tiles);
    assert!(number(&report["tiles"]) + number(&report["levels"]["files"]) == tiles.len() as u64);
    assert!(files_below(&job.out().join("tilesets")).len() > 2);
    let entries = entries(&job.out());
    assert!(entries.values().all(|&count| count <= 300), "{entries:?}");
    assert!(entries.len() > 20 && entries.contains_key(&job.out().join("tiles/007")), "{entries:?}");
    assert_eq!(number(&job.verified()["files"]), files_below(&job.out()).len() as u64 - 2);
    let few = Job::on(&[folder.path().join("cloud.csv")]).tiles_of(10_000).with("output", "format = \"3dtiles\"");
    few.report();
    for name in ["report.json", "georeference.json"] {
        let [many, few] = [&job, &few].map(|job| size(job, name));
        // Numbers have more or fewer digits.
        assert!(many.abs_diff(few) < 300, "{name} has {many} bytes with many tiles and {few} with few");
    }
}

/// Earlier versions had no folders below `tiles`. Their results give way to new ones as a whole, and so do those in folders.
#[test]
fn results_of_an_earlier_layout_are_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let job = many_tiles(folder.path());
    let many = number(&job.report()["tiles"]);
    for kind in ["tiles", "levels"] {
        let kind = job.out().join(kind);
        for path in files_below(&kind) {
            fs::rename(&path, kind.join(path.file_name().unwrap())).unwrap();
        }
        let left = fs::read_dir(&kind).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir());
        left.for_each(|path| fs::remove_dir(path).unwrap());
    }
    // Each line of the list is a checksum and a name.
    let list = fs::read_to_string(job.out().join("XXH128SUMS")).unwrap();
    let flat = |line: &str| match line.rsplit_once('/') {
        Some((before, file)) if before.contains("tiles/") || before.contains("levels/") => {
            let (folder, _) = before.rsplit_once("s/").unwrap();
            format!("{folder}s/{file}\n")
        }
        _ => format!("{line}\n"),
    };
    fs::write(job.out().join("XXH128SUMS"), list.lines().map(flat).collect::<String>()).unwrap();
    let whole = |few: bool| {
        let report = job.report();
        let entries = entries(&job.out());
        assert!(entries.values().all(|&count| (1..=300).contains(&count)), "{entries:?}");
        assert_eq!(entries.contains_key(&job.out().join("tilesets")), !few);
        let files = number(&report["tiles"]) + number(&report["levels"]["files"]);
        let found = ["tiles", "levels"].map(|kind| files_below(&job.out().join(kind)).len() as u64);
        assert_eq!(found.iter().sum::<u64>(), files);
        job.verified();
        number(&report["tiles"])
    };
    assert_eq!(whole(false), many);
    // Folders that nothing is left in go.
    let text = fs::read_to_string(job.config()).unwrap();
    fs::write(job.folder().join("few.toml"), text.replace("max_points_per_tile = 20", "max_points_per_tile = 9000"))
        .unwrap();
    let said = crate::program::gdt_batch(job.folder(), &[job.folder().join("few.toml")]);
    said.succeeded();
    let folders = entries(&job.out());
    // The directory itself, tiles/, levels/, and cut/ for the slivers along the hull.
    assert!(folders.len() <= 4 && folders.values().all(|&count| count > 0), "{folders:?}");
    assert_eq!(verify(&job.out(), MEMORY).unwrap().verdict, Conclusion::Proved);
}

#[test]
fn verify_finds_what_is_wrong_in_a_folder_below() {
    let folder = tempfile::tempdir().unwrap();
    let job = many_tiles(folder.path());
    job.report();
    let out = job.out();
    let failures = || verify(&out, MEMORY).unwrap().failures.join("\n");
    assert_eq!(failures(), "");
    for (from, strange) in [
        ("tiles/000001.glb", "tiles/003/000001.glb"),
        ("tiles/001/000256.glb", "tiles/000256.glb"),
        ("tiles/000001.glb", "tiles/theirs/roof.glb"),
        ("tilesets/000000.json", "tilesets/001/000256.json"),
    ] {
        fs::create_dir_all(out.join(strange).parent().unwrap()).unwrap();
        fs::copy(out.join(from), out.join(strange)).unwrap();
        let said = failures();
        assert!(said.contains(&format!("{strange} is not a file that the job wrote")), "{strange}: {said}");
        fs::remove_file(out.join(strange)).unwrap();
    }
    let aside = folder.path().join("aside");
    for name in ["tiles/001/000300.glb", "tiles/005/001400.glb"] {
        fs::rename(out.join(name), &aside).unwrap();
        let said = failures();
        assert!(said.contains(&format!("{name} is gone")), "{said}");
        fs::rename(&aside, out.join(name)).unwrap();
    }
    let external = out.join("tilesets/000000.json");
    let text = fs::read_to_string(&external).unwrap();
    fs::write(&external, text.replacen("REPLACE", "replace", 1)).unwrap();
    assert!(failures().contains("tilesets/000000.json is not as the job wrote it"), "{}", failures());
    fs::write(&external, text).unwrap();
    assert_eq!(failures(), "");
}

#[test]
fn a_file_in_the_place_of_a_folder_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let job = many_tiles(folder.path());
    fs::create_dir_all(job.out().join("tiles")).unwrap();
    fs::write(job.out().join("tiles/001"), "theirs").unwrap();
    let said = job.run();
    said.refused(2, &["tiles/001 is not a directory"]);
    assert_eq!(fs::read(job.out().join("tiles/001")).unwrap(), b"theirs");
}

/// Tiles of few points below large coarser ones: their list alone would be too long.
#[test]
fn a_tile_with_thousands_of_children_is_several_files() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills(9_000, 5));
    let job = Job::on(&[&cloud]).tiles_of(4).with("output", "format = \"3dtiles\"");
    let report = job.report();
    assert_eq!(number(&report["levels"]["files"]), 1);
    let tiles = tiles(&job);
    keeps_the_rules(&job, &tiles);
    let groups = tiles.iter().filter(|tile| tile.json["content"].is_null()).count() as u64;
    assert!(groups > 1 && tiles.len() as u64 == number(&report["tiles"]) + 1 + groups, "{groups}");
}

/// Nobody has to read all tiles to show the first.
#[test]
fn the_main_file_lists_only_the_coarsest_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let job = many_tiles(folder.path());
    job.report();
    let main: Value = serde_json::from_slice(&fs::read(job.out().join("tileset.json")).unwrap()).unwrap();
    fn uris(tile: &Value) -> Vec<String> {
        let own = tile["content"]["uri"].as_str().map(str::to_owned).into_iter();
        own.chain(tile["children"].as_array().into_iter().flatten().flat_map(uris)).collect()
    }
    let uris = uris(&main["root"]);
    assert!(uris.len() <= 1000 && uris.iter().any(|uri| uri.starts_with("tilesets/")), "{} tiles", uris.len());
}
