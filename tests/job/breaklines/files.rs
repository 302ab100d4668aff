//! Writing files of lines in three formats. Coordinates are metres from the origin of the survey, in EPSG:32633.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use rusqlite::{Connection, params};
use serde_json::{Value, json};

use super::terrain::ORIGIN;

/// What the `.prj` of a Shapefile says.
pub(crate) const UTM_33: &str = r#"PROJCS["WGS_1984_UTM_Zone_33N",GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",15.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#;

type Line = Vec<[f64; 3]>;

/// Features of one kind of geometry, each with an attribute, mostly `kind`, and one `level` for all.
pub(crate) struct Features {
    are_areas: bool,
    attribute: String,
    all: Vec<(String, Vec<Line>)>,
    level: Option<f64>,
}

impl Features {
    pub(crate) fn lines(lines: &[(&str, Line)]) -> Features {
        let all = lines.iter().map(|(kind, line)| (kind.to_string(), vec![moved(line)])).collect();
        Features { are_areas: false, attribute: "kind".into(), all, level: None }
    }

    /// Areas: the rings of each are not closed.
    pub(crate) fn areas(areas: &[(&str, Vec<Line>)]) -> Features {
        let closed = |ring: &Line| [moved(ring), vec![moved(ring)[0]]].concat();
        let area = |(kind, rings): &(&str, Vec<Line>)| (kind.to_string(), rings.iter().map(closed).collect());
        Features { are_areas: true, attribute: "kind".into(), all: areas.iter().map(area).collect(), level: None }
    }

    /// Gives the attribute another name.
    pub(crate) fn with_attribute(self, name: &str) -> Features {
        Features { attribute: name.into(), ..self }
    }

    pub(crate) fn with_level(self, level: f64) -> Features {
        Features { level: Some(level), ..self }
    }
}

fn moved(line: &Line) -> Line {
    line.iter().map(|[x, y, z]| [x + ORIGIN[0], y + ORIGIN[1], *z]).collect()
}

/// Writes GeoJSON with the member `crs`, as GIS programs do.
pub(crate) fn geojson(folder: &Path, name: &str, features: &Features) -> PathBuf {
    let feature = |(kind, lines): &(String, Vec<Line>)| {
        let geometry = match features.are_areas {
            true => json!({"type": "Polygon", "coordinates": lines}),
            false => json!({"type": "LineString", "coordinates": lines[0]}),
        };
        let properties = json!({features.attribute.as_str(): kind, "level": features.level});
        json!({"type": "Feature", "properties": properties, "geometry": geometry})
    };
    let all: Vec<Value> = features.all.iter().map(feature).collect();
    let crs = json!({"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32633"}});
    let path = folder.join(name);
    fs::write(&path, json!({"type": "FeatureCollection", "crs": crs, "features": all}).to_string()).unwrap();
    path
}

/// Writes a GeoPackage with one layer. Vertices with NaN for a height make it one without heights.
pub(crate) fn geopackage(folder: &Path, name: &str, features: &Features) -> PathBuf {
    let path = folder.join(name);
    let _ = fs::remove_file(&path);
    let file = Connection::open(&path).unwrap();
    file.execute_batch(
        "CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT, srs_id INTEGER PRIMARY KEY, organization TEXT,
             organization_coordsys_id INTEGER, definition TEXT, description TEXT);
         CREATE TABLE gpkg_contents (table_name TEXT PRIMARY KEY, data_type TEXT, identifier TEXT, srs_id INTEGER);
         CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, geometry_type_name TEXT, srs_id INTEGER, z, m);
         INSERT INTO gpkg_spatial_ref_sys VALUES ('UTM', 32633, 'EPSG', 32633, 'undefined', '');
         INSERT INTO gpkg_contents VALUES ('waters', 'features', 'waters', 32633);
         INSERT INTO gpkg_geometry_columns VALUES ('waters', 'geom', 'GEOMETRY', 32633, 2, 0);
         CREATE TABLE waters (fid INTEGER PRIMARY KEY, geom BLOB, kind TEXT, level REAL);",
    )
    .unwrap();
    if features.attribute != "kind" {
        file.execute(&format!("ALTER TABLE waters RENAME COLUMN kind TO {}", features.attribute), []).unwrap();
    }
    for (kind, lines) in &features.all {
        let blob = blob(features.are_areas, lines);
        file.execute("INSERT INTO waters VALUES (NULL, ?1, ?2, ?3)", params![blob, kind, features.level]).unwrap();
    }
    file.close().unwrap();
    path
}

