//! Jobs that tasks do: any number of them leave the bytes that one process leaves, and what they cannot do by parts, `publish` does.

use crate::clouds::{self, Cloud};
use crate::globe::{Source, gaps, square};
use crate::las_file::LasFile;
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, Said, gdt_batch, number};
use crate::tileset::tiles;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, SystemTime};
use tiles::checksums::seal;

const PHASES: [&str; 7] = ["plan", "read", "mesh", "join", "tiles", "levels", "publish"];

/// Returns the checksums of all results but the report.
fn bytes(job: &Job) -> String {
    fs::read_to_string(job.out().join("XXH128SUMS")).unwrap()
}

/// Runs the program with the configuration of `job` after the command.
#[track_caller]
fn command(job: &Job, command: &str, arguments: &[&str]) -> Said {
    let config = job.config();
    gdt_batch(job.folder(), &[&[command, config.to_str().unwrap()], arguments].concat())
}

#[track_caller]
fn local(job: &Job, tasks: u32) -> Said {
    command(job, "submit", &["--engine", "local", "--tasks", &tasks.to_string()])
}

#[track_caller]
fn task(job: &Job, phase: &str, task: &str) -> Said {
    command(job, "work", &["--phase", phase, "--task", task])
}

/// Does all tasks of the phases before `phase`.
#[track_caller]
fn up_to(job: &Job, phase: &str, tasks: u32) {
    for before in PHASES.iter().take_while(|before| **before != phase) {
        (1..=tasks).for_each(|number| _ = task(job, before, &format!("{number}/{tasks}")).succeeded());
    }
}

#[track_caller]
fn status(job: &Job, tasks: u32) -> Value {
    command(job, "status", &["--json", "--tasks", &tasks.to_string()]).succeeded().json()
}

/// Does all tasks of a job with `max_error`, which has one phase more.
#[test]
fn tasks_select_the_vertices_that_one_process_selects() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(20_000, 3), 4_000);
    let job = || in_parts(&files, 2_500).with("output", "max_error = 20.0");
    let one = job();
    let report = one.report();
    assert!(number(&report["parts"]) > 5 && number(&report["sites"]) < 15_000);
    for tasks in [1, 3] {
        let many = job();
        local(&many, tasks).succeeded();
        assert_eq!(bytes(&many), bytes(&one), "{tasks} tasks");
    }
    let many = job();
    for phase in ["plan", "read"] {
        task(&many, phase, "1/1").succeeded();
    }
    task(&many, "mesh", "1/1").refused(1, &["select is not complete: task 1 of 1 is missing"]);
    let phases = status(&many, 1)["phases"].as_array().unwrap().clone();
    let select = phases.iter().find(|phase| phase["phase"] == "select").unwrap();
    assert_eq!((&select["done"], &select["of"]), (&json!(0), &json!(1)));
    for phase in ["select", "mesh", "join", "tiles", "levels", "publish"] {
        task(&many, phase, "1/1").succeeded();
    }
    assert_eq!(bytes(&many), bytes(&one), "phase by phase");
}

