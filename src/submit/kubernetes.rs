//! What Kubernetes gets: an Indexed Job for each phase, with a pod for each task.
//!
//! Kubernetes has no order among Jobs. A task that comes too early ends with exit code 1, and Kubernetes starts its pod again later: after
//! ten seconds at first, then after twice as long each time, up to some minutes. Nothing waits in a pod, so phases that come later
//! never take the room of those that come first.

use crate::error::{Error, Result};
use crate::exit_code::exit_code;
use crate::submit::request::Request;
use crate::submit::submitted::{SentTasks, Submitted};
use clap::Parser;
use job::phase::{Phase, PhaseTasks};
use serde_json::{Value, json};
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use xxhash_rust::xxh3::xxh3_64;

/// The name of the engine.
pub(super) const ENGINE: &str = "kubernetes";

/// How often a task may be tried again, also because it came too early: with some minutes in between, it is more than a day.
const RETRIES: u32 = 400;

/// The exit codes after which another try ends in the same way.
const FINAL_EXIT_CODES: [u8; 3] =
    [exit_code(sys::ErrorKind::Usage), exit_code(sys::ErrorKind::Input), exit_code(sys::ErrorKind::Internal)];

/// The seconds that a task has to stop when it is asked to.
const GRACE_SECONDS: u32 = 60;

/// The most cores of a pod: as many as a job has threads.
const MOST_CORES: u16 = 1024;

/// Kubernetes lets a name have 63 characters, with the phase and the number of a task. This is what a name takes of the configuration's,
/// before the digest.
const LONGEST_STEM: usize = 31;

/// The annotation of a Job that says of which configuration it is.
const CONFIGURATION: &str = "gdt-batch/configuration";

/// The options after `--`.
#[derive(Parser, Debug)]
#[command(name = "gdt-batch submit --engine kubernetes --", no_binary_name = true, disable_version_flag = true)]
struct KubernetesOptions {
    /// The container image, which has gdt-batch on its path.
    #[arg(long)]
    image: String,
    /// A persistent volume claim, and the folder where all pods see it. The inputs, the configuration and the output directory are in
    /// it.
    #[arg(long = "volume", required = true, value_name = "CLAIM:FOLDER", value_parser = volume)]
    volumes: Vec<Volume>,
    /// The path of the configuration in the pods. Default: the one that it has here.
    #[arg(long, value_name = "FILE")]
    config: Option<String>,
    /// The name of the Jobs, to which that of the phase is added. Default: that of the configuration, with a digest of its path.
    #[arg(long)]
    name: Option<String>,
    /// The namespace.
    #[arg(long)]
    namespace: Option<String>,
    /// The cores of a pod. Default: [limits] threads.
    #[arg(long, value_parser = cores, allow_negative_numbers = true)]
    cpu: Option<u16>,
}

/// A volume of the pods.
#[derive(Clone, Debug)]
struct Volume {
    claim: String,
    folder: String,
}

fn volume(text: &str) -> std::result::Result<Volume, String> {
    match text.split_once(':') {
        Some((claim, folder)) if !claim.is_empty() && folder.starts_with('/') => {
            Ok(Volume { claim: claim.into(), folder: folder.into() })
        }
        _ => Err("a volume is the name of a claim, a colon and a folder, such as survey-data:/data".into()),
    }
}

fn cores(text: &str) -> std::result::Result<u16, String> {
    let cores = text.parse().ok().filter(|cores| (1..=MOST_CORES).contains(cores));
    cores.ok_or_else(|| {
        format!("the cores of a pod are a whole number from 1 to {MOST_CORES}; without --cpu it gets those of [limits] threads")
    })
}

/// Returns the Jobs for the tasks of `request` as YAML.
///
/// # Errors
/// [`sys::Error::Config`] if the options that the user has `added` are wrong.
pub fn show(request: &Request, added: &[String]) -> sys::Result<String> {
    yaml(&jobs(request, &KubernetesOptions::read(request, added)?))
}

