//! Coordinate reference systems as GeoTIFF keys.

use crate::codes::text_of_code;
use crate::from_wkt;
use crate::from_wkt::from_epsg;
use crate::geokeys::{GeoKeys, USER_DEFINED};
use crate::geotiff_esri as esri;
use crate::geotiff_text;
use crate::geotiff_text::{METHOD, PROJECTION};
use crate::system::{Crs, CrsKind};
use crate::unit::Unit;
use crate::vertical::VerticalSystem;

const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC_TYPE: u16 = 2048;
const PROJECTED_TYPE: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
/// The unit of lengths of a geographic or a geocentric system.
const GEOCENTRIC_UNITS: u16 = 2052;
const GEOCENTRIC_UNIT_SIZE: u16 = 2053;
const VERTICAL_TYPE: u16 = 4096;
const VERTICAL_CITATION: u16 = 4097;
const VERTICAL_UNITS: u16 = 4099;
/// The citations of the projected, the geographic and any system.
const CITATIONS: [u16; 3] = [3073, 2049, 1026];

/// Returns the metres of the unit of x and y, if a key gives it.
fn linear_unit(keys: &GeoKeys) -> Option<f64> {
    unit_of(keys, LINEAR_UNITS, LINEAR_UNIT_SIZE)
}

/// Returns the metres of a unit that one key gives by its code, or else another one by its length.
fn unit_of(keys: &GeoKeys, code: u16, size: u16) -> Option<f64> {
    match keys.code(code)? {
        USER_DEFINED => keys.double(size).filter(|size| *size > 0.0),
        code => metres(code),
    }
}

/// Says what of the keys is there, but cannot be used.
pub(crate) fn problems(keys: &GeoKeys) -> Vec<String> {
    let unit = keys.code(LINEAR_UNITS).filter(|_| linear_unit(keys).is_none()).map(|code| match code {
        USER_DEFINED => format!("GeoTIFF key {LINEAR_UNIT_SIZE}, the unit of x and y, is not a length"),
        code => format!("GeoTIFF key {LINEAR_UNITS}, the unit of x and y, has the code {code}, which is not known"),
    });
    let height = keys.code(VERTICAL_UNITS).filter(|code| metres(*code).is_none());
    let height = height.map(|code| {
        format!("GeoTIFF key {VERTICAL_UNITS}, the unit of heights, has the code {code}, which is not known")
    });
    let known = parse(keys);
    let is_unknown = known.as_ref().is_some_and(|crs| crs.form().is_none());
    let is_geographic = known.is_some_and(|crs| crs.kind == CrsKind::Geographic);
    let of_code = || keys.code(GEOGRAPHIC_TYPE).and_then(|code| text_of_code(code.into()));
    let problem = match projected(keys) {
        Some(USER_DEFINED) => geotiff_text::problem(keys)
            .or_else(|| Some("the GeoTIFF keys do not define its projection or its datum".into())),
        None if is_geographic => geotiff_text::problem_of_angles(keys, of_code()).or_else(|| {
            let code = keys.code(GEOGRAPHIC_TYPE).filter(|code| *code != USER_DEFINED);
            Some(code.map_or_else(|| "the GeoTIFF keys do not define its datum".into(), not_in_list))
        }),
        code => code.map(not_in_list),
    };
    let projection = problem.filter(|_| is_unknown);
    let projection = projection.map(|what| format!("the place of its coordinates is unknown: {what}"));
    unit.into_iter().chain(height).chain(projection).chain(other_unit(keys)).collect()
}

/// Says that a key gives another unit of x and y than the code of the system has.
fn other_unit(keys: &GeoKeys) -> Option<String> {
    let code = projected(keys).filter(|code| *code != USER_DEFINED)?;
    let (own, of_code) = (Unit::from_metres(linear_unit(keys)), from_epsg(code.into())?.horizontal);
    (own != Unit::Unknown && own != of_code).then(|| {
        format!(
            "GeoTIFF key {LINEAR_UNITS}, the unit of x and y, is {}, but EPSG:{code} has {}: that of the key is used",
            own.name(),
            of_code.name()
        )
    })
}

fn not_in_list(code: u16) -> String {
    format!("EPSG:{code} is not in the list of known codes")
}

/// Returns the code of the projected system. Some writers leave it out where other keys define the projection.
fn projected(keys: &GeoKeys) -> Option<u16> {
    let model = keys.code(MODEL_TYPE);
    let is_defined = || model == Some(1) && [PROJECTION, METHOD].iter().any(|key| keys.code(*key).is_some());
    let code = keys.code(PROJECTED_TYPE).or_else(|| is_defined().then_some(USER_DEFINED));
    code.filter(|_| !matches!(model, Some(2 | 3)))
}

