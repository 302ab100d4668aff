//! The engine "local": the tasks of a job as processes of this program on this machine, phase after phase. For tests, and for machines
//! without a scheduler.

use crate::error::{Error, Result};
use crate::exit_code::exit_code;
use crate::shell_word::quoted;
use crate::submit::request::Request;
use job::phase::{Phase, PhaseTasks};
use std::ffi::OsString;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;
use sys::{ErrorKind, interrupt, say, threads};

/// How often the engine looks whether a task has ended.
const PAUSE: Duration = Duration::from_millis(10);

/// Runs tasks on this machine.
pub struct LocalEngine<'a> {
    request: &'a Request,
    quiet: bool,
    json: bool,
}

/// A task under way. Its standard input is a pipe that ends with this process, however that ends: then the task stops, and keeps what it has
/// done.
struct RunningTask {
    number: u32,
    child: Child,
}

impl Drop for RunningTask {
    fn drop(&mut self) {
        // This closes the pipe first. What the task has done is kept, so its end is worth waiting for.
        let _ = self.child.wait();
    }
}

impl<'a> LocalEngine<'a> {
    /// Returns the engine for `request`. It takes no options that the user could have `added`.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if the user has added some.
    pub fn new(request: &'a Request, added: &[String], quiet: bool, json: bool) -> sys::Result<LocalEngine<'a>> {
        match added.first() {
            None => Ok(LocalEngine { request, quiet, json }),
            Some(option) => Err(sys::Error::Config(format!("{option}: the engine local takes no options after --"))),
        }
    }

    /// Returns the commands that [`LocalEngine::run`] would run.
    pub fn show(&self) -> String {
        let mut text = String::new();
        for phase in &self.request.phases {
            for &task in &phase.missing {
                let program = self.request.program.clone().into();
                let words = std::iter::once(program).chain(self.arguments(phase, task));
                let words: Vec<String> = words.map(|word: OsString| quoted(&word.to_string_lossy())).collect();
                text += &format!("{}\n", words.join(" "));
            }
        }
        text
    }

    /// Runs the tasks, phase after phase. After a phase of which tasks failed there is no use in the next. Once the job is planned,
    /// `missing` tells which tasks have something to do: only these are started, however many there are.
    ///
    /// # Errors
    /// [`Error::Tasks`] if tasks fail, [`sys::Error::Interrupted`], [`sys::Error::Io`] if a process cannot be started, and those of
    /// `missing`.
    pub fn run(&self, missing: impl FnOnce() -> sys::Result<Vec<PhaseTasks>>) -> Result<()> {
        match self.request.phases.split_first() {
            Some((plan, _)) if plan.phase == Phase::Plan => {
                self.run_phase(plan)?;
                self.run_phases(&missing()?)
            }
            _ => self.run_phases(&self.request.phases),
        }
    }

    fn run_phases(&self, phases: &[PhaseTasks]) -> Result<()> {
        phases.iter().filter(|phase| !phase.missing.is_empty()).try_for_each(|phase| self.run_phase(phase))
    }

    fn run_phase(&self, phase: &PhaseTasks) -> Result<()> {
        let mut waiting = phase.missing.iter().copied();
        let (mut running, mut failed, mut worst) = (Vec::<RunningTask>::new(), Vec::new(), 0);
        loop {
            while running.len() < self.at_once(phase) {
                let Some(task) = waiting.next() else { break };
                running.push(self.start(phase, task)?);
            }
            if running.is_empty() {
                break;
            }
            interrupt::check()?;
            std::thread::sleep(PAUSE);
            let mut ended = Vec::new();
            for task in &mut running {
                if let Some(status) =
                    task.child.try_wait().map_err(sys::Error::io("wait for", &self.request.program))?
                {
                    ended.push((task.number, status));
                }
            }
            running.retain(|task| ended.iter().all(|(number, _)| *number != task.number));
            for (number, status) in ended.into_iter().filter(|(_, status)| !status.success()) {
                failed.push(number);
                worst = worst.max(code_of(status));
            }
        }
        failed.sort_unstable();
        let (phase, count) = (phase.phase, phase.count);
        if failed.is_empty() { Ok(()) } else { Err(Error::Tasks { phase: phase.name(), failed, count, code: worst }) }
    }

    fn start(&self, phase: &PhaseTasks, task: u32) -> Result<RunningTask> {
        let mut command = Command::new(&self.request.program);
        command.args(self.arguments(phase, task)).arg("--until-stdin-ends").stdin(Stdio::piped());
        if phase.phase == Phase::Publish {
            // What it prints is what a job prints.
            command.args(self.json.then_some("--json"));
        } else {
            command.stdout(Stdio::null());
        }
        command.args(self.quiet.then_some("--quiet"));
        if !self.quiet && phase.missing.first() == Some(&task) {
            say(&format!("phase {}: {} of {} tasks", phase.phase, phase.missing.len(), phase.count));
        }
        let child = command.spawn().map_err(sys::Error::io("start", &self.request.program))?;
        Ok(RunningTask { number: task, child })
    }

    fn arguments(&self, phase: &PhaseTasks, task: u32) -> Vec<OsString> {
        let mut words: Vec<OsString> = vec!["work".into(), self.request.config.clone().into()];
        words.extend(["--phase", phase.phase.name()].map(OsString::from));
        match phase.phase.is_by_part() {
            true => words.extend(["--task".into(), format!("{task}/{}", phase.count).into()]),
            false => words.extend(["--tasks".into(), self.request.tasks.to_string().into()]),
        }
        words.extend(self.request.submission_words().into_iter().map(OsString::from));
        words.extend(["--threads".into(), self.threads(phase).to_string().into()]);
        words
    }

    /// Returns how many tasks run at the same time: no more than the machine can run.
    fn at_once(&self, phase: &PhaseTasks) -> usize {
        (self.request.tasks as usize).min(phase.missing.len()).min(threads::available()).max(1)
    }

    /// Returns the threads of each task, so that all that run at the same time have as many together as the job is to have.
    fn threads(&self, phase: &PhaseTasks) -> usize {
        let wanted = match self.request.threads {
            0 => threads::available(),
            threads => threads,
        };
        (wanted / self.at_once(phase)).max(1)
    }
}

/// Returns the exit code of a task. One that a signal has ended may be tried again.
fn code_of(status: ExitStatus) -> u8 {
    status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(exit_code(ErrorKind::Retry))
}
