//! Reading GeoJSON (RFC 7946). Coordinates are longitude and latitude on WGS 84, unless the member `crs` of the earlier version says
//! otherwise, as GIS programs still write it.

use std::path::Path;

use serde::{Deserialize, Deserializer};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::lines::attribute::{Attribute, NAME_FIELD, WantedAttributes, no_attribute};
use crate::lines::collector::FeatureCollector;
use crate::lines::feature::RawGeometry;
use crate::lines::geojson_geometry::geometry;
use crate::lines::geojson_properties::properties;
use crate::lines::options::{LineOptions, LinePurpose};
use crs::crs_name::CrsName;
use crs::from_wkt::from_epsg;
use crs::system::Crs;
use sys::{Error, Result, interrupt};

/// The system of GeoJSON that says none.
const WGS_84: u32 = 4326;

/// What begins a document of a text sequence.
const RECORD_SEPARATOR: u8 = 0x1e;

/// What programs write for numbers that JSON does not have, in small letters or capitals.
const NO_NUMBERS: [&str; 5] = ["-Infinity", "-Inf", "Infinity", "Inf", "NaN"];

/// Longitudes may go on beyond the antimeridian.
const FARTHEST: [f64; 2] = [540.0, 90.0];

/// A longer value of the member `crs` says nothing.
const LONGEST_CRS: usize = 1 << 16;

/// The members of a document that matter here. All but the type are kept as texts: whole trees of values would take many times the memory.
#[derive(Deserialize)]
struct Document<'a> {
    #[serde(rename = "type")]
    kind: String,
    /// The value null says that the CRS is not known; without the member it is.
    #[serde(borrow, default, deserialize_with = "with_null")]
    crs: Option<&'a RawValue>,
    #[serde(borrow, default)]
    features: Option<Vec<&'a RawValue>>,
}

#[derive(Deserialize)]
struct Feature<'a> {
    #[serde(borrow)]
    geometry: Option<&'a RawValue>,
    #[serde(borrow)]
    properties: Option<&'a RawValue>,
}

fn with_null<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<&'de RawValue>, D::Error> {
    <&RawValue>::deserialize(deserializer).map(Some)
}

/// Hands the features of the document `bytes`, or of the documents one after the other, to `collector`. Returns the coordinate reference
/// system that it says.
///
/// # Errors
/// `Input` if it is no GeoJSON, and those of the collector.
pub(super) fn read(path: &Path, bytes: &[u8], options: &LineOptions, collector: &mut FeatureCollector) -> Result<Crs> {
    let broken = |error: serde_json::Error| {
        Error::input(path, format!("is not readable GeoJSON: {}", why_no_json(bytes, &error)))
    };
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut documents = serde_json::Deserializer::from_slice(text).into_iter::<Document>();
    let first = documents.next();
    let rest = text.get(documents.byte_offset()..).unwrap_or_default();
    let document = match first {
        Some(Ok(document)) if rest.trim_ascii().is_empty() => document,
        Some(Ok(_)) if is_json(rest) => return read_sequence(path, text, options, collector),
        _ if text.starts_with(&[RECORD_SEPARATOR]) => return read_sequence(path, text, options, collector),
        _ => serde_json::from_slice(text).map_err(broken)?,
    };
    let crs = if options.crs.is_read() { document_crs(path, document.crs, options.purpose)? } else { Crs::default() };
    match document.kind.as_str() {
        "FeatureCollection" => {
            for (number, feature) in (1..).zip(document.features.unwrap_or_default()) {
                interrupt::check()?;
                let refused = |error: serde_json::Error| {
                    collector.refuse(number, format!("cannot be read: {}", without_place(&error)))
                };
                let feature = serde_json::from_str(feature.get()).map_err(refused)?;
                add(path, number, feature, options, collector)?;
            }
        }
        "Feature" => add(path, 1, serde_json::from_slice(text).map_err(broken)?, options, collector)?,
        _ => {
            let geometry = serde_json::from_slice(text).map_err(broken)?;
            add(path, 1, Feature { geometry: Some(geometry), properties: None }, options, collector)?;
        }
    }
    if options.crs.is_read() && document.crs.is_none() {
        refuse_metres(path, options.purpose, collector)?;
    }
    Ok(crs)
}

