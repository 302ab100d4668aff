//! What Slurm gets: a script for each phase, whose array has an element for each task, and the calls of `sbatch` that chain them.
//!
//! A phase waits for the end of the one before, however that ends (`afterany`): with `afterok`, a phase would never run after a task
//! that failed and was done by a later submission. Every phase checks by itself that what it needs is complete.

use crate::shell_word::quoted;
use crate::submit::request::Request;
use job::phase::{Phase, PhaseTasks};
use std::path::{Path, PathBuf};

/// The name of the engine, with which its folder ends.
pub(super) const ENGINE: &str = "slurm";

/// The most characters of the name of a job, which is for people alone: numbers tell jobs apart.
const LONGEST_NAME: usize = 40;

/// The most elements of an array, because every element has a log of its own in one folder.
const MOST_ELEMENTS: u32 = 1000;

/// A script for the tasks of a phase.
#[derive(Debug)]
pub(super) struct Script {
    pub(super) path: PathBuf,
    pub(super) text: String,
}

/// Returns the path of the script of a phase.
fn script_path(request: &Request, phase: Phase) -> PathBuf {
    request.folder(ENGINE).join(format!("{phase}.sh"))
}

/// Returns the path of the file with the numbers that Slurm has given to the arrays.
pub(super) fn sent_path(request: &Request) -> PathBuf {
    request.folder(ENGINE).join("submitted")
}

/// Returns the scripts of the phases that have tasks to do.
pub(super) fn scripts(request: &Request) -> Vec<Script> {
    let script = |tasks: &PhaseTasks| Script {
        path: script_path(request, tasks.phase),
        text: script_text(request, tasks.phase),
    };
    request.phases.iter().map(script).collect()
}

fn script_text(request: &Request, phase: Phase) -> String {
    let count = request.tasks;
    let (name, mebibytes) = (request.name(LONGEST_NAME), request.mebibytes());
    let [program, config] = [&request.program, &request.config].map(|path| quoted(&path.to_string_lossy()));
    let (cores, threads) = match request.threads {
        // As many as Slurm gives.
        0 => (String::new(), " --threads \"$SLURM_CPUS_ON_NODE\""),
        cores => (format!(" --cpus-per-task={cores}"), ""),
    };
    let more = request.submission_words().iter().map(|word| format!(" {word}")).collect::<String>();
    format!(
        r#"#!/bin/sh
# Phase "{phase}" of a job. An element of the array is a task; the argument is added to its number.
#SBATCH --job-name={name}-{phase}
#SBATCH --nodes=1 --ntasks=1 --mem={mebibytes}M{cores}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:TERM@60
# With exec the signals of Slurm reach the program, which stops with its complete phases on the disk.
exec {program} work {config} --phase {phase} --task $((SLURM_ARRAY_TASK_ID + ${{1:-0}}))/{count}{threads}{more}
"#
    )
}

/// Some tasks of a phase that are one array of Slurm: it numbers its elements from 0 to a limit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Array {
    pub(super) phase: Phase,
    /// What is added to the number of an element to get that of the task.
    pub(super) offset: u32,
    /// The numbers of the elements, ascending.
    pub(super) elements: Vec<u32>,
}

impl Array {
    /// Returns the folder of the logs. Each has the number of the element.
    pub(super) fn logs(&self, request: &Request) -> PathBuf {
        let folder = request.folder(ENGINE);
        match self.offset {
            0 => folder.join(self.phase.name()),
            offset => folder.join(format!("{}+{offset}", self.phase)),
        }
    }

    /// Returns the arguments of `sbatch`: what the user adds comes last, so it counts.
    pub(super) fn arguments(&self, request: &Request, after: &[String], added: &[String]) -> Vec<String> {
        let log = |folder: &Path| format!("{}/%a.log", folder.to_string_lossy().replace('%', "%%"));
        let mut words = vec![
            "--parsable".into(),
            format!("--array={}", ranges(&self.elements)),
            format!("--output={}", log(&self.logs(request))),
        ];
        if !after.is_empty() {
            words.push(format!("--dependency=afterany:{}", after.join(":")));
        }
        words.extend_from_slice(added);
        words.push(script_path(request, self.phase).to_string_lossy().into_owned());
        words.extend((self.offset > 0).then(|| self.offset.to_string()));
        words
    }

