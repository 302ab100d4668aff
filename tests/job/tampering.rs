//! What `verify` finds in the output of a job after somebody has changed it, and what it can prove if files are missing.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;
use tiles::checksums::{Checksum, list_text, parse_list, seal};
use verify::{Conclusion, Verdict, verify, verify_against};

use crate::clouds;
use crate::program::{Job, gdt_batch};
use crate::random::Random;

const MEMORY: u64 = 1 << 28;

/// A job that writes every kind of file, and its cloud.
fn every_file(compression: &str) -> (TempDir, PathBuf, Job) {
    let folder = tempfile::tempdir().unwrap();
    let field = |west: i64| (0..40 * 40).map(move |i| [west + i % 40 * 10, i / 40 * 10 + i % 3, i % 7]);
    let cloud = clouds::write(folder.path(), "cloud.csv", &field(0).chain(field(2_600)).collect::<Vec<_>>());
    let job = Job::on(&[&cloud]).tiles_of(400).threads(2).with("output", "max_edge = 100.0");
    let job = job.with("output", &format!("compression = \"{compression}\"\nmax_points_per_level_tile = 300"));
    job.report();
    (folder, cloud, job)
}

/// Returns all files below `folder` by their names.
fn files(folder: &Path, below: &str) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder.join(below)).unwrap() {
        let name = format!("{below}{}", entry.unwrap().file_name().to_str().unwrap());
        match folder.join(&name).is_dir() {
            true => found.extend(files(folder, &format!("{name}/"))),
            false => _ = found.insert(name.clone(), fs::read(folder.join(&name)).unwrap()),
        }
    }
    found
}

fn verdict(out: &Path) -> Verdict {
    verify(out, MEMORY).unwrap()
}

/// Asserts that verification fails and names `name`.
#[track_caller]
fn is_found(out: &Path, name: &str, what: &str) {
    let verdict = verdict(out);
    let said = verdict.failures.join("\n");
    assert!(verdict.verdict == Conclusion::Failed && said.contains(name), "{what} of {name}: {verdict}");
}

#[test]
fn a_flipped_bit_in_any_file_is_found_and_the_file_is_named() {
    let (_folder, _, job) = every_file("meshopt");
    let out = job.out();
    let files = files(&out, "");
    for (folder, least) in [("tiles/", 4), ("levels/", 2), ("cut/", 1)] {
        assert!(files.keys().filter(|name| name.starts_with(folder)).count() >= least, "{folder}");
    }
    for name in ["XXH128SUMS", "report.json", "tileset.json", "terrain.glb", "georeference.json", "preview.png"] {
        assert!(files.contains_key(name), "{name}");
    }
    let mut random = Random(5);
    for (name, bytes) in &files {
        // The files without a proof of their own are looked at more closely.
        let count = if name.contains('/') { 4 } else { 40 };
        for _ in 0..count {
            let bit = random.below(bytes.len() as u64 * 8) as usize;
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            fs::write(out.join(name), changed).unwrap();
            is_found(&out, name, &format!("bit {bit}"));
        }
        for end in [0, bytes.len() / 2, bytes.len() - 1] {
            fs::write(out.join(name), &bytes[..end]).unwrap();
            is_found(&out, name, &format!("a cut after {end} bytes"));
        }
        fs::write(out.join(name), bytes).unwrap();
    }
    assert_eq!(verdict(&out).verdict, Conclusion::Proved);
}

#[test]
fn only_the_changed_file_is_named() {
    let (_folder, _, job) = every_file("none");
    for name in ["preview.png", "terrain.glb", "levels/", "tileset.json"] {
        let (name, bytes) = files(&job.out(), "").into_iter().find(|(found, _)| found.starts_with(name)).unwrap();
        fs::write(job.out().join(&name), b"theirs").unwrap();
        let verdict = verdict(&job.out());
        assert_eq!(verdict.failures.len(), 1, "{verdict}");
        assert!(verdict.failures[0].starts_with(&format!("{name} is not as the job wrote it")), "{verdict}");
        assert!(verdict.sentence().contains("files are not as the job wrote them"), "{verdict}");
        fs::write(job.out().join(&name), bytes).unwrap();
    }
    fs::copy(job.out().join("tiles/000001.glb"), job.out().join("tiles/roof.glb")).unwrap();
    is_found(&job.out(), "tiles/roof.glb is not a file that the job wrote", "a strange tile");
}

