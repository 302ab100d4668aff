//! The Jobs for Kubernetes fit its published schema, and the commands of their pods do the job, each with the index of its pod.

use crate::rig::{Rig, succeeded};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// Returns the Jobs that `submit` would send, as they are written and as they are read.
fn jobs(rig: &Rig, added: &[&str]) -> (String, Vec<Value>) {
    let mut command = rig.program();
    let volume = format!("survey:{}", rig.folder().display());
    command.args(["submit", "out.toml", "--engine", "kubernetes", "--tasks", "5", "--dry-run"]);
    command.args(["--", "--image", "registry.example/gdt-batch:1", "--volume", &volume]).args(added);
    let text = succeeded(command.output().unwrap());
    let documents = yaml_serde::Deserializer::from_str(&text);
    let jobs = documents.map(|document| serde::Deserialize::deserialize(document).unwrap()).collect();
    (text, jobs)
}

/// Runs what the pod with this index runs.
fn pod(job: &Value, index: u64) -> Output {
    let command = &job["spec"]["template"]["spec"]["containers"][0]["command"];
    let command: Vec<&str> = command.as_array().unwrap().iter().map(|word| word.as_str().unwrap()).collect();
    let programs = Path::new(env!("CARGO_BIN_EXE_gdt-batch")).parent().unwrap();
    let path = std::env::join_paths([programs, Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    // With PATH set, the command is found on the new one.
    Command::new(command[0])
        .args(&command[1..])
        .env("PATH", path)
        .env("JOB_COMPLETION_INDEX", index.to_string())
        .output()
        .unwrap()
}

fn pods(job: &Value) -> u64 {
    job["spec"]["completions"].as_u64().unwrap()
}

#[test]
fn pods_do_the_job() {
    let Some(rig) = Rig::new() else { return };
    let (_, all) = jobs(&rig, &[]);
    assert_eq!(all.iter().map(pods).collect::<Vec<u64>>(), [1, 5, 5, 1, 5, 5, 1]);
    // One that comes too early is tried again later.
    assert_eq!(pod(&all[2], 0).status.code(), Some(1));
    for job in &all[..2] {
        // The order of the indices is that of the scheduler.
        (0..pods(job)).rev().for_each(|index| drop(succeeded(pod(job, index))));
    }
    [0, 3].iter().for_each(|index| drop(succeeded(pod(&all[2], *index))));
    let (_, rest) = jobs(&rig, &[]);
    // The two tasks that are done are not sent again, nor are some that have no part.
    assert_eq!(rest[0]["metadata"]["labels"]["app.kubernetes.io/component"], "mesh");
    assert!((1..=3).contains(&pods(&rest[0])) && rest.len() == 5, "{rest:?}");
    for job in &rest {
        (0..pods(job)).for_each(|index| drop(succeeded(pod(job, index))));
    }
    rig.is_complete();
}

/// Returns the program that compares with Kubernetes' schema. If it is not installed, says so; under tests/run, fails.
fn validator() -> Option<PathBuf> {
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/venv/bin/kubernetes-validate");
    if !program.is_file() {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no {}", program.display());
        eprintln!("not tested: no kubernetes-validate; run tests/run, which installs it");
        return None;
    }
    Some(program)
}

/// A configuration whose files nobody reads, in a folder of its own.
fn unread() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = "[input]\nfiles = [\"cloud.laz\"]\n[output]\ndirectory = \"out\"\n[limits]\nthreads = 4\n";
    fs::write(folder.path().join("out.toml"), text).unwrap();
    folder
}

fn submit(folder: &Path, added: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
    let volume = format!("survey:{}", folder.display());
    command.current_dir(folder).arg("submit").arg(folder.join("out.toml"));
    command.args(["--engine", "kubernetes", "--tasks", "7"]).args(added);
    command.args(["--", "--image", "registry.example/gdt-batch:1", "--volume", &volume, "--namespace", "gis"]);
    command
}

#[test]
fn the_jobs_fit_the_schema_of_kubernetes() {
    let Some(validator) = validator() else { return };
    let folder = unread();
    let yaml = succeeded(submit(folder.path(), &["--dry-run"]).output().unwrap());
    let file = folder.path().join("jobs.yaml");
    // From the version that has backoffLimitPerIndex on.
    for version in ["1.29", "1.33", "1.37"] {
        let check = |text: &str| {
            fs::write(&file, text).unwrap();
            Command::new(&validator).args(["--strict", "-k", version]).arg(&file).output().unwrap()
        };
        let said = succeeded(check(&yaml));
        assert_eq!(said.matches("INFO").count(), 7, "{said}");
        for (right, wrong) in [
            ("backoffLimitPerIndex", "backoffLimitByIndex"),
            ("completions: 7", "completions: seven"),
            ("mountPath", "path"),
            ("restartPolicy", "restart"),
        ] {
            assert!(!check(&yaml.replace(right, wrong)).status.success(), "{version}: {wrong}");
        }
    }
}

/// Makes a `kubectl` in `folder` that keeps the YAML that it gets, and that has the Jobs in the file `jobs`, whatever they are asked by.
/// Returns the path where programs are found.
fn stub(folder: &Path) -> OsString {
    let script =
        "#!/bin/sh\ncase \"$*\" in *' apply '*) cat > applied;; *' get '*) cat jobs 2>/dev/null;; esac; exit 0\n";
    // A shell writes it: a file that this process has open for writing could not be run yet.
    let mut write = Command::new("sh");
    write.args(["-c", "printf %s \"$0\" > kubectl && chmod +x kubectl", script]).current_dir(folder);
    succeeded(write.output().unwrap());
    std::env::join_paths([folder, Path::new("/usr/bin"), Path::new("/bin")]).unwrap()
}

/// Returns the Jobs that were applied as the stub lists them: the name and the configuration of each.
fn applied(folder: &Path) -> Vec<[String; 2]> {
    let text = fs::read_to_string(folder.join("applied")).unwrap();
    let jobs = yaml_serde::Deserializer::from_str(&text);
    let jobs = jobs.map(|job| -> Value { serde::Deserialize::deserialize(job).unwrap() });
    jobs.map(|job| {
        let metadata = &job["metadata"];
        [&metadata["name"], &metadata["annotations"]["gdt-batch/configuration"]]
            .map(|text| text.as_str().unwrap().to_owned())
    })
    .collect()
}

/// Lets the stub have these Jobs.
fn list(folder: &Path, jobs: &[[String; 2]]) {
    let lines = jobs.iter().map(|[name, configuration]| format!("{name}\t{configuration}\n"));
    fs::write(folder.join("jobs"), lines.collect::<String>()).unwrap();
}

#[test]
fn jobs_are_given_to_kubectl_unless_earlier_ones_are_there() {
    let folder = unread();
    let path = stub(folder.path());
    let sent: Value =
        serde_json::from_str(&succeeded(submit(folder.path(), &["--json"]).env("PATH", &path).output().unwrap()))
            .unwrap();
    let names: BTreeMap<&str, &str> = (sent["jobs"].as_array().unwrap().iter())
        .map(|job| (job["phase"].as_str().unwrap(), job["job"].as_str().unwrap()))
        .collect();
    assert!(names.len() == 7 && names["mesh"].starts_with("out-") && names["mesh"].ends_with("-mesh"), "{names:?}");
    let shown = succeeded(submit(folder.path(), &["--dry-run"]).output().unwrap());
    assert_eq!(fs::read_to_string(folder.path().join("applied")).unwrap().trim_end(), shown.trim_end());
    list(folder.path(), &applied(folder.path()));
    let again = submit(folder.path(), &[]).env("PATH", &path).output().unwrap();
    let why = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.code() == Some(1) && why.contains("kubectl --namespace gis delete jobs"), "{again:?}");
}

/// Two people have a configuration of the same name, in folders of their own, and one namespace.
#[test]
fn configurations_of_one_name_do_not_meet() {
    let (first, second) = (unread(), unread());
    let path = stub(second.path());
    // The stub's files are where it runs.
    let named = |folder: &TempDir, name: &[&str]| {
        submit(folder.path(), &[]).args(name).current_dir(second.path()).env("PATH", &path).output().unwrap()
    };
    succeeded(named(&first, &[]));
    let of_first = applied(second.path());
    list(second.path(), &of_first);
    succeeded(named(&second, &[]));
    let of_second = applied(second.path());
    assert!(of_first.iter().zip(&of_second).all(|(a, b)| a[0] != b[0] && a[1] != b[1]), "{of_second:?}");
    // With a name that the user gives, the annotation tells.
    succeeded(named(&first, &["--name", "north"]));
    list(second.path(), &applied(second.path()));
    let refused = named(&second, &["--name", "north"]);
    let why = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{why}");
    assert!(why.contains("job.batch/north-plan exists, and belongs to another configuration"), "{why}");
    assert!(why.contains(first.path().to_str().unwrap()) && !why.contains("delete"), "{why}");
}
