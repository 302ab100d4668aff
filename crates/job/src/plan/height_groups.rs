//! Heights that lie so far from all others that no terrain joins them: spikes, and nodata after a change of unit, of the geoid or of the grid.

/// The fewest metres between the heights of a terrain and lower ones that may be none. The sea lies at the foot of cliffs.
pub(crate) const LOW: f64 = 200.0;

/// The same for higher ones. Towers stand out.
pub(crate) const HIGH: f64 = 500.0;

/// Such heights lie so many times as far from the others as eight in ten of these spread,
const TIMES_SPREAD: f64 = 4.0;

/// or as the nearest of these do: one in a hundred, and at least so many.
const TIMES_NEAREST: f64 = 10.0;
const NEAREST: u64 = 12;

/// Fewer other points show no spread.
const LEAST_OTHERS: u64 = 5;

/// Of fewer points the nearest show nothing.
const ENOUGH: u64 = 100;

/// A few points may lie between: at most one for so many beyond, and one for so many of the others.
const BEYOND_FOR_ONE_BETWEEN: u64 = 2;
const OTHERS_FOR_ONE_BETWEEN: u64 = 100;

/// Heights that are so many times nearer to each other than the others are to those below lie together.
const GAP_FOR_NEAR: f64 = 50.0;

/// The lowest and the highest land in metres, with some margin.
const LAND: [f64; 2] = [-500.0, 9000.0];

/// Of heights in two parts, those of at most one point in so many may be mistakes,
const FEW: u64 = 5;

/// or those of one in so many, if they vary and the others do not.
const VERY_FEW: u64 = 20;

/// Nodata lies within so many metres, even if the geoid has been added to it.
pub(crate) const FLAT: f64 = 1.0;

/// One in so many points may lie far out without a gap: where a grid was resampled, heights run from those of a terrain to nodata.
const TAIL: u64 = 20;

/// No terrain has a tail of so many metres that is also so many times as long as eight in ten of the points spread.
const LONG_DOWNWARDS: f64 = 2000.0;
const LONG_UPWARDS: f64 = 5000.0;
const TIMES_TAIL: f64 = 10.0;

/// The number of bins of heights.
const BINS: usize = 4096;

/// Heights that lie together, in steps of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HeightGroup {
    pub(crate) count: u64,
    pub(crate) low: i64,
    pub(crate) high: i64,
    /// The number of the first record that has one of them.
    pub(crate) first: u64,
}

impl HeightGroup {
    /// Returns both together.
    pub(crate) fn and(self, other: HeightGroup) -> HeightGroup {
        HeightGroup {
            count: self.count + other.count,
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            first: self.first.min(other.first),
        }
    }

    /// Returns the distance to heights above.
    fn below(&self, other: &HeightGroup) -> f64 {
        (other.low - self.high) as f64
    }

    /// Returns these heights with the other sign.
    fn turned(&self) -> HeightGroup {
        HeightGroup { low: -self.high, high: -self.low, ..*self }
    }
}

/// Heights in bins of equal size.
#[derive(Clone)]
pub(crate) struct HeightBins {
    low: i64,
    width: i64,
    bins: Vec<Option<HeightGroup>>,
}

impl HeightBins {
    /// Returns empty bins for heights between these. Others come into the first or the last.
    pub(crate) fn between([low, high]: [i64; 2]) -> HeightBins {
        let width = ((high - low) / BINS as i64 + 1).max(1);
        HeightBins { low, width, bins: vec![None; BINS] }
    }

    /// Returns the bins of these heights, without the numbers of their records.
    pub(crate) fn of(heights: &[i32]) -> HeightBins {
        let ends = heights.iter().fold([i64::MAX, i64::MIN], |[low, high], &z| [low.min(z.into()), high.max(z.into())]);
        let mut bins = HeightBins::between(if heights.is_empty() { [0; 2] } else { ends });
        heights.iter().for_each(|&z| bins.see(z, 0));
        bins
    }

    /// Adds the height of record `number`.
    pub(crate) fn see(&mut self, height: i32, number: u64) {
        let height = i64::from(height);
        self.insert(HeightGroup { count: 1, low: height, high: height, first: number });
    }

    fn insert(&mut self, group: HeightGroup) {
        let bin = ((group.low - self.low) / self.width).clamp(0, BINS as i64 - 1) as usize;
        self.bins[bin] = self.bins[bin].into_iter().chain([group]).reduce(HeightGroup::and);
    }

