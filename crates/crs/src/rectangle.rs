//! A rectangle of longitudes and latitudes.

/// The longitudes of its western and its eastern end, and its latitudes, in degrees. One across the date line has its west east of its east.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rectangle {
    pub(crate) west: f64,
    pub(crate) south: f64,
    pub(crate) east: f64,
    pub(crate) north: f64,
}

impl Rectangle {
    pub(crate) const EARTH: Rectangle = Rectangle { west: -180.0, south: -90.0, east: 180.0, north: 90.0 };

    /// Reads four numbers between blanks.
    pub(crate) fn read(text: &str) -> Option<Rectangle> {
        let numbers = text.split(' ').map(|number| number.parse().ok()).collect::<Option<Vec<f64>>>()?;
        let [west, south, east, north] = numbers.try_into().ok()?;
        Some(Rectangle { west, south, east, north })
    }

    /// Returns how far a place lies outside: degrees of arc to the east or west, and to the north or south.
    pub(crate) fn beyond(&self, [longitude, latitude]: [f64; 2]) -> [f64; 2] {
        let turn = |degrees: f64| degrees.rem_euclid(360.0);
        let width = if self.west <= self.east { self.east - self.west } else { self.east - self.west + 360.0 };
        let from_west = turn(longitude - self.west);
        let across = if from_west <= width { 0.0 } else { (from_west - width).min(360.0 - from_west) };
        let along = (self.south - latitude).max(latitude - self.north).max(0.0);
        [across * libm::cos(latitude.to_radians()), along]
    }
}

/// Returns a longitude between -180 and 180 degrees.
pub fn turned(longitude: f64) -> f64 {
    (longitude + 180.0).rem_euclid(360.0) - 180.0
}
