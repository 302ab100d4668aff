//! The way from one coordinate reference system into another.

use crate::datum::Datum;
use crate::system::{Crs, CrsKind};
use crate::transform::datum_rule::{DatumRule, DatumWay, datum_way};
use crate::transform::ellipsoid::{Ellipsoid, WGS84};
use crate::transform::map_projection::{DEGREE, MapProjection};
use crate::wkt::{GEOGRAPHIC, degrees, find};

/// No longitude is farther from Greenwich, in radians: a turn and a half, as files have them that count to 360 degrees.
const FARTHEST_LONGITUDE: f64 = 540.0 * DEGREE;

/// The way of places from one coordinate reference system into another. Heights are no part of it.
///
/// The same bits come out on every machine, forward and back.
#[derive(Clone, Debug)]
pub struct CrsTransform {
    from: Coordinates,
    to: Coordinates,
    datums: DatumNote,
}

/// What was done about the datums.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DatumNote {
    /// They are one.
    #[default]
    Same,
    /// One of these two has no name, and is assumed to be the other one.
    Assumed(String),
    /// These two are taken for one.
    TakenAlike(String),
}

/// What the x and y of a system mean.
#[derive(Clone, Debug)]
struct Coordinates {
    /// `None` for longitude and latitude.
    projection: Option<MapProjection>,
    /// Metres of a unit of x and y, or radians.
    unit: f64,
    /// The prime meridian in radians east of Greenwich.
    meridian: f64,
}

impl CrsTransform {
    /// Returns the way from `from` to `to`. Each has its own unit, false origin and prime meridian.
    ///
    /// # Errors
    /// A sentence if one of them does not say enough, or the program does not compute it, or the datums differ and `rule` does not take
    /// them for one.
    pub fn between(from: &Crs, to: &Crs, rule: DatumRule) -> Result<CrsTransform, String> {
        let ((from_datum, source), (to_datum, target)) = (Coordinates::of(from)?, Coordinates::of(to)?);
        let datums = match datum_way(&from_datum, &to_datum, rule) {
            DatumWay::Same => DatumNote::Same,
            DatumWay::Assumed(names) => DatumNote::Assumed(names),
            DatumWay::TakenAlike(names) => DatumNote::TakenAlike(names),
            DatumWay::Shift(why) => return Err(format!("from {} to {}, {why}", from.label(), to.label())),
        };
        Ok(CrsTransform { from: source, to: target, datums })
    }

    /// Returns the way from `crs` to longitude and latitude, some hundred metres off at most: a map without an ellipsoid counts as one on
    /// that of WGS 84.
    ///
    /// # Errors
    /// As [`CrsTransform::between`], but for the datum.
    pub fn to_rough_degrees(crs: &Crs) -> Result<CrsTransform, String> {
        let form = crs.form().ok_or_else(|| crs.why_without_form())?;
        let projection = match form.projection() {
            Some(projection) if form.datum().and_then(Datum::ellipsoid).is_none() => projection,
            _ => return CrsTransform::to_degrees(crs),
        };
        let ellipsoid = Ellipsoid::of(WGS84).ok_or("no ellipsoid")?;
        let unit = crs.metres_per_unit().ok_or("no unit of x and y")?;
        let meridian = form.datum().map_or(0.0, Datum::meridian) * DEGREE;
        let from = Coordinates { projection: Some(MapProjection::of(projection, ellipsoid)?), unit, meridian };
        Ok(CrsTransform { from, to: Coordinates::DEGREES, datums: DatumNote::Same })
    }

    /// Returns the way from `crs` to longitude and latitude on its own datum, in degrees east of Greenwich and north.
    ///
    /// # Errors
    /// As [`CrsTransform::between`].
    pub fn to_degrees(crs: &Crs) -> Result<CrsTransform, String> {
        Ok(CrsTransform { from: Coordinates::of(crs)?.1, to: Coordinates::DEGREES, datums: DatumNote::Same })
    }

    /// Returns x and y in the other system; `None` if one of them has no such place. Neither is ever infinite or NaN.
    pub fn apply(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let found = self.to.at(self.from.geographic(place)?)?;
        found.iter().all(|value| value.is_finite()).then_some(found)
    }

    /// Returns the way back.
    pub(crate) fn reversed(self) -> CrsTransform {
        CrsTransform { from: self.to, to: self.from, datums: self.datums }
    }

    /// Returns what it does, in words.
    pub fn way(&self) -> String {
        let name = |of: &Coordinates| of.projection.as_ref().map(|projection| projection.label().to_string());
        match (name(&self.from), name(&self.to)) {
            (Some(from), Some(to)) => format!("{from} back to longitude and latitude, then {to}"),
            (Some(from), None) => format!("{from} back to longitude and latitude"),
            (None, Some(to)) => to,
            (None, None) => "longitude and latitude stay".into(),
        }
    }

    /// Returns what is done about the datums.
    pub fn datums(&self) -> &DatumNote {
        &self.datums
    }
}

impl Coordinates {
    /// Degrees east of Greenwich and north.
    const DEGREES: Coordinates = Coordinates { projection: None, unit: DEGREE, meridian: 0.0 };

    /// Returns what the x and y of a system mean, and its datum.
    fn of(crs: &Crs) -> Result<(Datum, Coordinates), String> {
        let label = crs.label();
        if matches!(crs.kind, CrsKind::Geocentric | CrsKind::Local) {
            return Err(format!("{label} is {}, neither a map nor longitude and latitude", crs.kind.name()));
        }
        let form = crs.form().ok_or_else(|| crs.why_without_form())?;
        let datum = form.datum().ok_or_else(|| format!("{label} does not state its datum"))?.clone();
        let Some(projection) = form.projection() else {
            let unit = crs.wkt.as_deref().and_then(|text| find(text, &GEOGRAPHIC));
            let unit = degrees(unit.as_ref().and_then(|system| system.unit())) * DEGREE;
            let meridian = datum.meridian() * DEGREE;
            return Ok((datum, Coordinates { projection: None, unit, meridian }));
        };
        let ellipsoid = datum.ellipsoid().and_then(Ellipsoid::of).ok_or_else(|| format!("{label} has no ellipsoid"))?;
        let unit = crs.metres_per_unit().ok_or_else(|| format!("{label} does not state the unit of x and y"))?;
        let projection = MapProjection::of(projection, ellipsoid);
        let projection = projection.map_err(|why| format!("gdt-batch does not support {label}: {why}"))?;
        let meridian = datum.meridian() * DEGREE;
        Ok((datum, Coordinates { projection: Some(projection), unit, meridian }))
    }

    /// Returns longitude and latitude in radians east of Greenwich and north.
    fn geographic(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let own = [x * self.unit, y * self.unit];
        let [longitude, latitude] = match &self.projection {
            Some(projection) => projection.inverse(own)?,
            None => own,
        };
        let is_place = longitude.abs() <= FARTHEST_LONGITUDE && latitude.abs() <= 90.000_000_1 * DEGREE;
        is_place.then_some([longitude + self.meridian, latitude])
    }

    fn at(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let own = [longitude - self.meridian, latitude];
        let [x, y] = match &self.projection {
            Some(projection) => projection.forward(own)?,
            None => own,
        };
        Some([x / self.unit, y / self.unit])
    }
}
