//! The options of `[output.terrain]`.

use serde::{Deserialize, Serialize};

/// `[output.terrain]`: tiles for globes that take their ground from a terrain service.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainOptions {
    /// The format of the tiles.
    pub format: TerrainFormat,
    /// The tiling scheme.
    #[serde(default, skip_serializing_if = "TerrainScheme::is_default")]
    pub scheme: TerrainScheme,
}

/// A format of terrain tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TerrainFormat {
    /// Quantized-mesh 1.0, in tiles of a tile map service.
    #[serde(rename = "quantized-mesh")]
    QuantizedMesh,
}

/// A tiling scheme.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TerrainScheme {
    /// In degrees (EPSG:4326).
    #[default]
    Geographic,
    /// The tiles of web maps (EPSG:3857).
    WebMercator,
}

impl TerrainScheme {
    fn is_default(&self) -> bool {
        *self == TerrainScheme::default()
    }
}