/// Returns the place of the positions of a plain tile in its bytes, and their number.
fn positions(glb: &[u8]) -> (usize, usize) {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&glb[20..20 + word(12)]).unwrap();
    let accessor = json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let accessor = &json["accessors"][accessor];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap_or(0) + accessor["byteOffset"].as_u64().unwrap_or(0);
    (20 + word(12) + 8 + start as usize, accessor["count"].as_u64().unwrap() as usize)
}

/// Adds `by` metres to one coordinate (x, y up, z of the scene) of a vertex of a tile that no other tile has. Returns the tile's name.
fn move_vertex(out: &Path, axis: usize, by: f32) -> String {
    let name = "tiles/000002.glb";
    let glb = fs::read(out.join(name)).unwrap();
    let (start, count) = positions(&glb);
    for vertex in 0..count {
        let mut moved = glb.clone();
        let bytes = &mut moved[start + 12 * vertex + 4 * axis..][..4];
        let value = f32::from_le_bytes(bytes.try_into().unwrap()) + by;
        bytes.copy_from_slice(&value.to_le_bytes());
        fs::write(out.join(name), moved).unwrap();
        // Where the mesh stays Delaunay, only the job's own words and the inputs tell.
        forge_checksums(out);
        let failures = verdict(out).failures;
        if failures.iter().all(|failure| failure.contains("the vertices are not those of the job")) {
            return name.into();
        }
    }
    panic!("every vertex is on a border");
}

/// Replaces a number of the offset in all tiles by another.
fn shift_all_tiles(out: &Path) {
    for (name, mut glb) in files(out, "").into_iter().filter(|(name, _)| name.ends_with(".glb")) {
        let start = glb.windows(10).position(|bytes| bytes == b"\"offset\":[").unwrap() + 10;
        let digit = glb[start..].iter().position(u8::is_ascii_digit).unwrap() + start;
        glb[digit] = if glb[digit] == b'9' { b'8' } else { glb[digit] + 1 };
        fs::write(out.join(name), glb).unwrap();
    }
}

/// Makes the list of files fit the files, and the report fit the list.
fn forge_checksums(out: &Path) {
    forge(out, |_| {});
}

/// As [`forge_checksums`], and changes the report.
fn forge(out: &Path, change: impl FnOnce(&mut Value)) {
    let list = out.join("XXH128SUMS");
    let mut listed = parse_list(&fs::read(&list).unwrap()).unwrap();
    listed.iter_mut().for_each(|(name, checksum)| *checksum = Checksum::of(&fs::read(out.join(name)).unwrap()));
    let text = list_text(&listed);
    fs::write(&list, &text).unwrap();
    let path = out.join("report.json");
    let mut report: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    report["file_list"] = Checksum::of(text.as_bytes()).to_string().into();
    change(&mut report);
    let text = serde_json::to_string_pretty(&report).unwrap();
    let (own, found) = seal(text.as_bytes()).unwrap();
    fs::write(&path, text.replace(&format!("\"checksum\": \"{found}\""), &format!("\"checksum\": \"{own}\""))).unwrap();
}

/// Changes the output and asserts what finds it: the checksums; if those are forged, the report's digest or lattice, which say
/// `words`; if those are forged too, nothing but the inputs, which then say `of_inputs`.
#[track_caller]
fn only_the_inputs_find_a_perfect_forgery(tamper: impl Fn(&Path) -> Vec<String>, words: &str, of_inputs: &str) {
    let (_folder, cloud, job) = every_file("none");
    let out = job.out();
    let originals = ["XXH128SUMS", "report.json"].map(|name| (name, fs::read(out.join(name)).unwrap()));
    let changed = tamper(&out);
    originals.iter().for_each(|(name, bytes)| fs::write(out.join(name), bytes).unwrap());
    changed.iter().for_each(|name| is_found(&out, &format!("{name} is not as the job wrote it"), "a change"));

    forge_checksums(&out);
    is_found(&out, words, "forged checksums");

    let found = verdict(&out).vertex_digest;
    let tile = fs::read(out.join("tiles/000000.glb")).unwrap();
    let text = String::from_utf8_lossy(&tile);
    let offset = text.split("\"offset\":[").nth(1).unwrap().split(']').next().unwrap().to_owned();
    forge(&out, |report| {
        report["vertex_digest"] = found.into();
        for (axis, number) in offset.split(',').enumerate() {
            let number: f64 = number.parse().unwrap();
            report["lattice"]["offset"][axis] = number.to_string().into();
        }
    });
    let verdict = verdict(&out);
    assert_eq!(verdict.verdict, Conclusion::Proved, "nothing in the output tells any more: {verdict}");
    let verdict = verify_against(&out, MEMORY, &[cloud]).unwrap();
    assert_eq!(verdict.verdict, Conclusion::Failed);
    assert!(verdict.failures.iter().any(|failure| failure.contains(of_inputs)), "{verdict}");
}

