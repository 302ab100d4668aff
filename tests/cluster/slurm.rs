//! A real Slurm does a job in arrays of tasks, one of which is queued again, and two of which are killed.

use crate::rig::{Rig, succeeded};
use crate::slurm_daemons::{MAX_ARRAY_SIZE, Slurm};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

/// More than an array may have elements.
const TASKS: u32 = 6;
const _: () = assert!(TASKS > MAX_ARRAY_SIZE);

/// Sends the job, and returns the tasks that are sent by phase.
fn submit(rig: &Rig, slurm: &Slurm) -> BTreeMap<String, BTreeSet<u64>> {
    let mut command = slurm.with_conf(rig.program());
    command.args(["--json", "submit", "out.toml", "--engine", "slurm", "--tasks", &TASKS.to_string()]);
    let sent: Value = serde_json::from_str(&succeeded(command.output().unwrap())).unwrap();
    let mut phases: BTreeMap<String, BTreeSet<u64>> = BTreeMap::new();
    for job in sent["jobs"].as_array().unwrap() {
        let tasks = job["tasks"].as_array().unwrap().iter().map(|task| task.as_u64().unwrap());
        phases.entry(job["phase"].as_str().unwrap().into()).or_default().extend(tasks);
    }
    phases
}

/// A process that does a task.
struct Worker {
    process: String,
    /// The number of the task.
    task: u64,
    /// The number by which Slurm knows it.
    job: String,
}

/// Waits for tasks of `phase` and stops their processes before they can end (SIGSTOP). `None` if they end too soon.
fn catch(rig: &Rig, slurm: &Slurm, phase: &str, wanted: usize) -> Option<Vec<Worker>> {
    let mut caught: Vec<Worker> = Vec::new();
    while caught.len() < wanted {
        // The queue takes longer to tell than a short task may take.
        for _ in 0..20 {
            for process in fs::read_dir("/proc").unwrap().map(|entry| entry.unwrap().path()) {
                if caught.len() < wanted && caught.iter().all(|worker| !process.ends_with(&worker.process)) {
                    caught.extend(stopped(&process, rig, phase));
                }
            }
            sleep(Duration::from_millis(1));
        }
        let left = slurm.queue("%j").iter().filter(|name| name.ends_with(phase)).count();
        if left <= caught.len() && caught.len() < wanted {
            caught.iter().for_each(|worker| signal(&worker.process, "CONT"));
            return None;
        }
    }
    Some(caught)
}

/// Stops the process if it does a task of `phase`.
fn stopped(process: &Path, rig: &Rig, phase: &str) -> Option<Worker> {
    let read = |name: &str| fs::read(process.join(name)).ok();
    let words = |bytes: Vec<u8>| -> Vec<String> {
        bytes.split(|byte| *byte == 0).map(|word| String::from_utf8_lossy(word).into_owned()).collect()
    };
    let arguments = words(read("cmdline")?);
    let [_, work, job, _, of, _, task, ..] = arguments.as_slice() else { return None };
    if work != "work" || Path::new(job) != rig.config() || of != phase {
        return None;
    }
    let number = process.file_name()?.to_str()?.to_owned();
    let environment = words(read("environ")?);
    let variable = |name: &str| environment.iter().find_map(|variable| variable.strip_prefix(name));
    let job = format!("{}_{}", variable("SLURM_ARRAY_JOB_ID=")?, variable("SLURM_ARRAY_TASK_ID=")?);
    let worker = Worker { process: number, task: task.split('/').next().unwrap().parse().unwrap(), job };
    signal(&worker.process, "STOP");
    loop {
        let state = String::from_utf8(read("stat")?).ok()?;
        match state.rsplit(") ").next()?.chars().next()? {
            'T' if hears_signals(process)? && rig.log(phase, worker.task).is_empty() => return Some(worker),
            // It has only begun, or it has said that a part is done: then it may have no other.
            'T' => {
                signal(&worker.process, "CONT");
                return None;
            }
            // It has ended.
            'Z' | 'X' => return None,
            _ => sleep(Duration::from_millis(1)),
        }
    }
}

/// Tells whether the process catches SIGTERM.
fn hears_signals(process: &Path) -> Option<bool> {
    const TERM: u32 = 15;
    let status = fs::read_to_string(process.join("status")).ok()?;
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
    u64::from_str_radix(caught.trim(), 16).ok().map(|signals| signals >> (TERM - 1) & 1 == 1)
}

fn signal(process: &str, name: &str) {
    let _ = Command::new("kill").args(["-s", name, process]).status().unwrap();
}

