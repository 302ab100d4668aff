//! Heights that stand for "nothing measured" (nodata), such as -9999 in a grid that was written as points. They are told from heights by
//! their number, and by their distance from all heights.

use crate::points::extremes::{Extremes, Lowest, SharedHeight};
use crate::points::nodata_number::{NO_HEIGHT, is_number_in_steps, is_usual_number, stands_for_nodata_alone};

/// The fewest units between a number that stands for nodata and the nearest height.
const FAR: f64 = 100.0;

/// The fewest metres between any other value that may stand for nodata and the nearest height, at the foot of all heights. The sea lies at the
/// foot of cliffs, and a lake in a quarry.
const DOUBTFUL_LOW: f64 = 100.0;

/// The same at the top, where buildings stand out.
const DOUBTFUL_HIGH: f64 = 500.0;

/// Fewer metres below all others such a value is less doubtful: harbours and lakes have an even surface. It lies at least so many metres below,
const LEAST_GAP: f64 = 5.0;

/// and so many times as far as all others spread.
const TIMES_RANGE: f64 = 8.0;

/// A value that so many records share may stand for nodata nearer to the others.
const LEAST_RECORDS: u64 = 5;

/// It is a usual number for nodata at least so many metres from the nearest other height, since the shore of water lies closer to it, and so many
/// times as far as all others spread,
const USUAL_GAP: f64 = 10.0;
const TIMES_OF_USUAL: f64 = 1.0 / 3.0;

/// or at least so many metres, and so many times as far as the nearest others spread. All others may spread far in mountains.
const EMPTY_GAP: f64 = 25.0;
const TIMES_OF_NEAREST: f64 = 4.0;

/// Either is so many times as wide as the least distance of the nearest others: heights may be rounded to whole metres, or be those of contours.
const STEPS: f64 = 4.0;

/// A small share of all records, one in so many, may have any number so far above all others: a tower may stand out of them. Below, a quarry
/// may lie.
const SHARE: u64 = 10;
const TOWER: f64 = 150.0;
const TIMES_OF_TOWER: f64 = 2.0;

/// Heights within so many units of a value are next to it, unless their own range is smaller.
const NEXT: f64 = 5.0;

/// Such a value is so many times as far from the nearest height as the heights there lie apart: a shore would join it to them.
const ALONE: f64 = 10.0;

/// A value that fewer records have, at the foot of all heights and at their top, may be a mistake of each, and no mark. Roofs and masts stand
/// out, and nothing lies that far below.
const FEW: [u64; 2] = [3, 5];

/// Heights of fewer values do not vary, so the distance of another one from them shows nothing.
const LEAST_VALUES: usize = 5;

/// So many records beside a value, below it and above, may be noise that joins it to nothing.
const STRAYS: u64 = 2;

/// What is among so many records is no noise, but a shore, if fewer than this many times as many share the value.
const TIMES_STRAYS: u64 = 10;

impl SharedHeight {
    /// Returns whether few of all `records` have this value, and it lies at least `least` below `others`, much farther than these lie from each
    /// other.
    fn is_set_apart(&self, records: u64, [low, high]: [f64; 2], least: f64) -> bool {
        let is_small_share = self.count >= LEAST_RECORDS && self.count.saturating_mul(SHARE) < records;
        is_small_share && low - self.value >= least.max(TIMES_OF_TOWER * (high - low))
    }

    /// Returns whether records share this value, and a gap parts it from all `others`, of which `nearest` are the lowest. A unit of heights is
    /// so many `metres`.
    fn is_across_gap(&self, nearest: &[SharedHeight], [low, high]: [f64; 2], metres: f64) -> bool {
        let gap = low - self.value;
        let spread = nearest.last().map_or(0.0, |last| last.value - low);
        let steps = nearest.windows(2).map(|pair| pair[1].value - pair[0].value);
        let is_wide = |least: f64, times: f64, range: f64| gap * metres >= least && gap >= times * range;
        self.count >= LEAST_RECORDS
            && gap >= STEPS * steps.fold(f64::INFINITY, f64::min)
            && (is_wide(USUAL_GAP, TIMES_OF_USUAL, high - low) || is_wide(EMPTY_GAP, TIMES_OF_NEAREST, spread))
    }
}