    /// Adds those of other records, in bins between the same heights.
    pub(crate) fn and(mut self, other: HeightBins) -> HeightBins {
        for (bin, more) in self.bins.iter_mut().zip(other.bins) {
            *bin = bin.iter().copied().chain(more).reduce(HeightGroup::and);
        }
        self
    }

    /// Returns the heights of all bins that have some, ascending.
    pub(crate) fn groups(&self) -> Vec<HeightGroup> {
        self.bins.iter().flatten().copied().collect()
    }
}

/// Heights that may be none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HeightsApart {
    /// Those below all others.
    pub(crate) below: Option<HeightGroup>,
    /// Those above all others.
    pub(crate) above: Option<HeightGroup>,
    /// All others.
    pub(crate) others: HeightGroup,
}

/// What a terrain may be like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TerrainScale {
    /// The metres of a step of heights.
    metres: f64,
    /// The lowest and the highest land, in steps.
    land: [f64; 2],
}

impl TerrainScale {
    /// Returns that for steps of so many `metres`, `zero` of which lie at sea level.
    pub(crate) fn new(metres: f64, zero: f64) -> TerrainScale {
        TerrainScale { metres, land: LAND.map(|height| height / metres + zero) }
    }

    /// Returns that for heights with the other sign.
    fn turned(self) -> TerrainScale {
        let [low, high] = self.land;
        TerrainScale { land: [-high, -low], ..self }
    }

    fn is_flat(self, part: &[HeightGroup]) -> bool {
        spread(part) * self.metres <= FLAT
    }

    /// Returns whether some of these heights, ascending, are those of no land.
    fn is_beyond(self, part: &[HeightGroup]) -> bool {
        let [low, high] = self.land;
        part.first().is_some_and(|first| (first.low as f64) < low)
            || part.last().is_some_and(|last| last.high as f64 > high)
    }
}

/// Returns which of these heights, ascending, lie apart from all others in a way that no terrain does; `None` if none do.
pub(crate) fn heights_apart(groups: &[HeightGroup], scale: TerrainScale) -> Option<HeightsApart> {
    let turned = |groups: &[HeightGroup]| groups.iter().rev().map(HeightGroup::turned).collect::<Vec<_>>();
    let above = |groups: &[HeightGroup]| lower_part(&turned(groups), [HIGH, LONG_UPWARDS], scale.turned());
    let end = groups.len() - above(groups);
    let start = lower_part(&groups[..end], [LOW, LONG_DOWNWARDS], scale);
    // Without the lowest heights, higher ones may stand out.
    let end = end - above(&groups[start..end]);
    let sum = |groups: &[HeightGroup]| groups.iter().copied().reduce(HeightGroup::and);
    let (below, above) = (sum(&groups[..start]), sum(&groups[end..]));
    let others = sum(&groups[start..end])?;
    (below.is_some() || above.is_some()).then_some(HeightsApart { below, above, others })
}

/// Returns the number of the lowest groups that lie apart from the others: beyond a gap of so many metres at least, or in a tail of so many.
fn lower_part(groups: &[HeightGroup], [gap, tail]: [f64; 2], scale: TerrainScale) -> usize {
    let total = count(groups);
    let (mut found, mut below) = (0, 0);
    for (at, group) in groups.iter().enumerate() {
        below += group.count;
        let (mut between, mut next) = (0, at + 1);
        while next < groups.len() && between <= most_between(below, total - below - between) {
            let length = group.below(&groups[next]);
            if length * scale.metres >= gap && is_apart(length, &groups[next..]) && is_doubtful(groups, next, scale) {
                found = start_of_others(groups, at, next);
            }
            between += groups[next].count;
            next += 1;
        }
    }
    if found == 0 { lower_tail(groups, tail, scale) } else { found }
}

/// Returns where the others really start, if they do not later than at `next`: heights just below belong to them.
fn start_of_others(groups: &[HeightGroup], below: usize, next: usize) -> usize {
    let near = groups[below].below(&groups[next]) / GAP_FOR_NEAR;
    let is_near = |at: &usize| groups[at - 1].below(&groups[*at]) <= near;
    let steps = (below + 2..=next).rev().take_while(is_near).count();
    next - steps
}

/// Returns how many points may lie between so many below and the others.
fn most_between(below: u64, others: u64) -> u64 {
    (below / BEYOND_FOR_ONE_BETWEEN).min(others / OTHERS_FOR_ONE_BETWEEN)
}

