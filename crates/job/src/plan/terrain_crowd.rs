//! What a sample of the points shows of terrain tiles before they are read: how many vertices the most crowded one has, whether the memory has room for
//! them, and how far the terrain reaches around the globe.
//!
//! The finest zoom follows the mean density. So a place that is far denser than the rest gives one tile far more vertices than others.

use crate::options::JobOptions;
use crate::plan::budget::{limit_for, working_memory};
use crate::plan::terrain_sample::{Placed, SampledCloud};
use crate::progress::number_text::{grouped, mebibytes};
use quantized_mesh::{Scheme, finest_zoom};
use tiles::options::MaxEdge;
use tiles::terrain_options::TerrainScheme;

/// Bytes that a vertex takes, with its triangles, while its tile is joined from pieces: most of all where rounding has folded triangles.
pub(crate) const BYTES_PER_VERTEX: u64 = 216;

/// Bytes that a vertex of the tiles below one takes while that one is made.
pub(crate) const BYTES_TO_SELECT: u64 = 80;

/// Bytes that the process has by then, and those that each thread takes besides its tile. The steps before take more where the limit is greater, and the
/// allocator keeps a share of the limit of that.
const PROCESS: u64 = 72 << 20;
const PER_THREAD: u64 = 8 << 20;
const KEPT_SHARE: u64 = 8;

/// Ordinary tiles take less, and have room in any memory.
const LEAST_ROOM: u64 = 8 << 20;

/// So many times as many vertices as a tile has wait in pieces: those along the borders of tiles of the job wait in several.
const IN_PIECES: f64 = 1.03;

/// What a sample of the points tells of terrain tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TerrainCrowd {
    /// How many vertices the most crowded tile has, at most, as far as the sample shows it well.
    shown: u64,
    /// How many it may have.
    possible: u64,
    /// How many degrees of longitude the points span: twice as many as they are from the middle of all, at most.
    pub(crate) longitudes: f64,
    /// How many degrees north or south of the equator the points are, at most.
    pub(crate) latitude: f64,
}

/// Returns the tiling scheme that the user wants, if the user wants terrain tiles.
pub(crate) fn scheme_of(options: &JobOptions) -> Option<Scheme> {
    options.output.terrain.map(|terrain| match terrain.scheme {
        TerrainScheme::Geographic => Scheme::Geographic,
        TerrainScheme::WebMercator => Scheme::WebMercator,
    })
}

impl TerrainCrowd {
    /// Looks at the sample of a cloud; `None` if there are to be no terrain tiles, or nothing is known.
    pub(crate) fn of(cloud: &SampledCloud, options: &JobOptions) -> Option<TerrainCrowd> {
        let scheme = scheme_of(options)?;
        let placed = Placed::of(cloud)?;
        let [least, most] = placed.areas;
        let finer = finest_zoom(scheme, least, placed.points(), placed.middle[1]);
        let vertices = placed.vertices((scheme, finer));
        let zooms = [least, most].map(|area| finest_zoom(scheme, area, vertices, placed.middle[1]));
        let of_tiles = |zoom: u8| {
            let [shown, possible] = placed.most_in_a_tile((scheme, zoom));
            // The tile above takes less for each vertex, and may have those of four.
            let above = placed.most_in_a_tile((scheme, zoom.saturating_sub(1)));
            let above = above.map(|most| most * (BYTES_TO_SELECT as f64 / BYTES_PER_VERTEX as f64));
            [shown.max(above[0]), possible.max(above[1])].map(|most| (most * IN_PIECES) as u64)
        };
        let [[_, finest], [shown, possible]] = zooms.map(of_tiles);
        // Which points are vertices is not known then, or which of the ground is terrain.
        let is_whole = options.output.max_edge == MaxEdge::default() && options.input.clip.is_none();
        let is_sure = is_whole && !options.leaves_points_out() && placed.shows_all;
        let shown = if is_sure { shown } else { 0 };
        Some(TerrainCrowd {
            shown,
            possible: possible.max(finest),
            longitudes: placed.longitudes,
            latitude: placed.latitude,
        })
    }

