//! The coordinate reference system that a well-known text describes.

use crate::codes::text_of_code;
use crate::system::{Crs, CrsKind};
use crate::unit::Unit;
use crate::vertical::VerticalSystem;
use crate::wkt::{GEOGRAPHIC, LOCAL, PROJECTED, VERTICAL, WktNode, is_compound, length, parts, units};

/// Returns the system of an EPSG code; `None` for a code that is not in the list of known ones.
pub fn from_epsg(code: u32) -> Option<Crs> {
    let crs = parse(text_of_code(code)?)?;
    // Of a compound system, the code of its plane: that of the whole says heights too, and readers of codes take it for no plane.
    let plane = crs.wkt.as_deref().is_some_and(is_compound).then_some(crs.epsg).flatten();
    Some(Crs { epsg: plane.or(Some(code)), ..crs })
}

/// Returns the code of the plane of the compound system that `roots` are, if only the whole has one.
fn code_of_plane(roots: &[WktNode]) -> Option<u32> {
    let [whole] = roots else { return None };
    let known = WktNode::parse_all(text_of_code(whole.epsg()?)?)?;
    let mut parts = known.iter().flat_map(parts);
    parts.find(|part| PROJECTED.contains(&part.keyword.as_str()))?.epsg()
}

/// Returns the system that `text` describes; `None` if it is not the well-known text of a coordinate reference system.
pub fn parse(text: &str) -> Option<Crs> {
    let roots = WktNode::parse_all(text)?;
    let parts: Vec<&WktNode> = roots.iter().flat_map(parts).collect();
    let find = |keywords: &[&str]| parts.iter().find(|part| keywords.contains(&part.keyword.as_str())).copied();
    let horizontal = find(&PROJECTED).or_else(|| find(&GEOGRAPHIC)).or_else(|| find(&LOCAL))?;
    let kind = kind(horizontal);
    let (unit, third) = units(horizontal);
    let vertical = find(&VERTICAL);
    let unit_of_height = vertical.and_then(|vertical| units(vertical).0).or(third).and_then(length);
    Some(Crs {
        wkt: Some(text.trim_end_matches(['\0', ' ', '\n', '\r', '\t']).to_string()),
        epsg: horizontal.epsg().or_else(|| code_of_plane(&roots)),
        kind,
        horizontal: match (kind, unit) {
            // A text may leave out the degree.
            (CrsKind::Geographic, unit) => unit.map_or(Unit::Degree, angle),
            (_, unit) => Unit::from_metres(unit.and_then(length)),
        },
        // Writers round a foot in several ways, which are one.
        vertical: Unit::from_metres(unit_of_height).metres_per_unit(),
        vertical_system: vertical.and_then(VerticalSystem::of),
        name: horizontal.text(0).map(str::to_string).filter(|name| !name.is_empty()),
        unread_keys: Vec::new(),
    })
}

fn kind(system: &WktNode) -> CrsKind {
    match system.keyword.as_str() {
        keyword if PROJECTED.contains(&keyword) => CrsKind::Projected,
        keyword if LOCAL.contains(&keyword) => CrsKind::Local,
        _ if system.is_geocentric() => CrsKind::Geocentric,
        _ => CrsKind::Geographic,
    }
}

