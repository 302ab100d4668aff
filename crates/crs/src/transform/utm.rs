//! The zone of the universal transverse Mercator for some data.

use crate::codes::text_of_code;
use crate::from_wkt::from_epsg;
use crate::system::Crs;
use crate::transform::datum_rule::{DatumRule, DatumWay, datum_way};

/// Returns the UTM zone of a place in degrees on the datum of `crs`, in metres: of several with a code, that with the least. Australia's
/// are called MGA zones. A datum without a name is assumed to be WGS 84, if nothing says otherwise.
///
/// # Errors
/// A sentence if the datum has no such zone, and `rule` does not take it for WGS 84.
pub fn utm_zone(crs: &Crs, place: [f64; 2], rule: DatumRule) -> Result<Crs, String> {
    let zone = zone_number(place[0]);
    let side = if place[1] < 0.0 { 'S' } else { 'N' };
    let names = [format!("UTM zone {zone}{side}\""), format!("MGA zone {zone}\"")];
    let names = if place[1] < 0.0 { &names[..] } else { &names[..1] };
    let datum = crs.form().and_then(|form| form.datum().cloned());
    let datum = datum.ok_or_else(|| format!("{} does not state its datum", crs.label()))?;
    let is_named = |code: &u32| text_of_code(*code).is_some_and(|text| names.iter().any(|n| title(text).ends_with(n)));
    let zones = (1..=u32::from(u16::MAX)).filter(is_named).filter_map(from_epsg);
    let mut zones = zones.filter(|zone| zone.metres_per_unit() == Some(1.0));
    let way = |zone: &Crs| Some(datum_way(&datum, zone.form()?.datum()?, rule));
    let same = zones.find(|zone| way(zone) == Some(DatumWay::Same));
    let of_wgs84 = wgs84_zone(place);
    let alike =
        || of_wgs84.clone().filter(|zone| matches!(way(zone), Some(DatumWay::TakenAlike(_) | DatumWay::Assumed(_))));
    same.or_else(alike).ok_or_else(|| {
        let other = of_wgs84.as_ref().map_or("none".into(), Crs::label);
        format!(
            "there is no code for UTM zone {zone}{side} on the datum of {}: name a CRS (on WGS 84 it is {other})",
            crs.label()
        )
    })
}

/// Returns the UTM zone of a place in degrees on WGS 84.
pub fn wgs84_zone([longitude, latitude]: [f64; 2]) -> Option<Crs> {
    from_epsg(zone_number(longitude) + if latitude < 0.0 { 32_700 } else { 32_600 })
}

/// Returns the zone of a longitude in degrees: six degrees each, without the exceptions of Norway and Svalbard.
fn zone_number(longitude: f64) -> u32 {
    let from_date_line = (longitude + 180.0) % 360.0;
    let from_date_line = if from_date_line < 0.0 { from_date_line + 360.0 } else { from_date_line };
    (from_date_line / 6.0) as u32 % 60 + 1
}

/// Returns the name of a system with its closing quote.
fn title(text: &str) -> &str {
    let rest = text.split_once('"').map_or("", |(_, rest)| rest);
    rest.find('"').map_or(rest, |end| &rest[..=end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zone_is_that_of_the_middle_on_the_same_datum() {
        let zone = |code: u32, place: [f64; 2]| utm_zone(&from_epsg(code).unwrap(), place, DatumRule::Strict);
        let code = |code: u32, place: [f64; 2]| zone(code, place).unwrap().epsg;
        assert_eq!(code(4326, [-93.1, 45.0]), Some(32615));
        assert_eq!(code(4269, [-93.1, 45.0]), Some(26915));
        assert_eq!(code(4258, [9.0, 53.0]), Some(25832));
        assert_eq!(code(4326, [179.99, -17.0]), Some(32760));
        assert_eq!(code(4326, [-180.0, 0.0]), Some(32601));
        assert_eq!(code(4326, [183.0, 1.0]), Some(32601));
        // NAD83(2011) has zones of its own.
        assert_eq!(code(6344, [-93.1, 45.0]), Some(6344));
        assert!(zone(4277, [-3.0, 52.0]).unwrap_err().contains("OSGB"));
    }
}