/// Gives the Jobs for the tasks of `request` to `kubectl apply`.
///
/// # Errors
/// [`sys::Error::Config`] if the options that the user has `added` are wrong or there is no `kubectl`, [`Error::Engine`] if it refuses.
pub fn send(request: &Request, added: &[String]) -> Result<Submitted> {
    let options = KubernetesOptions::read(request, added)?;
    nothing_is_there(request, &options)?;
    kubectl(&options, &["apply", "--filename", "-"], &yaml(&jobs(request, &options))?)?;
    let sent = |tasks: &PhaseTasks| SentTasks {
        phase: tasks.phase,
        job: options.job_name(request, tasks.phase),
        tasks: tasks.missing.clone(),
    };
    let jobs = request.phases.iter().map(sent).collect();
    Ok(Submitted { engine: ENGINE, jobs, watch: options.command(request, "get"), logs: None })
}

impl KubernetesOptions {
    fn read(request: &Request, added: &[String]) -> sys::Result<KubernetesOptions> {
        let options = KubernetesOptions::try_parse_from(added).map_err(|e| sys::Error::Config(e.to_string()))?;
        let config = options.config_in_pods(request);
        if options.volume_of(&config).is_none() {
            return Err(sys::Error::Config(format!(
                "no volume of the pods has the configuration {config}: name its path in the pods with -- --config FILE"
            )));
        }
        Ok(options)
    }

    /// Returns the volume that has the file at `path` in the pods.
    fn volume_of(&self, path: &str) -> Option<&Volume> {
        let holding = self.volumes.iter().filter(|volume| Path::new(path).starts_with(&volume.folder));
        holding.max_by_key(|volume| volume.folder.len())
    }

    /// Returns what tells the configuration from all others of the namespace: its claim and its path in the pods.
    fn identity(&self, request: &Request) -> String {
        let spelled = || request.config.canonicalize().unwrap_or_else(|_| request.config.clone());
        let path = self.config.clone().unwrap_or_else(|| spelled().to_string_lossy().into_owned());
        let claim = self.volume_of(&self.config_in_pods(request)).map_or("", |volume| &volume.claim);
        format!("{claim}:{path}")
    }

    /// Returns the name of the Jobs. Two configurations of one name in one namespace have different digests.
    fn name(&self, request: &Request) -> String {
        let digest = || xxh3_64(self.identity(request).as_bytes()) as u32;
        self.name.clone().unwrap_or_else(|| format!("{}-{:08x}", request.name(LONGEST_STEM), digest()))
    }

    fn job_name(&self, request: &Request, phase: Phase) -> String {
        format!("{}-{phase}", self.name(request))
    }

    fn config_in_pods(&self, request: &Request) -> String {
        self.config.clone().unwrap_or_else(|| request.config.to_string_lossy().into_owned())
    }

    /// Returns what selects the Jobs.
    fn selector(&self, request: &Request) -> String {
        format!("app.kubernetes.io/name=gdt-batch,app.kubernetes.io/instance={}", self.name(request))
    }

    /// Returns the command that does `verb` to the Jobs, for people.
    fn command(&self, request: &Request, verb: &str) -> String {
        let namespace = self.namespace.as_ref().map_or(String::new(), |name| format!("--namespace {name} "));
        format!("kubectl {namespace}{verb} jobs --selector {}", self.selector(request))
    }
}

/// Returns the Jobs in the order of their phases.
fn jobs(request: &Request, options: &KubernetesOptions) -> Vec<Value> {
    request.phases.iter().map(|tasks| job(request, options, tasks)).collect()
}

