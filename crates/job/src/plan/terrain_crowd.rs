//! How many vertices the most crowded terrain tile has, by a sample of the points before they are read, and whether the memory has room for them.
//!
//! The finest zoom follows the mean density. So a place that is far denser than the rest gives one tile far more vertices than others.

use crate::options::JobOptions;
use crate::plan::budget::{limit_for, working_memory};
use crate::plan::globe_system::globe_system;
use crate::progress::number_text::{grouped, mebibytes};
use crs::Crs;
use delaunay::geometry::Site;
use quantized_mesh::{SPAN, Scheme, TileGrid, finest_zoom};
use std::collections::{HashMap, HashSet};
use tiles::frame::Frame;
use tiles::options::MaxEdge;
use tiles::terrain_options::TerrainScheme;

/// Bytes that a vertex takes, with its triangles, while its tile is joined from pieces: most of all where rounding has folded triangles.
pub(crate) const BYTES_PER_VERTEX: u64 = 216;

/// Bytes that a vertex of the tiles below one takes while that one is made.
pub(crate) const BYTES_TO_SELECT: u64 = 80;

/// Bytes that the process has by then, and those that each thread takes besides its tile.
const PROCESS: u64 = 72 << 20;
const PER_THREAD: u64 = 8 << 20;

/// A tile where fewer places of the sample have points tells nothing for sure.
const SURE_PLACES: usize = 4;

/// For sure there are this part of the vertices that the sample shows.
const SURELY: f64 = 0.5;

/// There may be so many times as many.
const POSSIBLY: f64 = 1.25;

/// The vertices of the most crowded terrain tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TerrainCrowd {
    /// How many there are for sure.
    least: u64,
    /// About how many there are at most.
    about: u64,
}

/// What is known of a cloud before its points are read.
pub(crate) struct SampledCloud<'a> {
    pub(crate) crs: &'a Crs,
    pub(crate) frame: &'a Frame,
    /// The points that the job keeps of the sample.
    pub(crate) sample: &'a [(Site, i32)],
    /// So many points of it, at most, follow one another.
    pub(crate) of_place: usize,
    /// The records that are decoded, and those that the sample has seen.
    pub(crate) records: u64,
    pub(crate) seen: u64,
}

/// Returns the tiling scheme that the user wants, if the user wants terrain tiles.
pub(crate) fn scheme_of(options: &JobOptions) -> Option<Scheme> {
    options.output.terrain.map(|terrain| match terrain.scheme {
        TerrainScheme::Geographic => Scheme::Geographic,
        TerrainScheme::WebMercator => Scheme::WebMercator,
    })
}

impl TerrainCrowd {
    /// Estimates the vertices of the most crowded tile; `None` if there are to be no terrain tiles, or nothing is known.
    pub(crate) fn of(cloud: &SampledCloud, options: &JobOptions) -> Option<TerrainCrowd> {
        let scheme = scheme_of(options)?;
        let extras = cloud.frame.extras();
        let system = globe_system(cloud.crs, extras.metres_per_unit).ok()?;
        let place = |site: &Site| {
            let along = |axis: usize| extras.offset[axis] + extras.resolution * f64::from(site[axis]);
            (system.way)([along(0), along(1)])
        };
        let placed: Vec<(usize, Site, [f64; 2])> =
            (0..).zip(cloud.sample).filter_map(|(i, (site, _))| Some((i, *site, place(site)?))).collect();
        let (_, _, [_, latitude]) = *placed.get(placed.len() / 2)?;
        let times = (cloud.records as f64 / cloud.seen.max(1) as f64).max(1.0);
        let all = (placed.len() as f64 * times) as u64;
        let whole = box_area(placed.iter().map(|(_, site, _)| *site)) * cloud.frame.resolution_metres()[0].powi(2);
        // A terrain covers at least half of its box. In less area, tiles are smaller.
        let [fine, coarse] = [whole / 2.0, whole].map(|area| finest_zoom(scheme, area, all, latitude));
        let most = |zoom: u8| {
            let of_zoom = |zoom: u8| most_in_a_tile((scheme, zoom), &placed, (times, cloud.of_place));
            // The tile above takes less for each vertex, and may have those of four.
            let above =
                of_zoom(zoom.saturating_sub(1)).map(|most| most * (BYTES_TO_SELECT as f64 / BYTES_PER_VERTEX as f64));
            let own = of_zoom(zoom);
            [own[0].max(above[0]), own[1].max(above[1])]
        };
        let ([_, least], [about, _]) = (most(fine), most(coarse));
        // Which points are vertices is not known then, or which of the ground is terrain.
        let is_whole = options.output.max_edge == MaxEdge::default() && options.input.clip.is_none();
        let is_sure = is_whole && !options.leaves_points_out();
        let least = if is_sure { least * SURELY } else { 0.0 };
        Some(TerrainCrowd { least: least as u64, about: (about * POSSIBLY) as u64 })
    }

