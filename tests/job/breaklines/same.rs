//! The mesh is one and the same, whatever the tiles, the threads, the parts and the tasks, and after an interruption.

use std::fs;

use super::terrain::{Mesh, Survey};
use crate::program::{Job, gdt_batch, number};

/// Returns the checksums of all results but the report.
fn bytes(job: &Job) -> String {
    fs::read_to_string(job.out().join("XXH128SUMS")).unwrap()
}

#[test]
fn tilings_and_parts_give_one_mesh() {
    let survey = Survey::new(6_000);
    let whole = survey.job();
    let (expected, listed) = (whole.digest(), Mesh::listed(&whole));
    for (tile, part) in [(300, 1_500), (800, 1_000), (2_500, 30_000_000)] {
        let job = survey.job().tiles_of(tile).with("triangulation", &format!("max_points_per_part = {part}"));
        let report = job.report();
        assert_eq!(number(&report["parts"]) > 1, part < 6_000);
        assert_eq!(job.verified()["digest"], expected, "{tile} points a tile, {part} a part");
        assert_eq!(Mesh::listed(&job), listed);
    }
}

#[test]
fn threads_tasks_and_an_interruption_leave_the_same_bytes() {
    let survey = Survey::new(6_000);
    let job = || survey.job().tiles_of(400).with("triangulation", "max_points_per_part = 1500");
    let one = job().threads(1);
    one.report();
    let four = job().threads(4);
    four.report();
    assert_eq!(bytes(&four), bytes(&one));
    let tasks = job();
    let config = tasks.config();
    let config = config.to_str().unwrap();
    gdt_batch(tasks.folder(), &["submit", config, "--engine", "local", "--tasks", "3"]).succeeded();
    assert_eq!(bytes(&tasks), bytes(&one));
    // As if SIGTERM came while points are read, and while nodes are merged.
    for place in ["signal-read:1", "signal-merge:3"] {
        let mut stopped = job().variable("GDT_FAULT", place);
        stopped.run().refused(1, &["interrupted"]);
        stopped.calm();
        let said = stopped.run().succeeded();
        assert!(!said.err.contains("starting over"), "{}", said.err);
        assert_eq!(bytes(&stopped), bytes(&one), "{place}");
    }
}

#[test]
fn other_lines_make_another_job() {
    let survey = Survey::new(1_000);
    let lines = survey.lines();
    let stopped =
        survey.job_with(&lines, "kind_field = \"kind\"").tiles_of(200).variable("GDT_FAULT", "signal-merge:3");
    stopped.run().refused(1, &["interrupted"]);
    // The attributes of the Shapefile say something else now.
    let table = lines[2].with_extension("dbf");
    let text = fs::read(&table).unwrap();
    let at = text.windows(4).rposition(|word| word == b"line").unwrap();
    let changed = [&text[..at], b"lake", &text[at + 4..]].concat();
    fs::write(&table, [changed.as_slice(), b"\x1a"].concat()).unwrap();
    let said = stopped.run();
    said.refused(3, &["lines.shp: feature 3 is a line with two ends"]);
    fs::write(&table, text).unwrap();
    let mut stopped = stopped;
    stopped.calm();
    let report = stopped.with("[breaklines]", "spacing = 5").report();
    assert!(number(&report["breaklines"]["subsegments"]) < 300);
}
