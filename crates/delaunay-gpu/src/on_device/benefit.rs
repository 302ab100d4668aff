//! Whether a GPU that a job may use, but need not, makes its leaves cheaper: the processor time a site with its help, and without.

use crate::figures::GpuFigures;
use delaunay::voronoi::mesh_reply::MeshReply;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// So many leaves of either kind are measured before the first verdict.
const TRIAL: u64 = 6;
/// A GPU stays if its leaves take at most this share of the processor time of the others. Less would be lost in the noise.
const WORTHWHILE: f64 = 0.97;
/// The means count this many leaves in full, and older ones less: terrain changes on the way.
const MEMORY: u64 = 64;

/// The processor time of leaves of one kind.
#[derive(Clone, Copy, Debug, Default)]
struct LeafCosts {
    /// All leaves of this kind.
    leaves: u64,
    /// The leaves that the means count, their sites and their nanoseconds.
    counted: u64,
    sites: f64,
    nanoseconds: f64,
}

impl LeafCosts {
    fn add(&mut self, sites: usize, seconds: f64) {
        if self.counted == MEMORY {
            (self.counted, self.sites, self.nanoseconds) = (MEMORY / 2, self.sites / 2.0, self.nanoseconds / 2.0);
        }
        self.leaves += 1;
        self.counted += 1;
        self.sites += sites as f64;
        self.nanoseconds += seconds * 1e9;
    }

    fn per_site(&self) -> f64 {
        self.nanoseconds / self.sites
    }
}

#[derive(Debug, Default)]
struct Measured {
    helped: LeafCosts,
    alone: LeafCosts,
    /// Leaves for which help has been asked.
    asked: u64,
    /// Leaves for which help has been asked, and nothing came that could be used.
    in_vain: u64,
    /// Those of them that the GPU gave up itself.
    flagged: u64,
    /// Those of them whose mesh did not suit.
    rejected: u64,
    given_up: Option<String>,
}

impl Measured {
    fn is_on_trial(&self) -> bool {
        self.helped.leaves.min(self.alone.leaves) < TRIAL
    }

    fn judge(&mut self) {
        let [helped, alone] = [self.helped, self.alone].map(|costs| costs.per_site());
        // Where the system does not tell processor times, this is false.
        let is_worthwhile = helped <= WORTHWHILE * alone;
        if !self.is_on_trial() && !is_worthwhile {
            self.give_up(&format!("a site takes {helped:.0} ns of a processor with its help, and {alone:.0} without"));
        }
    }

    fn give_up(&mut self, why: &str) {
        self.given_up.get_or_insert_with(|| why.to_owned());
    }
}

/// What is known of a GPU's benefit so far. All workers share it.
#[derive(Debug)]
pub(crate) struct GpuBenefit {
    measured: Mutex<Measured>,
    /// Whether the job needs the GPU, so that it is never given up.
    is_required: bool,
}

impl GpuBenefit {
    /// Returns what is known at first.
    pub(crate) fn new(is_required: bool) -> GpuBenefit {
        GpuBenefit { measured: Mutex::default(), is_required }
    }

    /// Tells whether to ask for help with the next leaf. During the trial as many leaves are done alone.
    pub(crate) fn is_worth_asking(&self) -> bool {
        if self.is_required {
            return true;
        }
        let mut measured = self.measured();
        let worth = measured.given_up.is_none() && (!measured.is_on_trial() || measured.asked <= measured.alone.leaves);
        measured.asked += u64::from(worth);
        worth
    }

    /// Notes that a leaf of `sites` sites took `seconds` of processor time, with help or alone.
    pub(crate) fn note(&self, is_helped: bool, sites: usize, seconds: f64) {
        let mut measured = self.measured();
        let costs = if is_helped { &mut measured.helped } else { &mut measured.alone };
        costs.add(sites, seconds);
        if !self.is_required {
            measured.judge();
        }
    }

    /// Notes that help was asked for a leaf, and that `reply` could not be used.
    pub(crate) fn note_in_vain(&self, reply: &MeshReply) {
        let mut measured = self.measured();
        measured.in_vain += 1;
        measured.flagged += u64::from(matches!(reply, MeshReply::Flagged));
        measured.rejected += u64::from(matches!(reply, MeshReply::Made(_)));
        if !self.is_required && measured.in_vain >= TRIAL.max(measured.helped.leaves) {
            measured.give_up("most of what it was asked for was late or wrong");
        }
    }

    /// Asks for no help any more.
    pub(crate) fn give_up(&self, why: &str) {
        self.measured().give_up(why);
    }

