//! Web Mercator: the square map of the world that web maps cut into tiles.

use std::f64::consts::PI;

/// The latitude of the northern edge of the map, in radians: 85.0511 degrees.
pub const NORTHMOST: f64 = 1.484_422_229_745_332_4;

/// Returns the place on the map of longitude and latitude in radians: 0 to 1 from west to east and from north to south.
pub fn on_map([longitude, latitude]: [f64; 2]) -> [f64; 2] {
    [0.5 + longitude / (2.0 * PI), 0.5 - libm::asinh(libm::tan(latitude)) / (2.0 * PI)]
}

/// Returns longitude and latitude in radians of a place on the map.
pub fn geographic([x, y]: [f64; 2]) -> [f64; 2] {
    [(x - 0.5) * (2.0 * PI), libm::atan(libm::sinh((0.5 - y) * (2.0 * PI)))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_back() {
        for n in 0..1000 {
            let place = [f64::from(n * 37 % 991) / 991.0, f64::from(n) / 999.0];
            let back = on_map(geographic(place));
            assert!(back.iter().zip(place).all(|(back, place)| (back - place).abs() < 1e-14), "{place:?} {back:?}");
        }
        assert!((geographic([0.5, 0.0])[1] - NORTHMOST).abs() < 1e-15);
        assert_eq!(on_map([0.0, 0.0]), [0.5, 0.5]);
    }
}