fn angle(unit: &WktNode) -> Unit {
    if unit.keyword == "LENGTHUNIT" { Unit::from_metres(length(unit)) } else { Unit::Degree }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPOUND_2: &str = r#"COMPOUNDCRS["a + b",PROJCRS["a",BASEGEOGCRS["g",DATUM["d",ELLIPSOID["e",6378137,298.25,
        LENGTHUNIT["metre",1]]],PRIMEM["Greenwich",0,ANGLEUNIT["degree",0.0174532925199433]]],CONVERSION["c",
        METHOD["Transverse Mercator",ID["EPSG",9807]],PARAMETER["False easting",1,LENGTHUNIT["US survey foot",0.304800609601219]]],
        CS[Cartesian,2],AXIS["(E)",east,ORDER[1],LENGTHUNIT["US survey foot",0.304800609601219]],
        AXIS["(N)",north,ORDER[2],LENGTHUNIT["US survey foot",0.304800609601219]],ID["EPSG",2276]],
        VERTCRS["b",VDATUM["v"],CS[vertical,1],AXIS["h",up,LENGTHUNIT["metre",1]]]]"#;

    #[test]
    fn a_compound_system_of_version_2_has_both_units() {
        let crs = parse(COMPOUND_2).unwrap();
        assert_eq!((crs.horizontal, crs.vertical), (Unit::UsFoot, Some(1.0)));
        assert_eq!((crs.epsg, crs.name.as_deref()), (Some(2276), Some("a")));
        assert_eq!(crs.vertical_system.unwrap().label(), "b");
    }

    #[test]
    fn the_unit_of_a_projected_system_is_not_that_of_its_base() {
        let text = r#"PROJCS["P",GEOGCS["G",UNIT["degree",0.0174]],UNIT["Foot",0.3048],AUTHORITY["EPSG","2994"]]"#;
        let crs = parse(text).unwrap();
        assert_eq!((crs.horizontal, crs.vertical, crs.epsg), (Unit::Foot, None, Some(2994)));
    }

    #[test]
    fn geographic_systems_are_in_degrees_and_a_bound_system_is_its_source() {
        assert_eq!(parse(r#"GEOGCS["WGS 84",UNIT["degree",0.0174532925199433]]"#).unwrap().horizontal, Unit::Degree);
        let bound = r#"BOUNDCRS[SOURCECRS[PROJCRS["P",LENGTHUNIT["metre",1]]],TARGETCRS[GEOGCRS["W"]]]"#;
        assert_eq!(parse(bound).unwrap().horizontal, Unit::Metre);
    }

    #[test]
    fn a_geographic_system_without_a_unit_is_in_degrees_and_feet_are_the_same_however_rounded() {
        let bare =
            r#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0]]"#;
        assert_eq!(parse(bare).unwrap().horizontal, Unit::Degree);
        let feet = |size: &str| {
            let text =
                format!(r#"COMPD_CS["c",{bare},VERT_CS["v",VERT_DATUM["d",2005],UNIT["US survey foot",{size}]]]"#);
            parse(&text).unwrap().vertical
        };
        for size in ["0.304800609601219", "0.3048006096012192", "0.3048006096"] {
            assert_eq!(feet(size), Some(Unit::US_FOOT), "{size}");
        }
        assert_eq!((feet("0.3048"), feet("0.5")), (Some(0.3048), Some(0.5)));
    }

    #[test]
    fn a_compound_system_may_be_bound_as_a_whole_or_in_parts() {
        let datum = r#"DATUM["unknown",ELLIPSOID["e",6378388,297]]"#;
        let base = format!(
            r#"GEOGCRS["g",{datum},CS[ellipsoidal,2],AXIS["lat",north],AXIS["lon",east],ANGLEUNIT["degree",0.0174532925199433]]"#
        );
        let height = r#"VERTCRS["h",VDATUM["v"],CS[vertical,1],AXIS["up",up],LENGTHUNIT["metre",1]]"#;
        let bound = |source: &str| {
            format!(
                r#"BOUNDCRS[SOURCECRS[{source}],TARGETCRS[GEOGCRS["WGS 84"]],ABRIDGEDTRANSFORMATION["t",METHOD["Geocentric translations"],
                PARAMETER["x",-87],PARAMETER["y",-98],PARAMETER["z",-121]]]"#
            )
        };
        let whole = bound(&format!(r#"COMPOUNDCRS["c",{base},{height}]"#));
        let parts = format!(r#"COMPOUNDCRS["c",{},{height}]"#, bound(&base));
        for text in [whole, parts] {
            let crs = parse(&text).unwrap();
            assert_eq!(
                (crs.name.as_deref(), crs.kind, crs.vertical),
                (Some("g"), CrsKind::Geographic, Some(1.0)),
                "{text}"
            );
            let shift = crate::wkt::bound_shift(&text);
            assert_eq!(shift.map(|shift| shift[0]), Some(-87.0), "{text}");
        }
    }

    #[test]
    fn two_systems_separated_by_a_comma_are_a_compound_system() {
        let text = r#"PROJCS["P",GEOGCS["G",UNIT["Degree",0.0174]],UNIT["Foot_US",0.3048006096012192]],VERTCS["V",UNIT["Meter",1.0]]"#;
        let crs = parse(text).unwrap();
        assert_eq!((crs.horizontal, crs.vertical, crs.name.as_deref()), (Unit::UsFoot, Some(1.0), Some("P")));
    }

    #[test]
    fn damaged_text_is_no_system() {
        let deep = "A[".repeat(100_000);
        for text in
            ["", "hello", "PROJCS[", r#"PROJCS["x""#, "PROJCS[]]", "VERT_CS[\"v\",UNIT[\"metre\",1]]", deep.as_str()]
        {
            assert_eq!(parse(text), None, "{}", &text[..text.len().min(20)]);
        }
    }
}
