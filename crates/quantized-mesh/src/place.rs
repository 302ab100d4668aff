//! Where places lie on the tiles of a zoom: whole numbers.

use crate::scheme::Scheme;
use std::f64::consts::{FRAC_PI_2, PI};

/// The steps across a tile, in both directions.
pub const SPAN: i64 = 32_767;

/// The steps of height in a metre.
pub const HEIGHT_STEPS: f64 = 4096.0;

/// A place on the grid of a zoom. Tile number `n` of a direction, counted from the south-west, reaches from `n * SPAN` to `(n + 1) * SPAN`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GridPoint {
    /// Steps east of the meridian 180 degrees west. A terrain across that meridian goes on below zero, or beyond the last tile.
    pub x: i64,
    /// Steps north of the southern end of the scheme. Within a row of tiles they are linear in latitude.
    pub y: i64,
    /// Height above the ellipsoid, in [`HEIGHT_STEPS`] a metre.
    pub z: i32,
}

impl GridPoint {
    pub(crate) fn along(&self, axis: usize) -> i64 {
        if axis == 0 { self.x } else { self.y }
    }
}

/// The grid of a zoom.
#[derive(Clone, Debug)]
pub struct TileGrid {
    scheme: Scheme,
    zoom: u8,
    /// The steps in a radian of longitude.
    per_radian: f64,
    /// The row of the last place, since the next one is often in it too.
    row: Row,
}

/// A row of tiles.
#[derive(Clone, Copy, Debug)]
struct Row {
    number: i32,
    /// The latitudes of its borders in radians.
    south: f64,
    north: f64,
}

impl TileGrid {
    /// Returns the grid of a zoom.
    pub fn new(scheme: Scheme, zoom: u8) -> TileGrid {
        let per_radian = f64::from(scheme.columns(zoom)) * SPAN as f64 / (2.0 * PI);
        let row = Row { number: 0, south: scheme.latitude(zoom, 0), north: scheme.latitude(zoom, 1) };
        TileGrid { scheme, zoom, per_radian, row }
    }

    /// Returns the nearest place on the grid: longitude and latitude in radians, the height above the ellipsoid in metres. The longitude
    /// may be beyond half a turn. `None` if the height is more than half a million metres.
    pub fn nearest(&mut self, [longitude, latitude]: [f64; 2], height: f64) -> Option<GridPoint> {
        let x = floor((longitude + PI) * self.per_radian + 0.5);
        Some(GridPoint { x, y: self.y(latitude, 1), z: height_steps(height)? })
    }

    /// Returns the steps of a latitude in radians, each divided into so many parts.
    pub(crate) fn y(&mut self, latitude: f64, parts: i64) -> i64 {
        match self.scheme {
            Scheme::Geographic => floor((latitude + FRAC_PI_2) * (self.per_radian * parts as f64) + 0.5),
            Scheme::WebMercator => {
                let Row { number, south, north } = self.row_at(latitude);
                let span = SPAN * parts;
                i64::from(number) * span + floor((latitude - south) * (span as f64 / (north - south)) + 0.5)
            }
        }
    }

    /// Returns the row that a latitude lies in.
    fn row_at(&mut self, latitude: f64) -> Row {
        let Row { south, north, .. } = self.row;
        if !(south <= latitude && latitude < north) {
            let border = |row: i32| self.scheme.latitude(self.zoom, row);
            let mut number = self.scheme.near_row(self.zoom, latitude);
            // It may lie a row beside that, where rounding has led.
            number -= i32::from(latitude < border(number));
            number += i32::from(latitude >= border(number + 1));
            self.row = Row { number, south: border(number), north: border(number + 1) };
        }
        self.row
    }
}

/// Returns a height in metres in steps; `None` if it is more than half a million metres.
pub fn height_steps(metres: f64) -> Option<i32> {
    let steps = metres * HEIGHT_STEPS + 0.5;
    (steps.abs() < f64::from(i32::MAX)).then(|| floor(steps) as i32)
}

/// Returns the greatest whole number that is not above a number of usual size. Without a vector extension, `f64::floor` is a call.
fn floor(number: f64) -> i64 {
    let towards_zero = number as i64;
    towards_zero - i64::from(towards_zero as f64 > number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floors_are_those_of_the_standard_library() {
        for number in [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1e15 + 0.5, -1e15 - 0.5, 2.9999, -2.0001] {
            assert_eq!(floor(number), number.floor() as i64, "{number}");
        }
        assert_eq!(
            [524_287.0, 524_288.0, -524_288.0, f64::MAX].map(height_steps),
            [Some(2_147_479_552), None, None, None]
        );
    }
}
