//! The one coordinate reference system of a file that may describe two.

use crate::from_wkt;
use crate::geokeys::GeoKeys;
use crate::geotiff;
use crate::system::Crs;
use sys::{Result, Warnings};

/// Returns the system that the first readable one of `texts` describes, or else `keys`. Warns about a text that is neither readable
/// nor empty, about what is said in a way that cannot be used, and about a text and keys that differ.
pub fn from_records(
    texts: impl Iterator<Item = Result<Vec<u8>>>,
    keys: &GeoKeys,
    warnings: &mut Warnings,
) -> Result<Crs> {
    let text = from_texts(texts, warnings)?;
    let (records, keys) = (keys, geotiff::parse(keys));
    let used = text.as_ref().or(keys.as_ref());
    let problems = text.as_ref().map_or_else(|| geotiff::problems(records), Crs::problems);
    for doubt in problems {
        let label = used.map_or("unknown".into(), Crs::label);
        warnings.push(format!(
            "its coordinate system ({label}): {doubt}; fix: [input] crs or [input] unit, if that is wrong"
        ));
    }
    if let (Some(text), Some(keys)) = (&text, &keys)
        && let differences = text.differences(keys)
        && !differences.is_empty()
    {
        warnings.push(format!(
            "it has two coordinate systems: {} as WKT (used) and {} as GeoTIFF keys; they differ in {}; fix: [input] crs, if the first \
             is wrong",
            text.label(),
            keys.label(),
            differences.join(" and ")
        ));
    }
    Ok(text.or(keys).unwrap_or_default())
}

/// Returns whether the bytes of a record are well-known text that says what the system is.
pub fn is_readable(text: &[u8]) -> bool {
    from_wkt::parse(&String::from_utf8_lossy(text)).is_some()
}

fn from_texts(texts: impl Iterator<Item = Result<Vec<u8>>>, warnings: &mut Warnings) -> Result<Option<Crs>> {
    for bytes in texts {
        let bytes = bytes?;
        let text = String::from_utf8_lossy(&bytes);
        match from_wkt::parse(&text) {
            Some(crs) => return Ok(Some(crs)),
            None if text.trim_matches(['\0', ' ', '"', '\'']).is_empty() => {}
            None => warnings
                .push("its coordinate system is not well-known text that can be read; fix: [input] crs = \"EPSG:...\""),
        }
    }
    Ok(None)
}