/// A value that may stand for nodata, though it is none of the numbers that programs write for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuspectHeight {
    /// The value, and who has it.
    pub height: SharedHeight,
    /// Where all other heights lie.
    pub others: [f64; 2],
}

impl SuspectHeight {
    fn with_other_sign(self) -> SuspectHeight {
        let [low, high] = self.others;
        let height = SharedHeight { value: 0.0 - self.height.value, ..self.height };
        SuspectHeight { height, others: [0.0 - high, 0.0 - low] }
    }
}

/// Which heights stand for nodata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FoundNodata {
    pub heights: Vec<SharedHeight>,
    /// Where all other heights lie; `None` if there is none.
    pub(crate) others: Option<[f64; 2]>,
}

impl Extremes {
    /// Returns the heights that stand for nodata: those for which `is_number` holds, and which lie farther from all others than these
    /// from each other, or much farther than the nearest of them do.
    pub fn nodata(&self, is_number: impl Fn(f64) -> bool + Copy) -> FoundNodata {
        let high_number = |value: f64| is_number(0.0 - value);
        let Some((lowest, highest)) = self.lowest.rest(is_number).zip(self.highest.rest(high_number)) else {
            return self.nodata_alone(is_number);
        };
        let is_alone = |value: f64| is_apart_from(&lowest, value, FAR) || is_apart_from(&highest, 0.0 - value, FAR);
        let (low, high) = (lowest[0].value, highest[0].value);
        let mut others = [low, 0.0 - high];
        let restored = self.highest.0.iter().map(|height| SharedHeight { value: 0.0 - height.value, ..*height });
        let is_outside = |height: &SharedHeight| height.value < low || height.value > 0.0 - high;
        let mut heights: Vec<SharedHeight> = self.lowest.0.iter().copied().chain(restored).filter(is_outside).collect();
        // A number among heights is a height, and then the next one may be among them too.
        let is_near = |value: f64, others: [f64; 2]| !is_far(value, others, FAR) && !is_alone(value);
        while let Some(near) = heights.iter().position(|height| is_near(height.value, others)) {
            let SharedHeight { value, .. } = heights.swap_remove(near);
            others = [others[0].min(value), others[1].max(value)];
        }
        heights.sort_unstable_by(|a, b| a.value.total_cmp(&b.value));
        FoundNodata { heights, others: Some(others) }
    }

    /// Returns the heights that stand for nodata where no other height is known.
    fn nodata_alone(&self, is_number: impl Fn(f64) -> bool) -> FoundNodata {
        let is_nodata = |height: &SharedHeight| is_number(height.value) && stands_for_nodata_alone(height.value);
        let (heights, others): (Vec<_>, Vec<_>) = self.lowest.0.iter().partition(|height| is_nodata(height));
        let others = others.first().map(|low: &SharedHeight| {
            let high = others.last().map_or(low.value, |high| high.value);
            [low.value, high]
        });
        FoundNodata { heights, others }
    }

    /// Returns the lowest or the highest value if several records share it, and nothing joins it to the other heights: it lies farther from
    /// them than they lie from each other, or, at their foot, much farther than the nearest of them do. It may stand for nodata, such as 0
    /// among mountains. A unit of heights is so many `metres`.
    pub fn doubtful(&self, metres: f64) -> Option<SuspectHeight> {
        let [few_low, few_high] = FEW;
        let [least_low, least_high] = [DOUBTFUL_LOW, DOUBTFUL_HIGH].map(|least| least / metres);
        let low = self.lowest.doubtful(&self.highest, few_low, |height, above, others| {
            is_apart_from(above, height.value, least_low) || is_far(height.value, others, least_low)
        });
        let high = || {
            self.highest.doubtful(&self.lowest, few_high, |height, _, others| is_far(height.value, others, least_high))
        };
        low.or_else(|| high().map(SuspectHeight::with_other_sign))
    }

