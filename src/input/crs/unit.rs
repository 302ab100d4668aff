//! Units of coordinates.

use serde::{Deserialize, Serialize};

/// A unit of x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// The metre.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The foot of the US survey, 1200/3937 m.
    UsFoot,
    /// Degrees of longitude and latitude, or another angle.
    Degree,
    /// Another unit of so many metres.
    Other(f64),
    /// The file does not say.
    #[default]
    Unknown,
}

impl Unit {
    /// Metres of the foot of the US survey.
    pub const US_FOOT: f64 = 1200.0 / 3937.0;

    /// The unit of so many metres. The two feet differ by 6e-7 m; texts give them with 9 digits or more.
    pub(crate) fn of(metres: Option<f64>) -> Unit {
        let near = |value: f64, other: f64| (value - other).abs() < 1e-8;
        match metres {
            None => Unit::Unknown,
            Some(value) if near(value, 1.0) => Unit::Metre,
            Some(value) if near(value, 0.3048) => Unit::Foot,
            Some(value) if near(value, Unit::US_FOOT) => Unit::UsFoot,
            Some(value) => Unit::Other(value),
        }
    }

    /// Metres of one unit; `None` for angles and where it is not known.
    pub fn metres_per_unit(&self) -> Option<f64> {
        match self {
            Unit::Metre => Some(1.0),
            Unit::Foot => Some(0.3048),
            Unit::UsFoot => Some(Unit::US_FOOT),
            Unit::Other(metres) => Some(*metres),
            Unit::Degree | Unit::Unknown => None,
        }
    }

    /// The unit's name for a reader.
    pub fn name(&self) -> String {
        match self {
            Unit::Metre => "metre".into(),
            Unit::Foot => "foot".into(),
            Unit::UsFoot => "US survey foot".into(),
            Unit::Degree => "degree".into(),
            Unit::Other(metres) => format!("{metres} m"),
            Unit::Unknown => "unknown".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_feet_are_told_apart() {
        assert_eq!(Unit::of(Some(0.3048)), Unit::Foot);
        assert_eq!(Unit::of(Some(0.304800609601219)), Unit::UsFoot);
        assert_eq!(Unit::of(Some(0.3048006096)), Unit::UsFoot);
    }
}