fn job(request: &Request, options: &KubernetesOptions, tasks: &PhaseTasks) -> Value {
    let labels = json!({
        "app.kubernetes.io/name": "gdt-batch",
        "app.kubernetes.io/instance": options.name(request),
        "app.kubernetes.io/component": tasks.phase,
    });
    let mut job = json!({
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {
            "name": options.job_name(request, tasks.phase),
            "labels": labels,
            "annotations": {CONFIGURATION: options.identity(request)},
        },
        "spec": {
            "completionMode": "Indexed",
            "completions": tasks.missing.len(),
            "parallelism": tasks.missing.len(),
            "backoffLimitPerIndex": RETRIES,
            // The first rule that fits counts. All other failures count towards the limit, and the task is tried again.
            "podFailurePolicy": {"rules": [
                {
                    "action": "FailIndex",
                    "onExitCodes": {"containerName": "work", "operator": "In", "values": FINAL_EXIT_CODES},
                },
                {"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget", "status": "True"}]},
            ]},
            "template": {"metadata": {"labels": labels}, "spec": pod(request, options, tasks)},
        },
    });
    if let Some(namespace) = &options.namespace {
        job["metadata"]["namespace"] = json!(namespace);
    }
    job
}

fn pod(request: &Request, options: &KubernetesOptions, tasks: &PhaseTasks) -> Value {
    let name = |at: usize| format!("volume-{at}");
    let volumes = options.volumes.iter().enumerate();
    let mounts: Vec<Value> =
        volumes.clone().map(|(at, volume)| json!({"name": name(at), "mountPath": volume.folder})).collect();
    let claims = volumes
        .map(|(at, volume)| json!({"name": name(at), "persistentVolumeClaim": {"claimName": volume.claim}}))
        .collect::<Vec<Value>>();
    let mut resources = json!({"memory": format!("{}Mi", request.mebibytes())});
    let cores = options.cpu.map_or(request.threads, usize::from);
    if cores > 0 {
        resources["cpu"] = json!(cores.to_string());
    }
    json!({
        "restartPolicy": "Never",
        "terminationGracePeriodSeconds": GRACE_SECONDS,
        "containers": [{
            "name": "work",
            "image": options.image,
            "command": pod_command(&options.config_in_pods(request), request, tasks),
            "resources": {"requests": resources, "limits": resources},
            "volumeMounts": mounts,
        }],
        "volumes": claims,
    })
}

/// Returns the command of a pod. If only some tasks are missing, a shell looks up which of them has the index of the pod.
fn pod_command(config: &str, request: &Request, PhaseTasks { phase, count, missing }: &PhaseTasks) -> Vec<String> {
    let words = |words: &[&str]| words.iter().map(|word| word.to_string()).collect();
    let (phase, total, more) = (phase.name(), request.tasks.to_string(), request.submission_words());
    if missing.len() as u64 == u64::from(*count) {
        let all: Vec<String> = words(&["gdt-batch", "work", config, "--phase", phase, "--tasks", &total]);
        return [all, more].concat();
    }
    let numbers: Vec<String> = missing.iter().map(u32::to_string).collect();
    let script = format!(
        "set -- {} && shift \"$JOB_COMPLETION_INDEX\" && exec gdt-batch work \"$0\" --phase {phase} --task \"$1/{total}\"{}",
        numbers.join(" "),
        more.iter().map(|word| format!(" {word}")).collect::<String>()
    );
    words(&["/bin/sh", "-c", &script, config])
}

fn yaml(jobs: &[Value]) -> sys::Result<String> {
    let text = |job: &Value| yaml_serde::to_string(job).map_err(|e| sys::Error::Broken(e.to_string()));
    let documents = jobs.iter().map(text).collect::<sys::Result<Vec<String>>>()?;
    Ok(documents.join("---\n"))
}

