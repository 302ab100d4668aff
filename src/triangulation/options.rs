//! The options of `[triangulation]`.

use serde::{Deserialize, Serialize};

/// `[triangulation]`: how, never what: the mesh is the same whatever stands here.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TriangulationOptions {
    /// Who triangulates the tiles.
    pub backend: Backend,
    /// How many sites a tile holds at the most.
    #[serde(alias = "sites_per_tile")]
    pub max_points_per_tile: MaxPointsPerTile,
}

/// Who triangulates the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// The fastest this machine has.
    #[default]
    Auto,
    /// The discrete-VoronoiMethod pipeline on the CPU.
    Cpu,
    /// The discrete-VoronoiMethod pipeline on a GPU.
    Gpu,
    /// `spade` alone: slower, for tests and doubters.
    Reference,
}

/// How many sites a tile holds at the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "String")]
pub struct MaxPointsPerTile(pub u64);

impl MaxPointsPerTile {
    /// Keeps a leaf in the cache of one core while it is triangulated, and its vertices within 16-bit indices.
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

impl From<MaxPointsPerTile> for String {
    fn from(sites: MaxPointsPerTile) -> String {
        sites.0.to_string()
    }
}
