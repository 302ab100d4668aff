//! The units of x, y and z, as the names of columns or a line below them say them.

use crate::points::axis::AXIS_NAMES;
use crs::unit::Unit;

/// A unit that people write beside a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TextUnit {
    /// The clearest of its names.
    name: &'static str,
    /// Its length; `None` for an angle.
    metres: Option<f64>,
}

/// The name of the foot that the United States measured their land in.
const US_FOOT: &str = "us-ft";

/// The units that are known: their names, the clearest first, and their lengths.
const UNITS: [(&[&str], Option<f64>); 11] = [
    (&["m", "metre", "metres", "meter", "meters", "mètre", "mètres", "metro", "metros", "metri"], Some(1.0)),
    (&["dm", "decimetre", "decimetres", "decimeter", "decimeters"], Some(0.1)),
    (&["cm", "centimetre", "centimetres", "centimeter", "centimeters"], Some(0.01)),
    (&["mm", "millimetre", "millimetres", "millimeter", "millimeters"], Some(0.001)),
    (&["km", "kilometre", "kilometres", "kilometer", "kilometers"], Some(1000.0)),
    (&[US_FOOT, "sft", "ussft"], Some(Unit::US_FOOT)),
    (&["ft", "feet", "foot", "ift"], Some(Unit::FOOT)),
    (&["yd", "yard", "yards"], Some(0.9144)),
    (&["in", "inch", "inches"], Some(0.0254)),
    (&["degrees", "degree", "deg", "dd", "°", "dms", "decimal degrees", "decimal degree"], None),
    (&["radians", "radian", "rad", "gon", "grad"], None),
];

impl TextUnit {
    /// Returns the unit that `text` names, in brackets or not. The datum of heights may follow, as in "m NN" or "m.s.n.m".
    pub(crate) fn read(text: &str) -> Option<TextUnit> {
        let plain = plain(text);
        let before_datum = || plain.split_once([' ', '.']).filter(|(unit, _)| ["m", "ft"].contains(unit));
        TextUnit::known(&plain).or_else(|| {
            // "m.s.l." is the mean sea level.
            let (unit, _) = before_datum().filter(|_| letters(&plain) != "msl")?;
            TextUnit::known(unit)
        })
    }

    /// Returns the one unit that stands among `words`, which are those of a remark.
    pub(crate) fn among(words: &[&str]) -> Option<TextUnit> {
        let count = words.len();
        let starts_with_digit = |word: &str| word.starts_with(|c: char| c.is_ascii_digit());
        let read = |(start, window): (usize, &[&str])| match window {
            ["in"] if count > 1 => None,
            // "3 degree zones", "a grid of 1 m".
            _ if start > 0 && starts_with_digit(words[start - 1]) => None,
            [word] => TextUnit::read(word),
            _ => TextUnit::known(&window.join(" ")),
        };
        // More words say more: "us ft" is not "ft".
        let of_length = |length| words.windows(length).enumerate().filter_map(read).collect::<Vec<_>>();
        let found = (1..=count).rev().map(of_length).find(|units| !units.is_empty())?;
        found.iter().all(|unit| *unit == found[0]).then_some(found[0])
    }

    /// Returns the unit with this name, and nothing else.
    fn known(name: &str) -> Option<TextUnit> {
        let plain = plain(name);
        let is_us_foot = is_us_foot(&letters(&plain));
        let (names, metres) =
            UNITS.iter().find(|(names, _)| names.contains(&plain.as_str()) || is_us_foot && names[0] == US_FOOT)?;
        Some(TextUnit { name: names[0], metres: *metres })
    }
}

fn plain(text: &str) -> String {
    text.trim_matches(['[', ']', '(', ')', '{', '}', ' ', '.']).to_lowercase()
}

/// Returns what is left of a name without blanks, hyphens, underscores and points.
pub(crate) fn letters(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, ' ' | '\t' | '-' | '_' | '.')).collect()
}

/// Returns whether these letters name the foot of the surveys of the United States: people write "ft (US)", "U.S. survey feet", "usft".
fn is_us_foot(letters: &str) -> bool {
    ["feet", "foot", "ft"].iter().any(|foot| {
        let beside = letters.strip_prefix(foot).or_else(|| letters.strip_suffix(foot));
        beside.is_some_and(|beside| ["us", "survey", "ussurvey"].contains(&beside))
    })
}

/// The units of x, y and z, as far as a text says them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TextUnits(pub(crate) [Option<TextUnit>; 3]);

/// What the units of a text mean for its coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct UnitsOfAxes {
    /// The unit of x and y.
    pub(crate) horizontal: Unit,
    /// The length of the unit of z.
    pub(crate) vertical: Option<f64>,
    /// Whether a unit is a foot, of which there are two.
    pub(crate) some_foot: bool,
}

impl TextUnits {
    /// Takes the units of a line below the names into account: those of the columns of x, y and z. A line that does not give x and y a
    /// unit each is no line of units.
    ///
    /// # Errors
    /// A sentence, if the names say another unit.
    pub(crate) fn add_line(&mut self, line: [Option<TextUnit>; 3]) -> Result<(), String> {
        if line[0].is_none() || line[1].is_none() {
            return Ok(());
        }
        for (axis, (own, below)) in self.0.iter_mut().zip(line).enumerate() {
            match (*own, below) {
                (Some(named), Some(below)) if named != below => {
                    let (axis, named, below) = (AXIS_NAMES[axis], named.name, below.name);
                    return Err(format!("has {named} for {axis}, but the line below it has {below}"));
                }
                _ => *own = own.or(below),
            }
        }
        Ok(())
    }

