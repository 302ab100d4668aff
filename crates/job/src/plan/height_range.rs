//! The heights that a ramp of colours spans, and what else a first look at the points tells.
//!
//! One point of noise, or a header with a wrong greatest height, must not give all of a terrain one colour. So a sample of the points
//! decides. It is the same for a job of one part and of several, whose tiles are coloured before the last point is read.

use crate::plan::ground_cells::MOST_SAMPLE_CELLS;
use crate::plan::height_groups::{HeightBins, HeightGroup};
use delaunay::geometry::{Bounds, Site, bounds_of};
use ground::{Ground, GroundSizes, MetricLattice};
use points::{DecodedChunks, Extremes, OptionalFields, PointCounts, PointRules, Source};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use sys::{Result, interrupt};
use tiles::color::HeightRange;

/// The most chunks of the inputs in which the sample looks.
const MOST_CHUNKS: usize = 128;

/// The records at which the sample looks, in all chunks together: half a percent of the reading of ten million.
const RECORDS: u64 = 1 << 16;

/// The records at which it looks in a chunk, where there are many.
const POINTS_OF_PLACE: usize = RECORDS as usize / MOST_CHUNKS;

/// Where an index lists the chunks within bounds, they are few, and the sample would read much of them. A share of them is enough.
const SHARE_OF_LISTED: usize = 4;

/// Fewer points tell too little, unless they are all that there are.
const LEAST_POINTS: usize = 256;

/// One point of so many may be noise, at either end.
const NOISE: usize = 1000;

/// One point of so many lies beyond either end of the middle.
const TAIL: usize = 20;

/// A sample of the heights of the points that a job keeps.
pub(crate) struct HeightSample {
    /// The points: where each is, and its height.
    pub(crate) points: Vec<(Site, i32)>,
    /// Lattice integers of z, ascending.
    heights: Vec<i32>,
    /// The number of chunks in which it looked.
    places: usize,
    /// The number of records at which it looked.
    seen: u64,
    /// The number of all records.
    records: u64,
    /// What became of the records at which it looked.
    pub(crate) counts: PointCounts,
    /// What it found in each file at which it looked.
    pub(crate) by_file: BTreeMap<PathBuf, FileSample>,
}

/// What the sample found in a file.
#[derive(Default)]
pub(crate) struct FileSample {
    /// What became of its records.
    pub(crate) counts: PointCounts,
    /// The lattice integers of its points in x and y, in no order.
    pub(crate) plane: [Vec<i32>; 2],
    /// Their heights, likewise.
    pub(crate) heights: Vec<i32>,
    /// The lowest and the highest of them, in steps of the lattice.
    pub(crate) extremes: Extremes,
}

impl FileSample {
    /// Returns the median x and the median y of its points, in lattice integers; `None` without points. Stray points do not move them.
    pub(crate) fn middle(&self) -> Option<[i32; 2]> {
        let median = |values: &[i32]| {
            let mut values = values.to_vec();
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable(middle).1)
        };
        Some([median(&self.plane[0])?, median(&self.plane[1])?])
    }
}

impl HeightSample {
    /// Looks at the first records of chunks at equal distances: clouds are stored by place or by time, so that neighbours are alike.
    /// Sources that claim to have no point within `bounds`, the least x and y and the greatest, do not count.
    ///
    /// # Errors
    /// Those of [`Source::decode`]: if a chunk counted as empty because the disk failed once, the next run would have other colours.
    pub(crate) fn take(sources: &[Source], rules: &[PointRules], bounds: Option<[f64; 4]>) -> Result<HeightSample> {
        let inputs = sources.iter().zip(rules).filter(|(source, _)| may_reach(source, bounds));
        let inputs: Vec<(&Source, &PointRules, DecodedChunks)> =
            inputs.map(|(source, rules)| (source, rules, source.decoded_chunks(rules.bounds.as_ref()))).collect();
        let records = inputs.iter().map(|(.., chunks)| chunks.records).sum();
        // The number of all chunks up to and including those of each source.
        let mut chunks = 0;
        let up_to = |(.., decoded): &(_, _, DecodedChunks)| {
            chunks += decoded.len();
            chunks
        };
        let ends: Vec<usize> = inputs.iter().map(up_to).collect();
        let most = chunks.min(MOST_CHUNKS);
        let are_listed = inputs.iter().any(|(.., decoded)| decoded.are_listed());
        let places = if are_listed { most.div_ceil(SHARE_OF_LISTED) } else { most };
        let look = |place: usize| {
            interrupt::check()?;
            let chunk = (2 * place + 1) * chunks / (2 * places);
            let at = ends.partition_point(|&end| end <= chunk);
            let (source, rules, decoded) = &inputs[at];
            let chunk = decoded.chunk(chunk + decoded.len() - ends[at]);
            first_points(source, rules, chunk, RECORDS / most as u64).map(|found| (&source.path, found))
        };
        let found = (0..places).into_par_iter().map(look).collect::<Result<Vec<_>>>()?;
        let (mut points, mut counts, mut by_file) = (Vec::new(), PointCounts::default(), BTreeMap::new());
        for (path, (more, its_counts)) in found {
            counts += its_counts.clone();
            let of_file: &mut FileSample = by_file.entry(path.clone()).or_default();
            of_file.counts += its_counts;
            for ([x, y], z) in &more {
                of_file.plane[0].push(*x);
                of_file.plane[1].push(*y);
                of_file.heights.push(*z);
                of_file.extremes.see(f64::from(*z), 0);
            }
            points.extend(more);
        }
        let mut heights: Vec<i32> = points.iter().map(|(_, z)| *z).collect();
        heights.sort_unstable();
        Ok(HeightSample { points, heights, places, seen: counts.read - counts.not_decoded, records, counts, by_file })
    }

