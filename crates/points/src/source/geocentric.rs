//! Whether points can be geocentric, as their file states.

use crate::points::axis::Axis;
use crate::points::optional_fields::OptionalFields;
use crate::points::returns::KeptReturns;
use crate::points::rules::PointRules;
use crate::source::{Source, is_box};
use crs::area_of_use::arc;
use crs::system::{Crs, CrsKind};
use crs::unit::Unit;
use lattice::AxisMap;
use sys::Result;

/// The records by which a file is judged.
const RECORDS: u64 = 4096;

/// The number of raw steps in a step of a look at the points: every raw integer then lies within reach.
const COARSE: i64 = 16;

/// The half axes of the earth in metres.
const EARTH: [f64; 2] = [6_378_137.0, 6_356_752.3];

/// No terrain lies lower or higher above the ellipsoid, in metres: the bottom of the sea, and more than the highest mountain.
const HEIGHTS: [f64; 2] = [-12_000.0, 20_000.0];

/// No wall at the equator is so many units high.
const UPRIGHT: f64 = 100.0;

/// Longitudes and latitudes of a survey vary by less, and by so many times less than its heights.
const DEGREES: [f64; 2] = [1.0, 10.0];

/// No height of a terrain is greater, in metres.
const NO_HEIGHT: f64 = 20_000.0;

impl Source {
    /// Drops a record of a geocentric system if most points of a sample lie far from the surface of the earth: then it is false, and the
    /// coordinates are a plane. Its unit, if it states one, is that of the plane only where nothing else states a unit. The warning advises
    /// nothing if `is_crs_stated`: the user says what the points are in.
    ///
    /// # Errors
    /// `Io` or `Input` if the file cannot be read any more.
    pub(super) fn drop_false_geocentric_crs(&mut self, is_crs_stated: bool) -> Result<()> {
        if self.crs.kind != CrsKind::Geocentric {
            return Ok(());
        }
        let metres = self.crs.metres_per_unit().unwrap_or(1.0);
        let places = self.first_places()?;
        // The key of the unit may be meant for the axes of the ellipsoid.
        let is_elsewhere =
            |place: &&[f64; 3]| [metres, 1.0].iter().all(|unit| !lies_near_surface(place.map(|value| value * unit)));
        let elsewhere = places.iter().filter(is_elsewhere).count();
        // A stray point or two may lie anywhere.
        let first = places.iter().find(is_elsewhere).filter(|_| elsewhere.saturating_mul(2) > places.len());
        let why = match first {
            Some([x, y, z]) => format!(
                "its points do not lie on the surface of the earth, about 6,370 km from the middle: the first is at x {x:.0}, y {y:.0}, z \
                 {z:.0}, {:.0} km from it",
                arc([arc([*x, *y]), *z]) * metres / 1000.0,
            ),
            None => match upright(&places) {
                Some([across, z]) => format!(
                    "its points would be vertical near the equator, {:.0} m high and {:.0} m wide: x and y are those of a map",
                    across * metres,
                    z * metres
                ),
                None => return Ok(()),
            },
        };
        let stated = Some(self.crs.horizontal).filter(|unit| *unit != Unit::Unknown);
        let label = self.crs.label();
        self.warnings.push(if is_crs_stated {
            format!("its geocentric coordinate system ({label}) is ignored, because [input] sets another")
        } else {
            let in_unit = stated.map_or_else(String::new, |unit| {
                format!(" in {}", unit.name())
            });
            format!(
                "its coordinate system ({label}) is geocentric, but {why}: the record is ignored, and x and y are treated as a \
                 plane{in_unit}; \
                 fix: [input] crs = \"EPSG:...\""
            )
        });
        self.crs = Crs::default();
        self.unit_of_false_record = stated;
        Ok(())
    }

    /// Returns the unit that a false record of a geocentric system states for lengths; `None` if there is no such record or it states none.
    pub fn unit_of_false_record(&self) -> Option<Unit> {
        self.unit_of_false_record
    }

    /// Returns whether the box that the file claims lies on the surface of the earth as geocentric coordinates in metres do, with a z that
    /// is no height.
    pub fn looks_geocentric(&self) -> bool {
        self.claimed_middle().is_some_and(|place| lies_near_surface(place) && place[2].abs() > NO_HEIGHT)
    }

