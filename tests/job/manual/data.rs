//! Small files for what configurations and commands name: clouds and lines of a survey in UTM zone 33, and of one between two zones.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use toml::{Table, Value};

use crate::breaklines::files::{Features, geojson, geopackage, shapefile};
use crate::coordinate_systems::{code, write as las};
use crate::copc_file::CopcFile;
use crate::las_file::LasFile;
use crate::transformed;

/// The middle of the survey.
const MIDDLE: [f64; 2] = [500_000.0, 4_000_000.0];

/// Makes all files that a configuration names.
pub(super) fn prepare(folder: &Path, job: &Table) {
    let input = &job["input"];
    for name in texts(&input["files"]) {
        cloud(folder, &name, input.as_table().unwrap());
    }
    let crs = input.get("crs").and_then(Value::as_str).and_then(|crs| crs.strip_prefix("EPSG:"));
    if let Some(clip) = input.get("clip").and_then(Value::as_str) {
        let square = vec![[-90.0, -90.0, 0.0], [90.0, -90.0, 0.0], [90.0, 90.0, 0.0], [-90.0, 90.0, 0.0]];
        write_features(folder, clip, &Features::areas(&[("area", vec![square])]), crs);
    }
    for lines in job.get("breaklines").and_then(Value::as_array).into_iter().flatten() {
        texts(&lines["files"]).iter().for_each(|name| write_lines(folder, name, lines.as_table().unwrap(), crs));
    }
}

fn texts(list: &Value) -> Vec<String> {
    list.as_array().unwrap().iter().map(|text| text.as_str().unwrap().to_owned()).collect()
}

/// Makes a cloud that `name` names, which may be a glob, unless it is there. `input` says what it should be like.
pub(super) fn cloud(folder: &Path, name: &str, input: &Table) {
    let name = name.replace('*', "a");
    let path = folder.join(&name);
    if path.exists() {
        return;
    }
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let zone = [("zone15", 26915, 0), ("zone16", 26916, 1)].into_iter().find(|(zone, ..)| name.contains(zone));
    let columns = input.get("csv").and_then(|csv| csv.get("columns"));
    if let Some((_, zone, share)) = zone {
        let survey = transformed::survey(folder, "survey.csv", &format!("EPSG:{zone}"), share, 2);
        transformed::las(folder, &survey, &name, &[code(zone)], 0.01);
    } else if name.ends_with(".copc.laz") {
        fs::write(path, CopcFile::new(&LasFile::new(4, 7, 0, 400), 3).bytes()).unwrap();
    } else if name.ends_with(".las") || name.ends_with(".laz") {
        // A file counts by its content, so both names will do.
        las(folder, &name, &[code(32633)]);
    } else if input.contains_key("missing_crs") {
        transformed::survey(folder, &name, "EPSG:4269", 2, 7);
    } else {
        fs::write(path, text(columns.map(texts))).unwrap();
    }
}

/// Returns rows of points. With `columns` they have these, with semicolons between them, and otherwise a header says them.
fn text(columns: Option<Vec<String>>) -> String {
    let has_header = columns.is_none();
    let columns = columns.unwrap_or_else(|| ["x", "y", "z", "classification"].map(String::from).to_vec());
    let delimiter = if has_header { "," } else { ";" };
    let mut rows = if has_header { columns.join(",") + "\n" } else { String::new() };
    for i in 0..100u32 {
        let value = |name: &String| match name.as_str() {
            "x" => format!("{:.2}", MIDDLE[0] + f64::from(i % 10) * 1.5 + f64::from(i * 37 % 11) / 20.0),
            "y" => format!("{:.2}", MIDDLE[1] + f64::from(i / 10) * 1.5 + f64::from(i * 53 % 13) / 20.0),
            "z" => format!("{:.2}", f64::from(i * 29 % 17) / 10.0),
            "classification" => "2".into(),
            _ => i.to_string(),
        };
        writeln!(rows, "{}", columns.iter().map(value).collect::<Vec<_>>().join(delimiter)).unwrap();
    }
    rows
}

/// Makes a file of lines with all values of `kind_field` that the configuration lists. GeoJSON is in the CRS that the points are said to
/// be in.
fn write_lines(folder: &Path, name: &str, options: &Table, crs: Option<&str>) {
    let name = name.replace('*', "a");
    let path = folder.join(&name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let attribute = options.get("kind_field").and_then(Value::as_str).unwrap_or("kind");
    let listed = options.get("kinds").and_then(Value::as_table).map(|kinds| kinds.keys().cloned().collect::<Vec<_>>());
    let values = listed.unwrap_or_else(|| ["line", "river"].map(String::from).to_vec());
    let is_lake = options.get("kind").and_then(Value::as_str) == Some("lake");
    let features = if is_lake {
        let shore = vec![[-12.0, 2.0, 1.0], [-4.0, 2.0, 1.0], [-4.0, 9.0, 1.0], [-12.0, 9.0, 1.0]];
        Features::areas(&[("lake", vec![shore])])
    } else {
        let line = |i: usize| vec![[-9.0, -4.0 - 3.0 * i as f64, 2.0], [9.0, -5.0 - 3.0 * i as f64, 1.0]];
        let lines: Vec<_> = values.iter().enumerate().map(|(i, value)| (value.as_str(), line(i))).collect();
        Features::lines(&lines)
    };
    write_features(folder, &name, &features.with_attribute(attribute), crs);
}

fn write_features(folder: &Path, name: &str, features: &Features, crs: Option<&str>) {
    let path = folder.join(name);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("shp") => drop(shapefile(folder, name.strip_suffix(".shp").unwrap(), features)),
        Some("gpkg") => drop(geopackage(folder, name, features)),
        Some("geojson") => {
            let text = fs::read_to_string(geojson(folder, name, features)).unwrap();
            fs::write(path, text.replace("32633", crs.unwrap_or("32633"))).unwrap();
        }
        _ => panic!("no test makes lines such as {name}"),
    };
}