#[test]
fn any_number_of_tasks_leaves_the_bytes_of_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(20_000, 3), 4_000);
    for (section, line) in
        [("output", "levels = true"), ("output", "max_edge = \"auto\""), ("output", "format = \"glb\"")]
    {
        let job = || in_parts(&files, 2_500).with(section, line);
        let one = job();
        let report = one.report();
        assert!(number(&report["parts"]) > 5);
        for tasks in [1, 3, 8] {
            let many = job();
            let said = local(&many, tasks).succeeded();
            assert!(said.out.contains("triangles between"), "{}", said.out);
            assert_eq!(bytes(&many), bytes(&one), "{line}, {tasks} tasks");
            assert!(!many.out().join("job").exists());
            // A scheduler may start a task again that was done.
            for phase in &PHASES[..6] {
                let again = task(&many, phase, "1/1").succeeded();
                assert!(again.out.contains("all results are in place"), "{phase}: {}", again.out);
            }
            let again = task(&many, "publish", "1/1").succeeded();
            assert!(again.out.contains("triangles between") && !many.out().join("job").exists(), "{}", again.out);
            assert_eq!(bytes(&many), bytes(&one), "{line}, {tasks} tasks, started again");
            let written: Value = serde_json::from_slice(&fs::read(many.out().join("report.json")).unwrap()).unwrap();
            for figure in ["sites", "triangles", "points", "levels", "vertex_digest", "parts", "tiles", "bytes_written"]
            {
                assert_eq!(written[figure], report[figure], "{figure}");
            }
            // It counts what other tasks took.
            let slowest = written["slowest_part"]["seconds"].as_f64();
            assert!(written["wall_s"].as_f64() >= slowest && slowest > Some(0.0), "{written}");
            let stages = |report: &Value| -> Vec<Value> {
                let stages = report["stages"].as_array().unwrap().iter();
                stages.map(|stage| json!([stage["stage"], stage["done"]])).collect()
            };
            assert_eq!(stages(&written), stages(&report));
        }
        one.verified();
    }
}

/// How the scene of a wide terrain is bent comes from a machine's mathematics library. So tasks take it from the plan.
#[test]
fn tasks_bend_the_scene_as_one_process_does() {
    let folder = tempfile::tempdir().unwrap();
    let (mut files, points) = (Vec::new(), square(140, 12_000.0, [0.0; 2]));
    for (number, quarter) in points.chunks(points.len() / 4).enumerate() {
        let line = |[x, y, z]: &[i32; 3]| {
            let [x, y, z] = [x, y, z].map(|v| f64::from(*v) / 100.0);
            format!("{:.2},{:.2},{z:.2}\n", 5e5 + x, 4e6 + y)
        };
        files.push(folder.path().join(format!("{number}.csv")));
        fs::write(&files[number], quarter.iter().map(line).collect::<String>()).unwrap();
    }
    let wide = |job: Job| job.with("input", "crs = \"EPSG:32633\"").with("output", "format = \"3dtiles\"");
    let (one, many) = (wide(in_parts(&files, 2_500)), wide(in_parts(&files, 2_500)));
    let report = one.report();
    assert!(number(&report["parts"]) > 3, "{}", report["parts"]);
    local(&many, 3).succeeded();
    assert_eq!(bytes(&many), bytes(&one));
    assert!(Source::of(&many).extras.curvature.is_some());
    assert_eq!(gaps(&many, &tiles(&many)).0, 0.0);
    assert_eq!(wide(Job::on(&files).tiles_of(500)).digest(), many.digest());
}

/// A user need not know how many parts there will be.
#[test]
fn local_starts_no_more_tasks_than_have_something_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(8_000, 15), 4_000);
    let (job, one) = (in_parts(&files, 2_000), in_parts(&files, 2_000));
    let parts = number(&one.report()["parts"]);
    let started = |said: &Said| -> Vec<(String, u64)> {
        let lines = said.err.lines().filter_map(|line| line.strip_prefix("phase ")?.split_once(": "));
        let count = |(phase, text): (&str, &str)| {
            let (count, of) = text.split_once(" of ")?;
            of.starts_with('1').then(|| (phase.to_owned(), count.parse().unwrap()))
        };
        lines.filter_map(count).collect()
    };
    let said = local(&job, 1_000_000).succeeded();
    let phases = started(&said);
    assert_eq!(phases.len(), PHASES.len(), "{}", said.err);
    assert!(phases.iter().all(|(_, count)| *count <= parts), "{parts} parts: {phases:?}");
    assert_eq!(phases[2], ("mesh".to_owned(), parts));
    assert_eq!(bytes(&job), bytes(&one));
    let small = Job::on(&files).tiles_of(500);
    let said = local(&small, 1_000_000).succeeded();
    assert_eq!(started(&said), [("plan".to_owned(), 1), ("publish".to_owned(), 1)], "{}", said.err);
}