    /// Returns whether the box that the file claims, if it claims one, may hold geocentric coordinates in metres.
    pub fn may_be_geocentric(&self) -> bool {
        self.claimed_middle().is_none_or(lies_near_surface)
    }

    /// Returns whether the box that the file claims looks like longitudes and latitudes beside heights in a unit of length.
    pub fn looks_like_degrees(&self) -> bool {
        let Some([x, y, _]) = self.claimed_middle() else { return false };
        let [width, depth, height] = [0, 1, 2].map(|axis| self.max[axis] - self.min[axis]);
        let across = width.max(depth);
        let [most, times] = DEGREES;
        x.abs() <= 180.0 && y.abs() <= 90.0 && across <= most && height > times * across
    }

    /// Returns the middle of the box that the file claims, in its own coordinates.
    fn claimed_middle(&self) -> Option<[f64; 3]> {
        let own = self.transform().map(|transform| &transform.own);
        let [min, max] = own.map_or([self.min, self.max], |own| [own.min, own.max]);
        let has_box = is_box(min, max) && (self.records <= 1 || min != max);
        has_box.then(|| [0, 1, 2].map(|axis| min[axis] + (max[axis] - min[axis]) * 0.5))
    }

    /// Returns x, y and z of the first records of the first chunk.
    fn first_places(&self) -> Result<Vec<[f64; 3]>> {
        let coarse =
            |axis: &Axis| AxisMap::new(axis.offset, axis.scale, axis.offset, axis.scale.checked_mul(COARSE.into())?);
        let [Some(x), Some(y), Some(z)] = self.axes.each_ref().map(coarse) else { return Ok(Vec::new()) };
        let rules = PointRules {
            maps: [x, y, z],
            classes: [true; 256],
            returns: KeptReturns::All,
            bounds: None,
            clip: None,
            first_order: 0,
            numbered: false,
            fields: OptionalFields::default(),
        };
        let mut places = Vec::new();
        if self.chunks() > 0 {
            self.decode_start(0, RECORDS, &rules, &mut |points| {
                let steps = points.iter().map(|point| [point.position[0], point.position[1], point.z]);
                places.extend(steps.map(|steps| self.coarse_place(steps)));
                Ok(())
            })?;
        }
        Ok(places)
    }

    fn coarse_place(&self, steps: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.axes[axis].value(i64::from(steps[axis]) * COARSE))
    }
}

/// Returns how high the points rise from the middle of the earth and how far they reach to the north, if they would stand upright near
/// the equator. Northings of some latitudes are as great as the radius of the earth, but vary as no heights do.
fn upright(places: &[[f64; 3]]) -> Option<[f64; 2]> {
    let range = |values: &dyn Fn(&[f64; 3]) -> f64| {
        let all = places.iter().map(values);
        let [least, greatest] = [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)];
        greatest - least
    };
    let (high, wide) = (range(&|[x, y, z]| arc([arc([*x, *y]), *z])), range(&|place| place[2]));
    let is_near_equator = places.iter().all(|place| place[2].abs() < NO_HEIGHT);
    (is_near_equator && high > UPRIGHT && high > 2.0 * wide).then_some([high, wide])
}

/// Returns whether a place in metres from the middle of the earth may be one of a terrain.
fn lies_near_surface([x, y, z]: [f64; 3]) -> bool {
    let across = libm::hypot(x, y);
    let distance = libm::hypot(across, z);
    if distance == 0.0 {
        return false;
    }
    let [major, minor] = EARTH;
    let surface = major * minor / libm::hypot(minor * across / distance, major * z / distance);
    let [lowest, highest] = HEIGHTS;
    (lowest..=highest).contains(&(distance - surface))
}

#[cfg(test)]
mod tests {
    use super::lies_near_surface;

    #[test]
    fn places_of_terrains_lie_near_the_surface() {
        // Munich, Quito, the south pole, and the bottom of a deep sea.
        for place in [
            [4_177_000.0, 855_000.0, 4_728_000.0],
            [1_272_000.0, -6_253_000.0, -20_000.0],
            [0.0, 0.0, -6_359_600.0],
            [6_367_200.0, 0.0, 0.0],
        ] {
            assert!(lies_near_surface(place), "{place:?}");
        }
        for place in [[0.0; 3], [691_000.0, 5_334_000.0, 520.0], [500_000.0, 6_340_000.0, 20.0], [11.5, 48.1, 520.0]] {
            assert!(!lies_near_surface(place), "{place:?}");
        }
    }
}
