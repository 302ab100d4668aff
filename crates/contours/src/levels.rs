//! Levels on the lattice.

use lattice::Lattice;
use rust_decimal::Decimal;

/// The crossing of an edge is at least this part of a lattice step above its low end, and below its high end.
const LEAST_DISTANCE: f64 = 1.0 / 64.0;

/// Levels are at least one lattice step divided by this apart. Then the crossings of an edge keep their order, although
/// `LEAST_DISTANCE` moves those near its ends.
pub const CLOSEST: i128 = 32;

/// The height of a contour line, as the heights of the lattice see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The least height of the lattice that is at the level or above it: vertices from here on are high.
    pub least: i64,
    /// How many lattice steps the level is below `least`: at least 0, and less than 1.
    pub below: f64,
    /// Whether the level is just at `least`.
    pub is_at_least: bool,
}

impl Level {
    /// Returns how many lattice steps above its low end, which is at `low`, the level crosses an edge that is so many steps high. It is
    /// strictly between the ends, even if the high end is at the level.
    #[inline]
    pub(crate) fn rise(&self, low: i64, height: f64) -> f64 {
        ((self.least - low) as f64 - self.below).clamp(LEAST_DISTANCE, height - LEAST_DISTANCE)
    }
}

/// Why heights can be no levels.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LevelError {
    /// A height has too many digits to be compared exactly with those of the lattice.
    #[error("{0} has too many digits")]
    TooManyDigits(Decimal),
    /// Two heights are less than a part of a lattice step apart, or not in ascending order.
    #[error("{0} and {1} are too close to each other")]
    TooClose(Decimal, Decimal),
}

/// Levels in ascending order.
#[derive(Clone, Debug, Default)]
pub struct Levels(Vec<Level>);

impl Levels {
    /// Returns the levels at these ascending heights in source units.
    ///
    /// # Errors
    /// [`LevelError`].
    pub fn new(lattice: &Lattice, heights: &[Decimal]) -> Result<Levels, LevelError> {
        let steps = |height: &Decimal| Steps::of(lattice, *height).ok_or(LevelError::TooManyDigits(*height));
        let mut levels = Vec::with_capacity(heights.len());
        let mut last: Option<(Steps, Decimal)> = None;
        for height in heights {
            let steps = steps(height)?;
            if let Some((below, lower)) = &last
                && !below.is_far_below(&steps)
            {
                return Err(LevelError::TooClose(*lower, *height));
            }
            levels.push(steps.level().ok_or(LevelError::TooManyDigits(*height))?);
            last = Some((steps, *height));
        }
        Ok(Levels(levels))
    }

    /// Returns the number of levels.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns whether there is no level.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the levels from number `from` on, before number `to`.
    #[inline]
    pub(crate) fn between(&self, from: u32, to: u32) -> &[Level] {
        &self.0[from as usize..to as usize]
    }

    /// Returns how many levels each of these lattice heights has at or below it.
    pub fn counts(&self, heights: impl Iterator<Item = i32> + Clone) -> Vec<u32> {
        let [low, high] = heights.clone().fold([i32::MAX, i32::MIN], |[low, high], z| [low.min(z), high.max(z)]);
        let up_to = |levels: &[Level], z: i32| levels.partition_point(|level| level.least <= i64::from(z));
        // A tile spans few of all levels.
        let below = up_to(&self.0, low);
        let own = &self.0[below..up_to(&self.0, high).max(below)];
        heights.map(|z| (below + up_to(own, z)) as u32).collect()
    }
}

/// An exact number of lattice steps above the height 0 of the lattice: a fraction.
struct Steps {
    above: i128,
    /// What `above` is divided by. It is positive.
    step: i128,
}

impl Steps {
    fn of(lattice: &Lattice, height: Decimal) -> Option<Steps> {
        let above = height.checked_sub(lattice.offset[2])?.normalize();
        let step = lattice.resolution_z.normalize();
        let digits = above.scale().max(step.scale());
        let integer = |d: Decimal| 10i128.checked_pow(digits - d.scale())?.checked_mul(d.mantissa());
        let steps = Steps { above: integer(above)?, step: integer(step)? };
        // Room for products with other steps, and with 64.
        let fits = steps.above.unsigned_abs() < 1 << 118 && (1..1 << 118).contains(&steps.step);
        fits.then_some(steps)
    }

