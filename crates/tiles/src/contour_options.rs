//! The options of `[output.contours]`.

use lattice::shortest_decimal;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

/// The most levels of a terrain.
pub const MOST_LEVELS: u64 = 100_000;

/// Every fifth level is an index contour by default.
const USUAL_INDEX: u32 = 5;

/// `[output.contours]`: the terrain as contour lines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ContourTable", into = "ContourTable")]
pub struct ContourOptions {
    /// The heights of the lines.
    pub levels: ContourLevels,
    /// Whether a drawing for CAD programs is written too.
    pub dxf: bool,
}

/// The heights of contour lines.
#[derive(Clone, Debug, PartialEq)]
pub enum ContourLevels {
    /// Levels at whole multiples of an interval from a base.
    Interval {
        /// The height from one level to the next in source units. It is positive.
        interval: DecimalNumber,
        /// The levels from one index contour to the next, of which the base is one; 0 for none.
        index: u32,
        /// The height of a level in source units.
        base: DecimalNumber,
    },
    /// Levels at these heights in source units, in ascending order.
    Levels(Vec<DecimalNumber>),
}

/// The keys of the table.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ContourTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    interval: Option<toml::Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    index: Option<toml::Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    base: Option<toml::Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    levels: Option<toml::Value>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    dxf: bool,
}

/// A number that the user wrote, and the decimal that it means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecimalNumber {
    exact: Decimal,
    written: f64,
}

impl DecimalNumber {
    fn of(value: &toml::Value) -> Option<DecimalNumber> {
        let written = value.as_float().or_else(|| value.as_integer().map(|i| i as f64))?;
        shortest_decimal(written).map(|exact| DecimalNumber { exact, written })
    }

    /// Returns the number that the user wrote.
    pub fn number(self) -> f64 {
        self.written
    }
}

impl TryFrom<ContourTable> for ContourOptions {
    type Error = String;

    fn try_from(table: ContourTable) -> Result<ContourOptions, String> {
        let index = table.index.as_ref().map(index).transpose()?;
        let base = table.base.as_ref().map(base).transpose()?;
        let levels = match (&table.interval, &table.levels) {
            (Some(value), None) => {
                let interval = DecimalNumber::of(value).filter(|interval| interval.exact > Decimal::ZERO);
                let interval = interval.ok_or(
                    "interval is the height from one contour line to the next in source units, a positive number such as 1.0",
                )?;
                let base = base.unwrap_or(DecimalNumber { exact: Decimal::ZERO, written: 0.0 });
                ContourLevels::Interval { interval, index: index.unwrap_or(USUAL_INDEX), base }
            }
            (None, Some(value)) if index.is_none() && base.is_none() => ContourLevels::Levels(levels(value)?),
            (None, Some(_)) => return Err("index and base apply to interval alone, not to levels".into()),
            _ => return Err(
                "contours takes an interval such as interval = 1.0, or levels such as levels = [100.0, 101.5]: one of the two".into(),
            ),
        };
        Ok(ContourOptions { levels, dxf: table.dxf })
    }
}

impl From<ContourOptions> for ContourTable {
    fn from(ContourOptions { levels, dxf }: ContourOptions) -> ContourTable {
        let float = |number: DecimalNumber| toml::Value::Float(number.written);
        match levels {
            ContourLevels::Interval { interval, index, base } => ContourTable {
                interval: Some(float(interval)),
                index: Some(toml::Value::Integer(index.into())),
                base: Some(float(base)),
                levels: None,
                dxf,
            },
            ContourLevels::Levels(levels) => ContourTable {
                levels: Some(toml::Value::Array(levels.into_iter().map(float).collect())),
                dxf,
                ..ContourTable::default()
            },
        }
    }
}

fn index(value: &toml::Value) -> Result<u32, String> {
    let number = value.as_integer().and_then(|number| u32::try_from(number).ok());
    number
        .ok_or_else(|| "index is a whole number: with 5, every fifth line is an index contour; with 0, none is".into())
}

fn base(value: &toml::Value) -> Result<DecimalNumber, String> {
    let base = DecimalNumber::of(value);
    base.ok_or_else(|| "base is the height from which contour lines are counted, a number such as 0.0".into())
}

fn levels(value: &toml::Value) -> Result<Vec<DecimalNumber>, String> {
    const WHAT: &str = "levels are the heights of contour lines in source units, numbers such as [100.0, 101.5]";
    let numbers = value.as_array().into_iter().flatten().map(DecimalNumber::of);
    let mut levels = numbers.collect::<Option<Vec<_>>>().filter(|levels| !levels.is_empty()).ok_or(WHAT)?;
    if levels.len() as u64 > MOST_LEVELS {
        return Err(format!("{WHAT}, and no more than {MOST_LEVELS}"));
    }
    levels.sort_by_key(|level| level.exact);
    match levels.windows(2).find(|pair| pair[0].exact == pair[1].exact) {
        Some(pair) => Err(format!("{WHAT}, each once: {} is there twice", pair[0].written)),
        None => Ok(levels),
    }
}

/// The height of a contour line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourHeight {
    /// In source units.
    pub exact: Decimal,
    /// The nearest number.
    pub number: f64,
    /// Whether it is that of an index contour.
    pub is_index: bool,
}

/// Why a terrain has no contour lines of an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BadInterval {
    /// There would be about so many levels, and an interval such as this would give a hundred or so.
    TooMany {
        /// The number of levels.
        levels: f64,
        /// A better interval.
        better: f64,
    },
    /// The heights of levels would have too many digits.
    TooManyDigits,
}

