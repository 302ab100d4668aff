//! How long a job will take: the running stage by its own pace, and the stages to come by their expected cost compared with that of
//! the finished ones.

/// The weight of the expectation, as a fraction of a stage: what is measured soon outweighs it.
const EXPECTATION_WEIGHT: f64 = 0.03;

/// What the stages are expected to cost, and what the finished ones took.
#[derive(Clone, Debug, Default)]
pub(crate) struct TimeLeft {
    stages: Vec<(&'static str, f64)>,
    /// The seconds that the finished stages took, and their expected cost.
    done: [f64; 2],
}

impl TimeLeft {
    /// Returns the estimate for stages with these expected costs, in their order.
    pub(crate) fn new(stages: Vec<(&'static str, f64)>) -> TimeLeft {
        TimeLeft { stages, done: [0.0; 2] }
    }

    /// Notes that stage `name` took `seconds` for `share` of its work.
    pub(crate) fn finish(&mut self, name: &str, share: f64, seconds: f64) {
        self.done[0] += seconds;
        self.done[1] += self.expected(name).0 * share;
    }

    /// Returns the seconds left until the last stage ends. Stage `name` has taken `seconds` from share `from` of its work to share `to`.
    pub(crate) fn left(&self, name: &str, from: f64, to: f64, seconds: f64) -> f64 {
        let (now, later) = self.expected(name);
        let [spent, expected] = self.done;
        let share = (to - from).max(1e-9);
        let whole = if expected > 0.0 {
            (seconds + EXPECTATION_WEIGHT * now * spent / expected) / (share + EXPECTATION_WEIGHT)
        } else {
            seconds / share
        };
        let pace = (spent + seconds) / (expected + now * seconds / whole.max(1e-9)).max(1e-9);
        whole * (1.0 - to) + pace * later
    }

    /// Returns the expected cost of stage `name`, and that of all stages after it.
    fn expected(&self, name: &str) -> (f64, f64) {
        match self.stages.iter().position(|stage| stage.0 == name) {
            Some(at) => (self.stages[at].1, self.stages[at + 1..].iter().map(|stage| stage.1).sum()),
            None => (0.0, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STAGES: [(&str, f64); 4] = [("read", 370.0), ("mesh", 740.0), ("levels", 900.0), ("finish", 8.0)];

    /// Goes through a job whose stages take `seconds`, and compares the estimate with the truth at every hundredth of each. Returns the
    /// worst ratio after the first tenth of the job and before its last fiftieth.
    fn worst(seconds: [f64; 4], unsteady: f64) -> f64 {
        let all: f64 = seconds.iter().sum();
        let mut estimate = TimeLeft::new(STAGES.to_vec());
        let (mut before, mut worst) = (0.0, 1.0f64);
        for ((name, _), stage) in STAGES.iter().zip(seconds) {
            for percent in 1..100 {
                let share = percent as f64 / 100.0;
                // The pace within a stage varies around its mean.
                let time = stage * (share + unsteady * (share * 40.0).sin() / 40.0);
                let left = all - before - time;
                if before + time > 0.1 * all && left > 0.02 * all {
                    let ratio = estimate.left(name, 0.0, share, time) / left;
                    worst = worst.max(ratio).max(1.0 / ratio);
                }
            }
            estimate.finish(name, 1.0, stage);
            before += stage;
        }
        worst
    }

    proptest! {
        /// The machine has any speed, and each stage costs up to 1.35 times more or less than usual.
        #[test]
        fn after_a_tenth_of_a_job_the_estimate_is_within_a_factor_of_two(
            speed in 1e-12f64..1e3,
            odd in prop::array::uniform4(-1.0f64..1.0),
            unsteady in 0.0f64..0.5,
        ) {
            let seconds = [0, 1, 2, 3].map(|stage| speed * STAGES[stage].1 * 1.35f64.powf(odd[stage]));
            prop_assert!(worst(seconds, unsteady) < 2.0);
        }
    }

    #[test]
    fn work_of_an_earlier_run_does_not_count_as_speed() {
        let estimate = TimeLeft::new(vec![("read", 1.0), ("write", 1.0)]);
        // An earlier run did half; this one took ten seconds for a quarter.
        let left = estimate.left("read", 0.5, 0.75, 10.0);
        assert!((left - 50.0).abs() < 1.0, "{left}");
        assert_eq!(TimeLeft::default().left("anything", 0.0, 0.5, 10.0), 10.0);
    }
}