    /// Returns the name of the shell variable for its number.
    fn variable(&self) -> String {
        if self.offset == 0 { self.phase.to_string() } else { format!("{}_{}", self.phase, self.offset) }
    }
}

/// Returns the arrays of the phases in their order. No element has the number `limit` (`MaxArraySize`) or a greater one.
pub(super) fn arrays(request: &Request, limit: u32) -> Vec<Vec<Array>> {
    let size = limit.clamp(1, MOST_ELEMENTS);
    let of_phase = |tasks: &PhaseTasks| {
        let mut arrays: Vec<Array> = Vec::new();
        for number in &tasks.missing {
            let (offset, element) = (number / size * size, number % size);
            match arrays.last_mut() {
                Some(last) if last.offset == offset => last.elements.push(element),
                _ => arrays.push(Array { phase: tasks.phase, offset, elements: vec![element] }),
            }
        }
        arrays
    };
    request.phases.iter().map(of_phase).collect()
}

/// Returns numbers as Slurm writes them: `1-3,7`.
pub(super) fn ranges(numbers: &[u32]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = |run: &[u32]| match run {
        [first, .., last] => format!("{first}-{last}"),
        one => one.iter().map(u32::to_string).collect(),
    };
    runs.map(text).collect::<Vec<String>>().join(",")
}