/// The report of a job of tasks says what the hungriest of them took, not what `publish` did.
#[test]
fn the_report_counts_the_memory_of_all_tasks() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(8_000, 16), 4_000);
    let job = in_parts(&files, 2_000);
    up_to(&job, "publish", 1);
    let mut peaks = Vec::new();
    for folder in fs::read_dir(job.out().join("job/parts")).unwrap() {
        let journal = fs::read_to_string(folder.unwrap().path().join("journal")).unwrap();
        let values = journal.split("\"peak_memory\":").skip(1);
        peaks.extend(values.filter_map(|text| text.split([',', '}']).next()?.parse::<u64>().ok()));
    }
    assert!(peaks.len() > 8);
    task(&job, "publish", "1/1").succeeded();
    let report: Value = serde_json::from_slice(&fs::read(job.out().join("report.json")).unwrap()).unwrap();
    assert!(report["peak_memory"].as_u64() >= peaks.into_iter().max(), "{report}");
}

#[test]
fn the_environment_tells_a_task_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(10_000, 4), 4_000);
    let (job, one) = (in_parts(&files, 1_500), in_parts(&files, 1_500));
    one.report();
    let config = job.config();
    let run = |phase: &str, variables: &[(&str, String)], more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        command.args(["work", config.to_str().unwrap(), "--phase", phase]).args(more).current_dir(job.folder());
        command.envs(variables.iter().map(|(name, value)| (name, value))).output().unwrap()
    };
    for phase in PHASES {
        for number in 1..=3 {
            let slurm = |name: &'static str, value: u32| (name, value.to_string());
            let index = number - 1;
            let outcome = match phase {
                "read" => run(phase, &[("JOB_COMPLETION_INDEX", index.to_string())], &["--tasks", "3"]),
                "tiles" => run(phase, &[("AWS_BATCH_JOB_ARRAY_INDEX", index.to_string())], &["--tasks", "3"]),
                "mesh" | "levels" => {
                    let ends = [slurm("SLURM_ARRAY_TASK_MAX", 3), slurm("SLURM_ARRAY_TASK_COUNT", 3)];
                    run(phase, &[slurm("SLURM_ARRAY_TASK_ID", number), ends[0].clone(), ends[1].clone()], &[])
                }
                _ if number == 1 => run(phase, &[], &["--tasks", "3"]),
                _ => continue,
            };
            assert!(outcome.status.success(), "{phase}: {outcome:?}");
        }
    }
    assert_eq!(bytes(&job), bytes(&one));
    let nameless = run("mesh", &[], &[]);
    assert_eq!(nameless.status.code(), Some(2), "{nameless:?}");
}

#[test]
fn a_phase_too_early_names_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(12_000, 5), 4_000);
    let job = in_parts(&files, 2_000);
    for phase in &PHASES[1..] {
        task(&job, phase, "1/3").refused(1, &["the phase plan is not complete"]);
        assert!(!job.out().exists(), "a task makes no job");
    }
    up_to(&job, "read", 3);
    task(&job, "read", "2/3").succeeded();
    for (phase, missing) in [("join", "read is not complete: tasks 1, 3 of 3"), ("tiles", "join"), ("levels", "join")] {
        task(&job, phase, "1/3").refused(1, &[missing, "gdt-batch submit"]);
    }
    task(&job, "publish", "1/3").refused(1, &["read is not complete: tasks 1, 3 of 3 are missing"]);
    up_to(&job, "mesh", 3);
    task(&job, "mesh", "1/3").succeeded();
    task(&job, "mesh", "3/3").succeeded();
    task(&job, "join", "1/3").refused(1, &["mesh is not complete: task 2 of 3 is missing"]);
    let found = status(&job, 3);
    assert_eq!(found["state"], "under-way");
    let missing: Vec<&Value> =
        found["phases"].as_array().unwrap().iter().map(|phase| &phase["missing_tasks"]).collect();
    assert_eq!(json!(missing), json!([[], [], [2], [1], [1, 2, 3], [1, 2, 3], [1]]));
    let mesh = &found["phases"][2];
    assert_eq!(number(&mesh["done"]) + mesh["missing_parts"].as_array().unwrap().len() as u64, number(&mesh["of"]));
    assert!(number(&mesh["of"]) > 3 && found["slowest_part"]["seconds"].as_f64().unwrap() > 0.0);
    // Only what is missing is sent.
    let shown = command(&job, "submit", &["--engine", "local", "--tasks", "3", "--dry-run"]).succeeded().out;
    let tasks: Vec<&str> = shown.lines().filter_map(|line| line.split_once("--phase ")).map(|(_, task)| task).collect();
    assert_eq!(tasks.len(), 9, "{shown}");
    assert!(tasks[0].starts_with("mesh --task 2/3") && tasks[1].starts_with("join"), "{shown}");
    local(&job, 3).succeeded();
    job.verified();
    assert_eq!(status(&job, 3)["state"], "done");
}

