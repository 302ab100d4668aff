//! Changes between an interrupted run and the next: the job names them, and they decide which steps it keeps.

use std::fs;
use std::path::Path;

use crate::rig::{Rig, Run, Setup, files};
use crate::scattered;

fn base() -> Setup {
    Setup::tiles_of(2_000).output("color = \"elevation\"")
}

/// Kills the job `base` at its `count`-th commit and runs it as `setup`. Returns standard error and the number of steps kept.
#[track_caller]
fn change_to(rig: &mut Rig, count: u64, setup: &Setup) -> (String, u64) {
    rig.forget();
    rig.configure(&base());
    assert!(rig.run_to("committed", count).was_killed());
    rig.expect(setup);
    let said = rig.run().succeeded().err;
    let report = rig.is_complete(&said);
    (said, report["resumed"].as_u64().unwrap())
}

fn rig() -> Rig {
    Rig::new(&scattered::gaussian(20_000), &base())
}

#[test]
fn threads_memory_and_backend_may_change() {
    let mut rig = rig();
    for setup in
        [base().threads(2), Setup { limits: "memory = \"1 GiB\"\nthreads = 1".into(), ..base() }, base().backend("cpu")]
    {
        let (said, resumed) = change_to(&mut rig, 3, &setup);
        assert!(resumed >= 4 && !said.contains("changed"), "{resumed}: {said}");
    }
}

#[test]
fn another_style_keeps_the_mesh() {
    let mut rig = rig();
    let elevation = "color = \"elevation\"";
    let styles = [
        ("[output] color", Setup { output: base().output.replace(elevation, "color = \"none\""), ..base() }),
        ("[output] normals", base().output("normals = false")),
        ("[output] attributes", base().output("attributes = [\"classification\"]")),
        ("[output] hull", base().output("hull = \"whole\"")),
    ];
    // The kill comes once the part is meshed, or has its coarser tiles too. What was read and the mesh stay.
    for ((key, setup), count) in styles.iter().zip([3, 4, 5, 3]) {
        let (said, resumed) = change_to(&mut rig, count, setup);
        assert!(said.contains(key) && said.contains("written again"), "{said}");
        assert_eq!(resumed, 2, "{said}");
    }
}

/// The scene of a wide terrain follows the curve of the earth and the geoid. What an interrupted run found of it stays, unless the style is
/// another.
#[test]
fn another_geoid_keeps_the_mesh_and_bends_the_tiles_again() {
    let wide = |offset: &str| Setup {
        input: "files = [\"cloud.csv\"]\ncrs = \"EPSG:32633\"".into(),
        ..Setup::tiles_of(2_000).output("format = \"3dtiles\"").output(&format!("height_offset = {offset}"))
    };
    let mut rig = Rig::new(&scattered::uniform(20_000, 50_000, 5), &wide("0.0"));
    for (offset, is_same) in [("0.0", true), ("\"egm96\"", false)] {
        rig.forget();
        rig.configure(&wide("0.0"));
        assert!(rig.run_to("committed", 3).was_killed());
        rig.expect(&wide(offset));
        let said = rig.run().succeeded().err;
        let resumed = rig.is_complete(&said)["resumed"].as_u64().unwrap();
        assert_eq!(said.contains("height_offset") && said.contains("written again"), !is_same, "{said}");
        assert_eq!(resumed, if is_same { 4 } else { 2 }, "{said}");
        let georeference = fs::read_to_string(rig.folder.path().join("out/georeference.json")).unwrap();
        assert!(georeference.contains("\"curved\": true"), "{georeference}");
    }
}

#[test]
fn an_option_of_the_mesh_starts_over_and_is_named() {
    let mut rig = rig();
    for (key, setup) in [
        ("[triangulation] max_points_per_tile", Setup { triangulation: "max_points_per_tile = 1500".into(), ..base() }),
        ("[input] bounds", Setup { input: base().input + "\nbounds = [-20000, -20000, 20000, 20000]", ..base() }),
        ("[input] duplicates", Setup { input: base().input + "\nduplicates = \"highest\"", ..base() }),
        ("[output] color", Setup { output: base().output.replace("elevation", "auto"), ..base() }),
        // Intensities are read only if they are wanted.
        ("[output] attributes", base().output("attributes = [\"intensity\"]")),
    ] {
        let (said, resumed) = change_to(&mut rig, 3, &setup);
        assert!(said.contains(key) && said.contains("starting over") && resumed == 0, "{key}, {resumed}: {said}");
    }
}

