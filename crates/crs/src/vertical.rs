//! The system that heights count in.

use crate::codes::{HeightCode, height_datum, heights};
use crate::unit::Unit;
use crate::wkt::{WktNode, comparable_name};
use serde::{Deserialize, Serialize};

/// Parts of comparable names that writers vary, and the code of the datum. The rest is in the tables of `codes.rs`.
const VARIED: [(&[&str], u32); 15] = [
    (&["navd88", "navd1988", "northamericanverticaldatum"], 5103),
    (&["ngvd29", "ngvd1929", "nationalgeodeticvertical"], 5102),
    (&["egm96", "egm1996"], 5171),
    (&["egm2008"], 1027),
    (&["ign69", "nivellementgeneraldelafranceign69"], 5119),
    (&["dhhn2016", "deutscheshaupthoehennetz2016"], 1170),
    (&["dhhn92", "dhhn1992", "deutscheshaupthoehennetz1992"], 5181),
    (&["newlyn"], 5101),
    (&["normaalamsterdamspeil"], 5109),
    (&["rh2000", "rikets2000", "riketshojdsystem2000"], 5177),
    (&["australianheightdatum"], 5111),
    (&["evrf2007", "europeanverticalreferenceframe2007"], 5215),
    (&["evrf2000", "europeanverticalreferenceframe2000"], 5129),
    (&["cgvd28", "canadiangeodeticverticaldatumof1928"], 5114),
    (&["cgvd2013", "canadiangeodeticverticaldatumof2013"], 1127),
];

/// What stands for heights above an ellipsoid in the place of a system of heights: the codes of GeoTIFF 1.0 (section 6.3.4.1), and that
/// of WGS 84 with heights, which some writers put there.
const ELLIPSOIDS: [u32; 34] = {
    let mut codes = [4979; 34];
    let mut i = 1;
    while i < codes.len() {
        codes[i] = 5000 + i as u32;
        i += 1;
    }
    codes
};

/// What a file says of the system that its heights count in.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VerticalSystem {
    /// The EPSG code of the system.
    pub epsg: Option<u32>,
    /// Its name.
    pub name: Option<String>,
    /// The name of its datum.
    pub datum: Option<String>,
    /// Whether z counts downwards, if its text says so or the contrary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub downward: Option<bool>,
    /// Whether its text says that heights count from an ellipsoid.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ellipsoidal: bool,
}

impl VerticalSystem {
    /// Returns the system of a node of well-known text; `None` if it says nothing.
    pub(crate) fn of(node: &WktNode) -> Option<VerticalSystem> {
        let datum = node.child(&["VERT_DATUM", "VDATUM", "VERTICALDATUM", "VRF", "DATUM"]);
        let text = |node: &WktNode| node.text(0).map(str::to_string).filter(|name| !name.is_empty());
        let system = VerticalSystem {
            epsg: node.epsg(),
            name: text(node),
            datum: datum.and_then(text),
            downward: downward(node),
            ellipsoidal: datum.is_some_and(is_ellipsoid),
        };
        (system != VerticalSystem::default()).then_some(system)
    }

    /// Returns the metres of a unit of height by its code; `None` for a code that is not known.
    pub(crate) fn metres_of_code(&self) -> Option<f64> {
        // By way of the unit, two ways to round a foot are one.
        Unit::from_metres(heights().get(&self.epsg?).map(|code| code.metres)).metres_per_unit()
    }

    /// Returns the code of the system, for heights in a unit of so many metres: its own, or else that of the system with its datum, its
    /// direction and this unit. `None` if no code, or name, of it is known.
    pub fn system_code(&self, metres: f64) -> Option<u32> {
        let fits = |code: &HeightCode| {
            (code.metres - metres).abs() < 1e-8 && self.is_depth().unwrap_or(false) == code.is_depth
        };
        if let Some(code) = self.epsg.filter(|code| heights().get(code).is_some_and(fits)) {
            return Some(code);
        }
        let datum = self.keys().iter().find_map(|key| key.parse::<u32>().ok())?;
        let of_datum = heights().iter().filter(|(_, code)| code.datum == datum && fits(code));
        of_datum.map(|(code, _)| *code).min()
    }

    /// Returns the name for messages.
    pub fn label(&self) -> String {
        let name = self.name.as_ref().or(self.datum.as_ref()).cloned();
        name.unwrap_or_else(|| self.epsg.map_or("unnamed".into(), |code| format!("EPSG:{code}")))
    }

    /// Says in what the datums differ, or in what they cannot be compared; a system that says nothing agrees with all.
    pub fn difference(&self, other: &VerticalSystem) -> Option<String> {
        self.difference_in_datum(other).or_else(|| self.difference_in_direction(other))
    }