    /// Returns the heights of all points in groups, ascending.
    pub(crate) fn groups(&self) -> Vec<HeightGroup> {
        HeightBins::of(&self.heights).groups()
    }

    /// Returns the height that all points have; `None` if they have several, or there is no point.
    pub(crate) fn only_height(&self) -> Option<i32> {
        let (low, high) = (*self.heights.first()?, *self.heights.last()?);
        (low == high).then_some(low)
    }

    /// Returns the number of records at which it has looked.
    pub(crate) fn seen(&self) -> u64 {
        self.seen
    }

    /// Returns about how many of its points follow one another in their file.
    pub(crate) fn points_of_place(&self) -> usize {
        self.points.len().div_ceil(self.places.max(1))
    }

    /// Returns whether it has looked at all records.
    pub(crate) fn saw_all(&self) -> bool {
        self.seen >= self.records
    }

    /// Returns the lattice box of the points; `None` without any.
    pub(crate) fn bounds(&self) -> Option<Bounds<3>> {
        let positions: Vec<Site> = self.points.iter().map(|(position, _)| *position).collect();
        let plane = bounds_of(&positions)?;
        let (low, high) = (*self.heights.first()?, *self.heights.last()?);
        Some(Bounds { min: [plane.min[0], plane.min[1], low], max: [plane.max[0], plane.max[1], high] })
    }

    /// Returns the length of the middle of the points, nine in ten, on its longer side in x and y; `None` if there are too few to tell.
    pub(crate) fn middle(&self) -> Option<u64> {
        let count = self.points.len();
        let length = |axis: usize| {
            let mut values: Vec<i32> = self.points.iter().map(|(position, _)| position[axis]).collect();
            values.sort_unstable();
            let cut = count / TAIL;
            u64::from(values[count - 1 - cut].abs_diff(values[cut]))
        };
        (count >= LEAST_POINTS).then(|| length(0).max(length(1)))
    }

    /// Returns the sample with the heights of those points alone that lie on the ground, as far as the sample shows it. All stay if none does. Where
    /// the ground of the sample has too many cells, that of a part of it decides: points far from all others take as many as a place full of points.
    ///
    /// # Errors
    /// [`sys::Error::Interrupted`].
    pub(crate) fn on_ground(self, lattice: MetricLattice, sizes: GroundSizes) -> Result<HeightSample> {
        let corners = || self.points.iter().map(|([x, y], z)| [*x, *y, *z]);
        let mut heights = Vec::new();
        for every in (0..=MOST_CHUNKS.ilog2()).map(|power| 1 << power) {
            let is_in = |number: usize| (number / POINTS_OF_PLACE).is_multiple_of(every);
            let some = || corners().enumerate().filter(|(number, _)| is_in(*number)).map(|(_, corner)| corner);
            if let Some(ground) = Ground::of_points(lattice, some(), sizes, MOST_SAMPLE_CELLS, interrupt::check)? {
                heights.extend(corners().filter(|corner| ground.has(*corner)).map(|[_, _, height]| height));
                break;
            }
        }
        heights.sort_unstable();
        Ok(if heights.is_empty() { self } else { HeightSample { heights, ..self } })
    }

