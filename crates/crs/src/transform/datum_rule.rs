//! Which datums a job takes for one.

use crate::datum::{Datum, Sameness};
use serde::{Deserialize, Serialize};

/// `[input] datums`: whether datums that nearly agree are one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DatumRule {
    /// No two datums are one: a way from one to another is refused.
    #[default]
    Strict,
    /// Datums that agree with WGS 84 to a metre or two are one, such as NAD83, ETRS89 and GDA2020: longitudes and latitudes stay as they
    /// are.
    Close,
}

impl DatumRule {
    /// Returns whether the job uses what the program does by itself.
    pub fn is_default(&self) -> bool {
        *self == DatumRule::Strict
    }
}

/// The shifts that need a grid, by the beginnings of the comparable names of the two datums: the files that PROJ has for them. An empty
/// name is any other datum.
const GRIDS: [(&str, &str, &str); 12] = [
    ("nad27", "", "NADCON or NTv2: us_noaa_conus.tif, ca_nrc_ntv2_0.tif"),
    ("nad83", "nad83", "NADCON5: us_noaa_nadcon5_nad83_1986_nad83_harn_conus.tif and the like"),
    ("osgb", "", "OSTN15: uk_os_OSTN15_NTv2_OSGBtoETRS.tif"),
    ("dhdn", "", "BETA2007: de_adv_BETA2007.tif"),
    ("ntf", "", "fr_ign_gr3df97a.tif"),
    ("agd", "", "au_icsm_A66_National_13_09_01.tif, au_icsm_National_84_02_07_01.tif"),
    ("gda94", "gda2020", "au_icsm_GDA94_GDA2020_conformal.tif"),
    ("nzgd49", "", "nz_linz_nzgd2kgrid0005.tif"),
    ("ch1903", "", "CHENyx06: ch_swisstopo_CHENyx06a.tif"),
    ("tokyo", "", "TKY2JGD: jp_gsi_tky2jgd.tif"),
    ("jgd2000", "jgd2011", "jp_gsi_touhokutaiheiyouoki2011.tif"),
    ("ed50", "", "that of the country, such as es_ign_SPED2ETV2.tif of Spain"),
];

/// How one datum stands to another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum DatumWay {
    /// They are one.
    Same,
    /// Nothing says that they are two, but one of them has no name.
    Assumed(String),
    /// They differ by a metre or two, which the user does not mind.
    TakenAlike(String),
    /// One needs a shift to the other. The text says which.
    Shift(String),
}

/// Returns how `from` stands to `to`.
pub(crate) fn datum_way(from: &Datum, to: &Datum, rule: DatumRule) -> DatumWay {
    let name = |datum: &Datum| datum.name().unwrap_or("an unnamed datum").to_string();
    let names = format!("{} and {}", name(from), name(to));
    let difference = match from.sameness(to) {
        Sameness::Known => return DatumWay::Same,
        Sameness::Assumed => return DatumWay::Assumed(names),
        Sameness::Refuted(difference) => difference,
    };
    let are_close = from.is_close_to(to);
    if are_close && rule == DatumRule::Close {
        return DatumWay::TakenAlike(names);
    }
    let fits = |datum: &Datum, start: &str| start.is_empty() || datum.is_named_like(start);
    let is_between = |a: &str, b: &str| (fits(from, a) && fits(to, b)) || (fits(from, b) && fits(to, a));
    let what = match GRIDS.iter().find(|(a, b, _)| is_between(a, b)) {
        Some((_, _, grid)) => format!("a shift that needs a grid ({grid})"),
        None => "a shift".to_string(),
    };
    let remedy = if are_close {
        ". As these two agree to a metre or two, [input] datums = \"close\" treats them as one"
    } else {
        ""
    };
    DatumWay::Shift(format!(
        "they differ in {difference}: the transformation between them needs {what}, which gdt-batch does not do{remedy}"
    ))
}