    /// As [`VerticalSystem::difference`], of the datums alone.
    pub fn difference_in_datum(&self, other: &VerticalSystem) -> Option<String> {
        let (own, others) = (self.keys(), other.keys());
        let (label, other_label) = (self.label(), other.label());
        if !own.is_empty() && !others.is_empty() && !own.iter().any(|key| others.contains(key)) {
            let unknown = self.unknown_code().or_else(|| other.unknown_code());
            let doubt = unknown.map_or(String::new(), |code| {
                format!(", and EPSG:{code} is not in the list of known codes of heights")
            });
            return Some(format!("the datum of heights ({label}, {other_label}{doubt})"));
        }
        None
    }

    /// As [`VerticalSystem::difference`], of the directions alone.
    pub fn difference_in_direction(&self, other: &VerticalSystem) -> Option<String> {
        let (label, other_label) = (self.label(), other.label());
        let differs = matches!((self.is_depth(), other.is_depth()), (Some(own), Some(others)) if own != others);
        differs.then(|| format!("the direction of heights, one of which are depths ({label}, {other_label})"))
    }

    /// Returns all that the datum may be known by: codes of the dataset, or comparable names.
    fn keys(&self) -> Vec<String> {
        let names = [&self.name, &self.datum].into_iter().flatten().map(|name| comparable_name(name));
        let mut keys: Vec<String> = names.filter_map(|name| known_name(&name)).collect();
        if let Some(code) = self.epsg {
            // Old files have the code of the datum in place of that of the system.
            keys.push(heights().get(&code).map_or(code, |known| known.datum).to_string());
        }
        keys
    }

    /// Returns whether z counts downwards; `None` if neither the text nor the code nor the name of the system says so.
    pub(crate) fn is_depth(&self) -> Option<bool> {
        let of_code = || self.epsg.and_then(|code| heights().get(&code)).map(|code| code.is_depth);
        self.downward
            .or_else(of_code)
            .or_else(|| self.name.as_deref().map(|name| comparable_name(name).contains("depth")))
    }

    /// Returns whether it says that heights count from an ellipsoid, not from a geoid or the sea.
    pub(crate) fn is_ellipsoidal(&self) -> bool {
        let names = [&self.name, &self.datum].into_iter().flatten();
        self.ellipsoidal
            || self.epsg.is_some_and(|code| ELLIPSOIDS.contains(&code))
            || names.into_iter().any(|name| comparable_name(name).contains("ellipsoid"))
    }

    /// Returns its code if that is all that is known.
    fn unknown_code(&self) -> Option<u32> {
        let is_known =
            |code: &u32| heights().contains_key(code) || heights().values().any(|known| known.datum == *code);
        self.epsg.filter(|code| !is_known(code) && self.name.is_none() && self.datum.is_none())
    }
}

/// Returns whether the axis of a vertical system goes down, as its direction says, or ESRI's parameter for it.
fn downward(node: &WktNode) -> Option<bool> {
    let parameters = || node.children().filter(|child| child.keyword == "PARAMETER");
    let is_direction = |child: &&WktNode| child.text(0).is_some_and(|name| name.eq_ignore_ascii_case("direction"));
    let of_axis = node.child(&["AXIS"]).and_then(|axis| axis.text(1)).and_then(|direction| {
        let is = |word: &str| direction.eq_ignore_ascii_case(word);
        if is("down") { Some(true) } else { is("up").then_some(false) }
    });
    of_axis.or_else(|| parameters().find(is_direction)?.number(1).map(|direction| direction < 0.0))
}

/// Returns whether the datum of heights is an ellipsoid: ESRI writes that of the horizontal system, version 1 of the text has the type 2002.
fn is_ellipsoid(datum: &WktNode) -> bool {
    datum.child(&["SPHEROID", "ELLIPSOID"]).is_some() || datum.number(1) == Some(2002.0)
}

