//! Whether a file's coordinates can be what its coordinate reference system says.

use crate::system::{Crs, CrsKind};
use sys::Warnings;

/// No longitude or latitude is so great: two turns, in whatever unit of angle.
const FARTHEST: f64 = 800.0;

/// Returns `crs`, or no system if it says degrees and all coordinates between `min` and `max` are far beyond them. Terrestrial
/// scanners write such files: the record is a leftover, and the coordinates are a plane.
///
/// Warns about a projected system whose coordinates could all be longitudes and latitudes: the file was perhaps never transformed.
pub fn plausible(crs: Crs, min: [f64; 3], max: [f64; 3], warnings: &mut Warnings) -> Crs {
    if crs.kind == CrsKind::Projected && is_within_degrees(min, max) && !is_near_origin(&crs) {
        warnings.push(format!(
            "its coordinate system ({}) is a map projection, but x ({} to {}) and y ({} to {}) look like longitude and latitude, or a \
             local grid; fix: [input] crs = \"EPSG:4326\" and [input] to_crs = \"utm\" for degrees, [input] crs = \"none\" for a local \
             grid",
            crs.label(),
            min[0],
            max[0],
            min[1],
            max[1]
        ));
    }
    // One stray point must not decide: all of the box has to be beyond.
    let beyond = |axis: usize| min[axis] > FARTHEST || max[axis] < -FARTHEST;
    if crs.kind != CrsKind::Geographic || !(beyond(0) || beyond(1)) {
        return crs;
    }
    warnings.push(format!(
        "its coordinate system ({}) is in degrees, but x ({} to {}) and y ({} to {}) are not: the record is ignored; fix: [input] crs = \
         \"EPSG:...\", or \"none\" for a local grid",
        crs.label(),
        min[0],
        max[0],
        min[1],
        max[1]
    ));
    Crs::default()
}

fn is_within_degrees(min: [f64; 3], max: [f64; 3]) -> bool {
    let within = |axis: usize, most: f64| min[axis] >= -most && max[axis] <= most;
    within(0, 360.0) && within(1, 90.0)
}

/// Returns whether places near the origin of the coordinates are what such a system is made for: a grid of a site's own has no false
/// easting, and its origin is at the site.
fn is_near_origin(crs: &Crs) -> bool {
    const FAR: f64 = 1000.0;
    let origin = crs.form().and_then(|form| form.false_origin());
    crs.epsg.is_none() && origin.is_none_or(|origin| origin.iter().all(|metres| metres.abs() < FAR))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_wkt::from_epsg;

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

    #[test]
    fn a_projection_over_degrees_is_kept_with_a_warning() {
        let warned = |crs: &Crs, min: [f64; 3], max: [f64; 3]| {
            let mut warnings = Warnings::default();
            assert_eq!(plausible(crs.clone(), min, max, &mut warnings), *crs);
            warnings.iter().any(|warning| warning.contains("look like longitude and latitude"))
        };
        let utm = from_epsg(25832).unwrap();
        let (low, high) = ([11.5, 48.1, 500.0], [11.6, 48.2, 600.0]);
        assert!(warned(&utm, low, high) && warned(&Crs { epsg: None, ..utm.clone() }, low, high));
        assert!(!warned(&utm, low, [691_000.0, 48.2, 600.0]));
        assert!(!warned(&utm, [690_000.0, 5_330_000.0, 0.0], [691_000.0, 5_331_000.0, 9.0]));
        // The grid of a site has its origin there.
        let text = utm.wkt.as_deref().unwrap().replace("500000", "0");
        let site = crate::from_wkt::parse(&text).unwrap();
        assert!(!warned(&Crs { epsg: None, ..site }, low, high));
    }
}
