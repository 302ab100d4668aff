//! The stages of a job on standard error: a bar for each on a terminal, a line every ten seconds in a log, JSON every second for programs,
//! nothing with `--quiet`.

use crate::progress::activity::Activity;
use crate::progress::clock::JobClock;
use crate::progress::number_text::{grouped, rough_time};
use crate::progress::stats::StageStats;
use crate::progress::time_left::TimeLeft;
use indicatif::{HumanCount, ProgressBar, ProgressState, ProgressStyle};
use serde_json::json;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use sys::say;

/// The time between two lines in a log.
const LOG_INTERVAL: Duration = Duration::from_secs(10);

/// The time between two lines for programs.
const JSON_INTERVAL: Duration = Duration::from_secs(1);

/// Where progress goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgressOutput {
    /// Nowhere.
    Quiet,
    /// To a terminal, as bars.
    Bars,
    /// To a log, as lines.
    Lines,
    /// To a program, as JSON objects, one a line.
    Json,
}

impl ProgressOutput {
    /// Returns what suits standard error.
    pub fn detect() -> ProgressOutput {
        if std::io::stderr().is_terminal() { ProgressOutput::Bars } else { ProgressOutput::Lines }
    }

    /// Prints a note between two stages.
    pub fn note(self, text: &str) {
        match self {
            ProgressOutput::Quiet => {}
            ProgressOutput::Json => say(&json!({ "note": text }).to_string()),
            ProgressOutput::Bars | ProgressOutput::Lines => say(text),
        }
    }

    /// Starts a stage of `total` `unit`s outside a job. In a log, one that takes less than ten seconds leaves no line.
    pub fn stage(self, name: &'static str, total: u64, unit: &'static str) -> Stage {
        let stage = JobProgress::new(self, JobClock::start(), Vec::new()).stage(name, total, unit);
        Stage { of_job: false, ..stage }
    }
}

/// The stages of a job in their order, and how long the job will take.
pub struct JobProgress {
    progress: ProgressOutput,
    clock: JobClock,
    time_left: Arc<Mutex<TimeLeft>>,
}

impl JobProgress {
    /// Returns the progress of a job. `costs` names the stages in their order, with what each is expected to cost; only the ratios matter.
    pub fn new(progress: ProgressOutput, clock: JobClock, costs: Vec<(&'static str, f64)>) -> JobProgress {
        JobProgress { progress, clock, time_left: Arc::new(Mutex::new(TimeLeft::new(costs))) }
    }

    /// Prints a note between two stages.
    pub fn note(&self, text: &str) {
        self.progress.note(text);
    }

    /// Starts a stage of `total` `unit`s.
    pub fn stage(&self, name: &'static str, total: u64, unit: &'static str) -> Stage {
        let pace = Arc::new(StagePace {
            time_left: self.time_left.clone(),
            name,
            total,
            done: AtomicU64::new(0),
            taken_over: AtomicU64::new(0),
            start: Instant::now(),
        });
        let bar = match self.progress {
            ProgressOutput::Bars if total > 1 => {
                ProgressBar::new(total).with_style(style(unit, pace.clone())).with_prefix(name)
            }
            _ => ProgressBar::hidden(),
        };
        let logged = Mutex::new(pace.start);
        Stage {
            progress: self.progress,
            of_job: true,
            job: self.clock,
            own: JobClock::start(),
            unit,
            bar,
            pace,
            logged,
        }
    }

    /// Starts one of several kinds of work that go on at the same time within a stage.
    pub fn activity(&self, name: &'static str, unit: &'static str) -> Activity {
        Activity::start(name, unit, self.clock)
    }
}

/// Returns the line of a log about a stage that is done. One of a single piece has no number.
fn done_line(StageStats { stage, wall_s, done, unit, .. }: &StageStats, total: u64) -> String {
    let amount = if total > 1 { format!(", {} {unit}", grouped(*done)) } else { String::new() };
    format!("{stage}: done{amount} in {wall_s:.1} s")
}

/// How far a stage is, and how fast.
struct StagePace {
    time_left: Arc<Mutex<TimeLeft>>,
    name: &'static str,
    total: u64,
    done: AtomicU64,
    /// How much of it an earlier run did.
    taken_over: AtomicU64,
    start: Instant,
}

impl StagePace {
    fn share(&self, amount: &AtomicU64) -> f64 {
        (amount.load(Ordering::Relaxed) as f64 / self.total.max(1) as f64).min(1.0)
    }

    /// Returns the seconds left of the whole job.
    fn left(&self) -> f64 {
        let shares = [&self.taken_over, &self.done].map(|amount| self.share(amount));
        self.time_left().left(self.name, shares[0], shares[1], self.start.elapsed().as_secs_f64())
    }

