//! A job whose tiles lie in folders below folders, and whose tileset is several files, is killed like any other.

use std::collections::BTreeMap;
use std::fs;

use crate::rig::{Rig, Setup, files};
use crate::scattered;

/// More than 256 tiles, and more tiles than one file of the tileset lists.
fn setup() -> Setup {
    Setup::tiles_of(12).output("max_points_per_level_tile = 100").output("format = \"3dtiles\"")
}

#[test]
fn a_job_of_many_folders_goes_on_where_it_was_killed() {
    let rig = Rig::new(&scattered::clusters(9_000), &setup());
    for folder in ["tiles/003/", "levels/00", "tilesets/000000.json"] {
        assert!(rig.expected.keys().any(|name| name.starts_with(folder)), "{folder}");
    }
    for (place, count) in [
        ("committed", 3),
        ("published", 4),
        ("leaf", 500),
        ("tile", 300),
        ("replacing", 1),
        ("replacing", 400),
        ("replacing", 1_100),
        ("cleaning", 3),
    ] {
        rig.forget();
        assert!(rig.run_to(place, count).was_killed(), "{place}, {count}");
        rig.has_nothing_half_written(place);
        rig.completes(place);
    }
}

/// The results of the job before lie as an earlier version left them: without folders below.
#[test]
fn results_of_an_earlier_layout_give_way_whenever_the_job_is_killed() {
    let rig = Rig::new(&scattered::clusters(9_000), &setup());
    let mut earlier: BTreeMap<String, Vec<u8>> =
        rig.expected.iter().map(|(name, bytes)| (flat(name), bytes.clone())).collect();
    earlier.insert("XXH128SUMS".into(), flat_list(&rig.expected["XXH128SUMS"]));
    for count in [1, 300, 1_100] {
        rig.forget();
        for (name, bytes) in &earlier {
            let path = rig.out().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        fs::write(rig.out().join("report.json"), "{\"generator\": \"gdt-batch 0.1.0\"}").unwrap();
        assert!(rig.run_to("replacing", count).was_killed(), "{count}");
        let found = files(&rig.out());
        assert!(found.keys().any(|name| *name == flat("tiles/002/000600.glb")), "{count}: what is outdated goes last");
        assert!(!rig.out().join("report.json").exists(), "{count}");
        rig.completes("replaced");
    }
}

/// Returns the name that an earlier version gave to a result.
fn flat(name: &str) -> String {
    let parts: Vec<&str> = name.split('/').collect();
    match parts[..] {
        [kind, .., file] => format!("{kind}/{file}"),
        _ => name.to_owned(),
    }
}

/// Returns the list of checksums with the names that an earlier version gave to results.
fn flat_list(list: &[u8]) -> Vec<u8> {
    let flat_line = |line: &str| {
        let (checksum, name) = line.split_once("  ").unwrap();
        format!("{checksum}  {}\n", flat(name))
    };
    std::str::from_utf8(list).unwrap().lines().map(flat_line).collect::<String>().into_bytes()
}