#[test]
fn tasks_and_one_process_go_on_with_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(12_000, 6), 4_000);
    let one = in_parts(&files, 2_000);
    one.report();
    for phase in &PHASES[1..] {
        let job = in_parts(&files, 2_000);
        up_to(&job, phase, 2);
        // Twice changes nothing, and neither does half of a phase by as many tasks as nobody else has.
        task(&job, PHASES[PHASES.iter().position(|other| other == phase).unwrap() - 1], "1/2").succeeded();
        if *phase != "publish" {
            task(&job, phase, "2/5").succeeded();
        }
        let report = job.report();
        assert!(number(&report["resumed"]) > 0, "{phase}");
        assert_eq!(bytes(&job), bytes(&one), "{phase}");
    }
}

#[test]
fn a_small_job_is_left_to_publish() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(3_000, 7), 4_000);
    let (job, one) = (Job::on(&files).tiles_of(500), Job::on(&files).tiles_of(500));
    one.report();
    up_to(&job, "publish", 2);
    assert!(task(&job, "mesh", "1/2").succeeded().out.contains("the phase publish does all of it"));
    assert_eq!(status(&job, 2)["state"], "left-to-publish");
    local(&job, 2).succeeded();
    assert_eq!(bytes(&job), bytes(&one));
}

/// The header of one file claims a box that does not hold all its points, and another file is damaged and to be left out.
#[test]
fn one_bad_file_ends_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = in_files(folder.path(), &hills(12_000, 8), 4_000);
    let mut text = fs::read_to_string(&files[5]).unwrap();
    text.push_str("1.0,not a number,2\n");
    fs::write(&files[5], &text).unwrap();
    let mut bytes_of_spiral = LasFile::new(2, 2, 0, 120_000).las();
    let reach = 10.0 * 60_000.0 * 0.01;
    let claims =
        [(179, 5e5 + reach), (187, 5e5 - reach), (195, 4e6 + reach), (203, 4e6 - reach), (211, 1.0), (219, -1.0)];
    for (at, value) in claims {
        bytes_of_spiral[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
    }
    let spiral = folder.path().join("spiral.las");
    fs::write(&spiral, bytes_of_spiral).unwrap();
    let skip = |files: &[PathBuf]| {
        in_parts(files, 2_000).with("input", "on_bad_file = \"skip\"\nmax_malformed_fraction = 0.0")
    };
    let spirals =
        |_: &[PathBuf]| Job::on(&[&spiral]).tiles_of(10_000).with("triangulation", "max_points_per_part = 20000");
    for (what, job) in [("damaged", &skip as &dyn Fn(&[PathBuf]) -> Job), ("wrong header", &spirals)] {
        let (many, one) = (job(&files), job(&files));
        let report = one.report();
        let said = local(&many, 3).succeeded();
        assert_eq!(bytes(&many), bytes(&one), "{what}: {}", said.err);
        let written: Value = serde_json::from_slice(&fs::read(many.out().join("report.json")).unwrap()).unwrap();
        assert_eq!((&written["skipped"], &written["parts"]), (&report["skipped"], &report["parts"]), "{what}");
    }
    // Where bad files are not to be left out, the task that reads one says which it is.
    files.truncate(12);
    let stop = in_parts(&files, 2_000).with("input", "max_malformed_fraction = 0.0");
    let said = local(&stop, 3);
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains(files[5].file_name().unwrap().to_str().unwrap()), "{}", said.err);
}

