//! How far a job is: a bar per stage on a terminal, a line now and then in a log, nothing with `--quiet`.

use crate::job::progress::time_left::{Forecast, rough};
use crate::say;
use indicatif::{HumanCount, ProgressBar, ProgressState, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Between two lines in a log.
const LOG_EVERY: Duration = Duration::from_secs(10);

/// Where progress goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Nowhere.
    Quiet,
    /// To a terminal, as bars.
    Bars,
    /// To a log, as lines.
    Lines,
}

impl Progress {
    /// What suits standard error.
    pub fn detect(quiet: bool) -> Progress {
        match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => Progress::Quiet,
            (false, true) => Progress::Bars,
            (false, false) => Progress::Lines,
        }
    }

    /// Says something between two stages.
    pub fn note(self, text: &str) {
        if self != Progress::Quiet {
            say(text);
        }
    }

    /// Starts a stage of `total` `unit`s that is no part of a job.
    pub fn stage(self, name: &'static str, total: u64, unit: &'static str) -> Stage {
        Schedule::new(self, Clock::start(), Vec::new()).stage(name, total, unit)
    }
}

/// When a job began, by the wall and by the processors.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    wall: Instant,
    cpu: f64,
}

impl Clock {
    /// One that begins now.
    pub fn start() -> Clock {
        Clock { wall: Instant::now(), cpu: cpu_seconds() }
    }

    /// Seconds since then.
    pub fn wall_s(&self) -> f64 {
        self.wall.elapsed().as_secs_f64()
    }

    /// Seconds of processor time of this process since then.
    pub fn cpu_s(&self) -> f64 {
        cpu_seconds() - self.cpu
    }

    /// Seconds from then to `at`.
    fn until(&self, at: Instant) -> f64 {
        (at - self.wall).as_secs_f64()
    }
}

/// The stages of a job, one after the other, and when the last of them will be done.
pub struct Schedule {
    progress: Progress,
    clock: Clock,
    forecast: Arc<Mutex<Forecast>>,
}

impl Schedule {
    /// For stages that are expected to cost so much, in the order in which they will come.
    pub fn new(progress: Progress, clock: Clock, costs: Vec<(&'static str, f64)>) -> Schedule {
        Schedule { progress, clock, forecast: Arc::new(Mutex::new(Forecast::new(costs))) }
    }

    /// Says something between two stages.
    pub fn note(&self, text: &str) {
        self.progress.note(text);
    }

    /// Starts a stage of `total` `unit`s.
    pub fn stage(&self, name: &'static str, total: u64, unit: &'static str) -> Stage {
        let pace = Arc::new(Pace {
            forecast: self.forecast.clone(),
            name,
            total,
            done: AtomicU64::new(0),
            taken_over: AtomicU64::new(0),
            start: Instant::now(),
        });
        let bar = match self.progress {
            Progress::Bars if total > 1 => {
                ProgressBar::new(total).with_style(style(unit, pace.clone())).with_prefix(name)
            }
            _ => ProgressBar::hidden(),
        };
        let logged = Mutex::new(pace.start);
        Stage { progress: self.progress, job: self.clock, own: Clock::start(), unit, bar, pace, logged }
    }

    /// One of several kinds of work that go on side by side within a stage.
    pub fn strand(&self, name: &'static str, unit: &'static str) -> Strand {
        Strand { name, unit, job: self.clock, begun: Instant::now(), work: Mutex::default() }
    }
}

/// How far a stage is, and how fast.
struct Pace {
    forecast: Arc<Mutex<Forecast>>,
    name: &'static str,
    total: u64,
    done: AtomicU64,
    /// How much of it an earlier run had done.
    taken_over: AtomicU64,
    start: Instant,
}

impl Pace {
    fn share(&self, amount: &AtomicU64) -> f64 {
        (amount.load(Ordering::Relaxed) as f64 / self.total.max(1) as f64).min(1.0)
    }

    /// Seconds left of the whole job.
    fn left(&self) -> f64 {
        let shares = [&self.taken_over, &self.done].map(|amount| self.share(amount));
        self.forecast().left(self.name, shares[0], shares[1], self.start.elapsed().as_secs_f64())
    }

    fn finish(&self) {
        let share = 1.0 - self.share(&self.taken_over);
        self.forecast().finish(self.name, share, self.start.elapsed().as_secs_f64());
    }

