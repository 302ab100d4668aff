//! The tiles of a zoom: one or two at zoom 0, and four for each at the next.

use crate::scheme::Scheme;
use std::f64::consts::PI;

/// A tile. Rows are counted from the south, as in a tile map service (TMS).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tile {
    /// The tiling scheme.
    pub scheme: Scheme,
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
        Tile { zoom: self.zoom.saturating_sub(1), x: self.x >> 1, y: self.y >> 1, ..self }.once()
    }

    /// Returns the number of its column in file names: from 0 on, without a turn too many.
    pub fn column(self) -> i32 {
        self.x.rem_euclid(self.scheme.columns(self.zoom))
    }

    /// Returns the tile beside it, so many columns east and rows north.
    pub fn beside(self, [east, north]: [i32; 2]) -> Tile {
        Tile { x: self.x.saturating_add(east), y: self.y.saturating_add(north), ..self }.once()
    }

    /// Returns the tiles that have the same parent, this one among them.
    pub fn siblings(self) -> impl Iterator<Item = Tile> {
        let [x, y] = [self.x, self.y].map(|number| number & !1);
        [[0, 0], [1, 0], [0, 1], [1, 1]].into_iter().map(move |[east, north]| Tile {
            x: x | east,
            y: y | north,
            ..self
        })
    }

    /// A tile around the globe is beside itself, and has one number.
    fn once(self) -> Tile {
        if self.scheme.columns(self.zoom) == 1 { Tile { x: 0, ..self } } else { self }
    }

    /// Returns the zoom at which tiles of the geographic scheme are as wide.
    pub(crate) fn geographic_zoom(self) -> u8 {
        self.zoom.saturating_sub(self.scheme.delay())
    }

    /// Returns its width and its height in radians.
    pub(crate) fn sides(self) -> [f64; 2] {
        let width = PI * f64::from(1u32 << self.scheme.delay()) / f64::from(1u32 << self.zoom);
        match self.scheme {
            Scheme::Geographic => [width; 2],
            Scheme::WebMercator => {
                let [south, north] = [self.y, self.y + 1].map(|row| self.scheme.latitude(self.zoom, row));
                [width, north - south]
            }
        }
    }

    /// Returns longitude and latitude of its south-west corner in radians.
    pub(crate) fn south_west(self) -> [f64; 2] {
        [f64::from(self.x) * self.sides()[0] - PI, self.scheme.latitude(self.zoom, self.y)]
    }

    /// Returns longitude and latitude of its middle in radians.
    pub(crate) fn middle(self) -> [f64; 2] {
        let ([west, south], [width, height]) = (self.south_west(), self.sides());
        [west + width / 2.0, south + height / 2.0]
    }
}