/// Two clusters so far from each other that single precision cannot hold the triangles between them: the lattice becomes coarser.
#[test]
fn a_mesh_too_fine_is_left_to_publish() {
    let folder = tempfile::tempdir().unwrap();
    let at = |offset: i64| hills(4_000, 9).into_iter().map(move |[x, y, z]| [x + offset, y, z]);
    let cloud: Cloud = at(0).chain(at(60_000_000)).collect();
    let files = in_files(folder.path(), &cloud, 10_000);
    let (many, one) = (in_parts(&files, 2_000), in_parts(&files, 2_000));
    let said = one.run().succeeded();
    assert!(said.err.contains("starting again with a coarser step"), "{}", said.err);
    local(&many, 3).succeeded();
    assert_eq!(bytes(&many), bytes(&one));
}

#[test]
fn what_has_changed_since_the_plan_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(12_000, 10), 4_000);
    let job = in_parts(&files, 2_000);
    up_to(&job, "mesh", 2);
    let job = job.with("output", "color = \"elevation\"");
    for phase in &PHASES[2..] {
        task(&job, phase, "1/2").refused(2, &["[output] color", "changed since the job was planned", "phase plan"]);
    }
    // The plan starts the job over.
    local(&job, 2).succeeded();
    job.verified();
    fs::remove_dir_all(job.out()).unwrap();
    let text = fs::read_to_string(&files[0]).unwrap();
    up_to(&job, "read", 2);
    fs::write(&files[0], text.lines().rev().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
    let said = [1, 2].map(|number| task(&job, "read", &format!("{number}/2")));
    let refused = said.iter().find(|said| said.code != 0).expect("a task reads the file");
    refused.refused(2, &[files[0].file_name().unwrap().to_str().unwrap(), "has changed since the job was planned"]);
}

/// Whoever edits a record of a large file in place changes neither its size nor its samples, but its time.
#[cfg(unix)]
#[test]
fn an_input_that_is_edited_in_place_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = hills(24_000, 10);
    let file = clouds::write(folder.path(), "large.csv", &cloud);
    let files = [file.clone(), clouds::write(folder.path(), "small.csv", &clouds::uniform(2_000, 9_000, 4))];
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.len() > 250_000, "samples are all of it");
    // Where no sample is.
    let at = text.len() / 2 + (text.len() / 40) + text[text.len() / 2 + text.len() / 40..].find(',').unwrap() + 1;
    // Reports know whole seconds, and the test may take less.
    let edit = |seconds_ahead: u64| {
        let edited = fs::File::options().write(true).open(&file).unwrap();
        std::os::unix::fs::FileExt::write_all_at(&edited, b"7", at as u64).unwrap();
        edited.set_modified(SystemTime::now() + Duration::from_secs(seconds_ahead)).unwrap();
    };
    let report =
        |job: &Job| -> Value { serde_json::from_slice(&fs::read(job.out().join("report.json")).unwrap()).unwrap() };
    let job = in_parts(&files, 2_000);
    up_to(&job, "read", 2);
    edit(0);
    let said = [1, 2].map(|number| task(&job, "read", &format!("{number}/2")));
    let refused = said.iter().find(|said| said.code != 0).expect("a task reads the file");
    refused.refused(2, &["large.csv was modified after the job was planned", "phase plan again"]);
    // The plan starts the job over, and so does a submission.
    let said = task(&job, "plan", "1/1").succeeded();
    assert!(said.err.contains("large.csv") && said.err.contains("starting over"), "{}", said.err);
    up_to(&job, "publish", 2);
    edit(100);
    task(&job, "publish", "1/1").succeeded();
    let warnings = report(&job)["warnings"].to_string();
    assert!(warnings.contains("large.csv: modified after the job was planned") && warnings.contains("--restart"));
    // A copy that keeps an old time.
    up_to(&job, "publish", 2);
    let copy = fs::File::options().write(true).open(&file).unwrap();
    copy.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000)).unwrap();
    task(&job, "publish", "1/1").succeeded();
    let warnings = report(&job)["warnings"].to_string();
    assert!(warnings.contains("large.csv: its modification time differs from that when the job was planned"));
    up_to(&job, "join", 2);
    edit(200);
    local(&job, 2).succeeded();
    assert!(!report(&job)["warnings"].to_string().contains("--restart"));
    let one = in_parts(&files, 2_000);
    one.report();
    assert_eq!(bytes(&job), bytes(&one));
}