#[test]
fn a_changed_input_starts_over_and_is_named() {
    let mut rig = rig();
    let path = rig.folder.path().join("cloud.csv");
    let text = fs::read_to_string(&path).unwrap();
    let kill = |rig: &Rig| {
        rig.forget();
        fs::write(&path, &text).unwrap();
        assert!(rig.run_to("committed", 3).was_killed());
    };
    kill(&rig);
    fs::write(&path, text.clone() + "17,17,17\n").unwrap();
    rig.expect(&base());
    let said = rig.run().succeeded().err;
    assert!(said.contains("cloud.csv") && said.contains("starting over"), "{said}");
    assert_eq!(rig.is_complete("an input that grew")["resumed"], 0);
    // The same size and time, but another digit near the end.
    kill(&rig);
    let written = fs::metadata(&path).unwrap().modified().unwrap();
    let at = text.len() - 3;
    let digit = if &text[at..=at] == "1" { "2" } else { "1" };
    fs::write(&path, format!("{}{digit}{}", &text[..at], &text[at + 1..])).unwrap();
    fs::File::options().write(true).open(&path).unwrap().set_modified(written).unwrap();
    rig.expect(&base());
    let said = rig.run().succeeded().err;
    assert!(said.contains("cloud.csv") && said.contains("starting over"), "{said}");
    rig.is_complete("an input with another digit");
    // A second file.
    kill(&rig);
    let more = scattered::uniform(500, 50_000, 5);
    scattered::write(rig.folder.path(), "more.csv", &more);
    rig.expect(&Setup { input: "files = [\"*.csv\"]".into(), ..base() });
    let said = rig.run().succeeded().err;
    assert!(said.contains("more.csv (new)") && said.contains("starting over"), "{said}");
    rig.is_complete("a new input");
}

#[test]
fn restart_starts_over_also_under_its_old_name() {
    let rig = rig();
    for name in ["--restart", "--fresh"] {
        assert!(rig.run_to("committed", 4).was_killed());
        let said = Run::start(rig.command().arg(name)).end().succeeded().err;
        assert!(!said.contains("continuing"), "{said}");
        assert_eq!(said.contains("--fresh has a new name: --restart"), name == "--fresh", "{said}");
        assert_eq!(rig.is_complete(name)["resumed"], 0);
    }
}

#[test]
fn a_finished_job_runs_from_the_start() {
    let rig = rig();
    rig.completes("once");
    fs::remove_file(rig.out().join("tiles/000000.glb")).unwrap();
    assert_eq!(rig.completes("twice")["resumed"], 0);
}

