//! Heights of lines that seem to be in another unit than those of the points: of all features of a file, or of some.

use crate::plan::breaklines::terrain::{Around, Pair, SampledTerrain, median, middles};
use breaklines::Feature;
use crs::Unit;

/// Heights of a file in another unit are so many times nearer to the terrain when they are converted, and were farther from it than so many
/// metres, or fewer where they rise and fall with it.
const TIMES_NEARER: f64 = 4.0;
const LEAST_APART: f64 = 10.0;
const LEAST_RISE: f64 = 1.0;

/// Farther from the terrain than this, most lines are no roofs, and heights need not come onto the ground when they are converted.
const FAR_APART: f64 = 30.0;

/// The same of a feature among others.
const FEATURE_NEARER: f64 = 10.0;
const FEATURE_APART: f64 = 5.0;

/// Converted, the heights of a feature lie nearer to the middle of the points around than these to each other, or than so many metres.
const ON_GROUND: f64 = 0.5;

/// Where one in so many vertices of a feature is as high as a point around, that is its height: roofs over low ground stand out of most points.
const SHARED: usize = 8;

/// Of the features that lie off the terrain, so many in a hundred fit when they are converted. Of many roofs and bridges, a few do by chance.
const MOST: usize = 80;

/// So many heights are a multiple of those of the terrain if they vary by more than this, in metres, and lie so many times nearer to it when they
/// are divided than when they are shifted. No roofs, bridges or dams do that, however near to the ground they are.
const ENOUGH: usize = 8;
const LEAST_VARIATION: f64 = 0.2;
const TIMES_NEARER_THAN_SHIFTED: f64 = 2.5;

/// Units, and their lengths in metres, that `height_unit` does not have.
const OTHER_UNITS: [(&str, f64); 4] =
    [("millimetres", 1e-3), ("centimetres", 1e-2), ("decimetres", 0.1), ("inches", 0.0254)];

/// Units are the same if they differ by less than this part: it is far more than between the two feet.
const SAME_UNIT: f64 = 1e-4;

/// Compares heights of a file with the terrain around.
pub(super) struct UnitJudge<'a> {
    pub(super) terrain: &'a SampledTerrain<'a>,
    /// By what the heights of the file have been multiplied.
    pub(super) scale: f64,
}