/// The inputs alone do not tell a job from others: a submission with another style would end at once.
#[cfg(unix)]
#[test]
fn a_finished_job_is_not_finished_with_another_style() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(8_000, 11), 4_000);
    let job = in_parts(&files, 2_000);
    local(&job, 2).succeeded();
    assert_eq!(status(&job, 2)["state"], "done");
    let before = bytes(&job);
    // Limits that change no byte leave it as it is.
    let job = job.with("limits", "threads = 1\nkeep_steps = false");
    assert_eq!(status(&job, 2)["state"], "done");
    let text = fs::read_to_string(job.config()).unwrap();
    let other = job.folder().join("other.toml");
    for line in ["[output]\ncolor = \"elevation\"", "[limits]\nmemory = \"1 GiB\"", "[input]\nclasses = [2]"] {
        let (section, _) = line.split_once('\n').unwrap();
        fs::write(&other, text.replace(section, line)).unwrap();
        let run = |words: &[&str]| gdt_batch(job.folder(), words);
        let said = run(&["status", "other.toml"]).succeeded().out;
        assert!(said.contains("the results in place are of other options"), "{line}: {said}");
        run(&["work", "other.toml", "--phase", "mesh", "--task", "1/1"])
            .refused(1, &["the phase plan is not complete"]);
    }
    // The paths are not part of it.
    let link = job.folder().join("link");
    std::os::unix::fs::symlink(folder.path(), &link).unwrap();
    fs::rename(job.out(), job.folder().join("moved")).unwrap();
    let elsewhere = text.replace(folder.path().to_str().unwrap(), "link").replace("\"out\"", "\"moved\"");
    assert!(elsewhere != text);
    fs::write(&other, elsewhere).unwrap();
    let said = gdt_batch(job.folder(), &["status", "other.toml"]).succeeded().out;
    assert!(said.contains("done: all results are in place"), "{said}");
    fs::rename(job.folder().join("moved"), job.out()).unwrap();
    let job = job.with("output", "compression = \"none\"");
    assert_eq!(status(&job, 2)["state"], "other-results");
    local(&job, 2).succeeded();
    assert_eq!(status(&job, 2)["state"], "done");
    assert!(bytes(&job) != before);
    job.verified();
    // A changed input is another job too, also if only its time tells.
    let text = fs::read(&files[0]).unwrap();
    fs::write(&files[0], text).unwrap();
    let later = std::time::SystemTime::now() + std::time::Duration::from_secs(5);
    fs::File::options().append(true).open(&files[0]).unwrap().set_modified(later).unwrap();
    assert_eq!(status(&job, 2)["state"], "other-results");
}

