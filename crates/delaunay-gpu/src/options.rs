//! The options of `[gpu]`.

use serde::{Deserialize, Serialize};

/// `[gpu]`: how a GPU is used. The mesh is the same with every choice.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GpuOptions {
    /// How a GPU computes the discrete Voronoi diagram.
    pub voronoi: VoronoiMethod,
    /// A part of the name of the GPU to use. `None` takes the one that the environment names, or the fastest kind.
    pub adapter: Option<String>,
    /// The side of the pipeline's texture on a GPU.
    pub texture: TextureSide,
}

/// How a GPU computes the discrete Voronoi diagram. The mesh is the same either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VoronoiMethod {
    /// The exact transform, because it is faster.
    #[default]
    Auto,
    /// The exact transform: columns, then rows.
    Exact,
    /// Jump flooding, 1+JFA, as in the paper.
    Jfa,
}

/// The side of the texture on a GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum TextureSide {
    /// Chosen by the number of sites, within what the adapter supports.
    #[default]
    Auto,
    /// The largest that fits: at most 16,384 pixels, and what the device allows.
    Max,
    /// This many pixels; more than 16,384 are 16,384.
    Side(u32),
}

impl TryFrom<toml::Value> for TextureSide {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<TextureSide, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(TextureSide::Auto),
            toml::Value::String(s) if s == "max" => Ok(TextureSide::Max),
            toml::Value::Integer(side @ 64..=65_536) => Ok(TextureSide::Side(side as u32)),
            _ => Err("texture is \"auto\", \"max\" or a side from 64 to 65536 pixels".into()),
        }
    }
}

impl From<TextureSide> for toml::Value {
    fn from(texture: TextureSide) -> toml::Value {
        match texture {
            TextureSide::Auto => toml::Value::String("auto".into()),
            TextureSide::Max => toml::Value::String("max".into()),
            TextureSide::Side(side) => toml::Value::Integer(side.into()),
        }
    }
}
