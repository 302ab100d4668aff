//! The names of datums, as all writers would spell them.

use crate::codes::text_of_code;
use std::collections::HashSet;
use std::sync::OnceLock;

/// Long names and the short ones that other writers use.
const SHORT_NAMES: [(&str, &str); 21] = [
    ("worldgeodeticsystem", "wgs"),
    ("northamericandatum", "nad"),
    ("northamerican", "nad"),
    ("europeanterrestrialreferencesystem", "etrs"),
    ("europeandatum", "ed"),
    ("european", "ed"),
    ("geocentricdatumofaustralia", "gda"),
    ("australiangeodeticdatum", "agd"),
    ("reseaugeodesiquefrancais", "rgf"),
    ("japanesegeodeticdatum", "jgd"),
    ("newzealandgeodeticdatum", "nzgd"),
    ("internationalterrestrialreferenceframe", "itrf"),
    ("ordnancesurveyofgreatbritain", "osgb"),
    ("highaccuracyreferencenetwork", "harn"),
    ("highaccuracyregionalnetwork", "harn"),
    ("canadianspatialreferencesystem", "csrs"),
    ("nationalspatialreferencesystem", ""),
    ("nsrs2007", "2007"),
    ("ensemble", ""),
    ("datum", ""),
    ("rgf93v1", "rgf93"),
];

/// What stands for a name where the writer knew none.
const NO_NAMES: [&str; 5] = ["unknown", "unnamed", "notspecified", "undefined", "userdefined"];

/// Names that share nothing with those of the EPSG dataset, mostly ESRI's, and the names there; also names that the dataset has given up.
/// They are in order.
const ALIASES: [(&str, &str); 58] = [
    ("anna165", "cocosislands65"),
    ("astro52", "marcusisland52"),
    ("australian66", "agd66"),
    ("australian84", "agd84"),
    ("ayabelle", "ayabellelighthouse"),
    ("beacone45", "iwojima45"),
    ("belge50", "bd50"),
    ("belge72", "bd72"),
    ("bellevueign", "bellevue"),
    ("bogota", "bogota75"),
    ("camacupa", "camacupa48"),
    ("camparea", "campareaastro"),
    ("canton66", "phoenixislands66"),
    ("chathamisland71", "chathamislands71"),
    ("china2000", "cgcs2000"),
    ("chinageodeticcoordinatesystem2000", "cgcs2000"),
    ("corregoalegre", "corregoalegre7072"),
    ("dealulpiscului33", "dealulpiscului30"),
    ("dos714", "astrodos71"),
    ("etrf2000pl", "etrs89"),
    ("etrf2000poland", "etrs89"),
    ("fortdesaix", "martinique38"),
    ("geocentricofkorea", "kgd2002"),
    ("grandcayman59", "gcgd59"),
    ("hutzushan", "hutzushan50"),
    ("ig052012intermediate", "ig0512intermediatecrs"),
    ("ig052012intermediatecrs", "ig0512intermediatecrs"),
    ("israel", "israel93"),
    ("ists06168", "southgeorgia68"),
    ("ists07369", "diegogarcia69"),
    ("karbala79polservice", "karbala79"),
    ("kerguelenisland49", "ign62kerguelen"),
    ("kertau", "kertau68"),
    ("korea2000", "kgd2002"),
    ("koreageodetic2002", "kgd2002"),
    ("littlecayman61", "sigd61"),
    ("luxembourg30", "luref"),
    ("magna", "magnasirgas"),
    ("marcariosolis", "macariosolis"),
    ("mexicanof93", "mexicoitrf92"),
    ("nad27definition76", "nad2776"),
    ("nepalnagarkot", "nepal81"),
    ("newzealand49", "nzgd49"),
    ("pdo93", "psd93"),
    ("picodelasnieves", "pn84"),
    ("provisionalsamerican56", "psad56"),
    ("pulkovo42adj58", "pulkovo4258"),
    ("pulkovo42adj83", "pulkovo4283"),
    ("reseaugeodesiquedestpierreetmiquelon2006", "rgspm06"),
    ("rgspm2006", "rgspm06"),
    ("sainteanne", "guadeloupe48"),
    ("santodos65", "santo65"),
    ("selvagemgrande38", "selvagemgrande"),
    ("sgnpmarcariosolis", "macariosolis"),
    ("sirgas", "sirgas95"),
    ("sirgaschile", "sirgaschile2002"),
    ("swisstrf95", "chtrs95"),
    ("wakeeniwetok60", "marshallislands60"),
];