/// Returns why a text is no JSON. Some programs write numbers that JSON does not have.
fn why_no_json(text: &[u8], error: &serde_json::Error) -> String {
    let line = text.split(|byte| *byte == b'\n').nth(error.line().saturating_sub(1)).unwrap_or_default();
    // The column is that of the byte that does not fit: the first of the number, or one after it.
    let starts = [1, 2, 3].map(|back| line.get(error.column().saturating_sub(back)..).unwrap_or_default());
    let is_at =
        |number: &[u8], start: &[u8]| start.get(..number.len()).is_some_and(|of| of.eq_ignore_ascii_case(number));
    match NO_NUMBERS.iter().find(|number| starts.iter().any(|start| is_at(number.as_bytes(), start))) {
        Some(number) => format!(
            "it has {number} in line {}, near column {}, and JSON has no such number: give this vertex a number, or leave out its feature",
            error.line(),
            error.column()
        ),
        None => error.to_string(),
    }
}

/// Returns the error of a feature without its place, which does not count from the beginning of the file.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what).into()
}

/// Tells whether a text goes on as JSON does, after blanks and record separators.
pub(super) fn is_json(text: &[u8]) -> bool {
    let is_before = |byte: &u8| byte.is_ascii_whitespace() || *byte == RECORD_SEPARATOR;
    text.iter().find(|byte| !is_before(byte)) == Some(&b'{')
}

/// Reads features or geometries one after the other, as newline-delimited GeoJSON and text sequences (RFC 8142) have them.
fn read_sequence(path: &Path, text: &[u8], options: &LineOptions, collector: &mut FeatureCollector) -> Result<Crs> {
    let records = text.split(|byte| *byte == RECORD_SEPARATOR);
    let documents = records.flat_map(|record| serde_json::Deserializer::from_slice(record).into_iter::<&RawValue>());
    let mut first_crs = None;
    for (number, document) in (1..).zip(documents) {
        interrupt::check()?;
        let refused = |error: serde_json::Error| {
            collector.refuse(number, format!("cannot be read: {}", why_no_json(text, &error)))
        };
        let text = document.map_err(refused)?;
        let document: Document = serde_json::from_str(text.get()).map_err(refused)?;
        first_crs = first_crs.or(document.crs);
        let feature = match document.kind.as_str() {
            "FeatureCollection" => {
                let what = "is a collection: in a file of several documents, each is a feature; make one file of it, for example with \
                            `ogr2ogr lines.gpkg FILE`";
                return Err(collector.refuse(number, what.replace("FILE", &path.display().to_string())));
            }
            "Feature" => serde_json::from_str(text.get()).map_err(refused)?,
            _ => Feature { geometry: Some(text), properties: None },
        };
        add(path, number, feature, options, collector)?;
    }
    if !options.crs.is_read() {
        return Ok(Crs::default());
    }
    if first_crs.is_none() {
        refuse_metres(path, options.purpose, collector)?;
    }
    document_crs(path, first_crs, options.purpose)
}