#[test]
fn a_vertex_raised_by_a_thousand_metres_is_found() {
    let raise = |out: &Path| vec![move_vertex(out, 1, 1000.0)];
    only_the_inputs_find_a_perfect_forgery(
        raise,
        "the vertices are not those of the job",
        "1 vertices have another height",
    );
}

#[test]
fn a_vertex_moved_by_one_step_is_found() {
    // The coordinates of the cloud are whole numbers.
    let nudge = |out: &Path| vec![move_vertex(out, 0, 1.0)];
    only_the_inputs_find_a_perfect_forgery(nudge, "the vertices are not those of the job", "1 vertices are not points");
}

#[test]
fn an_offset_shifted_in_all_tiles_is_found() {
    let shift = |out: &Path| {
        shift_all_tiles(out);
        files(out, "").into_keys().filter(|name| name.ends_with(".glb")).collect()
    };
    only_the_inputs_find_a_perfect_forgery(shift, "where report.json says", "vertices are not points of the inputs");
}

/// Runs `verify` and asserts the exit code and the last line, with and without `--quiet`.
#[track_caller]
fn ends_with(job: &Job, more: &[&str], code: i32, last: &str) {
    let said = gdt_batch(job.folder(), &[&["verify", "out"], more].concat());
    let line = said.out.lines().last().unwrap_or_default();
    assert!(said.code == code && line.starts_with("verdict") && line.ends_with(last), "{said:?}");
    let said = gdt_batch(job.folder(), &[&["verify", "out", "--quiet"], more].concat());
    assert!(said.code == code && said.out.is_empty(), "{said:?}");
    assert!(if code == 0 { said.err.is_empty() } else { said.err.contains(last) }, "{said:?}");
    let said = gdt_batch(job.folder(), &[&["verify", "out", "--json"], more].concat());
    let verdict = if code == 0 { "proved" } else { ["as-far-as-can-be-told", "failed"][code as usize - 3] };
    assert!(said.code == code && said.json()["verdict"] == verdict, "{said:?}");
}

#[test]
fn exit_code_and_last_line_tell_proved_from_as_far_as_can_be_told() {
    let (_folder, cloud, job) = every_file("none");
    let inputs = ["--input", cloud.to_str().unwrap()];
    const TOLD: &str = "no error found, but not proved";
    ends_with(
        &job,
        &[],
        0,
        "proved: the exact Delaunay triangulation of its vertices; --input compares them with the points",
    );
    ends_with(&job, &inputs, 0, "proved: the exact Delaunay triangulation of the inputs' points");
    let without = |name: &str, code: i32, last: &str| {
        let (from, aside) = (job.out().join(name), job.folder().join("aside"));
        fs::rename(&from, &aside).unwrap();
        ends_with(&job, &[], code, last);
        ends_with(&job, &inputs, code, last);
        fs::rename(&aside, &from).unwrap();
    };
    for name in ["cut", "report.json", "XXH128SUMS", "terrain.glb", "levels", "tileset.json", "preview.png"] {
        without(name, 3, TOLD);
    }
    let (from, aside) = (job.out().join("tiles/000001.glb"), job.folder().join("aside"));
    fs::rename(&from, &aside).unwrap();
    ends_with(&job, &[], 4, "failed: not the Delaunay triangulation that the job wrote");
    ends_with(&job, &inputs, 4, "failed: not the Delaunay triangulation of the inputs' points");
    fs::rename(&aside, &from).unwrap();
    fs::write(job.out().join("preview.png"), "theirs").unwrap();
    ends_with(&job, &[], 4, "failed: files are not as the job wrote them");
}