impl Rig {
    /// Returns what a task has written.
    fn log(&self, phase: &str, task: u64) -> String {
        let size = u64::from(MAX_ARRAY_SIZE);
        let folder = if task < size { phase.to_owned() } else { format!("{phase}+{}", task / size * size) };
        let path = self.folder().join("out.slurm").join(folder).join(format!("{}.log", task % size));
        fs::read_to_string(path).unwrap_or_default()
    }
}

/// Queues a task again, as Slurm does when a node fails: it is done again, and what waits for it goes on waiting. `None` if the tasks
/// ended too soon.
fn queue_again(rig: &Rig, slurm: &Slurm) -> Option<Worker> {
    let worker = catch(rig, slurm, "read", 1)?.remove(0);
    succeeded(slurm.command("scontrol").args(["requeue", &worker.job]).output().unwrap());
    let waits = format!("{} BeginTime", worker.job);
    slurm.wait_until("the other tasks", |slurm| {
        let queue = slurm.queue("%i %r %j");
        let mut reading = queue.iter().filter(|task| task.ends_with("-read"));
        reading.next().is_some_and(|task| task.starts_with(&waits)) && reading.next().is_none()
    });
    let queue = slurm.queue("%j %r");
    let mut meshing = queue.iter().filter(|task| task.starts_with("out-mesh")).peekable();
    assert!(meshing.peek().is_some() && meshing.all(|task| task.ends_with("Dependency")), "{queue:?}");
    // A node refuses a task that starts in the second in which it was killed there. Nobody but this test starts one so soon.
    sleep(Duration::from_millis(1100));
    let now = [format!("JobId={}", worker.job), "StartTime=now".into()];
    succeeded(slurm.command("scontrol").arg("update").args(now).output().unwrap());
    Some(worker)
}

/// Sends the job and ends two of its tasks, one with `scancel` and one with `kill -9`. Returns their numbers; `None` if they ended too
/// soon by themselves.
fn disturb(rig: &Rig, slurm: &Slurm) -> Option<BTreeSet<u64>> {
    let sent = submit(rig, slurm);
    let all: BTreeSet<u64> = (1..=u64::from(TASKS)).collect();
    assert_eq!(sent.len(), 7);
    assert!(["read", "mesh", "tiles", "levels"].iter().all(|phase| sent[*phase] == all), "{sent:?}");

    let queued_again = queue_again(rig, slurm)?;
    let workers = catch(rig, slurm, "mesh", 2)?;
    // Slurm may write down what a task says only after it has told that the task is done.
    slurm.wait_until("the log of the task that was queued again", |_| {
        let says = rig.log("read", queued_again.task);
        says.contains("DUE TO JOB REQUEUE") && says.trim_end().ends_with(" s")
    });
    // As long as something is queued, nothing is sent twice.
    let mut again = slurm.with_conf(rig.program());
    let again = again.args(["submit", "out.toml", "--engine", "slurm"]).output().unwrap();
    let why = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.code() == Some(1) && why.contains("scancel"), "{again:?}");
    // scancel lets a process go on with SIGCONT, and then asks it to stop.
    succeeded(slurm.command("scancel").arg(&workers[0].job).output().unwrap());
    signal(&workers[1].process, "KILL");
    slurm.wait();
    // It heard the signal and ended by itself, unless it had done its work.
    let interrupted = rig.log("mesh", workers[0].task).contains("error: interrupted");
    interrupted.then(|| workers.iter().map(|worker| worker.task).collect())
}

#[test]
fn a_killed_job_is_done_by_the_next_submission() {
    let Some(rig) = Rig::new() else { return };
    let Some(slurm) = Slurm::start() else { return };
    let attempt = |_| {
        let missing = disturb(&rig, &slurm);
        if missing.is_none() {
            slurm.wait();
            rig.forget();
        }
        missing
    };
    let missing = (0..10).find_map(attempt).expect("tasks that take long enough to be killed");
    assert!(!rig.folder().join("out/tileset.json").exists());
    let says = rig.log("join", 1);
    let numbers: Vec<String> = missing.iter().map(u64::to_string).collect();
    let complaint = format!("the phase mesh is not complete: tasks {} of {TASKS} are missing", numbers.join(", "));
    assert!(says.contains(&complaint), "{says}");

    let sent = submit(&rig, &slurm);
    let phases: Vec<&str> = sent.keys().map(String::as_str).collect();
    assert_eq!(phases, ["join", "levels", "mesh", "publish", "tiles"]);
    assert_eq!(sent["mesh"], missing);
    slurm.wait();
    rig.is_complete();
}