/// Refuses coordinates that are no longitude and latitude, where nothing says what they are.
fn refuse_metres(path: &Path, purpose: LinePurpose, collector: &FeatureCollector) -> Result<()> {
    let is_beyond = |[x, y, _]: &&[f64; 3]| x.abs() > FARTHEST[0] || y.abs() > FARTHEST[1];
    match collector.find_vertex(is_beyond) {
        None => Ok(()),
        Some((number, [x, y, _])) => {
            let remedy = match purpose {
                LinePurpose::Breaklines => {
                    "and the file has no CRS: set crs in [[breaklines]] to that of its coordinates, such as crs = \
                                            \"points\" for the CRS of the points"
                        .into()
                }
                LinePurpose::Clip | LinePurpose::Places => {
                    let [of_crs, of_local] = [purpose.remedy_of_crs(path), purpose.remedy_of_local(path)];
                    format!("and the file has no CRS: {of_crs}; if they are those of points without a CRS, {of_local}")
                }
            };
            Err(collector.refuse(
                number,
                format!(
                    "has a vertex at ({x}, {y}), {remedy}. GeoJSON without the member crs is in degrees on WGS 84, which these are not"
                ),
            ))
        }
    }
}

fn document_crs(path: &Path, member: Option<&RawValue>, purpose: LinePurpose) -> Result<Crs> {
    let Some(text) = member.map(RawValue::get) else { return Ok(from_epsg(WGS_84).unwrap_or_default()) };
    if text == "null" {
        return Ok(Crs::default());
    }
    let value = Some(text).filter(|text| text.len() <= LONGEST_CRS).and_then(|text| serde_json::from_str(text).ok());
    value.as_ref().and_then(named_crs).ok_or_else(|| {
        let start: String = text.chars().take(200).collect();
        let what = format!("its member crs is {start}, which is unknown: {}", purpose.remedy_of_crs(path));
        Error::input(path, what)
    })
}

fn add(
    path: &Path,
    number: u64,
    feature: Feature,
    options: &LineOptions,
    collector: &mut FeatureCollector,
) -> Result<()> {
    let unreadable = |error: serde_json::Error| {
        Error::input(path, format!("feature {number} cannot be read: {}", without_place(&error)))
    };
    let wanted = [
        options.kind_field.as_deref(),
        options.height_field.as_deref(),
        options.purpose.has_names().then_some(NAME_FIELD),
    ];
    let wanted = match wanted {
        [None, None, None] => WantedAttributes::NONE,
        _ => {
            let text = feature.properties.unwrap_or(RawValue::NULL);
            let found = properties(text, wanted).map_err(unreadable)?;
            // Where most have the attribute, a misspelt name must not look like features without a value. A name may be missing.
            let missing =
                wanted.iter().zip(&found.values).take(2).find_map(|(name, value)| name.filter(|_| value.is_none()));
            if let Some(name) = missing {
                let what = no_attribute(name, &found.names);
                return Err(Error::input(path, format!("feature {number}: it {what}")));
            }
            let [kind, height, name] = found.values.map(|value| value.unwrap_or(Attribute::Missing));
            WantedAttributes { kind, height, name }
        }
    };
    let shape = match feature.geometry {
        None => RawGeometry::Empty,
        Some(text) => geometry(text).map_err(unreadable)?,
    };
    collector.add(number, shape, &wanted)
}

