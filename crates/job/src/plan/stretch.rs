//! A hint about a few points that stretch an area to many times its size: they cost room in a raster, and often precision.

use crate::plan::extent::SourceBox;
use crate::plan::point_survey::{PointSurvey, SplitBoxes, at_places, box_around};
use crate::plan::rounded_box::rounded;
use points::options::InputOptions;
use points::{RowBox, Source};
use sys::Result;

/// An area is stretched if it is so many times as long as without a few points, and as the middle of its points. Strips, mosaics and
/// scans that thin out are not.
const STRETCHED: f64 = 6.0;

/// A point lies far out if it is so many times the size of the middle of its file away from that.
const FAR_OUT: f64 = 3.0;

/// At most one point in so many stretches an area. If there are more, they are a part of it.
const FEW: u64 = 1000;

/// Of a sparse survey, a handful of points may do so, up to one in [`FEW_OF_SPARSE`], if they make the area [`FAR_STRETCHED`] times as long:
/// a benchmark or a base station lies nearer.
const HANDFUL: u64 = 5;

/// As for [`HANDFUL`].
const FEW_OF_SPARSE: u64 = 50;

/// As for [`HANDFUL`].
const FAR_STRETCHED: f64 = 12.0;

/// The most records of files that are all looked at only for the sake of the hint.
const MOST_RECORDS: u64 = 1 << 24;

/// Which points are told from which others.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hint {
    /// A few that lie far out in x and y.
    Few,
    /// All that are not among the majority of their file, because the area is too wide or too high for the lattice.
    Many,
}

impl Hint {
    /// Returns the box outside which points of a file lie far out.
    fn body(self, survey: &PointSurvey) -> Result<Option<RowBox>> {
        let around = |bounds: RowBox, times: f64, upwards: f64| {
            let size = |axis: usize| bounds.max[axis] - bounds.min[axis];
            let wide = size(0).max(size(1));
            let margin = [times * wide, times * wide, upwards * wide.max(size(2))];
            let beside = |corner: [f64; 3], side: f64| [0, 1, 2].map(|axis| corner[axis] + side * margin[axis]);
            RowBox { min: beside(bounds.min, -1.0), max: beside(bounds.max, 1.0) }
        };
        Ok(match self {
            Hint::Few => survey.middle()?.map(|middle| around(middle.bounds, FAR_OUT, f64::INFINITY)),
            Hint::Many => majority(&survey.sample()?).map(|bounds| around(bounds, FAR_OUT, FAR_OUT)),
        })
        .map(|body| body.filter(|body| body.min[0] < body.max[0]))
    }

    /// Tells whether so few points stretch the area so much that a user should know.
    fn is_worth_it(self, found: &SplitBoxes) -> bool {
        let (Some([min, max]), Some(all)) = (found.within.1, found.all()) else { return false };
        let size = |[min, max]: SourceBox, axis: usize| max[axis] - min[axis];
        let wide = size([min, max], 0).max(size([min, max], 1));
        let times = |axis: usize| size(all, axis) / if axis < 2 { wide } else { wide.max(max[2] - min[2]) };
        let [few, rest] = [found.outside.0, found.within.0];
        let is_handful = few <= HANDFUL.min(rest / FEW_OF_SPARSE);
        match self {
            Hint::Few => {
                let times = times(0).max(times(1));
                few > 0 && (few <= rest / FEW && times > STRETCHED || is_handful && times > FAR_STRETCHED)
            }
            Hint::Many => few > 0 && few < rest && (0..3).any(|axis| times(axis) > STRETCHED),
        }
    }
}

/// Returns a sentence about points of the `sources` that stretch the area, if there are some. `claims` are the boxes of the sources, if they
/// can be believed.
///
/// # Errors
/// Those of reading.
pub(crate) fn stretch_hint<'a>(
    sources: impl Iterator<Item = &'a Source>,
    options: &InputOptions,
    claims: Option<&[Option<SourceBox>]>,
    hint: Hint,
) -> Result<Option<String>> {
    let (mut found, mut unread) = (SplitBoxes::default(), Vec::new());
    let whole = claims.and_then(|claims| box_around(claims.iter().flatten().flatten().copied()));
    let longer = |[min, max]: SourceBox| (max[0] - min[0]).max(max[1] - min[1]);
    // A file whose own box is short has no points that stretch the area of all. There may be thousands of them.
    let is_short = |claim| hint == Hint::Few && whole.is_some_and(|whole| 2.0 * longer(claim) < longer(whole));
    for (index, source) in sources.enumerate() {
        let claim = match claims.map(|claims| claims[index]) {
            Some(None) => continue,
            Some(claim) => claim,
            None => None,
        };
        let Some(survey) = PointSurvey::new(source, options) else { continue };
        let body = if claim.is_some_and(is_short) { None } else { hint.body(&survey)? };
        match (body, claim) {
            (Some(body), Some(claim)) if !survey.holds_claim(&body, claim) => unread.push((source, survey, body)),
            (Some(body), None) => unread.push((source, survey, body)),
            (_, Some(claim)) => {
                found.add(SplitBoxes { within: (source.records, Some(claim)), outside: (0, None), first: None })
            }
            (None, None) => {}
        }
    }
    let is_sample = unread.iter().map(|(_, survey, _)| survey.records()).sum::<u64>() > MOST_RECORDS;
    let mut first = None;
    for (source, survey, body) in &unread {
        let split = if is_sample { at_places(&survey.sample()?, body) } else { survey.split_at(body)? };
        if let (None, Some(number)) = (&first, split.first) {
            first = Some(format!(" (the first is {} of {})", source.record_name(number)?, source.path.display()));
        }
        found.add(split);
    }
    Ok(hint.is_worth_it(&found).then(|| sentence(&found, first, is_sample)).flatten())
}

