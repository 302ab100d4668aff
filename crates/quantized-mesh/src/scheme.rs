//! The tiling schemes: how the globe is divided into tiles.

use std::f64::consts::{FRAC_PI_2, PI};

/// Metres along half a meridian, about.
const HALF_MERIDIAN: f64 = 20_003_931.0;

/// A tiling scheme: a division of the globe into tiles. Inside a tile, steps are linear in longitude and latitude, whatever the scheme: that is how
/// viewers read them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Scheme {
    /// Two tiles at zoom 0, each half of the globe. All tiles of a zoom have the same sides in degrees.
    #[default]
    Geographic,
    /// Web mercator: one tile at zoom 0. Rows are lower in degrees the farther they are from the equator.
    WebMercator,
}

impl Scheme {
    /// Returns its projection as `layer.json` names it.
    pub fn projection(self) -> &'static str {
        match self {
            Scheme::Geographic => "EPSG:4326",
            Scheme::WebMercator => "EPSG:3857",
        }
    }

    /// Returns the greatest latitude in degrees that a terrain may reach. Around a pole, columns are no longer beside each other. The
    /// rows of web mercator end at 85.0511 degrees.
    pub fn most_latitude(self) -> f64 {
        match self {
            Scheme::Geographic => 89.0,
            Scheme::WebMercator => 85.05,
        }
    }

    /// Returns how many zooms later its tiles are as wide as those of the geographic scheme.
    pub(crate) fn delay(self) -> u8 {
        match self {
            Scheme::Geographic => 0,
            Scheme::WebMercator => 1,
        }
    }

    /// Returns the zoom whose tiles are as wide as those of a zoom of the geographic scheme.
    pub fn as_wide_as(self, geographic_zoom: u8) -> u8 {
        geographic_zoom + self.delay()
    }

    /// Returns the number of columns of a zoom.
    pub fn columns(self, zoom: u8) -> i32 {
        2 << zoom >> self.delay()
    }

    /// Returns the latitude of the southern border of a row in radians.
    pub fn latitude(self, zoom: u8, row: i32) -> f64 {
        let share = f64::from(row) / f64::from(1u32 << zoom);
        match self {
            Scheme::Geographic => share * PI - FRAC_PI_2,
            Scheme::WebMercator => libm::atan(libm::sinh((2.0 * share - 1.0) * PI)),
        }
    }

    /// Returns the latitude of the southern border of a row in degrees, exact where degrees are.
    pub fn degrees(self, zoom: u8, row: i32) -> f64 {
        match self {
            Scheme::Geographic => f64::from(row) / f64::from(1u32 << zoom) * 180.0 - 90.0,
            Scheme::WebMercator => self.latitude(zoom, row).to_degrees(),
        }
    }

    /// Returns about the number of the row that a latitude in radians lies in.
    pub(crate) fn near_row(self, zoom: u8, latitude: f64) -> i32 {
        let share = match self {
            Scheme::Geographic => latitude / PI + 0.5,
            Scheme::WebMercator => (libm::asinh(libm::tan(latitude)) / PI + 1.0) / 2.0,
        };
        (share * f64::from(1u32 << zoom)) as i32
    }

    /// Returns width and height in metres of the tiles of a zoom at a latitude in radians, about.
    pub fn sides_in_metres(self, zoom: u8, latitude: f64) -> [f64; 2] {
        let side = HALF_MERIDIAN * f64::from(1u32 << self.delay()) / f64::from(1u32 << zoom);
        let cosine = libm::cos(latitude);
        match self {
            Scheme::Geographic => [side * cosine, side],
            Scheme::WebMercator => [side * cosine; 2],
        }
    }
}
