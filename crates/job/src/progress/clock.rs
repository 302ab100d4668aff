//! Wall-clock and processor time.

use std::time::Instant;

/// A moment, by the wall clock and by the processor time of this process.
#[derive(Clone, Copy, Debug)]
pub struct JobClock {
    wall: Instant,
    cpu: f64,
}

impl JobClock {
    /// Returns the present moment.
    pub fn start() -> JobClock {
        JobClock { wall: Instant::now(), cpu: cpu_seconds() }
    }

    /// Returns the seconds since then.
    pub fn wall_s(&self) -> f64 {
        self.wall.elapsed().as_secs_f64()
    }

    /// Returns the seconds of processor time of this process since then.
    pub fn cpu_s(&self) -> f64 {
        cpu_seconds() - self.cpu
    }

    /// Returns when it was by the wall clock.
    pub(crate) fn start_time(&self) -> Instant {
        self.wall
    }

    /// Returns the seconds from then to `at`.
    pub(crate) fn until(&self, at: Instant) -> f64 {
        (at - self.wall).as_secs_f64()
    }
}

/// Returns the processor time of this process so far in seconds.
fn cpu_seconds() -> f64 {
    cpu_time::ProcessTime::try_now().map_or(f64::NAN, |t| t.as_duration().as_secs_f64())
}