#[test]
fn a_part_of_what_was_left_out_may_be_gone() {
    let (_folder, cloud, job) = every_file("none");
    let inputs = ["--input", cloud.to_str().unwrap()];
    const TOLD: &str = "no error found, but not proved";
    let (first, bytes) = files(&job.out(), "").into_iter().find(|(name, _)| name.starts_with("cut/")).unwrap();
    let count = fs::read_dir(job.out().join("cut")).unwrap().count();
    assert!(count > 1, "{count}");
    fs::remove_file(job.out().join(&first)).unwrap();
    let unproved = verdict(&job.out()).unproved.unwrap();
    assert!(unproved.contains("a file of cut/") && unproved.contains(&first), "{unproved}");
    ends_with(&job, &[], 3, TOLD);
    ends_with(&job, &inputs, 3, TOLD);
    // The list says what is gone if the report is gone too.
    let aside = |name: &str| fs::rename(job.out().join(name), job.folder().join(name)).unwrap();
    let back = |name: &str| fs::rename(job.folder().join(name), job.out().join(name)).unwrap();
    aside("report.json");
    ends_with(&job, &[], 3, TOLD);
    aside("cut");
    ends_with(&job, &[], 3, TOLD);
    back("cut");
    back("report.json");
    // What is there must still be right.
    let tile = fs::read(job.out().join("tiles/000001.glb")).unwrap();
    fs::write(job.out().join("tiles/000001.glb"), &tile[..tile.len() / 2]).unwrap();
    is_found(&job.out(), "tiles/000001.glb", "half");
    fs::write(job.out().join("tiles/000001.glb"), tile).unwrap();
    fs::write(job.out().join(&first), bytes).unwrap();
    ends_with(&job, &inputs, 0, "proved: the exact Delaunay triangulation of the inputs' points");
}

#[test]
fn an_output_without_its_tiles_fails() {
    let (_folder, _, job) = every_file("none");
    let gone = || {
        is_found(&job.out(), "the tiles are gone", "the loss");
        ends_with(&job, &[], 4, "failed: not the Delaunay triangulation that the job wrote");
    };
    let aside = |name: &str| fs::rename(job.out().join(name), job.folder().join(name)).unwrap();
    aside("tiles");
    gone();
    is_found(&job.out(), "tiles/000000.glb is gone", "the loss");
    fs::create_dir(job.out().join("tiles")).unwrap();
    gone();
    aside("XXH128SUMS");
    gone();
    aside("report.json");
    gdt_batch(job.folder(), &["verify", "out"]).refused(2, &["output directory of a finished job"]);
    fs::rename(job.folder().join("XXH128SUMS"), job.out().join("XXH128SUMS")).unwrap();
    gone();
}

#[test]
fn a_file_that_the_job_did_not_write_is_found_in_every_folder() {
    let (_folder, _, job) = every_file("none");
    for folder in ["tiles", "levels", "cut"] {
        let (_, own) = files(&job.out(), "").into_iter().find(|(found, _)| found.starts_with(folder)).unwrap();
        let name = format!("{folder}/theirs.glb");
        fs::write(job.out().join(&name), own).unwrap();
        is_found(&job.out(), &format!("{name} is not a file that the job wrote"), "a strange file");
        fs::remove_file(job.out().join(&name)).unwrap();
    }
    assert_eq!(verdict(&job.out()).verdict, Conclusion::Proved);
}

#[test]
fn texts_are_read_again_as_the_job_has_read_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(4);
    let mut rows = |digits: usize, more: &str| -> String {
        let mut place = |from: f64| from + random.below(10_000_000_000) as f64 * 1e-8;
        let mut row = || {
            let [x, y, z] = [565_000.0, 5_933_000.0, 0.0].map(&mut place);
            format!("{x:.digits$},{y:.digits$},{z:.digits$}{more}\n")
        };
        (0..300).map(|_| row()).collect()
    };
    for (text, section, line) in [
        // A row out of bounds that no lattice holds beside the others.
        (format!("x,y,z\n{}9e16,5933000,3\n", rows(3, "")), "input", "bounds = [565000, 5933000, 565100.5, 5933100.5]"),
        // One of a class that is not wanted.
        (format!("x,y,z,class\n{}9e16,5933000,3,7\n", rows(3, ",2")), "input", "classes = [2]"),
        // Colours that nobody wants, and that cannot be read.
        (format!("x,y,z,red,green,blue\n{}", rows(3, ",a,b,c")), "output", "color = \"none\""),
        // A row that the job leaves out, because no lattice holds it beside the others.
        (format!("x,y,z\n{}99570000.5,5933050.5,12.5\n", rows(8, "")), "input", "max_malformed_fraction = 0.01"),
    ] {
        let path = folder.path().join("cloud.csv");
        fs::write(&path, text).unwrap();
        let job = Job::on(&[&path]).with(section, line);
        let report = job.report();
        assert_eq!(report["points"]["kept"], 300, "{line}");
        let said = gdt_batch(job.folder(), &["verify", "out", "--json", "--input", path.to_str().unwrap()]);
        assert_eq!((said.code, &said.json()["points"]), (0, &report["points"]["kept"]), "{line}: {said:?}");
    }
}

