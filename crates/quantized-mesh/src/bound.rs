//! How close the tiles of a zoom are to the triangulation.

use crate::place::HEIGHT_STEPS;
use crate::scheme::Scheme;

/// The error in metres that viewers expect of zoom 0 of the geographic scheme; that of each next zoom is half of the one before. CesiumJS estimates it
/// so: the length of the equator, divided by 2 tiles of 64 cells, a quarter of that.
pub const LEVEL_ZERO_ERROR: f64 = 77_067.339_6;

/// The part of the expected error that one step to a coarser zoom may add. All finer zooms together may add about as much again: a pixel where viewers
/// allow two.
const SHARE: f64 = 0.25;

/// Returns the bound that the vertices of a zoom are selected by, in steps of height.
pub(crate) fn steps(scheme: Scheme, zoom: u8) -> u64 {
    // Where a tile is as wide, viewers expect as much.
    ((LEVEL_ZERO_ERROR * SHARE * HEIGHT_STEPS) as u64) << scheme.delay() >> zoom
}

/// The most vertices that a tile of the finest zoom has on average.
const VERTICES_PER_TILE: f64 = 16_384.0;

/// The greatest zoom of the geographic scheme: a tile is 19 metres high there, and a step is half a millimetre.
const MOST_ZOOM: u8 = 20;

/// Tiles of smaller zooms of the geographic scheme have vertices at least in a grid, so that they follow the curve of the earth. All finest tiles are flat enough without.
pub(crate) const FIRST_FLAT_ZOOM: u8 = 10;

/// From this zoom of the geographic scheme on, no tile is missing around those that hold some of the terrain. It has 16 columns, of which the terrain has
/// 5 at most. At coarser ones viewers expect errors that are greater than the height of any mountain.
pub const FIRST_SURROUNDED_ZOOM: u8 = 3;

/// Returns the coarsest zoom, from 10 of the geographic scheme on, whose tiles have no more than some 16,000 vertices on average, at a latitude in
/// radians. `area` is that of the terrain in square metres, with so many vertices.
pub fn finest_zoom(scheme: Scheme, area: f64, vertices: u64, latitude: f64) -> u8 {
    let per_vertex = area / vertices.max(1) as f64;
    let fits = |zoom: &u8| {
        let [width, height] = scheme.sides_in_metres(*zoom, latitude);
        width * height <= per_vertex * VERTICES_PER_TILE
    };
    let [first, last] = [FIRST_FLAT_ZOOM, MOST_ZOOM].map(|zoom| zoom + scheme.delay());
    (first..last).find(fits).unwrap_or(last)
}