#[test]
fn a_finished_job_is_sent_only_to_start_it_over() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(8_000, 12), 4_000);
    let job = in_parts(&files, 2_000);
    local(&job, 2).succeeded();
    let (before, report) = (bytes(&job), fs::read(job.out().join("report.json")).unwrap());
    let pods = ["--", "--image", "i", "--volume", "data:/"];
    let submit = |engine: &str, more: &[&str]| {
        let pods = if engine == "kubernetes" { &pods[..] } else { &[] };
        command(&job, "submit", &[&["--engine", engine, "--tasks", "3"], more, pods].concat())
    };
    for (engine, more) in
        [("local", &[][..]), ("local", &["--dry-run"]), ("slurm", &["--dry-run"]), ("kubernetes", &["--dry-run"])]
    {
        let said = submit(engine, more).succeeded();
        assert!(said.err.contains("nothing was submitted, because the job is done"), "{engine}: {}", said.err);
        let expected = if more.is_empty() { "done: all results are in place" } else { "" };
        assert!(said.out.trim_end().ends_with(expected) && !said.out.contains("--phase"), "{}", said.out);
        assert_eq!(said.out.is_empty(), expected.is_empty(), "{}", said.out);
        let sent = submit(engine, &["--restart", "--dry-run"]).succeeded().out;
        assert_eq!(sent.matches("--phase").count(), sent.matches("--submission").count(), "{sent}");
        assert!(sent.contains("--submission"), "{engine}: {sent}");
    }
    assert_eq!(fs::read(job.out().join("report.json")).unwrap(), report);
    submit("local", &["--restart"]).succeeded();
    assert!(fs::read(job.out().join("report.json")).unwrap() != report);
    assert_eq!(bytes(&job), before);
    submit("local", &[]).succeeded();
    job.verified();
}

/// A scheduler may start the phases in any order, and a task twice: with the number of the submission nobody takes the results, the plan or
/// the note of before for those that are to come.
#[test]
fn tasks_of_a_submission_that_starts_over_come_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(8_000, 13), 4_000);
    for job in [in_parts(&files, 2_000), Job::on(&files).tiles_of(500)] {
        let numbered = |phase: &str, number: &str| {
            command(&job, "work", &["--phase", phase, "--task", "1/1", "--submission", number])
        };
        local(&job, 1).succeeded();
        let before = bytes(&job);
        up_to(&job, "publish", 1);
        for number in ["7", "8"] {
            for phase in &PHASES[1..] {
                numbered(phase, number).refused(1, &["the phase plan is not complete"]);
            }
            let report = || fs::read(job.out().join("report.json")).unwrap();
            let old = report();
            for phase in PHASES {
                numbered(phase, number).succeeded();
                numbered(phase, number).succeeded();
            }
            assert!(report() != old && bytes(&job) == before, "{number}");
            assert!(!job.out().join("job").exists());
        }
        // What came later counts too.
        numbered("publish", "7").succeeded();
        numbered("mesh", "9").refused(1, &["the phase plan is not complete"]);
    }
}

/// A report of an earlier version says nothing of the options. It still tells what `verify` needs.
#[test]
fn a_report_without_fingerprints_is_that_of_another_job() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(3_000, 14), 4_000);
    let job = Job::on(&files).tiles_of(500);
    job.report();
    assert_eq!(status(&job, 1)["state"], "done");
    let path = job.out().join("report.json");
    let text = fs::read_to_string(&path).unwrap();
    let is_new =
        |line: &&str| ["options_fingerprint", "job_fingerprint", "submission"].iter().any(|name| line.contains(name));
    let old: String = text.lines().filter(|line| !is_new(line)).map(|line| format!("{line}\n")).collect();
    let (checksum, found) = seal(old.as_bytes()).unwrap();
    fs::write(&path, old.replace(&found.to_string(), &checksum.to_string())).unwrap();
    assert_eq!(status(&job, 1)["state"], "other-results");
    gdt_batch(job.folder(), &["verify", "out"]).succeeded();
    // Nor does one that was changed tell that a job is done.
    fs::write(&path, text.replacen("\"sites\": ", "\"sites\": 1", 1)).unwrap();
    assert_eq!(status(&job, 1)["state"], "other-results");
}
