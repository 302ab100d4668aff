//! `[input.bare_earth]`: the sizes by which the ground is told from what stands on it.

use serde::{Deserialize, Serialize};

/// The sizes by which the ground is told from what stands on it. Lengths are in metres, whatever the unit of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GroundSizes {
    /// The width of the widest building.
    pub largest_building: LargestBuilding,
    /// The slope of the steepest ground that is no edge: height by length.
    pub slope: Slope,
    /// How far a point may lie from the ground that its neighbours show, on level ground.
    pub tolerance: Tolerance,
}

impl GroundSizes {
    /// Tells whether the user has changed none of them.
    pub fn is_default(&self) -> bool {
        *self == GroundSizes::default()
    }
}

/// A positive number with a default and limits.
macro_rules! number {
    ($(#[$doc:meta])* $name:ident, $key:literal, $default:literal, $least:literal, $most:literal, $what:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(try_from = "f64")]
        pub struct $name(pub f64);

        impl Default for $name {
            fn default() -> $name {
                $name($default)
            }
        }

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<$name, String> {
                match ($least..=$most).contains(&value) {
                    true => Ok($name(value)),
                    false => Err(format!(
                        "{} is {} from {} to {}, such as {:?}, not {value}",
                        $key, $what, $least, $most, $default
                    )),
                }
            }
        }
    };
}

number!(
    /// The width of the widest building in metres.
    LargestBuilding, "largest_building", 40.0, 2.0, 500.0, "a length in metres"
);
number!(
    /// A slope: height by length.
    Slope, "slope", 0.08, 0.01, 10.0, "a height by a length"
);
number!(
    /// A vertical distance in metres.
    Tolerance, "tolerance", 0.3, 0.01, 10.0, "a height in metres"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_limits() {
        let read = toml::from_str::<GroundSizes>;
        assert!(read("").unwrap().is_default());
        assert_eq!(read("largest_building = 60").unwrap().largest_building, LargestBuilding(60.0));
        for wrong in ["largest_building = 1", "slope = 0.0", "tolerance = -1", "tolerance = nan", "tolerence = 1"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
        let why = read("slope = 11").unwrap_err().to_string();
        assert!(why.contains("slope is a height by a length from 0.01 to 10, such as 0.08, not 11"), "{why}");
    }
}