/// Returns what would be done as a script of the shell, which does it: it writes the scripts and calls `sbatch`.
pub(super) fn dry_run(request: &Request, limit: u32, added: &[String]) -> String {
    let (arrays, mut lines) = (arrays(request, limit), vec!["set -e".to_owned()]);
    let word = |path: &Path| quoted(&path.to_string_lossy());
    for folder in arrays.iter().flatten().map(|array| array.logs(request)) {
        lines.push(format!("mkdir -p {}", word(&folder)));
    }
    for Script { path, text } in scripts(request) {
        lines.push(format!("cat > {} <<'END_OF_SCRIPT'\n{text}END_OF_SCRIPT", word(&path)));
    }
    let sent = word(&sent_path(request));
    lines.push(format!("> {sent}"));
    let mut after: Vec<String> = Vec::new();
    for arrays in arrays {
        for array in &arrays {
            let word = |word: String| if word.starts_with("--dependency=afterany:$") { word } else { quoted(&word) };
            let words: Vec<String> = array.arguments(request, &after, added).into_iter().map(word).collect();
            let variable = array.variable();
            lines.push(format!("{variable}=$(sbatch {})\necho ${variable} >> {sent}", words.join(" ")));
        }
        after = arrays.iter().map(|array| format!("${}", array.variable())).collect();
    }
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::submit::request::tests::request;
    use std::process::Command;

    fn missing(phase: Phase, count: u32, missing: &[u32]) -> Request {
        Request {
            phases: vec![PhaseTasks { phase, count, missing: missing.to_vec() }],
            ..request("/data/job.toml", count)
        }
    }

    #[test]
    fn numbers_are_written_as_ranges() {
        assert_eq!(ranges(&[]), "");
        assert_eq!(ranges(&[4]), "4");
        assert_eq!(ranges(&[1, 2, 3, 7, 9, 10]), "1-3,7,9-10");
    }

    #[test]
    fn arrays_stay_below_the_limit_and_have_every_task_once() {
        for (limit, count) in [(1, 3), (2, 5), (4, 3), (4, 4), (4, 11), (1001, 2500), (4_000_000, 2500)] {
            let request = request("/data/job.toml", count);
            let phases = arrays(&request, limit);
            assert_eq!(phases.len(), Phase::ALL.len());
            for (arrays, tasks) in phases.iter().zip(&request.phases) {
                let numbers = arrays.iter().flat_map(|array| array.elements.iter().map(|e| e + array.offset));
                assert_eq!(numbers.collect::<Vec<u32>>(), tasks.missing, "{limit} {count}");
                let is_within = |e: &u32| *e < limit && *e < MOST_ELEMENTS;
                assert!(arrays.iter().flat_map(|array| &array.elements).all(is_within), "{limit} {count}");
            }
        }
        let some = missing(Phase::Mesh, 64, &[3, 7, 8, 9, 41]);
        let [array] = arrays(&some, 1001).remove(0).try_into().unwrap();
        assert_eq!((array.offset, ranges(&array.elements)), (0, "3,7-9,41".into()));
    }

    /// A shell runs the script with a program that prints its arguments.
    #[test]
    fn a_script_starts_the_task_of_its_element() {
        let folder = tempfile::tempdir().unwrap();
        let run = |config: &str, arguments: &[&str]| {
            let mut request = missing(Phase::Mesh, 64, &[1]);
            request.program = "/bin/echo".into();
            request.config = config.into();
            let script = folder.path().join("mesh.sh");
            std::fs::write(&script, &scripts(&request)[0].text).unwrap();
            let mut shell = Command::new("sh");
            shell.arg(&script).args(arguments).env("SLURM_ARRAY_TASK_ID", "12").env("SLURM_CPUS_ON_NODE", "3");
            String::from_utf8(shell.output().unwrap().stdout).unwrap()
        };
        assert_eq!(run("/data/job.toml", &[]), "work /data/job.toml --phase mesh --task 12/64 --threads 3\n");
        assert_eq!(run("/it's $x/a b.toml", &["40"]), "work /it's $x/a b.toml --phase mesh --task 52/64 --threads 3\n");
    }

    #[test]
    fn a_script_asks_for_what_the_configuration_allows() {
        let mut request = missing(Phase::Read, 8, &[1]);
        let text = |request: &Request| scripts(request).remove(0).text;
        assert!(text(&request).contains("--mem=4352M\n"), "{}", text(&request));
        (request.memory, request.threads) = ((1 << 30) + 1, 6);
        assert!(text(&request).contains("--mem=1281M --cpus-per-task=6\n"), "{}", text(&request));
        assert!(!text(&request).contains("--threads"), "{}", text(&request));
        for line in ["#SBATCH --requeue", "#SBATCH --open-mode=append", "#SBATCH --signal=B:TERM@60"] {
            assert!(text(&request).lines().any(|found| found == line), "{line}");
        }
    }

    /// A shell runs what is shown, with an `sbatch` that prints numbers and keeps its arguments.
    #[test]
    fn what_is_shown_chains_the_phases() {
        let folder = tempfile::tempdir().unwrap();
        let (calls, home) = (folder.path().join("calls"), folder.path().join("it's 50%"));
        let request = request(home.join("job.toml").to_str().unwrap(), 6);
        let shown = dry_run(&request, 4, &["--comment=two words".into()]);
        let stub = format!("sbatch() {{ echo \"$*\" >> {0}; wc -l < {0}; }}\n", calls.display());
        let refused = Command::new("sh").args(["-c", &format!("sbatch() {{ return 1; }}\n{shown}")]).status().unwrap();
        assert!(!refused.success() && std::fs::read(sent_path(&request)).unwrap().is_empty());
        assert!(Command::new("sh").args(["-c", &(stub + &shown)]).status().unwrap().success());
        for Script { path, text } in scripts(&request) {
            assert_eq!(std::fs::read_to_string(path).unwrap(), text);
        }
        let numbers = (1..=12).map(|number| format!("{number}\n")).collect::<String>();
        assert_eq!(std::fs::read_to_string(sent_path(&request)).unwrap(), numbers);
        assert!(home.join("job.slurm/read+4").is_dir() && home.join("job.slurm/publish").is_dir());
        let calls = std::fs::read_to_string(calls).unwrap();
        let calls: Vec<&str> = calls.lines().collect();
        let call = |array: &str, log: &str, after: &str, rest: &str| {
            let logs = format!("{}/it's 50%%/job.slurm/{log}", folder.path().display());
            let script = format!("{}/job.slurm/{rest}", home.display());
            format!("--parsable --array={array} --output={logs}/%a.log{after} --comment=two words {script}")
        };
        assert_eq!(calls[0], call("1", "plan", "", "plan.sh"));
        assert_eq!(calls[1], call("1-3", "read", " --dependency=afterany:1", "read.sh"));
        assert_eq!(calls[2], call("0-2", "read+4", " --dependency=afterany:1", "read.sh 4"));
        assert_eq!(calls[3], call("1", "select", " --dependency=afterany:2:3", "select.sh"));
        assert_eq!(calls[4], call("1-3", "mesh", " --dependency=afterany:4", "mesh.sh"));
        assert_eq!(calls.len(), 4 + 2 * 4);
        assert_eq!(calls[11], call("1", "publish", " --dependency=afterany:10:11", "publish.sh"));
    }
}
