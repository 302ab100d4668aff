//! Samples of a cloud, each a part of the next.

use crate::error_bound::{ErrorBound, RoundBound};

/// Which samples the rounds go over before all points, and how strictly they select.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Samples {
    /// None, and no exception for far points: it takes more rounds and selects fewer points.
    Unneeded,
    /// Small ones first, each a part of the next.
    Growing,
    /// None: points have been selected from the regions of the cloud already.
    AfterRegions,
}

impl Samples {
    /// Returns the samples from the smallest on to all points, on a lattice with this offset.
    pub(crate) fn ladder(self, offset: [i64; 2]) -> impl Iterator<Item = Sample> {
        let steps = if self == Samples::Growing { Sample::FIRST / Sample::STEP } else { 0 };
        (0..=steps).rev().map(move |step| Sample { halvings: step * Sample::STEP, offset })
    }

    /// Returns the bound for rounds that go over these samples.
    pub(crate) fn bound(self, bound: RoundBound) -> RoundBound {
        if self == Samples::Unneeded { bound.without_exception() } else { bound }
    }
}

/// Some of the points of a cloud: one of so many, chosen by a hash of the place.
///
/// Rounds go over a small sample first. What that has selected is where the rounds over a greater one begin, so that most points are looked at in
/// few rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sample {
    /// It has one of two to the power of so many points.
    halvings: u32,
    /// The steps in x and y from zero of the source coordinates to zero of the lattice.
    offset: [i64; 2],
}

impl Sample {
    /// The first sample has one of two to the power of so many points.
    const FIRST: u32 = 4;
    /// A sample has one of two to the power of so many points of the next.
    const STEP: u32 = 2;

    /// Tells whether it has all points.
    pub(crate) fn is_all(self) -> bool {
        self.halvings == 0
    }

    /// Returns all points, on a lattice with this offset.
    pub(crate) fn all(offset: [i64; 2]) -> Sample {
        Sample { halvings: 0, offset }
    }

    /// Returns the bound for rounds over the sample of a cloud that has `points` points on an `area` in square lattice steps.
    ///
    /// For most triangles it is four times the bound of all points. If it were that, some percent of the vertices would be superfluous in the end:
    /// among all points there are worse ones. But large triangles have enough points of the sample, at least sixteen of the largest one and
    /// thirty-two of the one before it, and it is in them that points are placed most often. Those sixteen times as large are few, and each
    /// of their vertices matters.
    pub(crate) fn bound(self, bound: ErrorBound, points: u64, area: f64) -> RoundBound {
        if self.is_all() {
            return RoundBound::everywhere(bound);
        }
        let points_of_large = 8u64 << (3 * self.halvings / 2);
        let large = points_of_large as f64 * (area / points.max(1) as f64);
        RoundBound::everywhere(bound.times(4)).but(bound, large..16.0 * large)
    }

    /// Tells whether it has a point.
    #[inline]
    pub(crate) fn has(self, [x, y, _]: [i32; 3]) -> bool {
        if self.is_all() {
            return true;
        }
        // All points of a sample are in greater ones, since these ask for fewer of the same bits.
        let along = |value: i32, axis: usize| (i64::from(value) + self.offset[axis]) as u64;
        let mut hash =
            along(x, 0).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ along(y, 1).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
        hash = (hash ^ hash >> 32).wrapping_mul(0xFF51_AFD7_ED55_8CCD);
        hash.leading_zeros() >= self.halvings
    }
}

/// Returns the distance above which all points of a sample are selected at once. A quarter of the sample is within four times the bound of the
/// mesh by then, so where another point is so far away, the ground is rough, and nearly all points are needed.
pub(crate) fn very_far_above(bound: ErrorBound) -> ErrorBound {
    bound.times(16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error_bound::VerticalError;

    #[test]
    fn a_sample_is_a_part_of_the_next_wherever_the_lattice_begins() {
        let points: Vec<[i32; 3]> = (0..40_000).map(|i| [i % 200 * 50, i / 200 * 50, 0]).collect();
        let of = |sample: Sample, moved: i32| -> Vec<usize> {
            (0..points.len()).filter(|&i| sample.has([points[i][0] - moved, points[i][1], 0])).collect()
        };
        let samples: Vec<Vec<usize>> = Samples::Growing.ladder([0; 2]).map(|sample| of(sample, 0)).collect();
        let share = |sample: &Vec<usize>| sample.len() as f64 / points.len() as f64;
        for (pair, wanted) in samples.windows(2).zip([1.0 / 16.0, 1.0 / 4.0]) {
            assert!(pair[0].iter().all(|i| pair[1].binary_search(i).is_ok()));
            assert!((share(&pair[0]) / wanted - 1.0).abs() < 0.1, "{}", share(&pair[0]));
        }
        assert_eq!(samples.last().map(Vec::len), Some(points.len()));
        let moved: Vec<Vec<usize>> = Samples::Growing.ladder([777, 0]).map(|sample| of(sample, 777)).collect();
        assert_eq!(moved, samples);
    }

    #[test]
    fn large_triangles_have_the_bound_of_all_points_in_samples() {
        let bound = ErrorBound::new(10, 1);
        // Beyond the bound, but not beyond four times it. Each point has 10 square steps; 64 points take twice the area of 1280.
        let exceeds = |sample: Sample, area: u64| {
            let error = VerticalError { numerator: 20 * u128::from(area), area };
            sample.bound(bound, 1000, 10_000.0).excess(error) > 0
        };
        let [first, last, all] = Samples::Growing.ladder([0; 2]).collect::<Vec<_>>().try_into().unwrap();
        let areas = [1279, 1280, 20_479, 20_480];
        assert_eq!(areas.map(|area| exceeds(last, area)), [false, true, true, false]);
        assert_eq!(areas.map(|area| exceeds(first, 8 * area)), [false, true, true, false]);
        assert!(areas.iter().all(|&area| exceeds(all, area)));
    }
}
