//! A job writes tiles while it still triangulates others, where it may, and they have the same bytes as tiles that waited.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;

use crate::clouds;
use crate::program::Job;
use crate::tileset::files_below;

/// Returns the seconds from the start of the job to the start and to the end of stage `name`.
fn span(report: &Value, name: &str) -> [f64; 2] {
    let stage = report["stages"].as_array().unwrap().iter().find(|stage| stage["stage"] == name).unwrap();
    let [start, wall] = ["start_s", "wall_s"].map(|key| stage[key].as_f64().unwrap());
    [start, start + wall]
}

/// Returns the tiles, the levels and the files next to them, except the report.
fn results(job: &Job) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = files_below(&job.out()).into_iter().filter(|path| !path.ends_with("report.json"));
    files.map(|path| (path.strip_prefix(job.out()).unwrap().to_path_buf(), std::fs::read(&path).unwrap())).collect()
}

/// In a grid "auto" finds no edge too long. But it can tell only when all sites are known, so its tiles wait.
#[test]
fn tiles_are_written_while_others_are_triangulated_unless_they_must_wait() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "grid.csv", &clouds::grid(200, 200));
    let job = |threads| Job::on(&[&cloud]).tiles_of(150).threads(threads).with("output", "format = \"3dtiles\"");
    let mut expected = None;
    for threads in [1, 4] {
        let overlapping = job(threads);
        let report = overlapping.report();
        let ([begun, written], [_, triangulated]) = (span(&report, "write"), span(&report, "triangulate"));
        assert!(begun < triangulated && triangulated < written, "{threads} threads: {}", report["stages"]);
        let waiting = job(threads).with("output", "max_edge = \"auto\"");
        let report = waiting.report();
        assert_eq!(report["cut_triangles"], 0);
        assert!(
            span(&report, "write tiles")[0] >= span(&report, "triangulate")[1],
            "{threads} threads: {}",
            report["stages"]
        );
        let expected = expected.get_or_insert_with(|| results(&waiting));
        assert!(expected.len() > 400 && results(&overlapping) == *expected, "{threads} threads");
    }
}