    /// Returns what is wrong if the memory has no room for the vertices that the sample shows.
    pub(crate) fn too_many(self, options: &JobOptions) -> Option<String> {
        (!has_room(options, self.shown)).then(|| {
            format!(
                "[output.terrain] takes up to about {} for one terrain tile with up to about {} vertices: [limits] memory = \"{}\" has no room for it; \
                 fix: {}",
                mebibytes(bytes_of(self.shown)),
                grouped(self.shown),
                options.limits.memory,
                remedy(bytes_of(self.shown), options)
            )
        })
    }

    /// Returns a warning if the memory may have no room.
    pub(crate) fn warning(self, options: &JobOptions) -> Option<String> {
        (!has_room(options, self.possible)).then(|| {
            format!(
                "[output.terrain] may stop for lack of memory: one terrain tile has up to about {} vertices, which take {}: [limits] memory = \
                 \"{}\" may have no room for them; fix: {}",
                grouped(self.possible),
                mebibytes(bytes_of(self.possible)),
                options.limits.memory,
                remedy(bytes_of(self.possible), options)
            )
        })
    }

    /// Returns the bytes that the tile takes.
    pub(crate) fn bytes(self) -> u64 {
        bytes_of(self.possible)
    }
}

/// Returns what a user can do about a tile that takes so many bytes.
pub(crate) fn remedy(bytes: u64, options: &JobOptions) -> String {
    // The other way round than in `room_for_tiles`.
    let limit = bytes.saturating_add(fixed(options)).div_ceil(KEPT_SHARE - 1).saturating_mul(KEPT_SHARE);
    format!(
        "[limits] memory = \"{}\", or fewer points where they are densest, for example by [output] max_error or without the files of that place",
        limit_for(bytes.max(limit.div_ceil(4).saturating_mul(3)))
    )
}

/// Returns the bytes that are taken beside terrain tiles, whatever the limit.
fn fixed(options: &JobOptions) -> u64 {
    PROCESS + PER_THREAD * options.threads() as u64
}

/// Returns the bytes that terrain tiles may take at one time.
pub(crate) fn room_for_tiles(options: &JobOptions) -> u64 {
    let limit = options.limits.memory.0;
    let beside = fixed(options).saturating_add(limit / KEPT_SHARE);
    working_memory(options).min(limit.saturating_sub(beside)).max(LEAST_ROOM)
}

fn has_room(options: &JobOptions, vertices: u64) -> bool {
    bytes_of(vertices) <= room_for_tiles(options)
}

fn bytes_of(vertices: u64) -> u64 {
    vertices.saturating_mul(BYTES_PER_VERTEX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Limits, MemoryLimit, Threads};

    fn options(memory: u64) -> JobOptions {
        let text = r#"{"input":{"files":[]},"triangulation":{"backend":"auto"},
            "gpu":{"voronoi":"auto","adapter":null,"texture":"auto"},"output":{"directory":"out"},"limits":{}}"#;
        let options: JobOptions = serde_json::from_str(text).unwrap();
        let limits = Limits { memory: MemoryLimit(memory), threads: Threads(2), ..Limits::default() };
        JobOptions { limits, ..options }
    }

    #[test]
    fn the_memory_that_a_message_names_has_room_for_the_tile() {
        for vertices in [60_000, 250_000, 1_000_000, 2_500_000, 60_000_000] {
            let crowd = TerrainCrowd { shown: vertices, possible: vertices, longitudes: 0.0, latitude: 0.0 };
            let small = options(64 << 20);
            for why in [crowd.too_many(&small).unwrap(), crowd.warning(&small).unwrap()] {
                let (_, after) = why.rsplit_once("memory = \"").unwrap();
                let limit = MemoryLimit::try_from(after.split_once('"').unwrap().0.to_string()).unwrap();
                let raised = options(limit.0);
                assert_eq!((crowd.too_many(&raised), crowd.warning(&raised)), (None, None), "{why}");
                assert!(crowd.too_many(&options(limit.0 - (64 << 20))).is_some(), "{why}");
            }
        }
    }

    #[test]
    fn an_ordinary_tile_has_room_in_the_least_memory() {
        let crowd = TerrainCrowd { shown: 32_000, possible: 32_000, longitudes: 0.0, latitude: 0.0 };
        assert_eq!(crowd.too_many(&options(64 << 20)), None);
    }
}