/// The header of a GeoPackage's geometry without a box, and well-known binary.
fn blob(is_area: bool, lines: &[Line]) -> Vec<u8> {
    let has_z = !lines[0][0][2].is_nan();
    let kind = 2 + u32::from(is_area) + 1000 * u32::from(has_z);
    let mut bytes = [b"GP\0\x01".as_slice(), &32633i32.to_le_bytes(), &[1], &kind.to_le_bytes()].concat();
    if is_area {
        bytes.extend((lines.len() as u32).to_le_bytes());
    }
    for line in lines {
        bytes.extend((line.len() as u32).to_le_bytes());
        for vertex in line {
            let numbers = if has_z { &vertex[..] } else { &vertex[..2] };
            numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        }
    }
    bytes
}

/// Writes a Shapefile with heights, its attributes and its CRS. Returns the path of the `.shp`.
pub(crate) fn shapefile(folder: &Path, name: &str, features: &Features) -> PathBuf {
    let mut bytes = vec![0; 100];
    bytes[..4].copy_from_slice(&9994u32.to_be_bytes());
    for (number, (_, lines)) in (1u32..).zip(&features.all) {
        let record = record(if features.are_areas { 15 } else { 13 }, lines);
        bytes.extend(number.to_be_bytes());
        bytes.extend((record.len() as u32 / 2).to_be_bytes());
        bytes.extend(record);
    }
    let words = bytes.len() as u32 / 2;
    bytes[24..28].copy_from_slice(&words.to_be_bytes());
    let path = folder.join(format!("{name}.shp"));
    fs::write(&path, bytes).unwrap();
    fs::write(path.with_extension("prj"), UTM_33).unwrap();
    fs::write(path.with_extension("dbf"), table(features)).unwrap();
    path
}

fn record(kind: i32, lines: &[Line]) -> Vec<u8> {
    let vertices: Line = lines.concat();
    let mut bytes = [kind.to_le_bytes().as_slice(), &[0; 32]].concat();
    bytes.extend((lines.len() as u32).to_le_bytes());
    bytes.extend((vertices.len() as u32).to_le_bytes());
    let mut start = 0;
    for line in lines {
        bytes.extend(u32::to_le_bytes(start));
        start += line.len() as u32;
    }
    vertices.iter().for_each(|[x, y, _]| bytes.extend([x.to_le_bytes(), y.to_le_bytes()].concat()));
    bytes.extend([0; 16]);
    vertices.iter().for_each(|vertex| bytes.extend(vertex[2].to_le_bytes()));
    bytes
}

/// A dBASE table with the attribute as its column.
fn table(features: &Features) -> Vec<u8> {
    let mut bytes = vec![3, 0, 0, 0];
    bytes.extend((features.all.len() as u32).to_le_bytes());
    bytes.extend([65u8, 0, 17, 0]);
    bytes.resize(32, 0);
    let mut field = [0; 32];
    field[..features.attribute.len()].copy_from_slice(features.attribute.as_bytes());
    (field[11], field[16]) = (b'C', 16);
    bytes.extend(field);
    bytes.push(b'\r');
    let mut text = String::new();
    features.all.iter().for_each(|(kind, _)| write!(text, " {kind:<16}").unwrap());
    bytes.extend(text.bytes());
    bytes
}