impl ContourLevels {
    /// Returns the heights of all levels above the height `low`, up to `high`, in ascending order.
    ///
    /// # Errors
    /// [`BadInterval`].
    pub fn heights(&self, low: Decimal, high: Decimal) -> Result<Vec<ContourHeight>, BadInterval> {
        let is_inside = |height: &ContourHeight| low < height.exact && height.exact <= high;
        match self {
            ContourLevels::Levels(levels) => {
                let height = |level: &DecimalNumber| ContourHeight {
                    exact: level.exact,
                    number: level.written,
                    is_index: false,
                };
                Ok(levels.iter().map(height).filter(is_inside).collect())
            }
            ContourLevels::Interval { interval, index, base } => {
                let count = |height: Decimal| {
                    let above = height.checked_sub(base.exact)?;
                    above.checked_div(interval.exact)?.floor().to_i64()
                };
                let span = high.checked_sub(low).and_then(|span| span.to_f64()).unwrap_or(f64::INFINITY);
                let levels = span / interval.written;
                if levels > MOST_LEVELS as f64 {
                    return Err(BadInterval::TooMany { levels, better: round_interval(span) });
                }
                let (first, last) = count(low).zip(count(high)).ok_or(BadInterval::TooManyDigits)?;
                let height = |number: i64| {
                    let exact = interval.exact.checked_mul(Decimal::from(number))?.checked_add(base.exact)?;
                    let is_index = *index > 0 && number % i64::from(*index) == 0;
                    Some(ContourHeight { exact, number: exact.to_f64()?, is_index })
                };
                let heights = (first..=last.saturating_add(1))
                    .map(height)
                    .collect::<Option<Vec<_>>>()
                    .ok_or(BadInterval::TooManyDigits)?;
                Ok(heights.into_iter().filter(is_inside).collect())
            }
        }
    }
}

/// Returns a power of ten, or two or five times one, that divides a height into about a hundred intervals.
fn round_interval(span: f64) -> f64 {
    round_up(span / 200.0)
}

/// Returns the least of 1, 2 and 5 times a power of ten that is not below `value`, from a thousand-millionth on.
pub fn round_up(value: f64) -> f64 {
    let candidates = (-9..=9).flat_map(|power| [1, 2, 5].map(|digit| format!("{digit}e{power}")));
    let mut numbers = candidates.filter_map(|text| text.parse::<f64>().ok());
    numbers.find(|number| *number >= value).unwrap_or(5e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(text: &str) -> Result<ContourOptions, String> {
        toml::from_str(text).map_err(|error| error.message().to_string())
    }

    fn decimal(text: &str) -> Decimal {
        Decimal::from_str_exact(text).unwrap()
    }

    #[test]
    fn levels_are_multiples_of_the_interval_from_the_base() {
        let options = options("interval = 0.1\nbase = 0.05\nindex = 2").unwrap();
        let heights = options.levels.heights(decimal("-0.15"), decimal("0.25")).unwrap();
        let found: Vec<_> = heights.iter().map(|height| (height.number, height.is_index)).collect();
        // -0.15 itself has no vertex below it.
        assert_eq!(found, [(-0.05, false), (0.05, true), (0.15, false), (0.25, true)]);
        let every = self::options("interval = 2").unwrap();
        let indexes = every.levels.heights(decimal("-21"), decimal("21")).unwrap();
        let indexes: Vec<f64> = indexes.iter().filter(|height| height.is_index).map(|height| height.number).collect();
        assert_eq!(indexes, [-20.0, -10.0, 0.0, 10.0, 20.0]);
        let none = self::options("interval = 2\nindex = 0").unwrap();
        assert!(none.levels.heights(decimal("0"), decimal("99")).unwrap().iter().all(|height| !height.is_index));
    }

    #[test]
    fn levels_of_a_list_are_sorted_and_within_the_terrain() {
        let options = options("levels = [3, -1.5, 100.25]").unwrap();
        let heights = options.levels.heights(decimal("-1.5"), decimal("100.25")).unwrap();
        assert_eq!(heights.iter().map(|height| height.number).collect::<Vec<_>>(), [3.0, 100.25]);
    }

    #[test]
    fn too_many_levels_are_refused_with_a_better_interval() {
        let options = options("interval = 0.001").unwrap();
        let found = options.levels.heights(decimal("100"), decimal("350")).unwrap_err();
        assert_eq!(found, BadInterval::TooMany { levels: 250_000.0, better: 2.0 });
    }

    #[test]
    fn wrong_options_say_what_would_be_right() {
        for (text, word) in [
            ("", "interval = 1.0"),
            ("interval = 1.0\nlevels = [1]", "one of the two"),
            ("interval = 0", "positive"),
            ("interval = \"1\"", "positive"),
            ("interval = nan", "positive"),
            ("interval = 1\nindex = -1", "with 0, none is"),
            ("interval = 1\nindex = 2.5", "with 0, none is"),
            ("interval = 1\nbase = inf", "base is"),
            ("levels = []", "[100.0, 101.5]"),
            ("levels = 7", "[100.0, 101.5]"),
            ("levels = [7, 7.0]", "7 is there twice"),
            ("levels = [7]\nindex = 5", "apply to interval alone"),
            ("interval = 1\nstep = 2", "unknown field `step`"),
        ] {
            let said = options(text).unwrap_err();
            assert!(said.contains(word), "{text}: {said}");
        }
    }

    #[test]
    fn options_are_read_back_as_they_were_written() {
        for text in ["interval = 0.3", "interval = 5\nindex = 0\nbase = 0.1", "levels = [1.5, 7]\ndxf = true"] {
            let options = options(text).unwrap();
            let json = serde_json::to_string(&options).unwrap();
            assert_eq!(serde_json::from_str::<ContourOptions>(&json).unwrap(), options, "{json}");
        }
    }
}
