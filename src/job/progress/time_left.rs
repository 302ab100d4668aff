//! How long a job will take: from the pace of the stage that runs, and for the stages to come from what they usually cost beside
//! those that are done.

use crate::input::FileFormat;
use crate::job::plan::scan::Plan;
use std::time::Duration;

/// What the stages after the first cost on autzen.laz (see BENCHMARKS.md), in nanoseconds of one processor a point. Only their
/// ratios matter.
const MESH: f64 = 740.0;
const LEVELS: f64 = 900.0;
const FINISH: f64 = 8.0;

fn cost_of_reading(format: FileFormat) -> f64 {
    match format {
        FileFormat::Las => 130.0,
        FileFormat::Laz => 370.0,
        FileFormat::Text => 250.0,
    }
}

/// The stages of the job of `plan` in order, by name, with what each is expected to cost.
pub(crate) fn costs(plan: &Plan) -> Vec<(&'static str, f64)> {
    let reading = plan.sources.iter().map(|(source, _)| source.records as f64 * cost_of_reading(source.format)).sum();
    let points = plan.records as f64;
    vec![("read", reading), ("mesh", points * MESH), ("levels", points * LEVELS), ("finish", points * FINISH)]
}

/// How much of the stage "mesh" is done of a tile of so many points when it is triangulated but not written.
pub(crate) fn triangulated(points: u64) -> u64 {
    points * 3 / 5
}

/// How much of a stage what was expected of it counts as: soon what is measured outweighs it.
const DOUBT: f64 = 0.03;

/// What is expected of the stages, and what those that are done took.
#[derive(Clone, Debug, Default)]
pub(crate) struct Forecast {
    stages: Vec<(&'static str, f64)>,
    /// Seconds of the stages that are done, and what was expected of them.
    done: [f64; 2],
}

impl Forecast {
    /// For stages as [`costs`] gives them.
    pub(crate) fn new(stages: Vec<(&'static str, f64)>) -> Forecast {
        Forecast { stages, done: [0.0; 2] }
    }

    /// Takes note that stage `name` took so many seconds for `share` of what there was to do in it.
    pub(crate) fn finish(&mut self, name: &str, share: f64, seconds: f64) {
        self.done[0] += seconds;
        self.done[1] += self.expected(name).0 * share;
    }

    /// Seconds left to the end of the last stage, when stage `name` has in so many seconds come from share `from` to share `to`.
    pub(crate) fn left(&self, name: &str, from: f64, to: f64, seconds: f64) -> f64 {
        let (now, later) = self.expected(name);
        let [spent, expected] = self.done;
        let share = (to - from).max(1e-9);
        let whole =
            if expected > 0.0 { (seconds + DOUBT * now * spent / expected) / (share + DOUBT) } else { seconds / share };
        let pace = (spent + seconds) / (expected + now * seconds / whole.max(1e-9)).max(1e-9);
        whole * (1.0 - to) + pace * later
    }

    /// What is expected of stage `name` and of all after it.
    fn expected(&self, name: &str) -> (f64, f64) {
        match self.stages.iter().position(|stage| stage.0 == name) {
            Some(at) => (self.stages[at].1, self.stages[at + 1..].iter().map(|stage| stage.1).sum()),
            None => (0.0, 0.0),
        }
    }
}

/// A time to come, no more exact than it is.
pub(crate) fn rough(seconds: f64) -> String {
    // Whatever the estimate, it is a time.
    let seconds = Duration::try_from_secs_f64(seconds).map_or(u64::MAX, |time| time.as_secs());
    match seconds {
        0..=90 => format!("{seconds} s"),
        91..=5400 => format!("{} min", (seconds + 30) / 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STAGES: [(&str, f64); 4] = [("read", 370.0), ("mesh", 740.0), ("levels", 900.0), ("finish", 8.0)];

    /// Goes through a job whose stages take `seconds`, and compares at every hundredth of each what is left with the estimate;
    /// the worst ratio after the first tenth of the job, where more than a fiftieth of it is left.
    fn worst(seconds: [f64; 4], unsteady: f64) -> f64 {
        let all: f64 = seconds.iter().sum();
        let mut forecast = Forecast::new(STAGES.to_vec());
        let (mut before, mut worst) = (0.0, 1.0f64);
        for ((name, _), stage) in STAGES.iter().zip(seconds) {
            for percent in 1..100 {
                let share = percent as f64 / 100.0;
                // The pace within a stage swings about its mean.
                let time = stage * (share + unsteady * (share * 40.0).sin() / 40.0);
                let left = all - before - time;
                if before + time > 0.1 * all && left > 0.02 * all {
                    let ratio = forecast.left(name, 0.0, share, time) / left;
                    worst = worst.max(ratio).max(1.0 / ratio);
                }
            }
            forecast.finish(name, 1.0, stage);
            before += stage;
        }
        worst
    }

    proptest! {
        /// On a machine of any speed, where each stage costs up to 1.35 times more or less than usual.
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
    fn what_an_earlier_run_has_done_is_not_taken_for_speed() {
        let forecast = Forecast::new(vec![("read", 1.0), ("write", 1.0)]);
        // Half was there; ten seconds for a quarter.
        let left = forecast.left("read", 0.5, 0.75, 10.0);
        assert!((left - 50.0).abs() < 1.0, "{left}");
        assert_eq!(Forecast::default().left("anything", 0.0, 0.5, 10.0), 10.0);
    }

    #[test]
    fn times_are_rough() {
        assert_eq!([0.4, 59.7, 600.0, 9000.0].map(rough), ["0 s", "59 s", "10 min", "2 h 30 min"]);
        assert_eq!([f64::NAN, -1.0, f64::INFINITY].map(|odd| rough(odd).is_empty()), [false; 3]);
    }
}
