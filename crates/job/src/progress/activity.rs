//! Kinds of work that go on at the same time within a stage.

use crate::progress::clock::JobClock;
use crate::progress::stats::StageStats;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use sys::threads::own_cpu_seconds;

/// A kind of work that goes on at the same time as others. Any thread may call its methods.
pub struct Activity {
    name: &'static str,
    unit: &'static str,
    job: JobClock,
    begun: Instant,
    work: Mutex<ActivityTotals>,
}

/// What has been done of an activity.
#[derive(Default)]
struct ActivityTotals {
    /// When the first piece began and the last one ended.
    span: Option<[Instant; 2]>,
    cpu_s: f64,
    done: u64,
}

impl Activity {
    /// Starts an activity of a job that began at `job`.
    pub(crate) fn start(name: &'static str, unit: &'static str, job: JobClock) -> Activity {
        Activity { name, unit, job, begun: Instant::now(), work: Mutex::default() }
    }

    /// Runs a piece of the work on this thread. It is worth `units` units.
    pub fn time<T>(&self, units: u64, piece: impl FnOnce() -> T) -> T {
        let (begun, cpu_start) = (Instant::now(), own_cpu_seconds());
        let outcome = piece();
        let (ended, cpu_s) = (Instant::now(), own_cpu_seconds() - cpu_start);
        let mut work = self.work();
        work.span = Some(work.span.map_or([begun, ended], |[first, last]| [first.min(begun), last.max(ended)]));
        work.cpu_s += cpu_s;
        work.done += units;
        outcome
    }

    /// Ends the activity and returns what it took.
    pub fn finish(self) -> StageStats {
        let ActivityTotals { span, cpu_s, done } = *self.work();
        let [start_s, end_s] = span.unwrap_or([self.begun; 2]).map(|at| self.job.until(at));
        StageStats { stage: self.name.into(), start_s, wall_s: end_s - start_s, cpu_s, done, unit: self.unit.into() }
    }

    fn work(&self) -> MutexGuard<'_, ActivityTotals> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
