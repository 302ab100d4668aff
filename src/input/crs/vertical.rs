//! The system that heights count in.

use crate::input::crs::unit::Unit;
use crate::input::crs::wkt::{WktNode, comparable_name};
use serde::{Deserialize, Serialize};

/// Parts of comparable names and codes of vertical systems, with one name for each datum. The codes are those of systems and, below
/// 5200, those of datums, which old files have instead.
const KNOWN: [(&[&str], &[u32], &str); 16] = [
    (&["navd88", "navd1988", "northamericanverticaldatum"], &[5703, 6360, 8228, 5103], "navd88"),
    (&["ngvd29", "ngvd1929", "nationalgeodeticvertical"], &[5702, 7968, 5102], "ngvd29"),
    (&["egm96", "egm1996"], &[5773, 5171], "egm96"),
    (&["egm2008"], &[3855, 1027], "egm2008"),
    (&["nn2000", "norwaynormalnull2000"], &[5941, 1096], "nn2000"),
    (&["ign69", "nivellementgeneraldelafranceign69"], &[5720, 5119], "ign69"),
    (&["dhhn2016", "deutscheshaupthoehennetz2016"], &[7837, 1170], "dhhn2016"),
    (&["dhhn92", "dhhn1992", "deutscheshaupthoehennetz1992"], &[5783, 5181], "dhhn92"),
    (&["newlyn"], &[5701, 5101], "odn"),
    (&["normaalamsterdamspeil"], &[5709, 5109], "nap"),
    (&["rh2000", "rikets2000", "riketshojdsystem2000"], &[5613, 5177], "rh2000"),
    (&["australianheightdatum"], &[5711, 5111], "ahd"),
    (&["cgvd28", "canadiangeodeticverticaldatumof1928"], &[5713, 5114], "cgvd28"),
    (&["cgvd2013", "canadiangeodeticverticaldatumof2013"], &[6647, 1127], "cgvd2013"),
    (&["evrf2007", "europeanverticalreferenceframe2007"], &[5621, 5215], "evrf2007"),
    (&["evrf2000", "europeanverticalreferenceframe2000"], &[5730, 5129], "evrf2000"),
];

/// What a file says of the system that its heights count in.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VerticalSystem {
    /// The EPSG code of the system.
    pub epsg: Option<u32>,
    /// Its name.
    pub name: Option<String>,
    /// The name of its datum.
    pub datum: Option<String>,
}

impl VerticalSystem {
    /// Returns the system of a node of well-known text; `None` if it says nothing.
    pub(crate) fn of(node: &WktNode) -> Option<VerticalSystem> {
        let datum = node.child(&["VERT_DATUM", "VDATUM", "VERTICALDATUM", "VRF", "DATUM"]);
        let text = |node: &WktNode| node.text(0).map(str::to_string).filter(|name| !name.is_empty());
        let system = VerticalSystem { epsg: node.epsg(), name: text(node), datum: datum.and_then(text) };
        (system != VerticalSystem::default()).then_some(system)
    }

    /// Returns the metres of a unit of height by its code; `None` for a code that is not known.
    pub(crate) fn metres_of_code(&self) -> Option<f64> {
        match self.epsg? {
            5702 | 6360 => Some(Unit::US_FOOT),
            8228 => Some(Unit::FOOT),
            code => KNOWN.iter().any(|(_, codes, _)| codes.contains(&code)).then_some(1.0),
        }
        .filter(|_| self.epsg.is_some_and(|code| code == 3855 || code > 5215))
    }

    /// Returns the name for messages.
    pub(crate) fn label(&self) -> String {
        let name = self.name.as_ref().or(self.datum.as_ref()).cloned();
        name.unwrap_or_else(|| self.epsg.map_or("unnamed".into(), |code| format!("EPSG:{code}")))
    }

    /// Says in what the datums differ; a system that says nothing agrees with all.
    pub(crate) fn difference(&self, other: &VerticalSystem) -> Option<String> {
        let (own, others) = (self.keys(), other.keys());
        let differs = !own.is_empty() && !others.is_empty() && !own.iter().any(|key| others.contains(key));
        differs.then(|| format!("the datum of heights ({}, {})", self.label(), other.label()))
    }

    /// Returns all that the datum may be known by.
    fn keys(&self) -> Vec<String> {
        let names = [&self.name, &self.datum].into_iter().flatten().map(|name| comparable_name(name));
        let mut keys: Vec<String> = names.filter_map(known_name).collect();
        if let Some(code) = self.epsg {
            let known = KNOWN.iter().find(|(_, codes, _)| codes.contains(&code));
            keys.push(known.map_or_else(|| format!("epsg {code}"), |(.., name)| name.to_string()));
        }
        keys
    }
}

fn known_name(name: String) -> Option<String> {
    let known = KNOWN.iter().find(|(parts, ..)| parts.iter().any(|part| name.contains(part)));
    if let Some((.., short)) = known {
        return Some(short.to_string());
    }
    let own =
        ["ftus", "usft", "ft", "heights", "height"].iter().fold(name.as_str(), |name, end| name.trim_end_matches(*end));
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
}
