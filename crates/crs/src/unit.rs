//! Units of coordinates.

use serde::{Deserialize, Serialize};

/// The unit of x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// The metre.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The US survey foot, 1200/3937 m.
    UsFoot,
    /// Degrees of longitude and latitude, or another angle.
    Degree,
    /// Another unit of length, in metres.
    Other(f64),
    /// The file does not say.
    #[default]
    Unknown,
}

impl Unit {
    /// The international foot in metres.
    pub const FOOT: f64 = 0.3048;

    /// The US survey foot in metres.
    pub const US_FOOT: f64 = 1200.0 / 3937.0;

    /// The kilometre in metres.
    pub const KILOMETRE: f64 = 1000.0;

    /// Returns the unit of this length. The two feet differ by 6e-7 m; files give them with 9 digits or more.
    pub fn from_metres(metres: Option<f64>) -> Unit {
        let near = |value: f64, other: f64| (value - other).abs() < 1e-8;
        match metres {
            None => Unit::Unknown,
            Some(value) if near(value, 1.0) => Unit::Metre,
            Some(value) if near(value, Unit::FOOT) => Unit::Foot,
            Some(value) if near(value, Unit::US_FOOT) => Unit::UsFoot,
            Some(value) => Unit::Other(value),
        }
    }

    /// Returns the length of one unit in metres; `None` for angles and for an unknown unit.
    pub fn metres_per_unit(&self) -> Option<f64> {
        match self {
            Unit::Metre => Some(1.0),
            Unit::Foot => Some(Unit::FOOT),
            Unit::UsFoot => Some(Unit::US_FOOT),
            Unit::Other(metres) => Some(*metres),
            Unit::Degree | Unit::Unknown => None,
        }
    }

    /// Returns the unit's name for messages.
    pub fn name(&self) -> String {
        match self {
            Unit::Metre => "metre".into(),
            Unit::Foot => "foot".into(),
            Unit::UsFoot => "US survey foot".into(),
            Unit::Degree => "degree".into(),
            Unit::Other(metres) if *metres == Unit::KILOMETRE => "kilometre".into(),
            Unit::Other(metres) => format!("{metres} m"),
            Unit::Unknown => "unknown".into(),
        }
    }
}

/// Returns whether two lengths of units in metres are the same, however their writers rounded them.
pub fn same_length(own: f64, other: f64) -> bool {
    (own - other).abs() <= 1e-8 * own.abs().max(other.abs()).max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_feet_are_told_apart() {
        assert_eq!(Unit::from_metres(Some(0.3048)), Unit::Foot);
        assert_eq!(Unit::from_metres(Some(0.304800609601219)), Unit::UsFoot);
        assert_eq!(Unit::from_metres(Some(0.3048006096)), Unit::UsFoot);
    }
}