/// Returns whether so wide a gap parts other heights from the rest of a terrain.
fn is_apart(gap: f64, others: &[HeightGroup]) -> bool {
    let count = count(others);
    let nearest = || (quantile(others, (count / 100).max(NEAREST)).high - others[0].low) as f64;
    count >= LEAST_OTHERS
        && (gap >= TIMES_SPREAD * spread(others) || count >= ENOUGH && gap >= TIMES_NEAREST * nearest())
}

/// Returns whether the groups before `at`, and not those from there on, may be no heights.
fn is_doubtful(groups: &[HeightGroup], at: usize, scale: TerrainScale) -> bool {
    let (lower, upper) = groups.split_at(at);
    let (below, total) = (count(lower), count(groups));
    match (scale.is_beyond(lower), scale.is_beyond(upper)) {
        (true, false) => return true,
        (false, true) => return false,
        _ => {}
    }
    match (scale.is_flat(lower), scale.is_flat(upper)) {
        (true, false) => total - below > total / VERY_FEW,
        (false, true) => below <= total / VERY_FEW,
        _ => below <= total / FEW,
    }
}

fn count(groups: &[HeightGroup]) -> u64 {
    groups.iter().map(|group| group.count).sum()
}

/// Returns the number of the lowest groups, if they are the thin tail of the others.
fn lower_tail(groups: &[HeightGroup], least: f64, scale: TerrainScale) -> usize {
    let total = count(groups);
    if total < ENOUGH {
        return 0;
    }
    let (body, spread) = (quantile(groups, total / TAIL + 1), spread(groups));
    let length = (body.low - groups[0].low) as f64;
    if length * scale.metres < least || length < TIMES_TAIL * spread {
        return 0;
    }
    let end = body.low as f64 - 2.0 * spread;
    groups.partition_point(|group| (group.high as f64) < end)
}

/// Returns the range of the middle of the heights, eight in ten.
fn spread(groups: &[HeightGroup]) -> f64 {
    let count = count(groups);
    let cut = count / 10;
    (quantile(groups, count - cut).high - quantile(groups, cut + 1).low) as f64
}

/// Returns the group with the `rank`-th of the heights, from 1.
fn quantile(groups: &[HeightGroup], rank: u64) -> HeightGroup {
    let mut seen = 0;
    let holds = |group: &&HeightGroup| {
        seen += group.count;
        seen >= rank
    };
    groups.iter().find(holds).or(groups.last()).copied().unwrap_or(HeightGroup { count: 0, low: 0, high: 0, first: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what lies apart among heights in centimetres: how many points below and above, and the range of all others.
    fn apart(heights: impl Iterator<Item = i32>) -> Option<([u64; 2], [i64; 2])> {
        let heights: Vec<i32> = heights.collect();
        let found = heights_apart(&HeightBins::of(&heights).groups(), TerrainScale::new(0.01, 0.0))?;
        let count = |group: Option<HeightGroup>| group.map_or(0, |group| group.count);
        Some(([count(found.below), count(found.above)], [found.others.low, found.others.high]))
    }

    fn hills() -> impl Iterator<Item = i32> {
        (0..1000).map(|i| 84_000 + i * 7919 % 12_001)
    }

    #[test]
    fn gaps_and_tails_that_no_terrain_has_are_found() {
        let body = [hills().min().unwrap().into(), hills().max().unwrap().into()];
        assert_eq!(apart(hills()), None);
        assert_eq!(apart(hills().chain([500_000])), Some(([0, 1], body)));
        assert_eq!(apart(hills().chain([500_000, -1_200_000])), Some(([1, 1], body)));
        assert_eq!(apart(hills().chain((0..40).map(|i| i % 5))), Some(([40, 0], body)));
        assert_eq!(apart(hills().chain((0..9000).map(|i| -995_390 + i % 31))), Some(([9000, 0], body)));
        // A few points between, and a ramp from nodata to the terrain.
        assert_eq!(apart(hills().chain([0; 40]).chain([20_000, 50_000])), Some(([42, 0], body)));
        assert_eq!(apart(hills().chain((0..50).map(|i| -999_900 + 20_000 * i))), Some(([50, 0], body)));
    }

    #[test]
    fn shores_towers_and_depths_are_terrain() {
        assert_eq!(apart(hills().chain((0..300).map(|i| 280 * i))), None);
        assert_eq!(apart(hills().chain([66_000, 140_000])), None);
        assert_eq!(apart((0..1000).map(|i| -400_000 + i * i / 4)), None);
        assert_eq!(apart((0..1000).map(|i| (i - 940).max(0) * 1500)), None);
    }
}