/// Checks that Kubernetes has no Jobs of these names. It would take new ones for changes of those, and refuse them or do nothing.
fn nothing_is_there(request: &Request, options: &KubernetesOptions) -> Result<()> {
    let fields = format!("{{.metadata.name}}{{\"\\t\"}}{{.metadata.annotations.{CONFIGURATION}}}{{\"\\n\"}}");
    let output = format!("jsonpath={{range .items[*]}}{fields}{{end}}");
    let found = kubectl(options, &["get", "jobs", "--output", &output, "--selector", &options.selector(request)], "")?;
    let mut jobs = found.lines().map(|line| line.split_once('\t').unwrap_or((line, "")));
    let is_in_the_way = |name: &str| Phase::ALL.iter().any(|&phase| options.job_name(request, phase) == name);
    match jobs.find(|(name, _)| is_in_the_way(name)) {
        None => Ok(()),
        Some((name, configuration)) => Err(in_the_way(request, options, name, configuration)),
    }
}

/// Returns the error about the Job `name`, which is there already. Only a Job that says so is taken for one of the same `configuration`.
fn in_the_way(request: &Request, options: &KubernetesOptions, name: &str, configuration: &str) -> Error {
    let (watch, remove) = (options.command(request, "get"), options.command(request, "delete"));
    let own = options.identity(request);
    let another = "give this job another name with -- --name NAME";
    Error::Engine(match configuration {
        "" => format!(
            "job.batch/{name} exists, and does not name its configuration: {another}. If it is an earlier submission of {own}, \
             wait for its end ({watch}), then remove it: {remove}"
        ),
        same if same == own => format!(
            "job.batch/{name} of an earlier submission is still there: wait for its end ({watch}), then remove it: {remove}"
        ),
        other => format!("job.batch/{name} exists, and belongs to another configuration ({other}): {another}"),
    })
}