    /// Returns the lowest value if several records share it, and it lies below all others by many times their range, the lowest or the highest
    /// if it is a usual number for nodata and a gap parts it from all others, or the highest that few of all `records` share, and that lies
    /// apart. Nearer than a [`Extremes::doubtful`] one, it may be water, or a roof.
    pub fn set_apart(&self, metres: f64, records: u64) -> Option<SuspectHeight> {
        let low = self.lowest.doubtful(&self.highest, FEW[0], |height, above, others| {
            let gap = others[0] - height.value;
            let is_deep = gap * metres >= LEAST_GAP && gap >= TIMES_RANGE * (others[1] - others[0]);
            is_deep || is_usual_number(height.value) && height.is_across_gap(above, others, metres)
        });
        let high = || {
            self.highest.doubtful(&self.lowest, FEW[1], |height, below, others| {
                let is_usual = is_usual_number(0.0 - height.value);
                is_usual && height.is_across_gap(below, others, metres)
                    || height.is_set_apart(records, others, TOWER / metres)
            })
        };
        low.or_else(|| high().map(SuspectHeight::with_other_sign))
    }

    /// Returns warnings about the heights of records that the user takes for nodata, and that other heights of the file are next to.
    pub(crate) fn next_to(&self, others: &Extremes, record: &str) -> Vec<String> {
        let (Some(low), Some(high)) = (others.lowest.0.first(), others.highest.0.first()) else { return Vec::new() };
        let range = [low.value, 0.0 - high.value];
        let is_next = |value: f64| {
            let is_apart = is_apart_from(&others.lowest.0, value, NEXT);
            !is_apart && !is_apart_from(&others.highest.0, 0.0 - value, NEXT) && !is_far(value, range, 0.0)
        };
        self.lowest
            .0
            .iter()
            .filter(|height| is_next(height.value))
            .map(|height| real_nodata(height, range, record))
            .collect()
    }
}

impl Lowest {
    /// Returns the first value that `few` records share, apart from a few strays below, if it is apart from those above it and from `others`,
    /// the range of these. `top` has the greatest values with the other sign.
    fn doubtful(
        &self,
        top: &Lowest,
        few: u64,
        is_apart: impl Fn(&SharedHeight, &[SharedHeight], [f64; 2]) -> bool,
    ) -> Option<SuspectHeight> {
        let greatest = 0.0 - top.0.first()?.value;
        let is_shared = |(at, height): &(usize, &SharedHeight)| {
            let strays = records(&self.0[..*at]);
            strays <= STRAYS && height.count >= few.max(TIMES_STRAYS * strays)
        };
        let (at, height) = self.0.iter().enumerate().find(is_shared)?;
        let above = &self.0[at + 1..];
        let others = [above.first()?.value, greatest];
        let is_doubtful = above.len() >= LEAST_VALUES && is_apart(height, above, others);
        is_doubtful.then_some(SuspectHeight { height: *height, others })
    }
}

/// Returns the number of records that have these heights.
fn records(heights: &[SharedHeight]) -> u64 {
    heights.iter().map(|height| height.count).sum()
}

/// Returns whether `value` lies at least so far below the lowest `heights`, which are ascending, and much farther than these lie from each
/// other. A few strays may lie between.
fn is_apart_from(heights: &[SharedHeight], value: f64, least: f64) -> bool {
    (0..heights.len()).take_while(|&strays| records(&heights[..strays]) <= STRAYS).any(|strays| {
        let body = &heights[strays..];
        let is_enough = strays == 0 || body.len() >= LEAST_VALUES;
        match (body.first(), body.last()) {
            (Some(first), Some(last)) if is_enough => {
                first.value - value > least.max(ALONE * (last.value - first.value))
            }
            _ => false,
        }
    })
}

/// Returns whether `value` lies farther from all of `others` than these from each other, and at least so far.
pub(crate) fn is_far(value: f64, [low, high]: [f64; 2], least: f64) -> bool {
    (low - value).max(value - high) > (high - low).max(least)
}

