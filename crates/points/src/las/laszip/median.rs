//! A running median of steps.

/// Five of the latest values in order. A new value displaces the least and the greatest in turn, as long as they straddle the median.
#[derive(Clone, Copy, Default)]
pub(super) struct RunningMedian {
    values: [i32; 5],
    /// Whether the next value displaces the least; else it displaces the greatest.
    displaces_least: bool,
}

impl RunningMedian {
    #[inline(always)]
    pub(super) fn get(&self) -> i32 {
        self.values[2]
    }

    /// Puts `value` in its place, branch-free: which side it comes to cannot be foreseen.
    #[inline(always)]
    pub(super) fn add(&mut self, value: i32) {
        let median = self.get();
        let first = self.displaces_least as usize;
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| self.values[first + i]);
        let is_below = (value < median) | (self.displaces_least & (value == median));
        self.displaces_least = !is_below;
        self.values = [a.min(value), a.max(b.min(value)), b.max(c.min(value)), c.max(d.min(value)), d.max(value)];
    }
}
