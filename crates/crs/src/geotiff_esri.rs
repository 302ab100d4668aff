//! What ESRI's programs write into the citations of GeoTIFF: names in parts, such as `GCS Name = GCS_NAD_1983_2011|Datum = ...|`, or the
//! whole text of a system after `ESRI PE String = `.

use crate::from_wkt;
use crate::system::Crs;

const TEXT: &str = "ESRI PE String";

/// The parts that name a system.
const NAMES: [&str; 3] = ["PCS Name", "GCS Name", "VCS Name"];

/// Returns the value of a part of a citation, such as `Datum`.
pub(crate) fn part<'a>(citation: &'a str, name: &str) -> Option<&'a str> {
    let parts = citation.split('|').filter_map(|part| part.split_once('='));
    let (_, value) = parts.into_iter().find(|(key, _)| key.trim().eq_ignore_ascii_case(name))?;
    Some(value.trim()).filter(|value| !value.is_empty())
}

/// Returns the name that a citation gives; `None` if it holds the text of a system.
pub(crate) fn title(citation: &str) -> Option<String> {
    if citation.starts_with(TEXT) {
        return None;
    }
    let name = NAMES.iter().find_map(|name| part(citation, name)).unwrap_or(citation);
    Some(name.to_string())
}

/// Returns the system whose text a citation holds.
pub(crate) fn system(citation: &str) -> Option<Crs> {
    let (_, text) = citation.split_once(TEXT)?;
    from_wkt::parse(text.trim_start().strip_prefix('=')?)
}
