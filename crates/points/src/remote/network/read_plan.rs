//! Which ranges of a file will be read, and which are under way.
//!
//! Threads take the ranges of a plan, each once, about in their order. What a thread takes comes in a window with the ranges after it, and
//! the next window is fetched meanwhile. So a file is read in few requests, and nothing of it twice.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::remote::network::window::{Pending, held_bytes};

/// Ranges with no more bytes between them are fetched in one request: on most connections a request takes as long as these bytes. All gaps
/// of a request together have at most half as many bytes as what is wanted of it: many small ranges must not become the whole file.
const GAP: u64 = 1 << 17;

/// The bytes of a window, unless a single range is longer.
const WINDOW: u64 = 1 << 22;

/// The bytes that windows of the process may hold before nothing is read ahead any more.
static SPACE: AtomicU64 = AtomicU64::new(64 << 20);

/// Says how many bytes windows may hold before nothing is read ahead any more.
pub(crate) fn set_space(bytes: u64) {
    SPACE.store(bytes, Ordering::Relaxed);
}

fn has_space() -> bool {
    held_bytes() + WINDOW <= SPACE.load(Ordering::Relaxed)
}

/// Returns whether so many bytes more may be kept until they are read once more. Half of the space is for reading ahead.
pub(crate) fn may_keep(bytes: u64) -> bool {
    held_bytes() + bytes <= SPACE.load(Ordering::Relaxed) / 2
}

/// The ranges that will be read.
pub(crate) struct ReadPlan {
    /// In the order of their beginnings.
    ranges: Vec<Range<u64>>,
    states: Vec<State>,
}

enum State {
    Wanted,
    Coming(Pending),
    Taken,
}

impl ReadPlan {
    /// Returns the plan to read these ranges.
    pub(crate) fn new(mut ranges: Vec<Range<u64>>) -> ReadPlan {
        ranges.sort_unstable_by_key(|range| (range.start, range.end));
        ranges.dedup();
        let states = ranges.iter().map(|_| State::Wanted).collect();
        ReadPlan { ranges, states }
    }

    /// Takes a range of the plan: returns the window that it comes in. Begins to fetch that with `begin`, and the next one. Returns `None`
    /// for other ranges.
    pub(crate) fn take(&mut self, range: &Range<u64>, begin: &dyn Fn(Range<u64>) -> Pending) -> Option<Pending> {
        let at = self.ranges.binary_search_by_key(&(range.start, range.end), |range| (range.start, range.end)).ok()?;
        if matches!(self.states[at], State::Taken) {
            // The file is read once more.
            self.states.fill_with(|| State::Wanted);
        }
        if matches!(self.states[at], State::Wanted) {
            self.begin_window(at, begin);
        }
        let State::Coming(window) = std::mem::replace(&mut self.states[at], State::Taken) else { return None };
        self.read_ahead(at + 1, begin);
        Some(window)
    }

    /// Begins the window after those that are under way from range `next` on, if they are short enough and nobody else has begun it.
    fn read_ahead(&mut self, next: usize, begin: &dyn Fn(Range<u64>) -> Pending) {
        let coming = self.states[next..].iter().take_while(|state| matches!(state, State::Coming(_))).count();
        let after = next + coming;
        let bytes: u64 = self.ranges[next..after].iter().map(|range| range.end - range.start).sum();
        if bytes < WINDOW && has_space() && matches!(self.states.get(after), Some(State::Wanted)) {
            self.begin_window(after, begin);
        }
    }

    /// Begins to fetch range `first` and wanted ones after it, as many as a window holds.
    fn begin_window(&mut self, first: usize, begin: &dyn Fn(Range<u64>) -> Pending) {
        let mut run = Run::of(self.ranges[first].clone());
        let mut last = first;
        let most = if has_space() { WINDOW } else { 0 };
        for (at, range) in self.ranges.iter().enumerate().skip(first + 1) {
            if !matches!(self.states[at], State::Wanted) || !run.add(range, most) {
                break;
            }
            last = at;
        }
        let window = begin(run.range);
        self.states[first..=last].fill_with(|| State::Coming(window.clone()));
    }
}

/// Ranges that one request brings.
struct Run {
    range: Range<u64>,
    /// The bytes between them.
    gaps: u64,
}