    fn finish(&self) {
        let share = 1.0 - self.share(&self.taken_over);
        self.time_left().finish(self.name, share, self.start.elapsed().as_secs_f64());
    }

    fn time_left(&self) -> MutexGuard<'_, TimeLeft> {
        self.time_left.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn style(unit: &str, pace: Arc<StagePace>) -> ProgressStyle {
    // At most 80 columns, with the longest of all names.
    let template = format!("{{prefix:>14}} {{bar:16}} {{percent:>3}} %  {{rate}} {unit}/s, {{left}} left");
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    // A bar that cannot be drawn must not end the job.
    let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        let _ = out.write_str(&HumanCount(state.per_sec() as u64).to_string());
    };
    let left = move |_: &ProgressState, out: &mut dyn std::fmt::Write| {
        let _ = out.write_str(&rough_time(pace.left()));
    };
    style.with_key("rate", rate).with_key("left", left)
}

/// A running stage. Any thread may call its methods.
pub struct Stage {
    progress: ProgressOutput,
    of_job: bool,
    job: JobClock,
    own: JobClock,
    unit: &'static str,
    bar: ProgressBar,
    pace: Arc<StagePace>,
    logged: Mutex<Instant>,
}

impl Stage {
    /// Counts `amount` more units as done.
    pub fn advance(&self, amount: u64) {
        let done = self.pace.done.fetch_add(amount, Ordering::Relaxed) + amount;
        match self.progress {
            ProgressOutput::Quiet => {}
            ProgressOutput::Bars => self.bar.set_position(done.min(self.pace.total)),
            ProgressOutput::Lines | ProgressOutput::Json => self.log(done),
        }
    }

    /// Counts `amount` units as done by an earlier run. They do not count for the speed of this one.
    pub fn take_over(&self, amount: u64) {
        let done = self.pace.done.fetch_add(amount, Ordering::Relaxed) + amount;
        self.pace.taken_over.fetch_add(amount, Ordering::Relaxed);
        if self.progress == ProgressOutput::Bars {
            self.bar.set_position(done.min(self.pace.total));
            self.bar.reset_eta();
        }
    }

    fn log(&self, done: u64) {
        let Ok(mut logged) = self.logged.try_lock() else { return };
        let StagePace { name, total, .. } = *self.pace;
        let interval = if self.progress == ProgressOutput::Json { JSON_INTERVAL } else { LOG_INTERVAL };
        if logged.elapsed() < interval || done >= total {
            return;
        }
        *logged = Instant::now();
        if self.progress == ProgressOutput::Json {
            return self.say_json(done, false);
        }
        let percent = self.pace.share(&self.pace.done) * 100.0;
        let (total, left) = (grouped(total), rough_time(self.pace.left()));
        let of = if self.of_job { " of the job" } else { "" };
        say(&format!("{name}: {percent:.0} % of {total} {}, {left} left{of}", self.unit));
    }

    /// Prints how far the stage is, for programs.
    fn say_json(&self, done: u64, is_finished: bool) {
        let left = self.pace.left();
        let line = json!({
            "stage": self.pace.name,
            "done": done,
            "total": self.pace.total,
            "unit": self.unit,
            "finished": is_finished,
            // JSON has no number for an estimate that is none.
            "seconds_left": left.is_finite().then(|| left.round()),
        });
        say(&line.to_string());
    }

    /// Ends the stage and returns what it took.
    pub fn finish(self) -> StageStats {
        self.bar.finish_and_clear();
        self.pace.finish();
        let [done, taken_over] = [&self.pace.done, &self.pace.taken_over].map(|amount| amount.load(Ordering::Relaxed));
        let figures = StageStats {
            stage: self.pace.name.into(),
            start_s: self.job.until(self.own.start_time()),
            wall_s: self.own.wall_s(),
            cpu_s: self.own.cpu_s(),
            done: done - taken_over,
            unit: self.unit.into(),
        };
        if self.progress == ProgressOutput::Json {
            self.say_json(done, true);
        }
        let is_worth_a_line = self.of_job && self.pace.total > 0 || figures.wall_s >= LOG_INTERVAL.as_secs_f64();
        if self.progress == ProgressOutput::Lines && is_worth_a_line {
            say(&done_line(&figures, self.pace.total));
        }
        figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_a_log_has_the_amount_unless_it_is_one_piece() {
        let stats = |done, unit: &str| StageStats {
            stage: "levels".into(),
            start_s: 0.0,
            wall_s: 1.25,
            cpu_s: 0.0,
            done,
            unit: unit.into(),
        };
        assert_eq!(done_line(&stats(12_345, "tiles"), 20_000), "levels: done, 12 345 tiles in 1.2 s");
        assert_eq!(done_line(&stats(1, "job"), 1), "levels: done in 1.2 s");
    }
}