impl UnitJudge<'_> {
    /// Returns a sentence if the heights of a file seem to be in another unit.
    pub(super) fn of_file(&self, pairs: &[Pair]) -> Option<String> {
        self.feet_or_metres(pairs).or_else(|| self.constant_factor(pairs))
    }

    fn feet_or_metres(&self, pairs: &[Pair]) -> Option<String> {
        let fitting = self.factors().into_iter().find(|factor| self.fits(pairs, *factor).unwrap_or(false));
        // Where points of trees are kept too, the ground is the low side of the points around.
        let low_side: Vec<Pair> =
            pairs.iter().map(|(z, around)| (*z, Around { middle: around.lowest, ..*around })).collect();
        let multiple = |pairs| Some((self.multiple(pairs, self.factors())?, pairs));
        let (factor, pairs) =
            fitting.map(|factor| (factor, pairs)).or_else(|| [pairs, &low_side].into_iter().find_map(multiple))?;
        let [line, points] = middles(pairs)?;
        let numbers = format!("median {line}, points around {points}");
        Some(match self.unit_of_lines(factor) {
            Some((unit, option)) => format!(
                "its heights seem to be in {unit}, {} ({numbers}); fix: [[breaklines]] height_unit = \"{option}\" {}",
                self.taken(),
                if self.scale == 1.0 { "to convert them" } else { "instead" }
            ),
            None => format!(
                "its heights seem to be in {}, and those of the points in {} ({numbers}), but {} is assumed for the points; fix: \
                 [input] unit or crs for the points, such as [input] crs = \"EPSG:26915+6360\" for heights in US survey feet, and \
                 [[breaklines]] height_unit for the lines",
                if factor < 1.0 { "feet" } else { "metres" },
                if factor < 1.0 { "metres" } else { "feet" },
                self.unit_of_points().name()
            ),
        })
    }

    /// Returns a sentence if the heights of a file are a multiple of those of the terrain that no option converts.
    fn constant_factor(&self, pairs: &[Pair]) -> Option<String> {
        let factors = OTHER_UNITS.map(|(_, metres)| metres * self.terrain.in_height_unit(1.0) / self.scale);
        let twice = self.factors().map(|factor| factor * factor);
        let factor = self.multiple(pairs, factors.into_iter().chain(twice))?;
        let [line, points] = middles(pairs)?;
        let unit = OTHER_UNITS.iter().zip(factors).find(|(_, other)| *other == factor);
        let what = match unit {
            Some(((unit, _), _)) => format!("seem to be in {unit}"),
            None => format!(
                "are 10.76 times too {}, as if they had been converted between feet and metres twice",
                if factor < 1.0 { "high" } else { "low" }
            ),
        };
        Some(format!(
            "its heights {what} (median {line}, points around {points}); fix: convert them, or [[breaklines]] heights = \"points\" \
             takes them from the points"
        ))
    }

    /// Returns the numbers of the features that seem to be in another unit, and a sentence about them. `pairs` are those of each.
    pub(super) fn of_features(&self, features: &[Feature], pairs: &[Vec<Pair>]) -> Option<(Vec<u64>, String)> {
        let off: Vec<(u64, &Vec<Pair>)> = features
            .iter()
            .map(|feature| feature.id.feature)
            .zip(pairs)
            .filter(|(_, pairs)| self.is_off(pairs))
            .collect();
        let fitting = |factor: f64| {
            let of_unit = off.iter().filter(|(_, pairs)| self.feature_fits(pairs, factor).unwrap_or(false));
            let of_unit: Vec<(u64, &Vec<Pair>)> = of_unit.copied().collect();
            let is_most = of_unit.len().saturating_mul(100) >= off.len().saturating_mul(MOST);
            (is_most && !of_unit.is_empty()).then_some((factor, of_unit))
        };
        let (factor, found) = self.factors().into_iter().find_map(fitting)?;
        let (first, pairs) = *found.first()?;
        let mut numbers: Vec<u64> = found.iter().map(|(number, _)| *number).collect();
        numbers.dedup();
        let others = match numbers.len() {
            1 => String::new(),
            count => format!(" (and {} more of {} features)", count.saturating_sub(1), features.len()),
        };
        let [line, points] = middles(pairs)?;
        let numbers_of_first = format!("median {line}, points around {points}");
        let sentence = match self.unit_of_lines(factor) {
            Some((unit, option)) => format!(
                "the heights of feature {first}{others} seem to be in {unit}, {} ({numbers_of_first}); fix: convert them, or put such \
                 features into a file of their own, with [[breaklines]] height_unit = \"{option}\"",
                self.taken()
            ),
            None => format!(
                "the heights of feature {first}{others} are 3.28 times too {}, as if converted between feet and metres once too often \
                 ({numbers_of_first}); fix: correct them",
                if factor < 1.0 { "high" } else { "low" }
            ),
        };
        Some((numbers, sentence))
    }

    /// Returns the option to try where heights that fit no unit well would come much nearer to the terrain.
    pub(super) fn hint(&self, pairs: &[Pair]) -> Option<String> {
        let apart = |factor: f64| median(pairs.iter().map(move |(z, around)| (z * factor - around.middle).abs()));
        let is_nearer = |factor: &f64| {
            apart(1.0)
                .zip(apart(*factor))
                .is_some_and(|(as_written, converted)| as_written > FEATURE_NEARER * converted)
        };
        let factor = self.factors().into_iter().find(is_nearer)?;
        self.unit_of_lines(factor).map(|(_, option)| format!("set height_unit = \"{option}\" then"))
    }

    /// Returns by what heights in feet are multiplied to be in metres, and the reverse.
    fn factors(&self) -> [f64; 2] {
        let foot = if self.unit_of_points() == Unit::UsFoot { Unit::US_FOOT } else { Unit::FOOT };
        [foot, foot.recip()]
    }

    fn unit_of_points(&self) -> Unit {
        Unit::from_metres(Some(self.terrain.in_height_unit(1.0).recip()))
    }

    /// Returns how the heights of the file are taken, as the end of "its heights seem to be in feet".
    fn taken(&self) -> &'static str {
        let is_in_feet = self.unit_of_lines(1.0).is_some_and(|(unit, _)| unit == "feet");
        match (self.scale == 1.0, is_in_feet) {
            (true, false) => "and those of the points in metres",
            (true, true) => "and those of the points in feet",
            (false, false) => "but they are converted from metres",
            (false, true) => "but they are converted from feet",
        }
    }

    /// Returns the unit, and its option, in which heights are that fit the terrain after they are multiplied by `factor`; `None` if there is none,
    /// so that the points must be in another unit than they are taken to be.
    fn unit_of_lines(&self, factor: f64) -> Option<(&'static str, &'static str)> {
        let metres = factor * self.scale / self.terrain.in_height_unit(1.0);
        let is = |other: f64| (metres / other - 1.0).abs() < SAME_UNIT;
        let foot = if self.unit_of_points() == Unit::UsFoot { "us-foot" } else { "foot" };
        let known = [(1.0, ("metres", "metre")), (Unit::FOOT, ("feet", foot))];
        known.into_iter().find_map(|(unit, name)| is(unit).then_some(name))
    }

    /// Tells whether the heights of a file fit the terrain after they are multiplied by `factor`.
    fn fits(&self, pairs: &[Pair], factor: f64) -> Option<bool> {
        let apart = |factor: f64| median(pairs.iter().map(move |(z, around)| (z * factor - around.middle).abs()));
        let shift = median(pairs.iter().map(|(z, around)| z - around.middle))?;
        let shifted = median(pairs.iter().map(|(z, around)| (z - around.middle - shift).abs()))?;
        let (as_written, converted) = (apart(1.0)?, apart(factor)?);
        let is_more_than = |value: f64, metres: f64| value > self.terrain.in_height_unit(metres);
        // Heights from another zero fit better when they are shifted.
        let is_shifted = converted > 2.0 * shifted.max(self.terrain.in_height_unit(LEAST_RISE));
        let rises = is_more_than(shifted, LEAST_RISE) && shifted > TIMES_NEARER * converted;
        let is_apart = is_more_than(as_written, LEAST_APART) || rises;
        // Roofs over low ground come nearer to it, but not onto it.
        let relief = median(pairs.iter().map(|(_, around)| around.relief()))?;
        let is_on_ground = converted <= 2.0 * relief || !is_more_than(converted, LEAST_RISE);
        let is_far = is_more_than(as_written, FAR_APART) && as_written > FEATURE_NEARER * converted;
        Some(as_written > TIMES_NEARER * converted && !is_shifted && is_apart && (is_on_ground || is_far))
    }

    /// Returns that of the `factors` by which heights are multiplied to be those of the terrain, if they vary as these do.
    fn multiple(&self, pairs: &[Pair], factors: impl IntoIterator<Item = f64>) -> Option<f64> {
        let shift = median(pairs.iter().map(|(z, around)| z - around.middle))?;
        let shifted = median(pairs.iter().map(|(z, around)| (z - around.middle - shift).abs()))?;
        let apart = |factor: f64| median(pairs.iter().map(move |(z, around)| (z * factor - around.middle).abs()));
        let varies = pairs.len() >= ENOUGH && shifted > self.terrain.in_height_unit(LEAST_VARIATION);
        // Small numbers are near to each other, so both sides are compared with the terrain and with themselves.
        let fits = |(factor, apart): &(f64, f64)| shifted > TIMES_NEARER_THAN_SHIFTED * apart * factor.recip().max(1.0);
        let fitting = factors.into_iter().filter_map(|factor| Some((factor, apart(factor)?))).filter(fits);
        let (factor, _) = fitting.filter(|_| varies).min_by(|one, other| one.1.total_cmp(&other.1))?;
        Some(factor)
    }

    /// Tells whether a feature lies off the terrain, and hardly any point around shares its height.
    fn is_off(&self, pairs: &[Pair]) -> bool {
        let beyond = median(pairs.iter().map(|(z, around)| around.beyond(*z)));
        let near = self.terrain.in_height_unit(ON_GROUND);
        let is_shared = |(z, around): &&Pair| {
            [around.lowest, around.middle, around.highest].iter().any(|point| (z - point).abs() < near)
        };
        let shared = pairs.iter().filter(is_shared).count();
        beyond.is_some_and(|beyond| beyond.abs() > self.terrain.in_height_unit(FEATURE_APART))
            && shared.saturating_mul(SHARED) < pairs.len()
    }

    /// Tells whether a feature that lies off the terrain lies on it after its heights are multiplied by `factor`.
    fn feature_fits(&self, pairs: &[Pair], factor: f64) -> Option<bool> {
        let apart = |factor: f64| median(pairs.iter().map(move |(z, around)| (z * factor - around.middle).abs()));
        let relief = median(pairs.iter().map(|(_, around)| around.relief()))?;
        let (as_written, converted) = (apart(1.0)?, apart(factor)?);
        Some(as_written > FEATURE_NEARER * converted && converted <= relief.max(self.terrain.in_height_unit(ON_GROUND)))
    }
}
