//! How far a job is: a bar per stage on a terminal, a line now and then in a log, nothing with `--quiet`.

use indicatif::{HumanCount, ProgressBar, ProgressState, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
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
            eprintln!("{text}");
        }
    }

    /// Starts a stage of `total` `unit`s.
    pub fn stage(self, name: &'static str, total: u64, unit: &'static str) -> Stage {
        let bar = match self {
            Progress::Bars if total > 1 => ProgressBar::new(total).with_style(style(unit)).with_prefix(name),
            _ => ProgressBar::hidden(),
        };
        let now = Instant::now();
        Stage {
            progress: self,
            name,
            unit,
            total,
            bar,
            done: AtomicU64::new(0),
            taken_over: AtomicU64::new(0),
            start: now,
            cpu_start: cpu_seconds(),
            logged: Mutex::new(now),
        }
    }
}

fn style(unit: &str) -> ProgressStyle {
    let template = format!(
        "{{prefix:>12}} {{bar:30}} {{percent:>3}} %  {{human_pos}} of {{human_len}} {unit}, {{rate}}/s, {{eta}} left"
    );
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    style.with_key("rate", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        // A bar that cannot be drawn is no reason to stop.
        let _ = out.write_str(&HumanCount(state.per_sec() as u64).to_string());
    })
}

/// A running stage; its methods may be called from any thread.
pub struct Stage {
    progress: Progress,
    name: &'static str,
    unit: &'static str,
    total: u64,
    bar: ProgressBar,
    done: AtomicU64,
    /// How much of it an earlier run had done.
    taken_over: AtomicU64,
    start: Instant,
    cpu_start: f64,
    logged: Mutex<Instant>,
}

/// What a stage took.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageFigures {
    /// Its name.
    pub stage: String,
    /// Seconds from its start to its end.
    pub wall_s: f64,
    /// Seconds of processor time of all threads.
    pub cpu_s: f64,
    /// How many of its units it went through.
    pub done: u64,
    /// What its units are.
    pub unit: String,
}

impl Stage {
    /// Counts `amount` more units as done.
    pub fn advance(&self, amount: u64) {
        let done = self.done.fetch_add(amount, Ordering::Relaxed) + amount;
        match self.progress {
            Progress::Quiet => {}
            Progress::Bars => self.bar.set_position(done.min(self.total)),
            Progress::Lines => self.log(done),
        }
    }

    /// Counts `amount` units as done by an earlier run: they say nothing of how fast this one is.
    pub fn take_over(&self, amount: u64) {
        let done = self.done.fetch_add(amount, Ordering::Relaxed) + amount;
        self.taken_over.fetch_add(amount, Ordering::Relaxed);
        if self.progress == Progress::Bars {
            self.bar.set_position(done.min(self.total));
            self.bar.reset_eta();
        }
    }

    fn log(&self, done: u64) {
        let Ok(mut logged) = self.logged.try_lock() else { return };
        if logged.elapsed() < LOG_EVERY || done >= self.total {
            return;
        }
        *logged = Instant::now();
        let elapsed = self.start.elapsed().as_secs_f64();
        let share = done as f64 / self.total.max(1) as f64;
        let here = done.saturating_sub(self.taken_over.load(Ordering::Relaxed));
        let left = elapsed / here.max(1) as f64 * (self.total - done) as f64;
        eprintln!("{}: {:.0} % of {} {}, {:.0} s left", self.name, share * 100.0, self.total, self.unit, left);
    }

    /// Ends the stage.
    pub fn finish(self) -> StageFigures {
        self.bar.finish_and_clear();
        let figures = StageFigures {
            stage: self.name.into(),
            wall_s: self.start.elapsed().as_secs_f64(),
            cpu_s: cpu_seconds() - self.cpu_start,
            done: self.done.load(Ordering::Relaxed),
            unit: self.unit.into(),
        };
        if self.progress == Progress::Lines {
            eprintln!("{}: done, {} {} in {:.1} s", self.name, figures.done, self.unit, figures.wall_s);
        }
        figures
    }
}

/// Processor time of this process so far, in seconds.
fn cpu_seconds() -> f64 {
    cpu_time::ProcessTime::try_now().map_or(f64::NAN, |t| t.as_duration().as_secs_f64())
}