/// Returns the shortest ranges that have six in ten of the places, axis by axis; `None` without places.
fn majority(places: &[[f64; 3]]) -> Option<RowBox> {
    let count = (places.len() * 6).div_ceil(10);
    let shortest = |axis: usize| {
        let mut values: Vec<f64> = places.iter().map(|place| place[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let ranges = values.windows(count).map(|window| [window[0], window[count - 1]]);
        ranges.min_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
    };
    let [x, y, z] = if places.is_empty() { return None } else { [shortest(0)?, shortest(1)?, shortest(2)?] };
    box_around([[x[0], y[0], z[0]], [x[1], y[1], z[1]]].into_iter()).map(|[min, max]| RowBox { min, max })
}

fn sentence(found: &SplitBoxes, first: Option<String>, is_sample: bool) -> Option<String> {
    let (points, rest) = found.within;
    let (rest, all, few) = (rest?, found.all()?, found.outside.0);
    let share = (points as f64 / (points + few) as f64 * 10_000.0).floor() / 100.0;
    let of = if is_sample { "of a sample of the points" } else { "of the points" };
    let size = |[min, max]: SourceBox, axis: usize| max[axis] - min[axis];
    let is_wider = (0..2).any(|axis| size(all, axis) > 2.0 * size(rest, 0).max(size(rest, 1)));
    let [x, y, z] = [0, 1, 2].map(|axis| rounded([rest[0][axis], rest[1][axis]]));
    let first = first.unwrap_or_default();
    let others = if few == 1 { format!("1 point{first} stretches") } else { format!("{few} points{first} stretch") };
    Some(match is_wider {
        true => format!(
            "{share} % {of} lie within {:.0} x {:.0} units; {others} the area to {:.0} x {:.0}; fix: [input] bounds = [{}, {}, {}, {}] \
             leaves them out",
            size(rest, 0),
            size(rest, 1),
            size(all, 0),
            size(all, 1),
            x[0],
            y[0],
            x[1],
            y[1]
        ),
        false => format!(
            "{share} % {of} have heights from {} to {}; {others} the heights to {:.0} units, from {} to {}; fix: [input] heights = [{}, \
             {}] leaves them out",
            z[0],
            z[1],
            size(all, 2),
            all[0][2],
            all[1][2],
            z[0],
            z[1]
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_majority_is_the_shortest_range() {
        let places: Vec<[f64; 3]> = (0..10).map(|i| [f64::from(i * i), f64::from(100 - i * i), 7.0]).collect();
        let found = majority(&places).unwrap();
        assert_eq!((found.min, found.max), ([0.0, 75.0, 7.0], [25.0, 100.0, 7.0]));
        assert!(majority(&[]).is_none());
    }

    #[test]
    fn a_few_far_points_are_told_and_a_part_of_the_terrain_is_not() {
        let found = |few: u64, far: f64| SplitBoxes {
            within: (100_000, Some([[0.0; 3], [80.0, 70.0, 9.0]])),
            outside: (few, Some([[far, 0.0, 0.0], [far, 0.0, 9.0]])),
            first: None,
        };
        for (few, far, expected) in [(12, 5000.0, true), (1, 481.0, true), (1, 479.0, false), (101, 5000.0, false)] {
            assert_eq!(Hint::Few.is_worth_it(&found(few, far)), expected, "{few} at {far}");
        }
        let sparse = |few: u64, rest: u64| SplitBoxes { within: (rest, found(1, 0.0).within.1), ..found(few, 1700.0) };
        for (few, rest, expected) in [(1, 899, true), (1, 49, false), (5, 250, true), (6, 900, false)] {
            assert_eq!(Hint::Few.is_worth_it(&sparse(few, rest)), expected, "{few} of {rest}");
        }
        let benchmark = SplitBoxes { outside: found(1, 900.0).outside, ..sparse(1, 899) };
        assert!(!Hint::Few.is_worth_it(&benchmark));
        assert_eq!(
            sentence(&found(12, 5000.0), Some(" (the first is point 7 of a.las)".into()), false).unwrap(),
            "99.98 % of the points lie within 80 x 70 units; 12 points (the first is point 7 of a.las) stretch the area to 5000 x 70; fix: [input] bounds = \
             [0.0, 0.0, 80.0, 70.0] leaves them out"
        );
    }
}
