//! `[output] height_offset`.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use sys::path_text::{decoded, encoded};

/// The greatest offset in metres. No datum is that far from the ellipsoid, and f64 would lose the digits that let tiles meet.
const MOST_METRES: f64 = 100_000.0;

/// What to add to heights so that they count from the ellipsoid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum HeightOffset {
    /// This many metres everywhere.
    Metres(f64),
    /// The geoid of the Earth Gravitational Model 1996.
    Egm96,
    /// The geoid in this file, a grid in the format GTX or GeoTIFF.
    Grid(PathBuf),
}

impl HeightOffset {
    /// Returns whether it is the model of a geoid, and not a number.
    pub fn is_model(&self) -> bool {
        !matches!(self, HeightOffset::Metres(_))
    }

    /// Returns the path of the grid.
    pub fn grid(&self) -> Option<&Path> {
        if let HeightOffset::Grid(path) = self { Some(path) } else { None }
    }

    /// Returns the path of the grid, to be changed.
    pub fn grid_mut(&mut self) -> Option<&mut PathBuf> {
        if let HeightOffset::Grid(path) = self { Some(path) } else { None }
    }
}

impl TryFrom<toml::Value> for HeightOffset {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<HeightOffset, String> {
        let metres = match value {
            toml::Value::String(text) if text == "egm96" => return Ok(HeightOffset::Egm96),
            toml::Value::String(text) if is_grid(&text) => return Ok(HeightOffset::Grid(decoded(&text).into())),
            toml::Value::Integer(metres) => metres as f64,
            toml::Value::Float(metres) => metres,
            _ => f64::NAN,
        };
        match metres.abs() <= MOST_METRES {
            true => Ok(HeightOffset::Metres(metres)),
            false => Err(format!(
                "height_offset is a number of metres from -{MOST_METRES} to {MOST_METRES}, \"egm96\", or the path of a geoid grid \
                 that ends in .gtx or .tif"
            )),
        }
    }
}

impl From<HeightOffset> for toml::Value {
    fn from(offset: HeightOffset) -> toml::Value {
        match offset {
            HeightOffset::Metres(metres) => toml::Value::Float(metres),
            HeightOffset::Egm96 => toml::Value::String("egm96".into()),
            HeightOffset::Grid(path) => toml::Value::String(encoded(path.as_os_str())),
        }
    }
}

fn is_grid(name: &str) -> bool {
    let ending = Path::new(name).extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| ["gtx", "tif", "tiff"].contains(&ending.as_str()))
}