/// Returns the name as all writers would spell it; `None` if it says nothing.
pub(crate) fn datum_name(name: &str) -> Option<String> {
    let lower = name.to_ascii_lowercase();
    let own = lower.strip_prefix("d_").or_else(|| lower.strip_prefix("gcs_")).unwrap_or(&lower);
    // CH1903 and CH1903+ are two datums.
    let words = own.split(|c: char| !c.is_alphanumeric() && c != '+');
    let mut joined: String = words.map(without_century).collect();
    for (long, short) in SHORT_NAMES {
        joined = joined.replace(long, short);
    }
    let says_nothing = joined.is_empty() || NO_NAMES.iter().any(|none| joined.contains(none));
    let alias =
        ALIASES.binary_search_by(|(other, _)| (*other).cmp(joined.as_str())).ok().and_then(|at| ALIASES.get(at));
    (!says_nothing).then(|| alias.map_or(joined, |(_, name)| name.to_string()))
}

/// Writes a year of the twentieth century at the end of a word with two digits.
fn without_century(word: &str) -> String {
    let digits = word.len() - word.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (letters, number) = word.split_at(word.len() - digits);
    match number.strip_prefix("19") {
        Some(year) if digits == 4 => format!("{letters}{year}"),
        _ => word.to_string(),
    }
}

/// Returns whether a geographic system with an EPSG code has this name, so that it tells its datum. "Geographic coordinate system"
/// tells none.
pub(crate) fn is_known(name: &str) -> bool {
    static KNOWN: OnceLock<HashSet<String>> = OnceLock::new();
    let name_of = |code| text_of_code(code)?.split_once("GEOGCS[\"")?.1.split('"').next().and_then(datum_name);
    KNOWN.get_or_init(|| (1..=u32::from(u16::MAX)).filter_map(name_of).collect()).contains(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_datum_has_one_name_whoever_writes_it() {
        for names in [
            ["NAD83(2011)", "NAD83_National_Spatial_Reference_System_2011", "D_NAD_1983_2011", "GCS_NAD_1983_2011"],
            ["NAD83", "North_American_Datum_1983", "D_North_American_1983", "GCS_North_American_1983"],
            ["NAD83(HARN)", "NAD83_High_Accuracy_Reference_Network", "D_North_American_1983_HARN", "NAD83 (HARN)"],
            ["NAD83(NSRS2007)", "NAD83_National_Spatial_Reference_System_2007", "D_NAD_1983_NSRS2007", "NAD83(2007)"],
            ["WGS 84", "WGS_1984", "World Geodetic System 1984 ensemble", "GCS_WGS_1984"],
            ["ETRS89", "European_Terrestrial_Reference_System_1989", "D_ETRS_1989", "GCS_ETRS_1989"],
            ["ED50", "European_Datum_1950", "D_European_1950", "GCS_European_1950"],
            ["RGF93", "Reseau_Geodesique_Francais_1993", "D_RGF_1993", "RGF93 v1"],
        ] {
            let all: Vec<_> = names.iter().map(|name| datum_name(name).unwrap()).collect();
            assert!(all.iter().all(|name| *name == all[0]), "{names:?}: {all:?}");
        }
        assert_ne!(datum_name("CH1903"), datum_name("CH1903+"));
        assert_ne!(datum_name("NAD83"), datum_name("NAD83(CSRS)"));
        for nothing in ["", "unknown", "D_Unknown", "Not_specified_based_on_GRS_1980_ellipsoid"] {
            assert_eq!(datum_name(nothing), None, "{nothing}");
        }
    }

    #[test]
    fn names_of_esri_and_names_that_epsg_has_given_up_are_those_of_today() {
        assert!(ALIASES.is_sorted());
        for (name, _) in ALIASES {
            assert_ne!(datum_name(name).as_deref(), Some(name));
        }
        for (esri, epsg) in [
            ("GCS_Belge_1972", "BD72"),
            ("GCS_Pulkovo_1942_Adj_1958", "Pulkovo 1942(58)"),
            ("D_New_Zealand_1949", "NZGD49"),
            ("Luxembourg 1930", "LUREF"),
        ] {
            assert_eq!(datum_name(esri), datum_name(epsg));
        }
        assert_ne!(datum_name("NAD83(CSRS)v2"), datum_name("NAD83(CSRS)"));
    }
}