    /// Returns the seconds that a worker takes for `sites` sites alone, as far as that is known.
    pub(crate) fn seconds_alone(&self, sites: usize) -> Option<f64> {
        let alone = self.measured().alone;
        (alone.leaves > 0).then(|| alone.per_site() * sites as f64 / 1e9).filter(|seconds| seconds.is_finite())
    }

    /// Returns the figures for the report.
    pub(crate) fn figures(&self) -> GpuFigures {
        let measured = self.measured();
        let per_site = |costs: LeafCosts| if costs.leaves > 0 { costs.per_site() } else { 0.0 };
        GpuFigures {
            helped: measured.helped.leaves,
            alone: measured.alone.leaves,
            in_vain: measured.in_vain,
            flagged: measured.flagged,
            rejected: measured.rejected,
            ns_per_site_helped: per_site(measured.helped),
            ns_per_site_alone: per_site(measured.alone),
            given_up: measured.given_up.clone(),
        }
    }

    fn measured(&self) -> MutexGuard<'_, Measured> {
        self.measured.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does `leaves` leaves of 1000 sites that take so many nanoseconds a site; returns how many had help.
    fn run(benefit: &GpuBenefit, leaves: usize, helped_ns: f64, alone_ns: f64) -> u64 {
        let mut asked = 0;
        for _ in 0..leaves {
            let is_helped = benefit.is_worth_asking();
            asked += u64::from(is_helped);
            benefit.note(is_helped, 1000, if is_helped { helped_ns } else { alone_ns } * 1000.0 / 1e9);
        }
        asked
    }

    #[test]
    fn a_gpu_that_saves_processor_time_helps_with_all_leaves_after_the_trial() {
        let benefit = GpuBenefit::new(false);
        assert_eq!(run(&benefit, 12, 40.0, 130.0), TRIAL);
        assert_eq!(run(&benefit, 100, 40.0, 130.0), 100);
        let figures = benefit.figures();
        assert_eq!((figures.helped, figures.alone, figures.given_up), (100 + TRIAL, TRIAL, None));
        assert!((figures.ns_per_site_helped - 40.0).abs() < 1e-6, "{}", figures.ns_per_site_helped);
    }

    #[test]
    fn a_gpu_that_costs_more_than_it_saves_is_given_up_after_the_trial() {
        for helped_ns in [129.0, 130.0, 1300.0, f64::NAN] {
            let benefit = GpuBenefit::new(false);
            assert_eq!(run(&benefit, 1000, helped_ns, 130.0), TRIAL, "{helped_ns}");
            assert!(benefit.figures().given_up.is_some_and(|why| why.contains("130 without")), "{helped_ns}");
        }
    }

    #[test]
    fn a_gpu_that_becomes_slow_is_given_up_later() {
        let benefit = GpuBenefit::new(false);
        run(&benefit, 500, 40.0, 130.0);
        let asked = run(&benefit, 1000, 1300.0, 130.0);
        assert!(asked <= MEMORY, "{asked}");
    }

    #[test]
    fn a_gpu_that_is_asked_in_vain_is_given_up() {
        let benefit = GpuBenefit::new(false);
        run(&benefit, 100, 40.0, 130.0);
        let helped = benefit.figures().helped;
        for asked in 1..=helped {
            assert!(benefit.is_worth_asking(), "{asked}");
            let reply = if asked.is_multiple_of(3) { MeshReply::Flagged } else { MeshReply::Unavailable };
            benefit.note_in_vain(&reply);
        }
        assert!(!benefit.is_worth_asking());
        let GpuFigures { in_vain, flagged, rejected, .. } = benefit.figures();
        assert_eq!([in_vain, flagged, rejected], [helped, helped / 3, 0]);
    }

    #[test]
    fn a_gpu_that_the_job_needs_is_never_given_up() {
        let benefit = GpuBenefit::new(true);
        assert_eq!(run(&benefit, 100, 1300.0, 130.0), 100);
        assert_eq!(benefit.figures().given_up, None);
    }

    #[test]
    fn workers_know_what_a_leaf_takes_alone() {
        let benefit = GpuBenefit::new(false);
        assert_eq!(benefit.seconds_alone(1000), None);
        benefit.note(false, 1000, 0.5);
        assert_eq!(benefit.seconds_alone(2000), Some(1.0));
        benefit.give_up("it is gone");
        benefit.give_up("later");
        assert_eq!(benefit.figures().given_up.as_deref(), Some("it is gone"));
        assert!(!benefit.is_worth_asking());
    }
}
