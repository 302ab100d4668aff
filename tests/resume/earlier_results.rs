//! The results of an earlier job stay, every byte, until those of a new one are whole, in whatever way the new one fails.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use crate::rig::{End, Rig, Run, Setup, files};
use crate::scattered;
use sys::ErrorKind;

type Bytes = BTreeMap<String, Vec<u8>>;

/// A rig whose output directory holds the results of a job. It has another cloud by now.
pub(crate) struct Earlier {
    pub(crate) rig: Rig,
    results: Bytes,
    pub(crate) report: Vec<u8>,
}

pub(crate) fn base() -> Setup {
    Setup::tiles_of(500).output("max_edge = 15000").output("max_points_per_level_tile = 350")
}

impl Earlier {
    pub(crate) fn new() -> Earlier {
        let mut rig = Rig::new(&scattered::gaussian(3_000), &base());
        rig.completes("the earlier job");
        let results = files(&rig.out());
        for folder in ["cut/", "levels/", "tiles/"] {
            assert!(results.keys().any(|name| name.starts_with(folder)), "{folder}");
        }
        let report = fs::read(rig.out().join("report.json")).unwrap();
        scattered::write(rig.folder.path(), "cloud.csv", &scattered::clusters(3_000));
        rig.expect(&base());
        Earlier { rig, results, report }
    }

    /// Asserts that every byte of the results is still there.
    #[track_caller]
    pub(crate) fn stay(&self, what: &str) {
        let mut found = files(&self.rig.out());
        found.retain(|name, _| !name.starts_with("job/"));
        let differ: Vec<_> = self.results.iter().filter(|(name, bytes)| found.get(*name) != Some(bytes)).collect();
        assert!(found.len() == self.results.len() && differ.is_empty(), "{what}: {:?}", found.keys());
        assert!(fs::read(self.rig.out().join("report.json")).unwrap() == self.report, "{what}");
    }