    /// Takes these units where none is known.
    pub(crate) fn complete(&mut self, others: [Option<TextUnit>; 3]) {
        self.0.iter_mut().zip(others).for_each(|(own, other)| *own = own.or(other));
    }

    /// Returns what the units mean together.
    ///
    /// # Errors
    /// A sentence, if x and y are in different units, or z is in degrees.
    pub(crate) fn of_axes(&self) -> Result<UnitsOfAxes, String> {
        let [x, y, z] = self.0;
        if let (Some(x), Some(y)) = (x, y)
            && x != y
        {
            return Err(format!("has {} for x and {} for y: write both in one unit", x.name, y.name));
        }
        let horizontal = x.or(y);
        if let Some(z) = z.filter(|z| z.metres.is_none()) {
            return Err(format!("has {} for z: write heights in metres", z.name));
        }
        let unit = horizontal.map_or(Unit::Unknown, |unit| unit.metres.map_or(Unit::Degree, of_length));
        Ok(UnitsOfAxes {
            horizontal: unit,
            vertical: z.and_then(|z| z.metres),
            some_foot: self.0.iter().flatten().any(|unit| unit.name == "ft"),
        })
    }
}

fn of_length(metres: f64) -> Unit {
    Unit::from_metres(Some(metres))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(names: [&str; 3]) -> TextUnits {
        TextUnits(names.map(TextUnit::read))
    }

    #[test]
    fn units_of_many_spellings_are_used() {
        let of = |names| units(names).of_axes().unwrap();
        let all = |horizontal, metres| UnitsOfAxes { horizontal, vertical: Some(metres), ..UnitsOfAxes::default() };
        assert_eq!(of(["m", "[m]", "(Meter)"]), all(Unit::Metre, 1.0));
        assert_eq!(of(["mm", "mm", "mm"]).horizontal, Unit::Other(0.001));
        assert_eq!(of(["km", "km", "m"]).vertical, Some(1.0));
        assert_eq!(of(["m", "m", "cm"]).vertical, Some(0.01));
        assert_eq!((of(["ft", "ft", "ft"]).horizontal, of(["feet", "ft", "ft"]).some_foot), (Unit::Foot, true));
        assert_eq!(of(["us-ft", "usft", "US ft"]), all(Unit::UsFoot, Unit::US_FOOT));
        assert_eq!(of(["m", "m", ""]).vertical, None);
        assert_eq!(of(["dd", "°", "m"]).horizontal, Unit::Degree);
        assert_eq!(of(["local", "", "NAVD88"]), UnitsOfAxes::default());
        assert_eq!(
            of(["yd", "Yards", "ft NAVD88"]),
            UnitsOfAxes { some_foot: true, ..all(Unit::Other(0.9144), Unit::FOOT) }
        );
        assert_eq!(of(["survey feet", "US Survey Feet", "ft US"]), all(Unit::UsFoot, Unit::US_FOOT));
        assert_eq!(of(["Mètres", "m", "m ü. NHN"]), all(Unit::Metre, 1.0));
        for name in ["ft-US", "ft us survey", "foot us", "U.S. Survey Feet", "us_ft", "US feet"] {
            assert_eq!(of([name; 3]), all(Unit::UsFoot, Unit::US_FOOT), "{name}");
        }
        assert_eq!(of(["m", "m", "m.s.n.m."]), all(Unit::Metre, 1.0));
        assert_eq!(of(["m", "m", "(m.s.l.)"]).vertical, None);
    }

    #[test]
    fn one_unit_is_found_among_other_words() {
        let among = |words: &str| {
            let words: Vec<&str> = words.split(' ').collect();
            TextUnit::among(&words).map(|unit| unit.name)
        };
        for (words, unit) in [
            ("in feet", "ft"),
            ("navd88 us survey feet", "us-ft"),
            ("ft us", "us-ft"),
            ("in", "in"),
            ("decimal degrees wgs84", "degrees"),
            ("m nn", "m"),
            ("m m", "m"),
        ] {
            assert_eq!(among(words), Some(unit), "{words}");
        }
        for words in ["gk 3 degree zones", "in zone 3", "ft or m", "navd88", "m.s.l."] {
            assert_eq!(among(words), None, "{words}");
        }
    }

    #[test]
    fn units_that_contradict_each_other_are_errors() {
        assert!(units(["m", "ft", "m"]).of_axes().unwrap_err().contains("m for x and ft for y"));
        assert!(units(["deg", "deg", "deg"]).of_axes().unwrap_err().contains("for z"));
        let mut named = units(["m", "m", ""]);
        assert!(named.add_line(units(["cm", "cm", "cm"]).0).unwrap_err().contains("line below"));
        let mut named = units(["", "", ""]);
        named.add_line(units(["m", "m", "cm"]).0).unwrap();
        assert_eq!(named, units(["m", "m", "cm"]));
        named.add_line(units(["", "", "mm"]).0).unwrap();
    }
}