    /// Returns what is wrong if the memory has no room for the vertices that there are for sure.
    pub(crate) fn too_many(self, options: &JobOptions) -> Option<String> {
        (!has_room(options, self.least)).then(|| {
            format!(
                "[output.terrain] takes at least {} for one terrain tile with at least {} points: [limits] memory = \"{}\" has no room for it; fix: {}",
                mebibytes(bytes_of(self.least)),
                grouped(self.least),
                options.limits.memory,
                self.remedy(options)
            )
        })
    }

    /// Returns a warning if the memory may have no room.
    pub(crate) fn warning(self, options: &JobOptions) -> Option<String> {
        (!has_room(options, self.about)).then(|| {
            format!(
                "[output.terrain] may stop for lack of memory: one terrain tile has up to about {} vertices, which take {}: [limits] memory = \
                 \"{}\" may have no room for them; fix: {}",
                grouped(self.about),
                mebibytes(bytes_of(self.about)),
                options.limits.memory,
                self.remedy(options)
            )
        })
    }

    /// Returns the bytes that the tile takes.
    pub(crate) fn bytes(self) -> u64 {
        bytes_of(self.about)
    }

    fn remedy(self, options: &JobOptions) -> String {
        remedy(bytes_of(self.about.max(self.least)), beside(options))
    }
}

/// Returns what a user can do about a tile that takes so many bytes, where so many are taken beside it.
pub(crate) fn remedy(bytes: u64, beside: u64) -> String {
    // Three quarters of a limit are for work.
    let working = bytes.max(bytes.saturating_add(beside).div_ceil(4).saturating_mul(3));
    format!(
        "[limits] memory = \"{}\", or fewer points where they are densest, for example by [output] max_error or without the files of that place",
        limit_for(working)
    )
}

/// Returns the bytes that are taken beside terrain tiles.
pub(crate) fn beside(options: &JobOptions) -> u64 {
    PROCESS + PER_THREAD * options.threads() as u64
}

/// Returns the bytes that terrain tiles may take at one time.
pub(crate) fn room_for_tiles(options: &JobOptions) -> u64 {
    working_memory(options).min(options.limits.memory.0.saturating_sub(beside(options)))
}

fn has_room(options: &JobOptions, vertices: u64) -> bool {
    bytes_of(vertices) <= room_for_tiles(options)
}

fn bytes_of(vertices: u64) -> u64 {
    vertices.saturating_mul(BYTES_PER_VERTEX)
}

/// Returns the area of the box around sites in square steps.
fn box_area(sites: impl Iterator<Item = Site>) -> f64 {
    let ends = sites.fold([[i32::MAX; 2], [i32::MIN; 2]], |[min, max], site| {
        [[0, 1].map(|axis: usize| min[axis].min(site[axis])), [0, 1].map(|axis: usize| max[axis].max(site[axis]))]
    });
    [0, 1].map(|axis: usize| f64::from(ends[1][axis].saturating_sub(ends[0][axis]).max(1))).iter().product()
}