/// Returns the system of the member `crs`, as in `{"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}`.
fn named_crs(value: &Value) -> Option<Crs> {
    let name = value.get("properties")?.get("name")?.as_str()?;
    let name = CrsName::read(name)?;
    // A code that is not in the list is still a code: two files with the same one agree.
    Some(name.system().unwrap_or(Crs { epsg: Some(name.plane), ..Crs::default() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::feature::{LineFeature, LineShape};
    use breaklines::FeatureKind;

    fn read_text(text: &str, rest: &str) -> Result<(Crs, Vec<LineFeature>)> {
        let options: LineOptions = toml::from_str(&format!("files = [\"a\"]\n{rest}")).unwrap();
        let mut collector = FeatureCollector::new(Path::new("a.geojson"), &options);
        let crs = read(Path::new("a.geojson"), text.as_bytes(), &options, &mut collector)?;
        Ok((crs, collector.finish().0))
    }

    const LINE: &str = r#"{"type": "LineString", "coordinates": [[0, 0, 1], [2, 0, 1.5, 9]]}"#;

    #[test]
    fn documents_features_and_geometries_are_read() {
        let feature = format!(r#"{{"type": "Feature", "properties": {{"T": "river", "Z": 4}}, "geometry": {LINE}}}"#);
        let all = format!(r#"{{"type": "FeatureCollection", "features": [{feature}, {feature}]}}"#);
        for (text, count) in [(LINE, 1), (feature.as_str(), 1), (all.as_str(), 2)] {
            let (crs, features) = read_text(text, "").unwrap();
            assert_eq!((crs.epsg, features.len()), (Some(4326), count), "{text}");
            assert_eq!(features[0].shape, LineShape::Line(vec![[0.0, 0.0, 1.0], [2.0, 0.0, 1.5]]));
        }
        let (_, features) = read_text(&all, "kind_field = \"T\"\nheight_field = \"Z\"").unwrap();
        assert_eq!((features[1].number, features[1].kind), (2, FeatureKind::River));
        assert_eq!(features[1].shape.outlines()[0][0][2], 4.0);
        let error = read_text(&all, "kind_field = \"KIND\"").unwrap_err().to_string();
        assert!(error.contains("feature 1") && error.contains("it has T, Z"), "{error}");
    }

    #[test]
    fn areas_and_collections_are_read() {
        let ring = |x: u32| format!("[[{x},0,1],[{},0,1],[{x},1,1],[{x},0,1]]", x + 1);
        let polygon = format!(r#"{{"type": "Polygon", "coordinates": [{}, {}]}}"#, ring(0), ring(5));
        let areas = format!(r#"{{"type": "MultiPolygon", "coordinates": [[{}], [{}]]}}"#, ring(0), ring(5));
        let both = format!(r#"{{"type": "GeometryCollection", "geometries": [{polygon}, {areas}]}}"#);
        let (_, features) = read_text(&both, "kind = \"lake\"").unwrap();
        let rings: Vec<usize> = features.iter().map(|feature| feature.shape.outlines().len()).collect();
        assert_eq!(rings, [2, 1, 1]);
        let point = r#"{"type": "Point", "coordinates": [1, 2, 3]}"#;
        assert!(read_text(point, "").unwrap_err().to_string().contains("is a point"));
    }

    #[test]
    fn the_earlier_member_says_another_system() {
        let with = |crs: &str| {
            read_text(&format!(r#"{{"type": "FeatureCollection", "crs": {crs}, "features": []}}"#), "")
                .map(|read| read.0)
        };
        let named = |name: &str| with(&format!(r#"{{"type": "name", "properties": {{"name": "{name}"}}}}"#));
        assert_eq!(named("urn:ogc:def:crs:EPSG::25832").unwrap().epsg, Some(25832));
        assert_eq!(named("EPSG:99999").unwrap().epsg, Some(99999));
        assert_eq!(named("urn:ogc:def:crs:OGC:1.3:CRS84").unwrap().epsg, Some(4326));
        let compound = named("urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783").unwrap();
        assert_eq!((compound.epsg, compound.vertical), (Some(25832), Some(1.0)));
        assert_eq!(with("null").unwrap(), Crs::default());
        assert!(named("my grid").unwrap_err().to_string().contains("my grid"));
        for choice in ["points", "EPSG:25832"] {
            let text = r#"{"type": "FeatureCollection", "crs": {"type": "my grid"}, "features": []}"#;
            assert_eq!(read_text(text, &format!("crs = {choice:?}")).unwrap().0, Crs::default(), "{choice}");
        }
    }

    #[test]
    fn documents_one_after_the_other_are_read() {
        let feature = format!(r#"{{"type": "Feature", "properties": {{"T": "river"}}, "geometry": {LINE}}}"#);
        for text in [
            format!("{feature}\n{feature}"),
            format!("{feature}\r\n\n{LINE}\n"),
            format!("\u{1e}{feature}\n\u{1e}{feature}\n"),
            format!("\u{feff}{LINE}{LINE}"),
            format!("\u{1e}{feature}\n{feature}"),
        ] {
            let (crs, features) = read_text(&text, "").unwrap();
            assert_eq!((crs.epsg, features.len(), features[1].number), (Some(4326), 2, 2), "{text}");
        }
        let (_, features) = read_text(&format!("{feature}\n{feature}"), "kind_field = \"T\"").unwrap();
        assert_eq!(features[1].kind, FeatureKind::River);
        let cut = &feature[..feature.len() - 9];
        for (text, word) in [
            (format!("{feature}\n{cut}"), "feature 2 cannot be read"),
            (format!("\u{1e}{cut}\n\u{1e}{feature}\n"), "feature 1 cannot be read"),
            (format!("{feature}\n{{\"type\": \"FeatureCollection\", \"features\": []}}"), "feature 2 is a collection"),
            (format!("{feature} and more"), "trailing characters"),
        ] {
            let error = read_text(&text, "").unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }

    #[test]
    fn metres_without_a_system_are_refused() {
        let metres = LINE.replace("[2, 0", "[565020, 5933030");
        let error = read_text(&metres, "").unwrap_err().to_string();
        assert!(error.starts_with("a.geojson: feature 1 has a vertex at (565020, 5933030)"), "{error}");
        assert!(error.contains("set crs in [[breaklines]]") && error.contains("crs = \"points\""), "{error}");
        assert!(read_text(&format!("{LINE}\n{metres}"), "").unwrap_err().to_string().contains("feature 2"));
        assert_eq!(read_text(&metres, "crs = \"points\"").unwrap().1.len(), 1);
        let named = r#"{"type": "LineString", "crs": {"type": "name", "properties": {"name": "EPSG:25832"}},"#;
        assert_eq!(read_text(&metres.replace(r#"{"type": "LineString","#, named), "").unwrap().0.epsg, Some(25832));
    }

    #[test]
    fn a_height_may_be_null() {
        let error = read_text(&LINE.replace("1.5", "null"), "").unwrap_err().to_string();
        assert!(error.contains("feature 1 has a vertex without a height, its number 2, at (2, 0)"), "{error}");
        assert_eq!(read_text(&LINE.replace("1.5", "null"), "heights = \"points\"").unwrap().1.len(), 1);
    }

    #[test]
    fn what_is_broken_is_named() {
        for (text, word) in [
            ("{\"type\": \"FeatureCollection\", \"features\": [", "is not readable GeoJSON"),
            ("{}", "missing field"),
            (r#"{"type": "Topology"}"#, "Topology"),
            (
                r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": {"type": "Circle"}}]}"#,
                "feature 1",
            ),
            (r#"{"type": "LineString", "coordinates": [[0, null, 1]]}"#, "null"),
            (
                r#"{"type": "LineString", "coordinates": [[0, 1, NaN], [1, 2, 3]]}"#,
                "it has NaN in line 1, near column 4",
            ),
            ("{\"type\": \"LineString\",\n \"coordinates\": [[0, 1, -Infinity]]}", "it has -Infinity in line 2"),
            (r#"{"type": "LineString", "coordinates": [[0, 1, nan], [1, 2, 3]]}"#, "it has NaN"),
            ("{\"type\": \"Point\"}\n{\"type\": \"LineString\", \"coordinates\": [[0, 1, Infinity]]}", "is a point"),
            (r#"{"type": "LineString", "coordinates": [[0], [1]]}"#, "no place"),
            (r#"{"type": "LineString", "coordinates": [[0, 0], [1, 1]]}"#, "no heights"),
        ] {
            let error = read_text(text, "").unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
        assert!(read_text(r#"{"type": "FeatureCollection"}"#, "").unwrap().1.is_empty());
        assert!(read_text(r#"{"type": "Feature", "geometry": null, "properties": null}"#, "").unwrap().1.is_empty());
    }
}