/// Changes a byte of the file at each of `places`, which are fractions of its length.
fn damage(path: &Path, places: &[f64]) {
    let mut bytes = fs::read(path).unwrap();
    let length = bytes.len() as f64;
    // Which files have records by now depends on the threads. The first always has the partition.
    let places = if bytes.is_empty() { &[] } else { places };
    places.iter().for_each(|place| bytes[(place * length) as usize] ^= 0x10);
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_job_with_damaged_records_starts_over() {
    let rig = rig();
    // Once the points are read, the part is meshed, and it has its coarser tiles.
    for count in [2, 3, 4] {
        for places in [&[0.1][..], &[0.5, 0.9], &[0.999]] {
            rig.forget();
            assert!(rig.run_to("committed", count).was_killed());
            rig.stores().iter().for_each(|store| damage(store, places));
            let report = rig.completes(&format!("damage at {places:?} after {count} phases"));
            assert_eq!(report["resumed"], 0);
        }
        rig.forget();
        assert!(rig.run_to("committed", count).was_killed());
        for store in rig.stores() {
            let half = fs::metadata(&store).unwrap().len() / 2;
            fs::File::options().write(true).open(&store).unwrap().set_len(half).unwrap();
        }
        rig.completes(&format!("half a store after {count} phases"));
    }
    rig.forget();
    assert!(rig.run_to("committed", 3).was_killed());
    fs::remove_file(&rig.stores()[3]).unwrap();
    rig.completes("a file of the store is missing");
}

#[test]
fn files_of_another_version_are_removed_at_once() {
    let rig = rig();
    assert!(rig.run_to("committed", 3).was_killed());
    let old = rig.out().join("job/steps.store");
    fs::write(&old, "as another version called it").unwrap();
    fs::write(rig.out().join("job/journal"), "as another version wrote it").unwrap();
    assert!(rig.run_to("committed", 1).was_killed());
    assert!(!old.exists());
    rig.completes("after that");
}

#[test]
fn damaged_or_missing_tiles_are_written_again() {
    let rig = rig();
    assert!(rig.run_to("committed", 4).was_killed());
    let tiles = || fs::read_dir(rig.out().join("job/results/tiles")).unwrap().map(|entry| entry.unwrap().path());
    assert!(tiles().count() >= 3);
    for (i, path) in tiles().enumerate() {
        match i % 3 {
            0 => fs::remove_file(path).unwrap(),
            1 => fs::write(path, b"").unwrap(),
            _ => damage(&path, &[0.5]),
        }
    }
    let said = rig.run().succeeded().err;
    assert!(said.contains("is damaged; starting over"), "{said}");
    rig.is_complete("damaged tiles");
}

#[test]
fn damaged_points_are_read_again() {
    let rig = rig();
    assert!(rig.run_to("committed", 2).was_killed());
    let points = rig.out().join("job/points-by-part/0/0.points");
    let mut bytes = fs::read(&points).unwrap();
    bytes.iter_mut().for_each(|byte| *byte = !*byte);
    fs::write(&points, bytes).unwrap();
    let said = rig.run().succeeded().err;
    assert!(said.contains("is damaged; starting over"), "{said}");
    rig.is_complete("damaged points");
}

#[test]
fn a_job_with_a_broken_journal_starts_over() {
    let rig = rig();
    for garbage in [&b""[..], b"\n\n", b"\xff\xfe\x00", b"0000000000000000 {}\n"] {
        rig.forget();
        assert!(rig.run_to("committed", 3).was_killed());
        fs::write(rig.out().join("job/journal"), garbage).unwrap();
        assert_eq!(rig.completes("a journal of garbage")["resumed"], 0);
    }
}

#[test]
fn results_of_an_earlier_job_stay_until_the_new_mesh_is_there() {
    let mut rig = rig();
    rig.completes("once");
    let earlier = files(&rig.out());
    let path = rig.folder.path().join("cloud.csv");
    fs::write(&path, fs::read_to_string(&path).unwrap() + "17,17,17\n").unwrap();
    assert!(rig.run_to("committed", 3).was_killed());
    let mut found = files(&rig.out());
    found.retain(|name, _| !name.starts_with("job/"));
    assert!(found == earlier, "{:?}", found.keys());
    rig.expect(&base());
    rig.completes("with another point");
}

/// A job writes tiles early. So an interrupted run may leave some, and then the next run may find that the job is impossible.
#[test]
fn a_run_that_fails_for_good_removes_the_files_of_an_interrupted_run() {
    let rig = rig();
    let path = rig.folder.path().join("cloud.csv");
    let text = fs::read_to_string(&path).unwrap();
    assert!(rig.run_to("committed", 3).was_killed());
    assert!(files(&rig.out().join("job/results/tiles")).len() >= 3);
    // On one line there is no triangle, and only the merges can tell.
    fs::write(&path, (0..20).map(|i| format!("{i},{i},{i}\n")).collect::<String>()).unwrap();
    let end = rig.run();
    assert_eq!(end.status.code(), Some(3), "{end:?}");
    assert!(files(&rig.out()).is_empty(), "{:?}", files(&rig.out()).keys());
    fs::write(&path, text).unwrap();
    rig.completes("good again");
}

/// Whether a job has one part or several, no leaf is triangulated again.
#[test]
fn another_style_keeps_the_mesh_of_one_part_and_of_several() {
    let setup = |points: u64| Setup {
        input: "files = [\"part_*.csv\"]".into(),
        triangulation: format!("{}\nmax_points_per_part = {points}", base().triangulation),
        limits: "threads = 1\nkeep_steps = true".into(),
        ..base()
    };
    let mut rig = Rig::of_files(tempfile::tempdir().unwrap(), &scattered::gaussian(20_000), 60_000, &setup(4_000));
    for (points, kill, parts) in [(20_000, "committed:3", 1), (4_000, "replacing:1", 5), (4_000, "committed:18", 5)] {
        rig.forget();
        rig.configure(&setup(points));
        let killed = Run::start(rig.command().env("GDT_FAULT", kill)).end();
        assert!(killed.was_killed(), "{killed:?}");
        rig.expect(&setup(points).output("normals = false"));
        let is_all_meshed = kill != "committed:18";
        if is_all_meshed {
            // This would be the end at the first leaf.
            let said = Run::start(rig.command().env("GDT_FAULT", "leaf:1")).end().succeeded().err;
            assert!(said.contains("the tiles are written again"), "{said}");
        } else {
            rig.run().succeeded();
        }
        let report = rig.is_complete(kill);
        assert!(report["parts"].as_u64() >= Some(parts), "{report}");
        assert!(report["resumed"].as_u64() >= Some(2), "{report}");
    }
}
