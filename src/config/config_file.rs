//! A configuration file as TOML has it, with old names.

use delaunay_gpu::options::{TextureSide, VoronoiMethod};
use delaunay_gpu::triangulation_options::{Backend, MaxPointsPerPart, MaxPointsPerTile};
use job::options::Limits;
use points::lines::options::LineOptions;
use points::options::InputOptions;
use serde::Deserialize;
use tiles::options::OutputOptions;

/// A configuration file as it was written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ConfigFile {
    pub(crate) input: InputOptions,
    #[serde(default)]
    pub(crate) breaklines: Vec<LineOptions>,
    #[serde(default)]
    pub(crate) triangulation: TriangulationTable,
    #[serde(default)]
    pub(crate) gpu: GpuTable,
    pub(crate) output: OutputOptions,
    #[serde(default)]
    pub(crate) limits: Limits,
}

/// `[triangulation]`, with the keys that are in `[gpu]` now.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct TriangulationTable {
    pub(crate) backend: Backend,
    #[serde(alias = "sites_per_tile")]
    pub(crate) max_points_per_tile: MaxPointsPerTile,
    pub(crate) max_points_per_part: MaxPointsPerPart,
    pub(crate) voronoi: Option<VoronoiMethod>,
    pub(crate) adapter: Option<String>,
    pub(crate) texture: Option<TextureSide>,
}

/// `[gpu]`. Older configurations have these keys in `[triangulation]`.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct GpuTable {
    pub(crate) voronoi: Option<VoronoiMethod>,
    pub(crate) adapter: Option<String>,
    pub(crate) texture: Option<TextureSide>,
}
