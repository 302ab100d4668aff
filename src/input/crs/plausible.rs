//! Whether a file's coordinates can be what its coordinate reference system says.

use crate::Warnings;
use crate::input::crs::system::{Crs, CrsKind};

/// No longitude or latitude is so great: two turns, in whatever unit of angle.
const FARTHEST: f64 = 800.0;

/// Returns `crs`, or no system if it says degrees and all coordinates between `min` and `max` are far beyond them. Terrestrial
/// scanners write such files: the record is a leftover, and the coordinates are a plane.
pub(crate) fn plausible(crs: Crs, min: [f64; 3], max: [f64; 3], warnings: &mut Warnings) -> Crs {
    // One stray point must not decide: all of the box has to be beyond.
    let beyond = |axis: usize| min[axis] > FARTHEST || max[axis] < -FARTHEST;
    if crs.kind != CrsKind::Geographic || !(beyond(0) || beyond(1)) {
        return crs;
    }
    warnings.push(format!(
        "its coordinate system ({}) is in degrees, but its coordinates are x {} to {} and y {} to {}, which no longitude and \
         latitude is: the system is ignored, and the coordinates are taken as a plane (set [input] crs or unit to say otherwise)",
        crs.label(),
        min[0],
        max[0],
        min[1],
        max[1]
    ));
    Crs::default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::crs::from_wkt::from_epsg;

    fn kept(code: u32, min: [f64; 3], max: [f64; 3]) -> bool {
        let mut warnings = Warnings::default();
        let crs = plausible(from_epsg(code).unwrap(), min, max, &mut warnings);
        assert_eq!(crs == Crs::default(), !warnings.is_empty());
        warnings.is_empty()
    }

    #[test]
    fn degrees_in_the_hundred_thousands_are_no_degrees() {
        let (low, high) = ([565_000.0, 5_933_000.0, 0.0], [565_900.0, 5_933_900.0, 90.0]);
        assert!(!kept(4326, low, high));
        assert!(kept(32632, low, high));
        assert!(kept(4326, [9.0, 53.0, 0.0], [10.0, 54.0, 9_000.0]));
        // A stray point in a file that is in degrees.
        assert!(kept(4326, [9.0, 53.0, 0.0], [1e6, 54.0, 9.0]));
    }
}