/// Returns about how many vertices a tile of a zoom has at most, and how many where enough places of the sample have points in it. A point stands for
/// `times` as many.
fn most_in_a_tile(
    (scheme, zoom): (Scheme, u8),
    placed: &[(usize, Site, [f64; 2])],
    (times, of_place): (f64, usize),
) -> [f64; 2] {
    let mut grid = TileGrid::new(scheme, zoom);
    let mut tiles: HashMap<[i64; 2], (Vec<Site>, HashSet<usize>)> = HashMap::new();
    for (number, site, place) in placed {
        let Some(point) = grid.nearest(*place, 0.0) else { continue };
        let (sites, places) = tiles.entry([point.x, point.y].map(|along| along.div_euclid(SPAN))).or_default();
        sites.push(*site);
        places.insert(number / of_place.max(1));
    }
    let found = tiles.into_values().map(|(sites, places)| {
        let vertices = vertices_of(sites, times);
        [vertices, if places.len() >= SURE_PLACES || times == 1.0 { vertices } else { 0.0 }]
    });
    found.fold([0.0; 2], |[most, sure], [more, surer]| [most.max(more), sure.max(surer)])
}

/// Returns about how many vertices there are where a sample has these sites, of which each stands for `times` as many points. Points of the same place
/// become one vertex, and the more of the sample do, the fewer places there are (the birthday problem).
fn vertices_of(mut sites: Vec<Site>, times: f64) -> f64 {
    let points = sites.len() as f64;
    sites.sort_unstable();
    sites.dedup();
    let distinct = sites.len() as f64;
    if times == 1.0 {
        return distinct;
    }
    let places = (points * points / (2.0 * (points - distinct + 1.0))).max(distinct);
    places * (1.0 - libm::exp(-points * times / places))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Limits, MemoryLimit};

    fn options(memory: u64) -> JobOptions {
        let text = r#"{"input":{"files":[]},"triangulation":{"backend":"auto"},
            "gpu":{"voronoi":"auto","adapter":null,"texture":"auto"},"output":{"directory":"out"},"limits":{}}"#;
        let options: JobOptions = serde_json::from_str(text).unwrap();
        JobOptions { limits: Limits { memory: MemoryLimit(memory), ..Limits::default() }, ..options }
    }

    #[test]
    fn the_memory_that_a_message_names_has_room_for_the_tile() {
        let crowd = TerrainCrowd { least: 1_000_000, about: 2_500_000 };
        let small = options(512 << 20);
        for why in [crowd.too_many(&small).unwrap(), crowd.warning(&small).unwrap()] {
            let (_, after) = why.rsplit_once("memory = \"").unwrap();
            let limit = MemoryLimit::try_from(after.split_once('"').unwrap().0.to_string()).unwrap();
            let raised = options(limit.0);
            assert_eq!((crowd.too_many(&raised), crowd.warning(&raised)), (None, None), "{why}");
        }
        assert_eq!(TerrainCrowd { least: 800_000, about: 800_000 }.warning(&small), None);
    }

    #[test]
    fn points_of_one_place_are_one_vertex() {
        let apart: Vec<Site> = (0..5_000).map(|i| [i % 71 * 1_000, i / 71 * 1_000]).collect();
        assert!(vertices_of(apart, 100.0) > 450_000.0);
        assert!(vertices_of(vec![[3, 4]; 5_000], 100.0) < 5_000.0);
        // A hundred thousand places, each with five points of all.
        let mut random = 1u64;
        let few: Vec<Site> = (0..5_000)
            .map(|_| {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                [(random >> 33) as i32 % 100_000, 0]
            })
            .collect();
        let vertices = vertices_of(few, 100.0);
        assert!((60_000.0..200_000.0).contains(&vertices), "{vertices}");
    }

    #[test]
    fn the_most_crowded_tile_is_found() {
        // A tile of zoom 12 is 0.044 degrees wide.
        let place = |i: usize| [0.2, 0.8].map(|angle: f64| angle + (i % 50) as f64 * 1e-7);
        let wide = (0..500).map(|i| (i, [i as i32, 7], [0.1 + i as f64 * 1e-3, 0.7]));
        let crowd = (500..4_500).map(|i| (i, [i as i32, 9], place(i)));
        let placed: Vec<(usize, Site, [f64; 2])> = wide.chain(crowd).collect();
        let most = |of_place| most_in_a_tile((Scheme::Geographic, 12), &placed, (50.0, of_place));
        let [about, sure] = most(512);
        assert!((190_000.0..210_000.0).contains(&about) && about == sure, "{about} {sure}");
        assert!(most(4_000)[1] < 100_000.0, "few places show nothing for sure");
    }
}