fn known_name(name: &str) -> Option<String> {
    const ENDS: [&str; 6] = ["ftus", "usft", "ft", "heights", "height", "depth"];
    let own = ENDS.iter().fold(name, |name, end| name.trim_end_matches(*end));
    let varied =
        || VARIED.iter().find(|(parts, _)| parts.iter().any(|part| name.contains(part))).map(|(_, datum)| *datum);
    if let Some(datum) = height_datum(own).or_else(varied) {
        return Some(datum.to_string());
    }
    (!["", "unknown", "unnamed", "none", "undefined"].contains(&own)).then(|| own.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_names_of_one_vertical_datum_agree() {
        let named = |name: &str| VerticalSystem { name: Some(name.into()), ..VerticalSystem::default() };
        let coded = |code| VerticalSystem { epsg: Some(code), ..VerticalSystem::default() };
        for other in
            [named("NAVD88 height (ftUS)"), named("North_American_Vertical_Datum_1988"), coded(6360), coded(5103)]
        {
            assert_eq!(coded(5703).difference(&other), None, "{other:?}");
        }
        assert_eq!(named("DVR90 height").difference(&named("DVR90")), None);
        assert_eq!(VerticalSystem::default().difference(&coded(5703)), None);
        let differs = coded(5702).difference(&named("NAVD88 - Geoid12B (Meters)")).unwrap();
        assert_eq!(differs, "the datum of heights (EPSG:5702, NAVD88 - Geoid12B (Meters))");
    }

    #[test]
    fn a_code_agrees_with_the_names_that_epsg_and_esri_have_for_it() {
        let named = |name: &str| VerticalSystem { name: Some(name.into()), ..VerticalSystem::default() };
        let coded = |code| VerticalSystem { epsg: Some(code), ..VerticalSystem::default() };
        for (code, names) in [
            (7839, ["NZVD2016 height", "NZVD2016"]),
            (5728, ["LN02 height", "Landesnivellement_1902"]),
            (3900, ["N2000 height", "N2000"]),
            (5710, ["Ostend height", "Oostende"]),
            (5705, ["Baltic 1977 height", "Baltic"]),
            (5214, ["Genoa 1942 height", "Genoa"]),
        ] {
            for name in names {
                assert_eq!(coded(code).difference(&named(name)), None, "{code} {name}");
                assert_eq!(named(name).difference(&named(names[0])), None, "{code} {name}");
            }
            assert_eq!(coded(code).metres_of_code(), Some(1.0));
            assert!(coded(code).difference(&named("NAVD88 height")).is_some());
        }
        let unknown = coded(31_000).difference(&named("LN02 height")).unwrap();
        assert!(unknown.contains("EPSG:31000 is not in the list of known codes of heights"), "{unknown}");
        assert!(coded(5703).difference(&coded(6357)).unwrap().contains("depths"));
    }

    #[test]
    fn heights_above_an_ellipsoid_are_known_by_their_code_name_or_datum() {
        let of = |text: &str| VerticalSystem::of(&WktNode::parse_all(text).unwrap()[0]).unwrap().is_ellipsoidal();
        let esri =
            |datum: &str| format!(r#"VERTCS["WGS_1984",{datum},PARAMETER["Vertical_Shift",0.0],UNIT["Meter",1.0]]"#);
        assert!(of(&esri(r#"DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]]"#)));
        assert!(!of(&esri(r#"VDATUM["EGM96_Geoid"]"#)));
        let typed = |kind: u32| format!(r#"VERT_CS["GRS 80",VERT_DATUM["unknown",{kind}],UNIT["metre",1]]"#);
        assert!(of(&typed(2002)) && !of(&typed(2005)));
        assert!(of(r#"VERT_CS["NAD83(2011) Ellipsoidal Height",UNIT["metre",1]]"#));
        let coded = |code| VerticalSystem { epsg: Some(code), ..VerticalSystem::default() }.is_ellipsoidal();
        assert!(coded(5030) && coded(5001) && coded(5033) && coded(4979));
        assert!(!coded(5703) && !coded(5000) && !coded(5034) && !VerticalSystem::default().is_ellipsoidal());
    }

    #[test]
    fn heights_and_depths_are_told_apart_by_what_the_text_says_of_their_axis() {
        let of = |text: &str| VerticalSystem::of(&WktNode::parse_all(text).unwrap()[0]).unwrap();
        let datum = r#"VERT_DATUM["Local",2005],UNIT["metre",1]"#;
        let [up, down] = ["UP", "DOWN"].map(|way| of(&format!(r#"VERT_CS["Local",{datum},AXIS["z",{way}]]"#)));
        let esri = |way: &str| {
            of(&format!(r#"VERTCS["Local",VDATUM["Local"],PARAMETER["Direction",{way}],UNIT["Meter",1.0]]"#))
        };
        let said = "the direction of heights, one of which are depths (Local, Local)";
        for (height, depth) in [(&up, &down), (&esri("1.0"), &esri("-1.0")), (&up, &esri("-1.0"))] {
            assert_eq!(height.difference(depth).as_deref(), Some(said));
            assert_eq!((height.difference(height), depth.difference(depth)), (None, None));
        }
        let unknown = |way: &str| of(&format!(r#"VERT_CS["unknown",AXIS["z",{way}]]"#));
        assert!(unknown("UP").difference(&unknown("DOWN")).is_some_and(|said| said.contains("depths")));
        // The axis says more than the name.
        assert_eq!(of(&format!(r#"VERT_CS["Local depth",{datum},AXIS["z",UP]]"#)).is_depth(), Some(false));
    }
}
