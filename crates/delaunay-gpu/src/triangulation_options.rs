//! The options of `[triangulation]`.

use serde::{Deserialize, Serialize};

/// `[triangulation]`: how the mesh is computed. The mesh is the same with every choice.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TriangulationOptions {
    /// What triangulates the tiles.
    pub backend: Backend,
    /// The most sites that a tile holds.
    #[serde(alias = "sites_per_tile")]
    pub max_points_per_tile: MaxPointsPerTile,
    /// About how many points a part of the job has.
    pub max_points_per_part: MaxPointsPerPart,
}

/// What triangulates the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// The fastest backend of this machine.
    #[default]
    Auto,
    /// The discrete-Voronoi pipeline on the CPU.
    Cpu,
    /// The discrete-Voronoi pipeline on a GPU.
    Gpu,
    /// `spade` alone: slower, and quadratic on sites along lines; for tests and comparisons.
    Reference,
}

/// About how many points a part of the job has, as far as the headers tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "i64", into = "i64")]
pub struct MaxPointsPerPart(pub u64);

impl MaxPointsPerPart {
    /// Returns the most points of a job of one part. With a few more than a part has, two parts would be small.
    pub fn most_in_one_part(self) -> u64 {
        self.0 / 2 * 3
    }
}

impl Default for MaxPointsPerPart {
    /// A part of this size takes half a minute of one core and less than a gigabyte of disk, and what parts cost besides their points is
    /// little.
    fn default() -> MaxPointsPerPart {
        MaxPointsPerPart(20_000_000)
    }
}

impl TryFrom<i64> for MaxPointsPerPart {
    type Error = String;

    fn try_from(points: i64) -> std::result::Result<MaxPointsPerPart, String> {
        match points {
            100..=1_000_000_000_000 => Ok(MaxPointsPerPart(points as u64)),
            _ => Err("max_points_per_part is a whole number from 100 to 1000000000000".into()),
        }
    }
}

impl From<MaxPointsPerPart> for i64 {
    fn from(points: MaxPointsPerPart) -> i64 {
        points.0 as i64
    }
}

/// The most sites that a tile holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub struct MaxPointsPerTile(pub u64);

impl MaxPointsPerTile {
    /// With this many sites, a leaf stays in the cache of one core while it is triangulated, and 16-bit indices reach its vertices.
    const AUTO: MaxPointsPerTile = MaxPointsPerTile(50_000);
}

impl Default for MaxPointsPerTile {
    fn default() -> MaxPointsPerTile {
        MaxPointsPerTile::AUTO
    }
}

impl TryFrom<toml::Value> for MaxPointsPerTile {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<MaxPointsPerTile, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(MaxPointsPerTile::AUTO),
            toml::Value::Integer(sites @ 3..=50_000_000) => Ok(MaxPointsPerTile(sites as u64)),
            _ => Err("max_points_per_tile is \"auto\" or a whole number from 3 to 50000000".into()),
        }
    }
}

impl From<MaxPointsPerTile> for toml::Value {
    fn from(points: MaxPointsPerTile) -> toml::Value {
        toml::Value::Integer(points.0 as i64)
    }
}
