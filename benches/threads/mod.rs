//! What the worker threads of a job do, as benchmarks see it from outside. Linux only.

use std::collections::HashMap;
use std::fs;
use std::time::Duration;

/// A worker without work asks the others for some, and leaves its processor to them each time. Where threads are more than processors it is
/// still waiting for one then, but it does not work. So a worker counts as idle if its turns on a processor are shorter than this.
const SHORTEST_TURN: Duration = Duration::from_micros(50);

/// One look may come when a turn has only begun, so a worker is idle after so many looks that saw short turns.
const SHORT_TURNS: u32 = 2;

/// What a thread has had of the processors.
#[derive(Clone, Copy, Default)]
pub(crate) struct Turns {
    nanoseconds: u64,
    count: u64,
    /// How many looks in a row have seen short turns.
    short: u32,
}

impl Turns {
    /// Takes what the thread has had by now.
    fn update(&mut self, nanoseconds: u64, count: u64) {
        let (more, turns) = (nanoseconds - self.nanoseconds, count - self.count);
        let is_short = Duration::from_nanos(more / turns.max(1)) < SHORTEST_TURN;
        if turns > 0 || !is_short {
            *self = Turns { nanoseconds, count, short: if is_short { self.short + 1 } else { 0 } };
        }
    }

    fn is_idle(&self) -> bool {
        self.short >= SHORT_TURNS
    }
}

/// Returns the states of the workers of `process` that are not idle: `self`, or its number.
pub(crate) fn states_of_workers(process: &str, turns: &mut HashMap<String, Turns>) -> Vec<u8> {
    let Ok(threads) = fs::read_dir(format!("/proc/{process}/task")) else { return Vec::new() };
    let names = threads.flatten().map(|thread| thread.file_name().to_string_lossy().into_owned());
    names.filter_map(|thread| state(process, thread, turns)).collect()
}

/// Returns the state of a thread; `None` if it is no worker, has ended or is idle.
fn state(process: &str, thread: String, turns: &mut HashMap<String, Turns>) -> Option<u8> {
    let folder = format!("/proc/{process}/task/{thread}");
    let text = fs::read_to_string(format!("{folder}/stat")).ok()?;
    let (name, rest) = text.split_once('(')?.1.rsplit_once(") ")?;
    if !name.starts_with("worker") {
        return None;
    }
    let schedule = fs::read_to_string(format!("{folder}/schedstat")).unwrap_or_default();
    let mut numbers = schedule.split_whitespace().map(|number| number.parse().unwrap_or(0));
    let turns = turns.entry(thread).or_default();
    turns.update(numbers.next().unwrap_or(0), numbers.nth(1).unwrap_or(0));
    rest.bytes().next().filter(|state| *state != b'R' || !turns.is_idle())
}