impl Run {
    fn of(range: Range<u64>) -> Run {
        Run { range, gaps: 0 }
    }

    /// Adds a range behind the others if it is near them and all together have at most `most` bytes. Returns whether it did.
    fn add(&mut self, range: &Range<u64>, most: u64) -> bool {
        let gap = range.start.saturating_sub(self.range.end);
        let (end, gaps) = (self.range.end.max(range.end), self.gaps + gap);
        let length = end - self.range.start;
        let is_near = gap <= GAP && gaps <= (length - gaps) / 2 && length <= most;
        if is_near {
            (self.range.end, self.gaps) = (end, gaps);
        }
        is_near
    }
}

/// Joins ranges with few bytes between them. They are in the order of their beginnings.
pub(crate) fn joined(ranges: impl IntoIterator<Item = Range<u64>>, most: u64) -> Vec<Range<u64>> {
    let mut joined: Vec<Run> = Vec::new();
    for range in ranges {
        if !joined.last_mut().is_some_and(|last| last.add(&range, most)) {
            joined.push(Run::of(range));
        }
    }
    joined.into_iter().map(|run| run.range).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Takes ranges of a plan by their numbers and returns what was fetched for them.
    fn fetched(plan: &mut ReadPlan, numbers: &[usize]) -> Vec<Range<u64>> {
        let begun = Mutex::new(Vec::new());
        let begin = |range: Range<u64>| {
            begun.lock().unwrap().push(range.clone());
            Pending::begin(range, || Ok(Vec::new()))
        };
        for &number in numbers {
            let range = plan.ranges[number].clone();
            assert!(plan.take(&range, &begin).is_some());
        }
        begun.into_inner().unwrap()
    }

    fn ranges(count: u64, length: u64, step: u64) -> Vec<Range<u64>> {
        (0..count).map(|i| i * step..i * step + length).collect()
    }

    fn only(range: Range<u64>) -> Vec<Range<u64>> {
        std::iter::once(range).collect()
    }

    #[test]
    fn a_file_is_fetched_once_in_windows() {
        const MIB: u64 = 1 << 20;
        let mut plan = ReadPlan::new(ranges(10, MIB, MIB));
        // The first window, and the next one at once.
        assert_eq!(fetched(&mut plan, &[0]), [0..4 * MIB, 4 * MIB..8 * MIB]);
        assert_eq!(fetched(&mut plan, &[1, 2, 3]), []);
        assert_eq!(fetched(&mut plan, &[4]), only(8 * MIB..10 * MIB));
        assert_eq!(fetched(&mut plan, &[5, 6, 7, 8, 9]), []);
        // Once more from the beginning.
        assert_eq!(fetched(&mut plan, &[0])[0], 0..4 * MIB);
    }

    #[test]
    fn two_threads_fetch_nothing_twice() {
        let mut plan = ReadPlan::new(ranges(64, 1 << 19, 1 << 19));
        let order: Vec<usize> = (0..32).flat_map(|i| [i, i + 32]).collect();
        let fetched = fetched(&mut plan, &order);
        assert_eq!(fetched.iter().map(|range| range.end - range.start).sum::<u64>(), 64 << 19, "{fetched:?}");
        assert!(fetched.len() <= 10, "{fetched:?}");
    }

    #[test]
    fn far_ranges_are_fetched_apart_and_others_are_unknown() {
        const LONG: u64 = 4 * GAP;
        let mut plan = ReadPlan::new(ranges(3, LONG, LONG + GAP));
        assert_eq!(fetched(&mut plan, &[0]), only(0..3 * LONG + 2 * GAP));
        let mut plan = ReadPlan::new(ranges(3, LONG, LONG + GAP + 1));
        assert_eq!(fetched(&mut plan, &[0]), [0..LONG, LONG + GAP + 1..2 * LONG + GAP + 1]);
        let never = |range| Pending::begin(range, || Ok(Vec::new()));
        assert!(plan.take(&(0..99), &never).is_none());
        assert_eq!(joined(ranges(3, 100, 201), u64::MAX).len(), 3, "gaps are no more than half of what is wanted");
        assert_eq!(joined(ranges(3, 100, 140), u64::MAX), only(0..380));
        assert_eq!(joined(ranges(3, 100, 140), 300), [0..240, 280..380]);
    }
}
