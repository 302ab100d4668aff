//! The options of `[input]`.

use crate::geometry::lattice::shortest_decimal;
use crate::input::text::options::TextOptions;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

/// `[input]`: which points.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputOptions {
    /// Paths or globs, relative to the configuration file.
    pub files: Vec<String>,
    /// Keep only these classes; default: all but noise (7, 18).
    #[serde(default)]
    pub classes: Option<Vec<u8>>,
    /// Keep only what lies in [xmin, ymin, xmax, ymax], in source units, borders included.
    #[serde(default)]
    pub bounds: Option<SourceBounds>,
    /// Which of several points with the same x and y stays.
    #[serde(default)]
    pub duplicates: Duplicates,
    /// The unit of x and y.
    #[serde(default)]
    pub unit: UnitChoice,
    /// The step of the lattice in x and y, in source units.
    #[serde(default)]
    pub resolution: ResolutionChoice,
    /// The fraction of malformed records or lines that is put up with, 0 to 1.
    #[serde(default, alias = "malformed_share")]
    pub max_malformed_fraction: Fraction,
    /// What becomes of a job with a file that cannot be used.
    #[serde(default)]
    pub on_bad_file: OnBadFile,
    /// How text files are laid out, where detection is not to be trusted.
    #[serde(default)]
    pub csv: TextOptions,
}

impl InputOptions {
    /// Which of the 256 classification codes are kept.
    pub fn kept_classes(&self) -> [bool; 256] {
        match &self.classes {
            Some(classes) => {
                let mut kept = [false; 256];
                classes.iter().for_each(|&class| kept[class as usize] = true);
                kept
            }
            None => std::array::from_fn(|class| class != 7 && class != 18),
        }
    }
}

/// Which of several points with the same x and y stays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Duplicates {
    /// The one with the least z.
    #[default]
    Lowest,
    /// The one with the greatest z.
    Highest,
    /// The one that is read first, in the order of the files.
    First,
}

/// What becomes of a job with a file that is no point cloud, is damaged, or has too many malformed records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OnBadFile {
    /// It stops with an error.
    #[default]
    Stop,
    /// It leaves the file out, all of it, and says so.
    Skip,
}

/// The unit of x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UnitChoice {
    /// As the CRS says; metres where there is none.
    #[default]
    Auto,
    /// 1 m.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The US survey foot, 1200/3937 m.
    UsFoot,
}

/// A rectangle [xmin, ymin, xmax, ymax] in source units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f64; 4]")]
pub struct SourceBounds(pub [f64; 4]);

/// The step of the lattice: `None` means "auto".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub struct ResolutionChoice(pub Option<Decimal>);

impl TryFrom<toml::Value> for ResolutionChoice {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<ResolutionChoice, String> {
        let number = match value {
            toml::Value::String(s) if s == "auto" => return Ok(ResolutionChoice(None)),
            toml::Value::Integer(i) => Some(Decimal::from(i)),
            toml::Value::Float(f) => shortest_decimal(f),
            _ => None,
        };
        match number {
            Some(step) if step > Decimal::ZERO => Ok(ResolutionChoice(Some(step))),
            _ => Err("resolution is \"auto\" or a positive number of source units, such as 0.01".into()),
        }
    }
}

impl From<ResolutionChoice> for toml::Value {
    fn from(resolution: ResolutionChoice) -> toml::Value {
        match resolution.0.and_then(|step| step.to_f64()) {
            None => toml::Value::String("auto".into()),
            Some(step) => toml::Value::Float(step),
        }
    }
}

/// A share between 0 and 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct Fraction(pub f64);

impl TryFrom<f64> for Fraction {
    type Error = String;

    fn try_from(share: f64) -> std::result::Result<Fraction, String> {
        if (0.0..=1.0).contains(&share) {
            Ok(Fraction(share))
        } else {
            Err(format!("a share lies between 0 and 1, not {share}"))
        }
    }
}

impl TryFrom<[f64; 4]> for SourceBounds {
    type Error = String;

    fn try_from(b: [f64; 4]) -> std::result::Result<SourceBounds, String> {
        if b.iter().any(|v| !v.is_finite()) || b[0] >= b[2] || b[1] >= b[3] {
            return Err(format!("bounds are [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax, not {b:?}"));
        }
        Ok(SourceBounds(b))
    }
}
