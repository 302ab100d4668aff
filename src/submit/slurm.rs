//! Sending tasks to Slurm, by its commands.

use crate::error::{Error, Result};
use crate::submit::request::Request;
use crate::submit::slurm_script::{Array, ENGINE, Script, arrays, dry_run, scripts, sent_path};
use crate::submit::submitted::{SentTasks, Submitted};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use sys::disk;

/// `MaxArraySize` where nobody sets it.
const DEFAULT_LIMIT: u32 = 1001;

/// Sends the tasks of `request` with the options of `sbatch` that the user has `added`.
///
/// # Errors
/// [`sys::Error::Config`] if Slurm's commands are missing or an option cannot be added, [`Error::Engine`] if Slurm refuses or an earlier
/// submission is still queued, [`sys::Error::Io`] if a script cannot be written.
pub fn send(request: &Request, added: &[String]) -> Result<Submitted> {
    check_options(added)?;
    let limit = max_array_size()?;
    let sent = sent_path(request);
    nothing_is_queued(&sent)?;
    let arrays = arrays(request, limit);
    for folder in arrays.iter().flatten().map(|array| array.logs(request)) {
        disk::create_folder(&folder).map_err(sys::Error::io("create the directory", &folder))?;
    }
    for Script { path, text } in scripts(request) {
        fs::write(&path, text).map_err(sys::Error::io("write", &path))?;
    }
    let mut numbers = File::create(&sent).map_err(sys::Error::io("create", &sent))?;
    let (mut jobs, mut after) = (Vec::new(), Vec::new());
    for arrays in arrays {
        let mut of_phase = Vec::new();
        for array in arrays {
            let sent_before = || jobs.iter().map(|sent: &SentTasks| sent.job.as_str()).collect::<Vec<&str>>();
            let job = send_array(&array, request, &after, added).map_err(|e| with_queued(e, &sent_before()))?;
            // At once: if the next call fails, this one is queued all the same.
            writeln!(numbers, "{job}").map_err(sys::Error::io("write to", &sent))?;
            of_phase.push(job.clone());
            jobs.push(sent_tasks(array, job));
        }
        after = of_phase;
    }
    Ok(Submitted { engine: ENGINE, jobs, watch: "squeue --me".into(), logs: Some(request.folder(ENGINE)) })
}

/// Returns what [`send`] would do, as a script of the shell.
///
/// # Errors
/// [`sys::Error::Config`] if an option cannot be added.
pub fn show(request: &Request, added: &[String]) -> Result<String> {
    check_options(added)?;
    Ok(dry_run(request, max_array_size().unwrap_or(DEFAULT_LIMIT), added))
}

/// Checks that the user adds no option that says which tasks run, and when.
fn check_options(added: &[String]) -> sys::Result<()> {
    let is_ours = |word: &&String| {
        ["--array", "--dependency", "--wrap"].iter().any(|name| word.starts_with(name))
            || ["-a", "-d"].iter().any(|name| word.starts_with(name) && !word.starts_with("--"))
    };
    match added.iter().find(is_ours) {
        None => Ok(()),
        Some(word) => Err(sys::Error::Config(format!("{word}: submit sets this option itself"))),
    }
}

/// Returns the limit for the numbers of an array's elements.
fn max_array_size() -> Result<u32> {
    let config = output_of("scontrol", &["show".into(), "config".into()])?;
    limit_in(&config).ok_or_else(|| Error::Engine("scontrol show config does not show MaxArraySize".into())).and_then(
        |limit| match limit {
            0 | 1 => {
                Err(sys::Error::Config("this Slurm allows no arrays: its MaxArraySize must be 2 or more".into()).into())
            }
            limit => Ok(limit),
        },
    )
}

fn limit_in(config: &str) -> Option<u32> {
    let line = config.lines().find_map(|line| line.trim_start().strip_prefix("MaxArraySize"))?;
    line.trim_start_matches([' ', '=']).trim_end().parse().ok()
}

/// Checks that no array of an earlier submission, whose numbers are in the file `sent`, waits or runs.
fn nothing_is_queued(sent: &Path) -> Result<()> {
    let earlier = match fs::read_to_string(sent) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        text => text.map_err(sys::Error::io("read", sent))?,
    };
    let queue = output_of("squeue", &["--noheader", "--me", "--format=%F"].map(String::from))?;
    let queued: HashSet<&str> = queue.lines().map(str::trim).collect();
    let waiting: Vec<&str> = earlier.lines().filter(|number| queued.contains(number)).collect();
    if waiting.is_empty() {
        return Ok(());
    }
    let waiting = waiting.join(" ");
    Err(Error::Engine(format!(
        "an earlier submission of this job is still queued: wait for it (squeue --me), or end it with: scancel {waiting}"
    )))
}

/// Calls `sbatch` and returns the number that Slurm gives to the array.
fn send_array(array: &Array, request: &Request, after: &[String], added: &[String]) -> Result<String> {
    let answer = output_of("sbatch", &array.arguments(request, after, added))?;
    // In a federation the name of a cluster follows.
    let number = answer.trim().split(';').next().unwrap_or_default();
    if number.is_empty() || !number.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(Error::Engine(format!("sbatch answered {answer:?}, which is not a job number")));
    }
    Ok(number.into())
}

/// Adds to an error what is queued all the same.
fn with_queued(error: Error, sent: &[&str]) -> Error {
    match error {
        Error::Engine(what) if !sent.is_empty() => Error::Engine(format!(
            "{what}\nthe phases before it are queued, as jobs {}: when they are done, the same command sends the rest",
            sent.join(" ")
        )),
        error => error,
    }
}

fn sent_tasks(array: Array, job: String) -> SentTasks {
    let tasks = array.elements.iter().map(|element| element + array.offset).collect();
    SentTasks { phase: array.phase, job, tasks }
}

/// Runs a command of Slurm and returns what it prints.
fn output_of(command: &'static str, arguments: &[String]) -> Result<String> {
    let output = match Command::new(command).args(arguments).output() {
        Err(e) if e.kind() == ErrorKind::NotFound => {
            return Err(sys::Error::Config(format!(
                "{command} was not found: run this on a machine with Slurm's commands, or use --engine local"
            ))
            .into());
        }
        output => output.map_err(sys::Error::io("run", PathBuf::from(command)))?,
    };
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(Error::Engine(format!("{command}: {}", said.trim())));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_arrays_is_found() {
        let config = "MaxArrayTasks = 5\nMaxArraySize            = 1001\nMaxDBDMsgs              = 20012\n";
        assert_eq!(limit_in(config), Some(1001));
        assert_eq!(limit_in("MaxJobCount = 3\n"), None);
    }

    #[test]
    fn options_that_say_which_tasks_run_are_refused() {
        let check = |option: &str| check_options(&[option.into()]).map_err(|e| e.kind());
        for wrong in ["--array=1-3", "--dependency=singleton", "-a1", "-d", "--wrap=true"] {
            assert_eq!(check(wrong), Err(sys::ErrorKind::Usage), "{wrong}");
        }
        for right in ["--time=1:00:00", "-Along", "--account=a", "-N1", "--cpus-per-task=8"] {
            assert_eq!(check(right), Ok(()), "{right}");
        }
    }
}