    /// Returns the heights that colours span, without what may be noise; `None` if the sample has too few points to tell. Where the
    /// sample did not see all records, the range is as much wider as a slope would go on behind the last of them, but reaches no farther
    /// than `claimed`.
    pub(crate) fn range_within(&self, claimed: HeightRange) -> Option<HeightRange> {
        let count = self.heights.len();
        let saw_all = self.saw_all();
        if count == 0 || count < LEAST_POINTS && !saw_all {
            return None;
        }
        let [low, high] = [count / NOISE, count - 1 - count / NOISE].map(|at| self.heights[at]);
        if saw_all {
            return Some(HeightRange { low, high });
        }
        // Between the first record that was seen and the last lie all places but one whole, and of that one as much as was seen.
        let [seen, records, places] = [self.seen as i128, self.records as i128, self.places as i128];
        let span = high as i128 - low as i128;
        let beyond = span * (records - seen) / ((places - 1) * records + seen).max(1);
        let within = |height: i128| height.clamp(i32::MIN as i128, i32::MAX as i128) as i32;
        let wide = [within(low as i128 - beyond), within(high as i128 + beyond)];
        Some(HeightRange { low: low.min(claimed.low.max(wide[0])), high: high.max(claimed.high.min(wide[1])) })
    }
}

/// Tells whether a source may have points within `bounds`, as far as it claims.
pub(crate) fn may_reach(source: &Source, bounds: Option<[f64; 4]>) -> bool {
    let (Some([xmin, ymin, xmax, ymax]), Some([min, max])) = (bounds, source.claimed_rectangle()) else { return true };
    min[0] <= xmax && min[1] <= ymax && max[0] >= xmin && max[1] >= ymin
}

/// Returns the points that the job keeps among the first `records` records of a chunk, and what became of these records.
fn first_points(
    source: &Source,
    rules: &PointRules,
    chunk: usize,
    records: u64,
) -> Result<(Vec<(Site, i32)>, PointCounts)> {
    let rules = PointRules { fields: OptionalFields::default(), ..rules.clone() };
    let mut found = Vec::new();
    let counts = source.decode_start(chunk, records, &rules, &mut |points| {
        found.extend(points.iter().map(|point| (point.position, point.z)));
        Ok(())
    })?;
    Ok((found, counts))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: HeightRange = HeightRange { low: i32::MIN, high: i32::MAX };

    /// A sample in `places` chunks of heights from 0 that saw every record that passed, of `records`.
    fn sample(count: i32, places: usize, records: u64) -> HeightSample {
        let counts = PointCounts::default();
        let by_file = BTreeMap::new();
        HeightSample {
            points: Vec::new(),
            heights: (0..count).collect(),
            places,
            seen: count as u64,
            records,
            counts,
            by_file,
        }
    }

    fn range(low: i32, high: i32) -> Option<HeightRange> {
        Some(HeightRange { low, high })
    }

    #[test]
    fn one_of_a_thousand_at_either_end_may_be_noise() {
        for (count, expected) in [
            (1, range(0, 0)),
            (999, range(0, 998)),
            (1000, range(1, 998)),
            (1999, range(1, 1997)),
            (65_536, range(65, 65_470)),
        ] {
            assert_eq!(sample(count, 1, count as u64).range_within(WIDE), expected, "{count}");
        }
    }

    #[test]
    fn too_few_points_tell_nothing_unless_they_are_all() {
        assert_eq!(sample(255, 4, 255).range_within(WIDE), range(0, 254));
        assert_eq!(sample(255, 4, 256).range_within(WIDE), None);
        assert!(sample(256, 4, 257).range_within(WIDE).is_some());
        assert_eq!(sample(0, 0, 0).range_within(WIDE), None);
    }

    #[test]
    fn the_range_goes_on_behind_the_sample_as_far_as_headers_claim() {
        // Half of each of two places: a slope of 999 steps over three quarters ends a third higher.
        assert_eq!(sample(999, 2, 1998).range_within(WIDE), range(-332, 1330));
        for (claimed, expected) in
            [((0, 998), (0, 998)), ((-9999, 1100), (-332, 1100)), ((500, 501), (0, 998)), ((2000, -2000), (0, 998))]
        {
            let claimed = HeightRange { low: claimed.0, high: claimed.1 };
            assert_eq!(sample(999, 2, 1998).range_within(claimed), range(expected.0, expected.1), "{claimed:?}");
        }
        let mut heights = [i32::MIN, i32::MAX].repeat(400);
        heights.sort_unstable();
        let steep = HeightSample { heights, places: 1, seen: 800, ..sample(0, 1, 1 << 40) };
        assert_eq!(steep.range_within(WIDE), range(i32::MIN, i32::MAX));
    }
}
