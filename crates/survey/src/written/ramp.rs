//! The colours of differences: red for cut, blue for fill, and white between them.

use overlay::FixedSum;
use serde::Serialize;
use tiles::color::{LinearRgb, from_srgb};

/// From the greatest cut to the greatest fill, in sRGB: a scale that people who see red and green alike can read.
const STOPS: [[u8; 3]; 5] = [[178, 24, 43], [239, 138, 98], [247, 247, 247], [103, 169, 207], [33, 102, 172]];

/// Where the height changes by less than the threshold.
const UNCHANGED: [u8; 3] = [230, 230, 230];

/// Where only one of the terrains is.
const OUTSIDE: [u8; 3] = [140, 140, 140];

/// What the colours of a difference mean, for a legend.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Legend {
    /// The fall and the rise with the strongest colours, in units of heights. Greater ones have these colours too.
    pub range: f64,
    /// Smaller changes are unchanged, in units of heights.
    pub threshold: f64,
    /// The unit of heights.
    pub unit: String,
    /// The sRGB colours from a fall of `range` to a rise of `range`, at equal distances.
    pub colors: [[u8; 3]; 5],
    /// The colour of what changes by less than `threshold`.
    pub unchanged: [u8; 3],
    /// The colour of what only the later terrain covers.
    pub outside: [u8; 3],
}

impl Legend {
    pub(crate) fn new(range: f64, threshold: f64, unit: String) -> Legend {
        Legend { range, threshold, unit, colors: STOPS, unchanged: UNCHANGED, outside: OUTSIDE }
    }

    /// Returns the colour of a change in units of heights, or of none.
    pub(crate) fn color(&self, change: Option<f64>) -> LinearRgb {
        let Some(change) = change else { return from_srgb(OUTSIDE) };
        if change.abs() < self.threshold {
            return from_srgb(UNCHANGED);
        }
        let last = (STOPS.len() - 1) as f64;
        let place = ((change / self.range).clamp(-1.0, 1.0) + 1.0) / 2.0 * last;
        let stop = place.floor().min(last - 1.0);
        let part = place - stop;
        let [low, high] = [0, 1].map(|k| STOPS[stop as usize + k]);
        from_srgb([0, 1, 2].map(|k| {
            let [from, to] = [low[k], high[k]].map(f64::from);
            (from + part * (to - from) + 0.5) as u8
        }))
    }
}

/// How often changes of each size occur, told apart to about a hundredth of their size.
#[derive(Clone, Debug)]
pub(crate) struct ChangeCounts {
    /// By the upper half of the bits of the size.
    counts: Vec<u64>,
}

impl ChangeCounts {
    pub(crate) fn new() -> ChangeCounts {
        ChangeCounts { counts: vec![0; 1 << 15] }
    }

    /// Adds a change. NaN is none.
    pub(crate) fn add(&mut self, change: f32) {
        if !change.is_nan() {
            self.counts[(change.abs().to_bits() >> 16) as usize] += 1;
        }
    }

    pub(crate) fn merge(mut self, other: &ChangeCounts) -> ChangeCounts {
        self.counts.iter_mut().zip(&other.counts).for_each(|(own, other)| *own += other);
        self
    }

    /// Returns the number of changes.
    pub(crate) fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Returns a size that all but a fiftieth of the changes of `least` and more are below; `None` without such changes.
    pub(crate) fn usual_limit(&self, least: f32) -> Option<f32> {
        const LEFT_OUT: u64 = 50;
        let first = ((least.abs().to_bits() >> 16) as usize).max(1);
        let of_all: u64 = self.counts[first..].iter().sum();
        let mut left_out = of_all / LEFT_OUT;
        for (bits, count) in (0u32..1 << 15).zip(&self.counts).skip(first).rev() {
            if *count > left_out {
                return Some(f32::from_bits((bits + 1) << 16));
            }
            left_out -= count;
        }
        None
    }
}

/// Returns the least of 1, 2 and 5 times a power of ten that is not below `value`, which is positive.
pub(crate) fn round_up(value: f64) -> f64 {
    const POWERS: std::ops::Range<i32> = -12..16;
    let all = POWERS.flat_map(|power| ["1", "2", "5"].map(|digit| format!("{digit}e{power}")));
    let mut numbers = all.map(|text| text.parse::<f64>().unwrap_or(f64::NAN));
    numbers.find(|number| *number >= value).unwrap_or(value)
}

/// Returns the mean distance of the vertices of triangles with this area in square steps: half as many as triangles.
pub(crate) fn spacing(area: FixedSum, triangles: u64) -> Option<f64> {
    let each = area.value()? * 2.0 / triangles as f64;
    (each > 0.0).then(|| each.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_are_red_and_rises_are_blue() {
        let legend = Legend::new(2.0, 0.1, "metre".into());
        let of = |change: f64| legend.color(Some(change));
        assert_eq!([of(-2.0), of(-9.0)], [from_srgb(STOPS[0]); 2]);
        assert_eq!([of(2.0), of(1e30)], [from_srgb(STOPS[4]); 2]);
        assert_eq!(of(-1.0), from_srgb(STOPS[1]));
        assert_eq!([of(0.0), of(0.09), of(-0.09)], [from_srgb(UNCHANGED); 3]);
        assert_eq!(legend.color(None), from_srgb(OUTSIDE));
        let [light, dark] = [of(0.5), of(1.5)];
        assert!(light[0] > dark[0] && light[2] > dark[2] && dark[2] > dark[0], "{light:?} {dark:?}");
        assert_eq!(Legend::new(2.0, 0.0, String::new()).color(Some(0.0)), from_srgb(STOPS[2]));
    }

    #[test]
    fn few_great_changes_do_not_set_the_range() {
        let mut counts = ChangeCounts::new();
        (0..980).for_each(|n| counts.add(n as f32 * 0.001 + 0.01));
        (0..15).for_each(|_| counts.add(-40.0));
        (0..5000).for_each(|_| counts.add(0.0));
        counts.add(f32::NAN);
        assert_eq!(counts.total(), 5995);
        let limit = counts.usual_limit(0.0).unwrap();
        assert!((0.97..1.0).contains(&limit), "{limit}");
        assert!(counts.usual_limit(10.0).unwrap() >= 40.0);
        assert_eq!(ChangeCounts::new().usual_limit(0.0), None);
    }

    #[test]
    fn numbers_are_rounded_up_to_plain_ones() {
        assert_eq!([0.97, 1.0, 1.01, 2.5, 0.0301, 7.0].map(round_up), [1.0, 1.0, 2.0, 5.0, 0.05, 10.0]);
    }
}
