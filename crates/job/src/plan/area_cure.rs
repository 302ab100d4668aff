//! What would bring points into the area of use of their coordinate reference system: mistakes that are usual enough to be tried.

use crs::{AreaOfUse, Crs, CrsKind, CrsTransform, DatumRule, Unit, utm_zone};
use points::FileFormat;

/// The units in which a file may be, whatever its CRS.
const UNITS: [Unit; 5] = [Unit::Metre, Unit::Foot, Unit::Other(Unit::KILOMETRE), Unit::Other(0.01), Unit::Other(0.001)];

/// What the steps of one of several files may be wrong by.
const SCALES: [f64; 6] = [10.0, 0.1, 100.0, 0.01, 1000.0, 0.001];

/// Numbers of zones stand in front of so many metres.
const ZONE: f64 = 1e6;

/// The false northing of the southern zones of UTM, in metres.
const SOUTHERN: f64 = 1e7;

/// False origins in metres of one map, the old one and the new one, which begins with whole millions: those of Switzerland.
const RENEWED_ORIGINS: [[[f64; 2]; 2]; 1] = [[[600_000.0, 200_000.0], [2_600_000.0, 1_200_000.0]]];

/// Zones of UTM, and the same with the number of the zone before the easting: EPSG codes, and how many metres that adds.
const PREFIXED_ZONES: [(u32, u32, f64); 3] = [(25831, 5649, 31e6), (25832, 4647, 32e6), (25833, 5650, 33e6)];

/// A change of all x and y of a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Change {
    /// They are longitude and latitude already, in this order or the other one.
    Degrees { exchanged: bool },
    /// x and y change places.
    Exchanged,
    /// They are multiplied by this.
    Scaled(f64),
    /// The same, and they lie near the area then, as surveys beyond it do.
    ExchangedNearBy,
    /// They count in this unit.
    Unit(Unit),
    /// This is added to them.
    Moved([f64; 2]),
    /// Their northings are those of the southern zone, which has this code and this name.
    Southern(u32, String),
    /// These have the other sign.
    Negated([bool; 2]),
}

/// Returns the changes that bring one of several files to the others, if one does.
pub(crate) fn scales() -> impl Iterator<Item = Change> {
    SCALES.into_iter().map(Change::Scaled)
}

/// Returns the changes of a place of a file in `crs` that are worth a try, the most usual first.
pub(crate) fn changes([x, y]: [f64; 2], crs: &Crs) -> Vec<Change> {
    let signs = [[true, false], [false, true], [true, true]].map(Change::Negated);
    let Some(metres) = crs.metres_per_unit().filter(|_| crs.kind != CrsKind::Geographic) else {
        return [Change::Exchanged].into_iter().chain(signs).collect();
    };
    // Such numbers fit nearly everything that is added to them.
    if x.abs() <= 360.0 && y.abs() <= 360.0 {
        return [false, true].map(|exchanged| Change::Degrees { exchanged }).into();
    }
    let units = UNITS.map(Change::Unit);
    let moved = moves([x, y], crs, metres).into_iter().filter(|by| *by != [0.0; 2]).map(Change::Moved);
    let all = [Change::Exchanged].into_iter().chain(units).chain([Change::ExchangedNearBy]).chain(moved).chain(signs);
    all.chain(southern([x, y], crs, metres)).collect()
}

/// Returns what the number of a zone or a false origin may be, if it is too much or missing.
fn moves(place: [f64; 2], crs: &Crs, metres: f64) -> Vec<[f64; 2]> {
    let zones = |value: f64| (value / ZONE).trunc() * ZONE;
    let form = crs.form();
    let projection = form.as_ref().and_then(|form| form.projection());
    let meridian = projection.map_or(0.0, |projection| projection.value("lon_0"));
    let origin =
        projection.map(|projection| projection.false_origin()).unwrap_or_default().map(|length| length / metres);
    // Other eastings of some million metres have no number in front.
    let is_number = |value: f64| numbers_of_zone(meridian).contains(&value);
    let in_front = |value: f64| if is_number(zones(value) / ZONE) { -zones(value) } else { 0.0 };
    let x = in_front(place[0]);
    let [east, north] = origin;
    let [zone_east, zone_north] = origin.map(zones);
    let renewed = RENEWED_ORIGINS.iter().filter(|[old, _]| (*old).map(|length| length / metres) == origin);
    let renewed = renewed.map(|[old, new]| [0, 1].map(|axis| (old[axis] - new[axis]) / metres));
    let of_one = [[x, 0.0], [0.0, north], [east, 0.0], [east, north], [zone_east, 0.0], [zone_east, zone_north]];
    of_one.into_iter().chain(renewed).collect()
}

