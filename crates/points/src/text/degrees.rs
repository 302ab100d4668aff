//! Coordinates of a text that may be longitudes and latitudes.

use crate::text::row_box::RowBox;

/// Of fewer decimals, degrees are no places but towns.
const LEAST_DECIMALS: u8 = 5;

/// How many of its widths a small area lies from the origin, at least, if its coordinates do not count from a place in it or beside it.
const FAR: f64 = 100.0;

/// Returns whether x and y can be degrees, in this order or the other.
pub(crate) fn can_be(rows: &RowBox) -> bool {
    let fits = |x: f64, y: f64| rows.farthest(0) <= x && rows.farthest(1) <= y;
    fits(360.0, 90.0) || fits(90.0, 360.0)
}

/// Returns a warning about rows in this box, with so many decimals in x, y and z, if they look like degrees and nothing says what they
/// are: their area is narrower than it is high, or far from the origin. The coordinates of a scanner are lengths that count from itself.
pub(crate) fn warning(rows: &RowBox, decimals: &[u8; 3]) -> Option<String> {
    let size = |axis: usize| rows.max[axis] - rows.min[axis];
    let width = size(0).max(size(1));
    let is_far = rows.farthest(0).max(rows.farthest(1)) > FAR * width;
    let is_likely = width > 0.0 && (width < size(2) || is_far);
    if !is_likely || !can_be(rows) || decimals[..2].iter().any(|decimals| *decimals < LEAST_DECIMALS) {
        return None;
    }
    Some(format!(
        "its x ({} to {}) and y ({} to {}) look like longitude and latitude, but are treated as lengths; fix: [input] crs = \"EPSG:4326\" \
         and [input] to_crs = \"utm\", if they are degrees",
        rows.min[0], rows.max[0], rows.min[1], rows.max[1]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warns(min: [f64; 3], max: [f64; 3], decimals: [u8; 3]) -> bool {
        warning(&RowBox { min, max }, &decimals).is_some()
    }

    #[test]
    fn an_area_in_degrees_is_told_from_the_coordinates_of_a_scanner() {
        assert!(warns([11.5, 48.1, 500.0], [11.51, 48.11, 500.0], [7, 7, 2]));
        assert!(warns([48.1, 11.5, 500.0], [48.2, 11.6, 600.0], [6, 6, 2]));
        assert!(warns([139.0, 35.0, 0.0], [140.0, 36.0, 900.0], [5, 6, 0]));
        assert!(!warns([-8.0, -7.0, -1.0], [9.0, 11.0, 4.0], [8, 8, 8]));
        assert!(!warns([11.5, 48.1, 5.0], [11.51, 48.11, 5.0], [3, 3, 3]));
        assert!(!warns([565_000.0, 48.1, 5.0], [565_000.1, 48.2, 50.0], [7, 7, 2]));
        assert!(!warns([11.5, 48.1, 5.0], [11.5, 48.1, 5.0], [7, 7, 2]));
    }
}