    /// Makes the output directory hold these results again.
    pub(crate) fn put_back(&self) {
        self.rig.forget();
        for (name, bytes) in self.results.iter().chain([(&"report.json".to_string(), &self.report)]) {
            let path = self.rig.out().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    }

    /// Runs a job that must fail with this exit code and these words, with the results as they were.
    #[track_caller]
    fn refuses(&self, setup: &Setup, code: i32, words: &[&str]) -> End {
        self.rig.configure(setup);
        let end = self.rig.run();
        assert_eq!(end.status.code(), Some(code), "{words:?}: {end:?}");
        assert!(words.iter().all(|word| end.err.contains(word)), "no {words:?} in: {}", end.err);
        self.stay(&end.err);
        end
    }
}

fn with_output(from: &str, to: &str) -> Setup {
    let output = base().output;
    assert!(output.contains(from));
    Setup { output: output.replace(from, to), ..base() }
}

fn with_input(line: &str) -> Setup {
    Setup { input: base().input + "\n" + line, ..base() }
}

#[test]
fn a_job_that_is_refused_leaves_the_results_of_the_one_before() {
    let earlier = Earlier::new();
    let folder = earlier.rig.folder.path();
    // The configuration is wrong: at once, when the points are known, and when the whole mesh is.
    earlier.refuses(&with_output("max_edge = 15000", "max_edge = -9"), 2, &["max_edge"]);
    let refused = earlier.refuses(&with_output("max_edge = 15000", "max_edge = 0.001"), 2, &["all", "greater"]);
    assert!(refused.err.contains("correct the configuration"), "{}", refused.err);
    let missing = Setup { input: "files = [\"no.csv\"]".into(), ..base() };
    earlier.refuses(&missing, 2, &["no.csv"]);
    earlier.refuses(&with_input("resolution = 0.000001"), 2, &["resolution"]);
    // No point is left, or none makes a triangle.
    earlier.refuses(&with_input("bounds = [-9e6, -9e6, -8e6, -8e6]"), 3, &["no point is left", "inputs lie in ["]);
    earlier.refuses(&with_input("resolution = 10000000"), 3, &["no triangle"]);
    // Bad inputs.
    let cloud = fs::read_to_string(folder.join("cloud.csv")).unwrap();
    for (text, word) in [(cloud.clone() + "no,point,this\n", "malformed"), (String::new(), "empty")] {
        fs::write(folder.join("cloud.csv"), text).unwrap();
        earlier.refuses(&base(), 3, &[word]);
    }
    fs::write(folder.join("cloud.csv"), cloud).unwrap();
    earlier.rig.configure(&base());
    earlier.rig.completes("after all that");
}

/// What reading and triangulating took is not lost with it.
#[test]
fn a_mistyped_max_edge_costs_only_the_tiles() {
    let earlier = Earlier::new();
    earlier.refuses(&with_output("max_edge = 15000", "max_edge = 0.001"), 2, &["what is done is kept"]);
    earlier.rig.configure(&base());
    let said = earlier.rig.run().succeeded().err;
    assert!(said.contains("[output] max_edge; the tiles are written again"), "{said}");
    let report = earlier.rig.is_complete(&said);
    assert!(report["resumed"] == 2, "{}", report["resumed"]);
}

/// Kills until the results take their places, and while they do.
#[test]
fn a_killed_job_leaves_the_results_of_the_one_before_until_its_own_are_whole() {
    let earlier = Earlier::new();
    let rig = &earlier.rig;
    let mut kills = 0;
    for place in ["commit", "published", "torn", "committed", "leaf", "tile"] {
        for count in 1.. {
            if !rig.run_to(place, count).was_killed() {
                break;
            }
            earlier.stay(&format!("{place}, {count}"));
            kills += 1;
            let said = Run::start(rig.command().arg("--restart").env("GDT_FAULT", "commit:1")).end();
            assert!(said.was_killed());
        }
        rig.is_complete(place);
        earlier.put_back();
    }
    assert!(kills > 20, "{kills}");
}

#[test]
fn a_job_killed_while_its_results_take_their_places_is_complete_after_the_next_run() {
    let earlier = Earlier::new();
    let rig = &earlier.rig;
    let steps = rig.expected.len() as u64 + 1;
    for count in [1, 2, steps / 2, steps - 1, steps] {
        rig.configure(&base());
        assert!(rig.run_to("replacing", count).was_killed(), "{count} of {steps}");
        assert!(!rig.out().join("report.json").exists(), "some results are old and some are new");
        let refused = verify::verify(&rig.out(), 1 << 28).unwrap_err();
        assert!(refused.kind() == ErrorKind::Retry && refused.to_string().contains("run the job again"), "{refused}");
        // Whatever the next run is asked for, it finds the results whole.
        match count % 3 {
            0 => _ = rig.completes(&format!("replacing, {count}"))["resumed"],
            1 => {
                rig.configure(&with_output("max_edge = 15000", "max_edge = 0.001"));
                assert_eq!(rig.run().status.code(), Some(2));
                found_whole(rig, count);
            }
            _ => {
                rig.configure(&with_input("bounds = [-9e6, -9e6, -8e6, -8e6]"));
                assert_eq!(Run::start(rig.command().arg("--restart")).end().status.code(), Some(3));
                found_whole(rig, count);
            }
        }
        earlier.put_back();
    }
    assert!(!rig.run_to("replacing", steps + 1).was_killed());
}

/// The run after a damaged result writes another report. The journal must not name the old one beside it.
#[test]
fn a_damaged_result_and_a_second_kill_leave_a_job_that_the_next_run_completes() {
    let earlier = Earlier::new();
    let rig = &earlier.rig;
    assert!(rig.run_to("replacing", 1).was_killed());
    fs::write(rig.out().join("job/results/preview.png"), "damaged").unwrap();
    assert!(rig.run_to("replacing", 3).was_killed());
    rig.configure(&with_output("max_edge = 15000", "max_edge = 0.001"));
    assert_eq!(rig.run().status.code(), Some(2));
    found_whole(rig, 3);
}

#[track_caller]
pub(crate) fn found_whole(rig: &Rig, count: u64) {
    let mut found = files(&rig.out());
    found.retain(|name, _| !name.starts_with("job/"));
    assert!(found == rig.expected && rig.out().join("report.json").exists(), "{count}: {:?}", found.keys());
}

#[test]
fn a_job_without_room_on_the_disk_leaves_the_results_of_the_one_before() {
    let earlier = Earlier::new();
    for kibibytes in [8, 48, 96] {
        let mut command = Command::new("bash");
        command.arg("-c").arg(format!("ulimit -f {kibibytes} && exec \"$0\" --force --restart job.toml"));
        command.arg(env!("CARGO_BIN_EXE_gdt-batch")).current_dir(earlier.rig.folder.path());
        let end = Run::start(&mut command).end().stopped(&["error: cannot write"]);
        earlier.stay(&end.err);
    }
    earlier.rig.completes("with room");
}

#[test]
fn files_that_are_open_stay_readable_and_none_is_missing_at_any_moment() {
    use std::io::{Read, Seek};
    let earlier = Earlier::new();
    let rig = &earlier.rig;
    let open = |name: &str| fs::File::open(rig.out().join(name)).unwrap();
    let mut files: Vec<(&String, fs::File)> = earlier.results.keys().map(|name| (name, open(name))).collect();
    let mut run = Run::start(&mut rig.command());
    let both: Vec<&String> = earlier.results.keys().filter(|name| rig.expected.contains_key(*name)).collect();
    assert!(both.len() > 5);
    while run.child.try_wait().unwrap().is_none() {
        for name in &both {
            let bytes = fs::read(rig.out().join(name)).expect("a file that both jobs have is there at any moment");
            assert!(bytes == earlier.results[*name] || bytes == rig.expected[*name], "{name} is half-written");
        }
    }
    run.end().succeeded();
    rig.is_complete("while somebody looks");
    for (name, file) in &mut files {
        let mut bytes = Vec::new();
        file.rewind().unwrap();
        file.read_to_end(&mut bytes).unwrap();
        assert!(bytes == earlier.results[*name], "{name}");
    }
}