/// Returns the change of a place in a northern zone of UTM that lies in the southern zone of the same meridian.
fn southern([x, y]: [f64; 2], crs: &Crs, metres: f64) -> Option<Change> {
    let form = crs.form()?;
    let projection = form.projection()?;
    let meridian = projection.value("lon_0");
    let is_utm = projection.method() == "tmerc"
        && projection.false_origin() == [500_000.0, 0.0]
        && projection.value("lat_0") == 0.0
        && (meridian + 183.0).rem_euclid(6.0) == 0.0;
    let way = CrsTransform::to_rough_degrees(crs).ok().filter(|_| is_utm)?;
    let degrees = way.apply([x, y - SOUTHERN / metres]).filter(|[_, latitude]| *latitude < 0.0)?;
    let zone = utm_zone(crs, [meridian, degrees[1]], DatumRule::Strict).ok()?;
    let is_there = AreaOfUse::of(&zone)?.beyond(degrees) == [0.0; 2];
    is_there.then_some(Change::Southern(zone.epsg?, zone.name?))
}

/// Returns the numbers of a zone with this central meridian: of 6 degrees as UTM counts them and as from Greenwich, and of 3 degrees.
fn numbers_of_zone(meridian: f64) -> [f64; 3] {
    [(meridian + 183.0) / 6.0, (meridian + 3.0) / 6.0, meridian / 3.0]
}

impl Change {
    /// Returns where a place of a file in `crs` lies with the change.
    pub(crate) fn apply(&self, [x, y]: [f64; 2], crs: &Crs) -> Option<[f64; 2]> {
        let signed = |value: f64, is_negated: bool| if is_negated { -value } else { value };
        Some(match self {
            Change::Degrees { exchanged: false } => [x, y],
            Change::Degrees { exchanged: true } | Change::Exchanged | Change::ExchangedNearBy => [y, x],
            Change::Scaled(factor) => [x * factor, y * factor],
            Change::Unit(unit) => {
                let factor = unit.metres_per_unit()? / crs.metres_per_unit()?;
                [x * factor, y * factor]
            }
            Change::Moved([east, north]) => [x + east, y + north],
            Change::Southern(..) => [x, y - SOUTHERN / crs.metres_per_unit()?],
            Change::Negated([of_x, of_y]) => [signed(x, *of_x), signed(y, *of_y)],
        })
    }

    /// Returns whether the changed places are longitudes and latitudes.
    pub(crate) fn is_in_degrees(&self) -> bool {
        matches!(self, Change::Degrees { .. })
    }

    /// Says what to do about a file of this format that names no CRS, and is taken to be in `crs`, that of the others. `[input] crs` would say
    /// what all files are in.
    pub(crate) fn cure_without_crs(&self, format: FileFormat, crs: &Crs) -> String {
        let what = match self {
            Change::Degrees { exchanged: false } => "as longitude and latitude, they lie within it".into(),
            Change::Unit(unit) => format!("in the unit {}, they lie within it", unit.name()),
            Change::Moved(by) => {
                format!("with {}, they lie within it: a zone number or a false origin is extra or missing", moved(*by))
            }
            Change::Southern(_, name) => {
                format!("in the southern zone of the same number ({name}), they lie within its area")
            }
            Change::Degrees { .. }
            | Change::Exchanged
            | Change::ExchangedNearBy
            | Change::Scaled(_)
            | Change::Negated(_) => return self.cure(format),
        };
        format!("{what}: {}", name_missing_crs(self.code(crs), crs))
    }