    fn forecast(&self) -> MutexGuard<'_, Forecast> {
        self.forecast.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

fn style(unit: &str, pace: Arc<Pace>) -> ProgressStyle {
    let template = format!(
        "{{prefix:>12}} {{bar:30}} {{percent:>3}} %  {{human_pos}} of {{human_len}} {unit}, {{rate}}/s, {{left}} left of the job"
    );
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    // A bar that cannot be drawn is no reason to stop.
    let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        let _ = out.write_str(&HumanCount(state.per_sec() as u64).to_string());
    };
    let left = move |_: &ProgressState, out: &mut dyn std::fmt::Write| {
        let _ = out.write_str(&rough(pace.left()));
    };
    style.with_key("rate", rate).with_key("left", left)
}

/// A running stage; its methods may be called from any thread.
pub struct Stage {
    progress: Progress,
    job: Clock,
    own: Clock,
    unit: &'static str,
    bar: ProgressBar,
    pace: Arc<Pace>,
    logged: Mutex<Instant>,
}

/// What a stage took.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageFigures {
    /// Its name.
    pub stage: String,
    /// Seconds from the start of the job to its start.
    #[serde(default)]
    pub start_s: f64,
    /// Seconds from its start to its end.
    pub wall_s: f64,
    /// Seconds of processor time of all threads.
    pub cpu_s: f64,
    /// How many of its units this run went through.
    pub done: u64,
    /// What its units are.
    pub unit: String,
}

impl Stage {
    /// Counts `amount` more units as done.
    pub fn advance(&self, amount: u64) {
        let done = self.pace.done.fetch_add(amount, Ordering::Relaxed) + amount;
        match self.progress {
            Progress::Quiet => {}
            Progress::Bars => self.bar.set_position(done.min(self.pace.total)),
            Progress::Lines => self.log(done),
        }
    }

    /// Counts `amount` units as done by an earlier run: they say nothing of how fast this one is.
    pub fn take_over(&self, amount: u64) {
        let done = self.pace.done.fetch_add(amount, Ordering::Relaxed) + amount;
        self.pace.taken_over.fetch_add(amount, Ordering::Relaxed);
        if self.progress == Progress::Bars {
            self.bar.set_position(done.min(self.pace.total));
            self.bar.reset_eta();
        }
    }

    fn log(&self, done: u64) {
        let Ok(mut logged) = self.logged.try_lock() else { return };
        let Pace { name, total, .. } = *self.pace;
        if logged.elapsed() < LOG_EVERY || done >= total {
            return;
        }
        *logged = Instant::now();
        let percent = self.pace.share(&self.pace.done) * 100.0;
        say(&format!("{name}: {percent:.0} % of {total} {}, {} left of the job", self.unit, rough(self.pace.left())));
    }

    /// Ends the stage.
    pub fn finish(self) -> StageFigures {
        self.bar.finish_and_clear();
        self.pace.finish();
        let [done, taken_over] = [&self.pace.done, &self.pace.taken_over].map(|amount| amount.load(Ordering::Relaxed));
        let figures = StageFigures {
            stage: self.pace.name.into(),
            start_s: self.job.until(self.own.wall),
            wall_s: self.own.wall_s(),
            cpu_s: self.own.cpu_s(),
            done: done - taken_over,
            unit: self.unit.into(),
        };
        if self.progress == Progress::Lines {
            say(&format!("{}: done, {} {} in {:.1} s", figures.stage, figures.done, self.unit, figures.wall_s));
        }
        figures
    }
}

/// A kind of work that goes on beside others; its methods may be called from any thread.
pub struct Strand {
    name: &'static str,
    unit: &'static str,
    job: Clock,
    begun: Instant,
    work: Mutex<Work>,
}

/// What has been done of a [`Strand`].
#[derive(Default)]
struct Work {
    /// When the first piece of it began and the last one ended.
    span: Option<[Instant; 2]>,
    cpu_s: f64,
    done: u64,
}

impl Strand {
    /// Does a piece of the work, of so many units, all of it on this thread.
    pub fn time<T>(&self, units: u64, piece: impl FnOnce() -> T) -> T {
        let (begun, cpu_start) = (Instant::now(), thread_cpu_seconds());
        let outcome = piece();
        let (ended, cpu_s) = (Instant::now(), thread_cpu_seconds() - cpu_start);
        let mut work = self.work();
        work.span = Some(work.span.map_or([begun, ended], |[first, last]| [first.min(begun), last.max(ended)]));
        work.cpu_s += cpu_s;
        work.done += units;
        outcome
    }

    /// What it took.
    pub fn finish(self) -> StageFigures {
        let Work { span, cpu_s, done } = *self.work();
        let [start_s, end_s] = span.unwrap_or([self.begun; 2]).map(|at| self.job.until(at));
        StageFigures { stage: self.name.into(), start_s, wall_s: end_s - start_s, cpu_s, done, unit: self.unit.into() }
    }

    fn work(&self) -> MutexGuard<'_, Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Processor time of this thread so far, in seconds.
fn thread_cpu_seconds() -> f64 {
    cpu_time::ThreadTime::try_now().map_or(f64::NAN, |t| t.as_duration().as_secs_f64())
}

/// Processor time of this process so far, in seconds.
fn cpu_seconds() -> f64 {
    cpu_time::ProcessTime::try_now().map_or(f64::NAN, |t| t.as_duration().as_secs_f64())
}
