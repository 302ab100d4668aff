//! Cuts tiles that are wider than f32 can hold in the job's steps into parts, each with its own translation.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::axis_scale::NODE_REACH;
use crate::frame::{FINE_GRID, Frame, origin_between, short_origin};
use crate::tile::Tile;
use lattice::shortest_decimal;
use rust_decimal::Decimal;
use sys::{Error, Result};

/// The distance in steps between the origins of parts. Half of it and half a triangle stay within reach, unless the triangle is very
/// long.
const COARSE_GRID: i64 = 1 << 24;

/// The part of a tile that becomes one node and its mesh.
pub(crate) struct SplitNode<'a> {
    /// The node's translation in glTF steps.
    pub(crate) origin: [f64; 3],
    /// Whether 16 bits reach every vertex from the origin.
    pub(crate) short: bool,
    /// The vertices and triangles, all within reach of the origin.
    pub(crate) tile: Cow<'a, Tile>,
    /// The glTF coordinates of its vertices in steps, if the scene is bent.
    pub(crate) bent: Option<Vec<[f64; 3]>>,
    /// The least and the greatest of these coordinates.
    pub(crate) extent: [[f64; 3]; 2],
}

/// Where the vertices of a tile lie in the scene.
struct Places {
    /// The glTF coordinates in steps, if the scene is bent.
    bent: Option<Vec<[f64; 3]>>,
    /// The least and the greatest of these coordinates.
    extent: [[f64; 3]; 2],
}

impl Places {
    /// Returns where the vertices of `tile` lie, in the memory of `steps`. `None` without vertices.
    fn of(frame: &Frame, tile: &Tile, steps: Vec<[f64; 3]>) -> Option<Places> {
        let bounds = tile.bounds()?;
        let bent = frame.bent_steps(&tile.positions, steps);
        // On the plane the map is monotonic.
        let extent = match &bent {
            Some(bent) => extent_of(bent.iter().copied()),
            None => extent_of([bounds.min, bounds.max].map(|point| frame.steps(point)).into_iter()),
        };
        Some(Places { bent, extent })
    }

    /// Returns the part that is all of `tile`, whose places these are.
    fn into_part(self, tile: Cow<Tile>, origin: [f64; 3], short: bool) -> SplitNode {
        let Places { bent, extent } = self;
        SplitNode { origin, short, tile, bent, extent }
    }
}

/// Returns the least and the greatest coordinates.
fn extent_of(places: impl Iterator<Item = [f64; 3]>) -> [[f64; 3]; 2] {
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    places.fold(none, |[low, high], place| {
        [[0, 1, 2].map(|k| low[k].min(place[k])), [0, 1, 2].map(|k| high[k].max(place[k]))]
    })
}

/// Returns the parts of `tile`, each within reach of f32. A tile that is small enough is one part. Their places take the memory of `steps`.
///
/// # Errors
/// [`Error::Config`] if a single triangle is too long.
pub(crate) fn split<'a>(frame: &Frame, tile: &'a Tile, steps: Vec<[f64; 3]>) -> Result<Vec<SplitNode<'a>>> {
    let Some(places) = Places::of(frame, tile, steps) else { return Ok(Vec::new()) };
    split_at(frame, tile, places)
}

fn split_at<'a>(frame: &Frame, tile: &'a Tile, places: Places) -> Result<Vec<SplitNode<'a>>> {
    if let Some(origin) = common_origin(places.extent, FINE_GRID) {
        return Ok(vec![places.into_part(Cow::Borrowed(tile), origin, false)]);
    }
    split_triangles(frame, tile, &tile.triangles)
}

/// Returns the parts of these triangles of `tile`.
fn split_triangles(frame: &Frame, tile: &Tile, triangles: &[[u32; 3]]) -> Result<Vec<SplitNode<'static>>> {
    let mut groups = BTreeMap::<[i64; 3], Vec<[u32; 3]>>::new();
    for &triangle in triangles {
        let corners = triangle.map(|v| tile.positions[v as usize]);
        let extent = extent_of(corners.iter().map(|&corner| frame.steps(corner)));
        let origin = common_origin(extent, COARSE_GRID)
            .or_else(|| common_origin(extent, FINE_GRID))
            .ok_or_else(|| too_long(frame, corners))?;
        groups.entry(origin.map(|v| v as i64)).or_default().push(triangle);
    }
    let part = |(origin, triangles): ([i64; 3], _)| {
        let tile = tile.subset(triangles);
        let places = Places::of(frame, &tile, Vec::new())?;
        Some(places.into_part(Cow::Owned(tile), origin.map(|v| v as f64), false))
    };
    Ok(groups.into_iter().filter_map(part).collect())
}

/// Returns one part with 16-bit positions if they reach all of `tile`, else what [`split`] does.
///
/// # Errors
/// As [`split`].
pub(crate) fn split_short<'a>(frame: &Frame, tile: &'a Tile, steps: Vec<[f64; 3]>) -> Result<Vec<SplitNode<'a>>> {
    let Some(places) = Places::of(frame, tile, steps) else { return Ok(Vec::new()) };
    let [low, high] = places.extent;
    match short_origin(low, high) {
        Some(origin) => Ok(vec![places.into_part(Cow::Borrowed(tile), origin, true)]),
        None => split_at(frame, tile, places),
    }
}

/// Returns the origin on `grid` next to the middle between `low` and `high`, in steps, if both are within reach of it.
fn common_origin([low, high]: [[f64; 3]; 2], grid: i64) -> Option<[f64; 3]> {
    let origin = origin_between(low, high, grid);
    let reach = (NODE_REACH + FINE_GRID / 2) as f64;
    (0..3).all(|k| high[k] - origin[k] <= reach && origin[k] - low[k] <= reach).then_some(origin)
}

fn too_long(frame: &Frame, corners: [[i32; 3]; 3]) -> Error {
    let [low, high] = extent_of(corners.iter().map(|&corner| frame.steps(corner)));
    let (length, limit) = (frame.metres([0, 1, 2].map(|k| high[k] - low[k])), frame.longest_triangle());
    let factor = [length[0] / limit[0], length[2] / limit[0], length[1] / limit[1]].into_iter().fold(1.0, f64::max);
    let extras = frame.extras();
    let (resolution, axes, key, extent) = if length[1] / limit[1] == factor {
        (extras.resolution_z, "in z", "resolution_z", length[1])
    } else {
        (extras.resolution, "in x and y", "resolution", length[0].max(length[2]))
    };
    let workable = coarser(resolution, factor);
    Error::Config(format!(
        "a triangle that is {extent:.1} m long cannot be written exactly with a resolution of {resolution} {axes} \
         (glTF has 24 binary digits for a coordinate): set [input] {key} = {workable} or coarser, or leave out \
         the far-off points with bounds"
    ))
}

/// Returns `resolution` times the least power of ten that makes room for a triangle `factor` times too long.
fn coarser(resolution: f64, factor: f64) -> String {
    // Ten times the resolution gives at least eight times the step, a power of two.
    let room = std::iter::successors(Some(8.0), |room| Some(room * 8.0));
    let tens = 1 + room.take_while(|room| *room < factor).take(19).count() as i32;
    let exact = shortest_decimal(resolution).and_then(|r| (0..tens).try_fold(r, |r, _| r.checked_mul(Decimal::TEN)));
    exact.map_or_else(|| format!("{:e}", resolution * 10f64.powi(tens)), |r| r.normalize().to_string())
}
