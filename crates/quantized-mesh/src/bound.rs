//! How close the tiles of a zoom are to the triangulation.

use crate::place::{HEIGHT_STEPS, MOST_ZOOM};

/// The error in metres that viewers expect of zoom 0; that of each next zoom is half of the one before. CesiumJS estimates it so: the length of
/// the equator, divided by 2 tiles of 64 cells, a quarter of that.
pub const LEVEL_ZERO_ERROR: f64 = 77_067.339_6;

/// The part of the expected error that one step to a coarser zoom may add. All finer zooms together may add about as much again: a pixel where viewers
/// allow two.
const SHARE: f64 = 0.25;

/// Returns the bound that the vertices of a zoom are selected by, in steps of height.
pub fn steps(zoom: u8) -> u64 {
    (LEVEL_ZERO_ERROR * SHARE * HEIGHT_STEPS) as u64 >> zoom
}

/// The most vertices that a tile of the finest zoom has on average.
const VERTICES_PER_TILE: f64 = 16_384.0;

/// Metres along half a meridian, about.
pub const HALF_MERIDIAN: f64 = 20_003_931.0;

/// Tiles of smaller zooms have vertices at least in a grid, so that they follow the curve of the earth. All finest tiles are flat enough without.
pub(crate) const FIRST_FLAT_ZOOM: u8 = 10;

/// Returns the coarsest zoom from 10 on whose tiles have no more than some 16,000 vertices on average, at a latitude in radians. `area` is that of the terrain in
/// square metres, with so many vertices.
pub fn finest_zoom(area: f64, vertices: u64, latitude: f64) -> u8 {
    let per_vertex = area / vertices.max(1) as f64;
    let fits = |zoom: &u8| {
        let side = HALF_MERIDIAN / f64::from(1u32 << zoom);
        side * side * libm::cos(latitude) <= per_vertex * VERTICES_PER_TILE
    };
    (FIRST_FLAT_ZOOM..MOST_ZOOM).find(fits).unwrap_or(MOST_ZOOM)
}