#[test]
fn a_report_of_an_older_version_proves_less_but_nothing_wrong() {
    let (_folder, cloud, job) = every_file("none");
    let path = job.out().join("report.json");
    let mut report: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for name in ["checksum", "file_list", "vertex_digest", "inputs_fingerprint", "input"] {
        report.as_object_mut().unwrap().remove(name).unwrap();
    }
    fs::write(&path, report.to_string()).unwrap();
    fs::remove_file(job.out().join("XXH128SUMS")).unwrap();
    ends_with(&job, &[], 3, "no error found, but not proved");
    ends_with(&job, &["--input", cloud.to_str().unwrap()], 3, "no error found, but not proved");
}

#[test]
fn the_inputs_prove_the_vertices_whatever_the_job_wanted_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut twice = clouds::uniform(3_000, 3_000, 4);
    twice.extend(twice.clone().iter().map(|&[x, y, z]| [x, y, z + 5]));
    let first = clouds::write(folder.path(), "first.csv", &twice);
    let second = clouds::write(folder.path(), "second.csv", &clouds::uniform(3_000, 5_000, 9));
    let laz = folder.path().join("terrain.laz");
    gdt_batch(folder.path(), &["sample", "terrain.laz", "--points", "20000"]).succeeded();
    let [first, second, laz] = [first, second, laz].map(|path| path.to_str().unwrap().to_owned());
    let other = clouds::write(folder.path(), "other.csv", &clouds::uniform(3_000, 5_000, 10));
    let other = other.to_str().unwrap();
    for (files, lines) in [
        (vec![&first, &second], vec![]),
        (vec![&first, &second], vec!["duplicates = \"highest\"", "bounds = [100.5, 100, 1999, 2500.25]"]),
        (vec![&second, &first], vec!["duplicates = \"first\""]),
        (vec![&first], vec!["resolution = 7"]),
        (vec![&laz], vec!["classes = [2]"]),
        (vec![&laz], vec!["bounds = [565010, 5933010, 565050.005, 5933040]", "resolution = 0.03"]),
    ] {
        let job = lines.iter().fold(Job::on(&files).tiles_of(500), |job, line| job.with("input", line));
        let report = job.report();
        let verify =
            |inputs: &[&str]| gdt_batch(job.folder(), &[&["verify", "out", "--json", "--input"], inputs].concat());
        let names: Vec<&str> = files.iter().map(|name| name.as_str()).collect();
        let said = verify(&names).succeeded();
        assert_eq!(said.json()["points"], report["points"]["kept"], "{lines:?}");
        let said = verify(&[other]);
        said.refused(4, &["not the Delaunay triangulation of the inputs' points"]);
        let failures = said.json()["failures"].to_string();
        assert!(
            failures.contains("vertices are not points of the inputs") && failures.contains("fingerprint"),
            "{failures}"
        );
    }
    // A point too few is found as well as a point too many.
    let job = Job::on(&[&second]);
    job.report();
    let said = gdt_batch(job.folder(), &["verify", "out", "--input", &second, &first]);
    said.refused(4, &["points of the inputs are not vertices", "record", "first.csv"]);
}

#[test]
fn inputs_that_the_job_left_out_prove_nothing_against_it() {
    let folder = tempfile::tempdir().unwrap();
    let good = clouds::write(folder.path(), "good.csv", &clouds::uniform(2_000, 3_000, 4));
    let bad = folder.path().join("bad.las");
    fs::write(&bad, "no cloud").unwrap();
    let job = Job::on(&[&good, &bad]).with("input", "on_bad_file = \"skip\"");
    job.report();
    gdt_batch(job.folder(), &["verify", "out", "--input", good.to_str().unwrap(), bad.to_str().unwrap()]).succeeded();
    gdt_batch(job.folder(), &["verify", "out", "--input", "missing.las"]).refused(2, &["missing.las"]);
}

#[test]
fn xxhsum_reads_the_list() {
    let (_folder, _, job) = every_file("meshopt");
    let check = || std::process::Command::new("xxhsum").args(["-c", "XXH128SUMS"]).current_dir(job.out()).output();
    let Ok(checked) = check() else {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "there is no program xxhsum");
        eprintln!("skipped: there is no program xxhsum");
        return;
    };
    assert!(checked.status.success(), "{checked:?}");
    let found = files(&job.out(), "").len();
    assert_eq!(
        String::from_utf8_lossy(&checked.stdout).matches(": OK").count(),
        found - 2,
        "all but the report and itself"
    );
    fs::write(job.out().join("preview.png"), "theirs").unwrap();
    assert!(!check().unwrap().status.success());
}
