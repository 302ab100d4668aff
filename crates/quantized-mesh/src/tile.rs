//! The tiles of a zoom: two at zoom 0, each half of the globe, and four for each at the next.

use std::f64::consts::{FRAC_PI_2, PI};

/// A tile. Rows are counted from the south, as in a tile map service (TMS).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tile {
    /// Its zoom.
    pub zoom: u8,
    /// The number of its row, from the south.
    pub y: i32,
    /// The number of its column, from 180 degrees west; below zero or beyond the last where a terrain crosses that meridian.
    pub x: i32,
}

impl Tile {
    /// Returns the tile that holds this one at the zoom before. There must be one.
    pub fn parent(self) -> Tile {
        Tile { zoom: self.zoom.saturating_sub(1), x: self.x >> 1, y: self.y >> 1 }
    }

    /// Returns the number of its column in file names: from 0 on, without a turn too many.
    pub fn column(self) -> i32 {
        self.x.rem_euclid(2 << self.zoom)
    }

    /// Returns the tile beside it, so many columns east and rows north.
    pub fn beside(self, [east, north]: [i32; 2]) -> Tile {
        Tile { x: self.x.saturating_add(east), y: self.y.saturating_add(north), ..self }
    }

    /// Returns its side in radians.
    pub(crate) fn side(self) -> f64 {
        PI / f64::from(1u32 << self.zoom)
    }

    /// Returns longitude and latitude of its south-west corner in radians.
    pub(crate) fn south_west(self) -> [f64; 2] {
        [f64::from(self.x) * self.side() - PI, f64::from(self.y) * self.side() - FRAC_PI_2]
    }

    /// Returns the latitude of its middle in radians.
    pub(crate) fn middle_latitude(self) -> f64 {
        self.south_west()[1] + self.side() / 2.0
    }
}
