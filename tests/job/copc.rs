//! Jobs on COPC files: bounds read only a part of the file, and the mesh is that of the whole file.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::copc_file::{CopcFile, without_octree};
use crate::las_file::LasFile;
use crate::program::{Job, gdt_batch, number};

/// A hundredth of the cloud's area.
const SMALL: &str = "bounds = [500050.0, 4000060.0, 500450.0, 4000460.0]";

fn made() -> CopcFile {
    CopcFile::new(&LasFile::new(4, 7, 0, 20_000), 4)
}

/// Proves the results of a job and that its vertices are the points of `file`, of which everything is read. Returns the digest.
#[track_caller]
fn digest_with_input(job: &Job, file: &Path) -> Value {
    let arguments = ["verify", "out", "--json", "--input", file.to_str().unwrap()];
    let verdict = gdt_batch(job.folder(), &arguments).succeeded().json();
    assert_eq!(verdict["failures"], serde_json::json!([]));
    verdict["digest"].clone()
}

/// Writes the cloud as COPC, and the same points as LAZ.
fn with_and_without_octree(folder: &Path) -> [PathBuf; 2] {
    let files = ["a.copc.laz", "b.laz"].map(|name| folder.join(name));
    let bytes = made().bytes();
    fs::write(&files[0], &bytes).unwrap();
    fs::write(&files[1], without_octree(&bytes)).unwrap();
    files
}

#[test]
fn the_mesh_is_that_of_the_whole_file_with_the_same_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let [copc, laz] = with_and_without_octree(folder.path());
    for surface in ["ground", "all"] {
        let job = |file| Job::on(&[file]).with("input", SMALL).with("input", &format!("surface = \"{surface}\""));
        let (with, without) = (job(&copc), job(&laz));
        let (mut counts, mut all) = (with.report(), without.report());
        assert_eq!(digest_with_input(&with, &copc), without.verified()["digest"], "{surface}");
        assert_eq!(counts["vertex_digest"], all["vertex_digest"]);
        let [counts, all] = [&mut counts, &mut all].map(|report| report["points"].as_object_mut().unwrap());
        let not_decoded = number(&counts["not_decoded"]);
        assert!(not_decoded > 16_000 && number(&all["not_decoded"]) == 0, "{not_decoded}");
        counts["not_decoded"] = 0.into();
        assert_eq!(counts, all);
    }
    let check = Job::on(&[&copc]).with("input", SMALL).run_with(&["check", "--json"]).succeeded().json();
    assert!(number(&check["kept"]) < 4_000, "the octree tells: {check}");
}

#[test]
fn a_wrong_octree_leads_to_the_whole_file_and_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let [copc, laz] = ["a.copc.laz", "b.laz"].map(|name| folder.path().join(name));
    let mut made = made();
    let node = |range: std::ops::Range<i32>| {
        let is_there = |key: &&[i32; 4]| {
            key[0] == 3 && key[1..3].iter().all(|number| range.contains(number)) && made.nodes[*key].len() > 3
        };
        *made.nodes.keys().find(is_there).unwrap()
    };
    // A quarter of the cloud has one of two nodes whose last points have changed places.
    let (near, far) = (node(1..3), node(5..7));
    let [a, b] = [near, far].map(|key| made.nodes.get_mut(&key).unwrap().pop().unwrap());
    made.nodes.get_mut(&near).unwrap().push(b);
    made.nodes.get_mut(&far).unwrap().push(a);
    let bytes = made.bytes();
    fs::write(&copc, &bytes).unwrap();
    fs::write(&laz, without_octree(&bytes)).unwrap();
    let quarter = "bounds = [400000.0, 3900000.0, 500000.0, 4000000.0]";
    let [with, without] = [&copc, &laz].map(|file| Job::on(&[file]).with("input", quarter));
    let (report, all) = (with.report(), without.report());
    assert_eq!(report["vertex_digest"], all["vertex_digest"]);
    assert_eq!(with.verified()["digest"], without.verified()["digest"]);
    let warnings = report["warnings"].as_array().unwrap();
    let is_said = |text: &str| text.contains("a.copc.laz: 1 points lie outside their cell of its octree");
    assert!(warnings.iter().any(|warning| is_said(warning.as_str().unwrap())), "{warnings:?}");
    assert_eq!((number(&report["points"]["not_decoded"]), &report["points"]["kept"]), (0, &all["points"]["kept"]));
    // A node too few is found out before anything is decoded.
    fs::write(&copc, made.bytes_with(|entries| entries.truncate(entries.len() - 1))).unwrap();
    let report = with.run().succeeded();
    assert!(report.out.contains("its octree (COPC) has no node for 1 of the chunks"), "{}", report.out);
    assert_eq!(with.verified()["digest"], without.verified()["digest"]);
}

#[test]
fn parts_read_only_the_nodes_that_meet_the_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let [copc, laz] = with_and_without_octree(folder.path());
    let job = |file| {
        let bounds = "bounds = [499400.0, 3999400.0, 500450.0, 4000450.0]";
        Job::on(&[file]).with("input", bounds).tiles_of(300).with("triangulation", "max_points_per_part = 3000")
    };
    let (with, without) = (job(&copc), job(&laz));
    let report = with.report();
    assert!(number(&report["parts"]) > 1 && number(&report["points"]["not_decoded"]) > 0, "{report}");
    assert_eq!(report["vertex_digest"], without.report()["vertex_digest"]);
    assert_eq!(with.verified()["digest"], without.verified()["digest"]);
}