    /// Tells whether this is below `other` by the least distance of levels.
    fn is_far_below(&self, other: &Steps) -> bool {
        // A height with fewer digits has a smaller step, which divides the other.
        let common = self.step.max(other.step);
        let scaled = |steps: &Steps| steps.above.checked_mul(common / steps.step);
        let apart =
            scaled(other).zip(scaled(self)).and_then(|(other, own)| other.checked_sub(own)?.checked_mul(CLOSEST));
        apart.is_some_and(|apart| apart >= common)
    }

    fn level(&self) -> Option<Level> {
        let least = -(-self.above).div_euclid(self.step);
        let rest = least * self.step - self.above;
        // Both are rounded to the nearest number, which is exact for all but very long decimals.
        let below = rest as f64 / self.step as f64;
        // All heights of the lattice have 32 bits; a level beyond them is as good as any other beyond.
        let least = i64::try_from(least).ok()?;
        Some(Level { least, below, is_at_least: rest == 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(offset: &str, step: &str) -> Lattice {
        let [offset, step] = [offset, step].map(|text| Decimal::from_str_exact(text).unwrap());
        Lattice { offset: [Decimal::ZERO, Decimal::ZERO, offset], resolution: Decimal::ONE, resolution_z: step }
    }

    fn levels(lattice: &Lattice, heights: &[&str]) -> Result<Vec<Level>, LevelError> {
        let heights: Vec<Decimal> = heights.iter().map(|text| Decimal::from_str_exact(text).unwrap()).collect();
        Levels::new(lattice, &heights).map(|levels| levels.0)
    }

    #[test]
    fn levels_lie_between_the_heights_of_the_lattice() {
        let found = levels(&lattice("100", "0.01"), &["99.995", "100", "100.0025", "100.00999999"]).unwrap();
        let expected = [(0, 0.5, false), (0, 0.0, true), (1, 0.75, false), (1, 1e-6, false)];
        assert_eq!(found, expected.map(|(least, below, is_at_least)| Level { least, below, is_at_least }));
        let negative = levels(&lattice("0", "0.25"), &["-0.3", "-0.25", "-0.1"]).unwrap();
        let expected = [(-1, 0.2, false), (-1, 0.0, true), (0, 0.4, false)];
        assert_eq!(negative, expected.map(|(least, below, is_at_least)| Level { least, below, is_at_least }));
    }

    #[test]
    fn a_crossing_is_never_at_an_end() {
        let level = |least, below| Level { least, below, is_at_least: below == 0.0 };
        assert_eq!(level(5, 0.0).rise(3, 4.0), 2.0);
        assert_eq!(level(5, 0.0).rise(3, 2.0), 2.0 - 1.0 / 64.0);
        assert_eq!(level(5, 0.999).rise(4, 1.0), 1.0 / 64.0);
        assert_eq!(level(5, 0.5).rise(4, 1.0), 0.5);
    }

    #[test]
    fn levels_that_would_meet_are_refused() {
        let unit = lattice("0", "1");
        for (heights, is_fine) in [
            (["0", "0.03125"], true),
            (["0", "0.03124"], false),
            (["0.5", "0.53125"], true),
            (["0.969", "1"], false),
            (["2", "2"], false),
            (["2", "1"], false),
        ] {
            assert_eq!(levels(&unit, &heights).is_ok(), is_fine, "{heights:?}");
        }
        let long = "0.0000000000000000000000000001";
        let far = lattice("70000000000000000000000000000", "0.01");
        assert!(matches!(levels(&far, &[long]), Err(LevelError::TooManyDigits(_))));
    }

    #[test]
    fn counts_are_those_of_a_plain_comparison() {
        let all = Levels::new(
            &lattice("0", "1"),
            &["-3", "-2.5", "0", "1", "7.5"].map(|text| Decimal::from_str_exact(text).unwrap()),
        );
        let all = all.unwrap();
        for span in [-9..9, 2..5, -20..-10, 20..21, 1..2] {
            let found = all.counts(span.clone());
            let expected: Vec<u32> = span
                .map(|z| [-3.0, -2.5, 0.0, 1.0, 7.5].iter().filter(|level| **level <= f64::from(z)).count() as u32)
                .collect();
            assert_eq!(found, expected);
        }
        assert_eq!(all.counts([].into_iter()), [0u32; 0]);
    }
}
