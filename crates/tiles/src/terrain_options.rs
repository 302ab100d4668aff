//! The options of `[output.terrain]`.

use serde::{Deserialize, Serialize};

/// `[output.terrain]`: tiles for globes that take their ground from a terrain service.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainOptions {
    /// The format of the tiles.
    pub format: TerrainFormat,
}

/// A format of terrain tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TerrainFormat {
    /// Quantized-mesh 1.0, in the geographic tiles of a tile map service.
    #[serde(rename = "quantized-mesh")]
    QuantizedMesh,
}