/// Returns the metres of a unit of length by its EPSG code.
fn metres(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(Unit::FOOT),
        9003 => Some(Unit::US_FOOT),
        9036 => Some(1000.0),
        _ => None,
    }
}

/// Returns the system that the keys describe; `None` if they say nothing.
pub(crate) fn parse(keys: &GeoKeys) -> Option<Crs> {
    let model = keys.code(MODEL_TYPE);
    let projected = projected(keys);
    let code = projected.or_else(|| keys.code(GEOGRAPHIC_TYPE).filter(|_| model != Some(1)));
    let epsg = code.filter(|code| *code != USER_DEFINED).map(u32::from);
    let name = CITATIONS.iter().filter_map(|key| keys.text(*key)).find_map(|text| esri::title(&text));
    let unit = linear_unit(keys);
    let of_code = epsg.and_then(from_epsg);
    if let Some(crs) = in_other_angles(keys, &of_code, name.clone()) {
        return Some(crs);
    }
    let is_defined = projected == Some(USER_DEFINED);
    let defined = || from_wkt::parse(&geotiff_text::projected(keys, name.as_deref(), unit?)?);
    // ESRI's programs write their text into a citation.
    let written = || CITATIONS.iter().filter_map(|key| keys.text(*key)).find_map(|text| esri::system(&text));
    let written = || written().filter(|crs| projected.is_some() == (crs.kind == CrsKind::Projected));
    let geographic = || from_wkt::parse(&geotiff_text::geographic(keys)?).filter(|_| is_geographic(keys));
    let known = of_code.or_else(written).or_else(|| defined().filter(|_| is_defined)).or_else(geographic);
    let known = known.unwrap_or_default();
    let kind = kind(model, projected.is_some(), epsg.is_some(), known.kind);
    let horizontal = match unit {
        _ if kind == CrsKind::Geographic => Unit::Degree,
        Some(metres) => Unit::from_metres(Some(metres)),
        // The metre that such a system has without a key is no statement about points that are not in it.
        None if kind == CrsKind::Geocentric => Unit::from_metres(unit_of(keys, GEOCENTRIC_UNITS, GEOCENTRIC_UNIT_SIZE)),
        None => known.horizontal,
    };
    let heights = VerticalSystem {
        epsg: keys.code(VERTICAL_TYPE).filter(|code| *code != USER_DEFINED).map(u32::from),
        name: keys.text(VERTICAL_CITATION).and_then(|text| esri::title(&text)),
        ..VerticalSystem::default()
    };
    let unit_of_height = keys.code(VERTICAL_UNITS).and_then(metres).or_else(|| heights.metres_of_code());
    let mut crs = Crs {
        // If a key gives another unit than the code, the text of the code would be wrong.
        wkt: known.wkt.filter(|_| horizontal == Unit::Unknown || known.horizontal == horizontal),
        epsg,
        kind,
        horizontal,
        vertical: unit_of_height.or(known.vertical),
        vertical_system: Some(heights).filter(|system| *system != VerticalSystem::default()).or(known.vertical_system),
        name: known.name.or(name),
        unread_keys: Vec::new(),
    };
    if is_defined && crs.form().is_none() {
        crs.unread_keys = geotiff_text::definition(keys);
    }
    (crs != Crs::default()).then_some(crs)
}

/// Returns whether the keys say that places are longitudes and latitudes.
fn is_geographic(keys: &GeoKeys) -> bool {
    keys.code(MODEL_TYPE) == Some(2)
}

/// Returns a system of longitude and latitude in radians, grads or another angle than the text of its code has. Nothing here reads such
/// coordinates, so it has no text and no code by which they would count as degrees.
fn in_other_angles(keys: &GeoKeys, of_code: &Option<Crs>, name: Option<String>) -> Option<Crs> {
    let known = of_code.as_ref();
    let is_geographic = known.map_or(is_geographic(keys), |crs| crs.kind == CrsKind::Geographic);
    let text = known.and_then(|crs| crs.wkt.as_deref());
    geotiff_text::problem_of_angles(keys, text).filter(|_| is_geographic)?;
    Some(Crs {
        kind: CrsKind::Geographic,
        horizontal: Unit::Degree,
        name: known.and_then(|crs| crs.name.clone()).or(name),
        unread_keys: geotiff_text::definition(keys),
        ..Crs::default()
    })
}

/// Returns the kind that the keys say, or else that of the code.
fn kind(model: Option<u16>, is_projected: bool, has_code: bool, known: CrsKind) -> CrsKind {
    match model {
        Some(3) => CrsKind::Geocentric,
        _ if known != CrsKind::Unknown => known,
        _ if is_projected => CrsKind::Projected,
        Some(2) => CrsKind::Geographic,
        None if has_code => CrsKind::Geographic,
        _ => CrsKind::Unknown,
    }
}