    /// Returns the code of the system that the points are in, if this change brings them into `crs`.
    fn code(&self, crs: &Crs) -> Option<u32> {
        match self {
            Change::Degrees { .. } => Some(4326),
            Change::Southern(code, _) => Some(*code),
            Change::Moved(by) => {
                let prefixed = |(zone, _, metres): &&(u32, u32, f64)| crs.epsg == Some(*zone) && *by == [-metres, 0.0];
                PREFIXED_ZONES.iter().find(prefixed).map(|(_, code, _)| *code)
            }
            _ => None,
        }
    }

    /// Says what to do about a file of this format.
    pub(crate) fn cure(&self, format: FileFormat) -> String {
        let is_text = format.is_text();
        match self {
            Change::Degrees { exchanged } => degrees(*exchanged, is_text),
            Change::Exchanged => format!("with x and y exchanged, they lie within it: {}", exchange(is_text)),
            Change::ExchangedNearBy => format!("with x and y exchanged, they lie near it: {}", exchange(is_text)),
            Change::Scaled(factor) => format!(
                "multiplied by {factor}, they lie beside those of the other files: {}, or leave the file out of [input] files",
                if is_text {
                    "the decimal point or the unit of the file is wrong. Multiply its x, y and z first"
                } else {
                    "the scale factors in the header of the file are wrong. Correct them first"
                }
            ),
            Change::Unit(unit) => {
                format!("in the unit {}, they lie within it: [input] crs with a CRS in that unit", unit.name())
            }
            Change::Moved(by) => format!(
                "with {}, they lie within it: a zone number or a false origin is missing or too much. Set [input] crs to the CRS with \
                 that origin, or move the points first",
                moved(*by)
            ),
            Change::Southern(code, name) => format!(
                "with southern northings (10000000 at the equator), they lie in the southern zone of the same number: [input] crs = \
                 \"EPSG:{code}\" ({name})"
            ),
            Change::Negated(signs) => format!(
                "with the sign of {} changed, they lie within it: change it first, or set [input] crs",
                match signs {
                    [true, true] => "x and y",
                    [true, false] => "x",
                    _ => "y",
                }
            ),
        }
    }
}

/// Says how the user names the CRS of the files without one, beside others in `crs`.
pub(crate) fn name_missing_crs(code: Option<u32>, crs: &Crs) -> String {
    let [missing, common] = [code, crs.epsg].map(|code| code.map_or("EPSG:...".into(), |code| format!("EPSG:{code}")));
    format!(
        "set [input] missing_crs = \"{missing}\" and [input] to_crs = \"{common}\", which transforms them into the CRS of the others"
    )
}

/// Says how x and y are exchanged.
fn exchange(is_text: bool) -> &'static str {
    if is_text {
        return "[input.csv] columns = [\"y\", \"x\", \"z\"]";
    }
    "exchange them first, for example with `pdal translate in.laz out.laz --writers.las.forward=scale --writers.las.offset_x=auto \
     --writers.las.offset_y=auto transformation --filters.transformation.matrix=\"0 1 0 0 1 0 0 0 0 0 1 0 0 0 0 1\"`"
}

/// Says what to do about longitudes and latitudes under a map.
fn degrees(exchanged: bool, is_text: bool) -> String {
    let order = match (exchanged, is_text) {
        (false, _) => "",
        (true, true) => " Latitude comes first: [input.csv] columns = [\"y\", \"x\", \"z\"].",
        (true, false) => " Latitude comes first: exchange x and y first.",
    };
    format!(
        "as longitude and latitude, they lie within it: [input] crs = \"EPSG:4326\" and [input] to_crs = \"utm\".{order} For a local \
         grid, [input] crs = \"none\""
    )
}

/// Says what is added to x and y.
fn moved(by: [f64; 2]) -> String {
    let one = |(by, axis): (f64, &str)| match by {
        more if more > 0.0 => Some(format!("{more} added to {axis}")),
        less if less < 0.0 => Some(format!("{} subtracted from {axis}", -less)),
        _ => None,
    };
    by.into_iter().zip(["x", "y"]).filter_map(one).collect::<Vec<_>>().join(" and ")
}