/// Returns whether `value` is a number for nodata and lies far from all of `others`.
pub fn is_nodata_beside(value: f64, step: f64, others: [f64; 2]) -> bool {
    is_number_in_steps(value, step) && is_far(value, others, FAR)
}

/// Returns a height as people write it.
pub fn shown_height(value: f64) -> String {
    if value.abs() >= NO_HEIGHT { format!("{value:e}") } else { value.to_string() }
}

/// Returns how many records have a height, and which is the first of them.
pub fn who_has(SharedHeight { value, count, first }: &SharedHeight, record: &str) -> String {
    let height = shown_height(*value);
    match count {
        1 => format!("{record} {first} has the height {height}"),
        _ => format!("{count} {record}s have the height {height} (the first is {record} {first})"),
    }
}

fn real_nodata(height: &SharedHeight, [low, high]: [f64; 2], record: &str) -> String {
    format!(
        "{}, which [input] nodata leaves out, though they may be real, like the sea: the other heights lie from {low} to {high}; fix: \
         if they are real, set [input] nodata = \"none\"",
        who_has(height, record)
    )
}

/// Returns a warning about a height that stands for nodata. Records of the file are called `record`.
pub(crate) fn left_out(height: &SharedHeight, record: &str) -> String {
    // Nothing keeps a height that no lattice holds.
    let remedy = if height.value.abs() < NO_HEIGHT { "; fix: [input] nodata = \"none\" keeps them" } else { "" };
    format!("{}, far from all others: treated as nodata and left out{remedy}", who_has(height, record))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::nodata_number::is_nodata_number;

    fn extremes(heights: impl IntoIterator<Item = f64>) -> Extremes {
        let mut extremes = Extremes::default();
        (0..).zip(heights).for_each(|(number, height)| extremes.see(height, number));
        extremes
    }

    fn nodata(heights: impl IntoIterator<Item = f64>) -> Vec<f64> {
        extremes(heights).nodata(is_nodata_number).heights.iter().map(|height| height.value).collect()
    }

    #[test]
    fn numbers_far_from_all_heights_stand_for_nodata() {
        let hills = || (0..500).map(|i| 100.0 + f64::from(i % 97));
        assert_eq!(nodata(hills().chain([-9999.0])), [-9999.0]);
        assert_eq!(
            nodata([-9999.0, 9999.0, -32768.0, 1e30].into_iter().chain(hills())),
            [-32768.0, -9999.0, 9999.0, 1e30]
        );
        assert_eq!(nodata(hills()), [0.0; 0]);
        // Among heights in millimetres it is one.
        assert_eq!(nodata((0..500).map(|i| -12_000.0 + 30.0 * f64::from(i)).chain([-9999.0])), [0.0; 0]);
        assert_eq!(nodata((0..500).map(|i| -9990.0 + 30.0 * f64::from(i)).chain([-9999.0])), [0.0; 0]);
        // A floor at 999 that nothing else is as far from as it is high.
        assert_eq!(nodata((0..500).map(|i| 300.0 + 2.0 * f64::from(i)).chain([-999.0])), [-999.0]);
        // In high mountains it is not, but nothing joins it to the lowest of them.
        assert_eq!(nodata((0..900).map(|i| 300.0 + 2.0 * f64::from(i)).chain([-999.0])), [-999.0]);
        assert_eq!(
            nodata((0..900).map(|i| 300.0 + 2.0 * f64::from(i)).chain([-999.0, 40.0, -300.0, -310.0])),
            [0.0; 0]
        );
        assert_eq!(nodata([-9999.0; 7]), [-9999.0]);
        assert_eq!(nodata([9999.0; 7]), [0.0; 0]);
        let found = extremes(hills().chain([-9999.0, -9999.0])).nodata(is_nodata_number);
        assert_eq!(found.heights, [SharedHeight { value: -9999.0, count: 2, first: 500 }]);
        assert_eq!(found.others, Some([100.0, 196.0]));
    }

    #[test]
    fn a_value_that_several_records_share_far_from_all_heights_is_doubtful() {
        let peaks = || (0..500).map(|i| 1500.0 + f64::from(i % 97));
        let zeros = |count: usize| std::iter::repeat_n(0.0, count);
        let doubt = extremes(zeros(7).chain(peaks())).doubtful(1.0).unwrap();
        assert_eq!((doubt.height.value, doubt.height.count, doubt.others), (0.0, 7, [1500.0, 1596.0]));
        let doubt = extremes(peaks().chain([5000.0; 9])).doubtful(1.0).unwrap();
        assert_eq!((doubt.height.value, doubt.height.first), (5000.0, 500));
        let alps = || (0..5000).map(|i| 800.0 + 0.5 * f64::from(i));
        assert_eq!(extremes(zeros(5).chain(alps())).doubtful(1.0).map(|doubt| doubt.others), Some([800.0, 3299.5]));
        assert_eq!(extremes(zeros(3).chain(peaks())).doubtful(1.0).map(|doubt| doubt.height.count), Some(3));
        assert_eq!(extremes(zeros(2).chain(peaks())).doubtful(1.0), None);
        // Strays below and between join it to nothing.
        for strays in [[-40.0, 450.0], [-40.0, -300.0], [450.0, 780.0]] {
            let doubt = extremes(zeros(100).chain(alps()).chain(strays)).doubtful(1.0);
            assert_eq!(doubt.map(|doubt| doubt.height.value), Some(0.0), "{strays:?}");
        }
        assert_eq!(nodata([-9999.0; 50].into_iter().chain(alps()).chain([-6000.0, -5000.0])), [-9999.0]);
        // The sea, and a lake with a shore.
        assert_eq!(extremes(zeros(200).chain((0..400).map(f64::from))).doubtful(1.0), None);
        assert_eq!(extremes(zeros(200).chain(peaks()).chain([700.0, 750.0, 800.0])).doubtful(1.0), None);
        assert_eq!(extremes(zeros(200).chain(alps()).chain([1.0, 30.0, 40.0])).doubtful(1.0), None);
        // The sea at the foot of a cliff, and a tower in a plain.
        assert_eq!(extremes(zeros(200).chain((0..400).map(|i| 60.0 + f64::from(i) / 50.0))).doubtful(1.0), None);
        assert_eq!(extremes((0..400).map(|i| f64::from(i) / 50.0).chain([140.0; 9])).doubtful(1.0), None);
        // A platform and what stands on it.
        assert_eq!(extremes(zeros(200).chain([100.0, 100.0, 100.5])).doubtful(1.0), None);
    }

    #[test]
    fn a_value_many_times_as_far_below_all_heights_as_they_spread_is_set_apart() {
        let plain = |zeros: usize, from: f64, range: f64| {
            let others = (0..500).map(move |i| from + range * f64::from(i % 97) / 96.0);
            extremes(std::iter::repeat_n(0.0, zeros).chain(others))
        };
        let value = |found: Option<SuspectHeight>| found.map(|doubt| doubt.height.value);
        assert_eq!(
            (value(plain(5, 85.0, 10.0).set_apart(1.0, 1_000)), plain(5, 85.0, 10.0).doubtful(1.0)),
            (Some(0.0), None)
        );
        assert_eq!(value(plain(5, 60.0, 2.0).set_apart(1.0, 1_000)), Some(0.0));
        assert_eq!(value(plain(2, 60.0, 2.0).set_apart(1.0, 1_000)), None);
        assert_eq!(value(plain(50, 4.0, 0.4).set_apart(1.0, 1_000)), None);
        // The same in millimetres, and in feet.
        assert_eq!(value(plain(6, 500.0, 60.0).set_apart(0.001, 1_000)), None);
        assert_eq!(value(plain(6, 500.0, 60.0).doubtful(0.001)), None);
        assert_eq!(value(plain(6, 500.0, 60.0).doubtful(0.3048)), Some(0.0));
        assert_eq!(value(plain(6, 300.0, 60.0).doubtful(0.3048)), None);
    }

    #[test]
    fn a_usual_number_across_a_gap_and_a_value_of_few_records_far_above_are_set_apart() {
        let hills = |mark: f64, count: usize, from: f64, range: f64| {
            let others = (0..900).map(move |i| from + range * f64::from(i % 97) / 96.0);
            let found = extremes(std::iter::repeat_n(mark, count).chain(others)).set_apart(1.0, 1_000);
            found.map(|doubt| (doubt.height.value, doubt.others))
        };
        assert_eq!(hills(0.0, 60, 28.0, 42.0), Some((0.0, [28.0, 70.0])));
        assert_eq!(hills(255.0, 60, 17.0, 32.0), Some((255.0, [17.0, 49.0])));
        assert_eq!(hills(400.0, 60, 17.0, 32.0), Some((400.0, [17.0, 49.0])));
        assert_eq!(hills(-1.0, 60, 67.0, 32.0), Some((-1.0, [67.0, 99.0])));
        assert_eq!(hills(0.0, 60, -70.0, 42.0), Some((0.0, [-70.0, -28.0])));
        // At any share, and far for the nearest of the others alone.
        for count in [5, 60, 100, 2_000, 100_000] {
            assert_eq!(hills(0.0, count, 28.0, 42.0), Some((0.0, [28.0, 70.0])), "{count}");
            assert_eq!(hills(255.0, count, 17.0, 32.0), Some((255.0, [17.0, 49.0])), "{count}");
            assert_eq!(hills(0.0, count, 90.0, 192.0), Some((0.0, [90.0, 282.0])), "{count}");
            assert_eq!(hills(-99.0, count, -54.0, 96.0), Some((-99.0, [-54.0, 42.0])), "{count}");
        }
        // Near for the range of the others, or at all, or of few records.
        for (mark, count, from, range) in [
            (0.0, 60, 28.0, 96.0),
            (0.0, 2_000, 24.0, 96.0),
            (0.0, 60, 9.0, 3.0),
            (0.0, 2_000, 9.0, 3.0),
            (0.0, 4, 28.0, 42.0),
            // No usual number: the floor of a quarry, and a tower.
            (560.0, 60, 700.0, 20.0),
            (149.0, 60, 0.0, 20.0),
            (400.0, 2_000, 17.0, 32.0),
        ] {
            assert_eq!(hills(mark, count, from, range), None, "{mark} {count} {from} {range}");
        }
    }

    #[test]
    fn a_usual_number_that_other_heights_lead_to_is_not_set_apart() {
        let with_zeros = |heights: Vec<f64>| {
            let zeros = std::iter::repeat_n(0.0, 900);
            extremes(zeros.chain(heights)).set_apart(1.0, 2_000).map(|doubt| doubt.others)
        };
        let hills = |from: f64| (0..900).map(move |i| from + f64::from(i % 420) / 10.0);
        // The sea, a polder, a flat country, a lake in a hollow.
        assert_eq!(with_zeros(hills(0.1).collect()), None);
        assert_eq!(with_zeros(hills(-30.0).collect()), None);
        assert_eq!(with_zeros(hills(28.0).chain((1..28).map(f64::from)).collect()), None);
        assert_eq!(with_zeros((0..900).map(|i| 0.01 * f64::from(i % 7)).collect()), None);
        // Heights in steps of 5 and of 1 metre.
        assert_eq!(with_zeros((0..900).map(|i| 15.0 + 5.0 * f64::from(i % 6)).collect()), None);
        assert_eq!(with_zeros((0..900).map(|i| 15.0 + f64::from(i % 26)).collect()), Some([15.0, 40.0]));
    }

    #[test]
    fn nodata_of_the_user_next_to_other_heights_is_told() {
        let zeros = || extremes([0.0; 9]);
        let coast = extremes((0..500).map(|i| 0.2 + 0.1 * f64::from(i)));
        let told = zeros().next_to(&coast, "point");
        assert!(told.len() == 1 && told[0].starts_with("9 points have the height 0 "), "{told:?}");
        for from in [60.0, 900.0] {
            let hills = extremes((0..500).map(|i| from + 0.1 * f64::from(i)));
            assert!(zeros().next_to(&hills, "point").is_empty());
        }
        assert!(extremes([]).next_to(&coast, "point").is_empty());
    }
}