/// Runs `kubectl` with `input`, and returns what it prints.
fn kubectl(options: &KubernetesOptions, arguments: &[&str], input: &str) -> Result<String> {
    let mut command = Command::new("kubectl");
    if let Some(namespace) = &options.namespace {
        command.args(["--namespace", namespace]);
    }
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = match command.spawn() {
        Err(e) if e.kind() == ErrorKind::NotFound => {
            return Err(sys::Error::Config(
                "kubectl was not found: with --dry-run, submit prints the YAML instead".into(),
            )
            .into());
        }
        child => child.map_err(sys::Error::io("run", "kubectl"))?,
    };
    if let Some(mut pipe) = child.stdin.take() {
        // If kubectl has ended already, it says why.
        let _ = pipe.write_all(input.as_bytes());
    }
    let output = child.wait_with_output().map_err(sys::Error::io("run", "kubectl"))?;
    if !output.status.success() {
        return Err(Error::Engine(format!("kubectl: {}", String::from_utf8_lossy(&output.stderr).trim())));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::submit::request::tests::request;
    use job::phase::Phase;

    const LEAST: [&str; 4] = ["--image", "registry/gdt-batch:1", "--volume", "survey:/data"];

    fn words(added: &[&str]) -> Vec<String> {
        LEAST.iter().chain(added).map(|word| word.to_string()).collect()
    }

    fn read(request: &Request, added: &[&str]) -> Vec<Value> {
        let text = show(request, &words(added)).unwrap();
        let documents = yaml_serde::Deserializer::from_str(&text);
        documents.map(|document| serde::Deserialize::deserialize(document).unwrap()).collect()
    }

    #[test]
    fn every_phase_is_a_job_with_an_index_for_each_task() {
        let jobs = read(&request("/data/Big job.toml", 5), &[]);
        let names: Vec<&str> = jobs.iter().map(|job| job["metadata"]["name"].as_str().unwrap()).collect();
        let name = |digest: &str| Phase::ALL.map(|phase| format!("big-job-{digest}-{phase}"));
        let digest = names[0].split('-').nth(2).unwrap();
        assert!(digest.len() == 8 && names == name(digest), "{names:?}");
        for (job, phase) in jobs.iter().zip(Phase::ALL) {
            let tasks = phase.tasks(5);
            assert_eq!(job["spec"]["completions"], tasks);
            assert_eq!(job["spec"]["completionMode"], "Indexed");
            let work = &job["spec"]["template"]["spec"]["containers"][0];
            let command = ["gdt-batch", "work", "/data/Big job.toml", "--phase", phase.name(), "--tasks"];
            let command: Vec<String> = command.map(String::from).into_iter().chain(["5".into()]).collect();
            assert_eq!(work["command"], json!(command));
            assert_eq!(work["resources"], json!({"requests": {"memory": "4352Mi"}, "limits": {"memory": "4352Mi"}}));
        }
    }

    #[test]
    fn every_configuration_has_a_name_and_an_annotation_of_its_own() {
        let long = "x".repeat(90);
        let north = format!("/data/{long}north.toml");
        let south = format!("/data/{long}south.toml");
        let elsewhere = ["--volume", "archive:/data/old"];
        let jobs = [
            ("/data/a/job.toml", &[][..], "survey:/data/a/job.toml"),
            ("/data/b/job.toml", &[], "survey:/data/b/job.toml"),
            (&north, &[], &format!("survey:{north}")),
            (&south, &[], &format!("survey:{south}")),
            ("/data/old/job.toml", &[], "survey:/data/old/job.toml"),
            // Another volume has another file at this path.
            ("/data/old/job.toml", &elsewhere, "archive:/data/old/job.toml"),
            ("/home/me/job.toml", &["--config", "/data/c/job.toml"], "survey:/data/c/job.toml"),
        ];
        let mut names = std::collections::HashSet::new();
        for (config, added, identity) in jobs {
            let job = read(&request(config, 9_999), added).pop().unwrap();
            let metadata = &job["metadata"];
            assert_eq!(metadata["annotations"][CONFIGURATION], identity);
            let name = metadata["name"].as_str().unwrap();
            // With the number of a task it is the name of a host.
            assert!(name.len() + "-9999".len() <= 63 && names.insert(name.to_owned()), "{name}");
            let label = metadata["labels"]["app.kubernetes.io/instance"].as_str().unwrap();
            assert_eq!(name, format!("{label}-publish"));
        }
        // From wherever it is submitted, the same file of the pods has the same name.
        let name = |config: &str, added: &[&str]| read(&request(config, 2), added)[0]["metadata"]["name"].clone();
        assert_eq!(name("/home/you/job.toml", &["--config", "/data/c/job.toml"]), name("/data/c/job.toml", &[]));
    }

    #[test]
    fn a_job_of_somebody_else_is_not_taken_for_an_earlier_submission() {
        let request = request("/data/job.toml", 2);
        let options = KubernetesOptions::read(&request, &words(&["--name", "north"])).unwrap();
        let said = |configuration: &str| in_the_way(&request, &options, "north-plan", configuration).to_string();
        let own = said("survey:/data/job.toml");
        assert!(
            own.contains("of an earlier submission is still there") && own.contains("kubectl delete jobs"),
            "{own}"
        );
        let other = said("survey:/data/other/job.toml");
        assert!(other.contains("another configuration (survey:/data/other/job.toml)"), "{other}");
        assert!(other.contains("--name") && !other.contains("delete"), "{other}");
        let unknown = said("");
        assert!(unknown.contains("does not name its configuration") && unknown.contains("--name"), "{unknown}");
    }

    #[test]
    fn cores_are_a_number_that_a_pod_can_have() {
        for wrong in ["0", "-2", "1025", "two", "0.5", ""] {
            let error = show(&request("/data/job.toml", 2), &words(&["--cpu", wrong])).unwrap_err();
            assert_eq!(error.kind(), sys::ErrorKind::Usage, "{wrong}");
            assert!(error.to_string().contains("a whole number from 1 to 1024"), "{wrong}: {error}");
        }
        let job = read(&request("/data/job.toml", 2), &["--cpu", "8"]).remove(2);
        assert_eq!(job["spec"]["template"]["spec"]["containers"][0]["resources"]["limits"]["cpu"], "8");
    }

    #[test]
    fn a_submission_that_starts_over_tells_every_pod() {
        let mut request = request("/data/job.toml", 64);
        request.submission = Some(17);
        request.phases[4].missing = vec![3, 7];
        for job in read(&request, &[]) {
            let command = job["spec"]["template"]["spec"]["containers"][0]["command"].to_string();
            assert!(command.contains("--submission 17") || command.contains(r#""--submission","17""#), "{command}");
        }
    }

    #[test]
    fn final_exit_codes_end_a_task_and_disruptions_do_not_count() {
        let job = read(&request("/data/job.toml", 2), &[]).remove(2);
        let rules = &job["spec"]["podFailurePolicy"]["rules"];
        assert_eq!(rules[0]["action"], "FailIndex");
        assert_eq!(rules[0]["onExitCodes"], json!({"containerName": "work", "operator": "In", "values": [2, 3, 4]}));
        assert_eq!(
            rules[1],
            json!({"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget", "status": "True"}]})
        );
        assert_eq!(job["spec"]["template"]["spec"]["restartPolicy"], "Never");
    }

    /// The shell of the pod runs a `gdt-batch` that prints its arguments.
    #[cfg(unix)]
    #[test]
    fn a_pod_of_some_tasks_does_the_one_of_its_index() {
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("/bin/echo", folder.path().join("gdt-batch")).unwrap();
        let phases = vec![PhaseTasks { phase: Phase::Tiles, count: 64, missing: vec![3, 7, 41] }];
        let jobs = read(&Request { phases, ..request("/data/it's $x.toml", 64) }, &[]);
        assert_eq!(jobs[0]["spec"]["completions"], 3);
        let command: Vec<&str> = jobs[0]["spec"]["template"]["spec"]["containers"][0]["command"]
            .as_array()
            .unwrap()
            .iter()
            .map(|word| word.as_str().unwrap())
            .collect();
        for (index, task) in [3, 7, 41].iter().enumerate() {
            let mut pod = Command::new(command[0]);
            pod.args(&command[1..]).env("PATH", folder.path()).env("JOB_COMPLETION_INDEX", index.to_string());
            let said = String::from_utf8(pod.output().unwrap().stdout).unwrap();
            assert_eq!(said, format!("work /data/it's $x.toml --phase tiles --task {task}/64\n"));
        }
    }

    #[test]
    fn options_say_what_pods_need() {
        let added = ["--volume", "results:/results", "--cpu", "6", "--namespace", "gis", "--name", "north"];
        let job = read(&request("/data/job.toml", 2), &added).remove(1);
        assert_eq!((&job["metadata"]["name"], &job["metadata"]["namespace"]), (&json!("north-read"), &json!("gis")));
        let pod = &job["spec"]["template"]["spec"];
        assert_eq!(pod["volumes"][1]["persistentVolumeClaim"]["claimName"], "results");
        assert_eq!(pod["containers"][0]["volumeMounts"][1]["mountPath"], "/results");
        assert_eq!(pod["volumes"][1]["name"], pod["containers"][0]["volumeMounts"][1]["name"]);
        assert_eq!(pod["containers"][0]["resources"]["limits"]["cpu"], "6");
        let elsewhere = read(&request("/home/me/job.toml", 2), &["--config", "/data/job.toml"]).remove(0);
        assert_eq!(elsewhere["spec"]["template"]["spec"]["containers"][0]["command"][2], "/data/job.toml");
    }

    #[test]
    fn wrong_options_are_errors_that_say_what_is_missing() {
        let error = |config: &str, added: &[String]| show(&request(config, 1), added).unwrap_err();
        assert!(error("/data/job.toml", &[]).to_string().contains("--image"));
        assert!(error("/data/job.toml", &words(&["--volume", "data"])).to_string().contains("survey-data:/data"));
        let unseen = error("/home/me/job.toml", &words(&[]));
        assert!(unseen.to_string().contains("--config") && unseen.kind() == sys::ErrorKind::Usage, "{unseen}");
    }
}
