//! Finding out which format a file of lines has, and reading it.

use std::path::{Path, PathBuf};

use crate::file::random_access::RandomAccessFile;
use crate::lines::collector::FeatureCollector;
use crate::lines::feature::LineFile;
use crate::lines::options::{LineOptions, LinePurpose};
use crate::lines::{geojson, geopackage, shapefile};
use sys::{Error, Result, Warnings};

/// Endings of the files beside a Shapefile or an open GeoPackage, which a glob names too.
const SIDE_FILES: [&str; 13] =
    ["dbf", "shx", "prj", "cpg", "qpj", "sbn", "sbx", "qix", "qmd", "xml", "gpkg-wal", "gpkg-shm", "gpkg-journal"];

/// What to say about a file of another format.
const OTHER_FORMAT: &str =
    "is not a Shapefile, GeoPackage or GeoJSON: convert it first, for example with `ogr2ogr lines.gpkg FILE`";

/// Tells whether the file at `path` belongs to a file of lines, and is none itself.
pub fn is_side_file(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| SIDE_FILES.contains(&ending.as_str()))
}

/// Returns the files in which the lines of the file at `path` are: a Shapefile has several.
pub fn files_of_lines(path: &Path) -> Vec<PathBuf> {
    let is_shapefile = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("shp"));
    if is_shapefile { shapefile::all_files(path) } else { vec![path.to_path_buf()] }
}

/// Reads the file at `path`, which the options name. The job may take `memory` bytes.
///
/// # Errors
/// `Input` if it is no file of lines, is damaged, or a feature cannot be used; `Io` if it cannot be read.
pub fn read_lines(path: &Path, options: &LineOptions, memory: u64) -> Result<LineFile> {
    let file = RandomAccessFile::open(path)?;
    let bytes = |file: &RandomAccessFile| file.bytes(0..file.size());
    let mut start = [0; 16];
    let held = file.size().min(start.len() as u64) as usize;
    file.read_exact_at(&mut start[..held], 0)?;
    let (mut collector, mut warnings) = (FeatureCollector::new(path, options), Warnings::default());
    let crs = match &start {
        [0, 0, 0x27, 0x0a, ..] => shapefile::read(path, &bytes(&file)?, options, &mut collector, &mut warnings)?,
        b"SQLite format 3\0" => geopackage::read(path, file.size(), memory, options, &mut collector)?,
        start if is_json(&start[..held]) => geojson::read(path, &bytes(&file)?, options, &mut collector)?,
        _ => return Err(Error::input(path, other_format(path, held, options.purpose))),
    };
    let (features, left_out) = collector.finish();
    warnings.extend(left_out);
    Ok(LineFile { path: path.to_path_buf(), crs, purpose: options.purpose, height_scale: 1.0, features, warnings })
}

fn is_json(start: &[u8]) -> bool {
    geojson::is_json(start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start))
}

fn other_format(path: &Path, held: usize, purpose: LinePurpose) -> String {
    if held == 0 {
        return "is empty".into();
    }
    let is_of_gdb = path.components().any(|part| part.as_os_str().to_string_lossy().to_lowercase().ends_with(".gdb"));
    let (what, named) = match is_of_gdb {
        true => (IN_GDB, path.parent().unwrap_or(path)),
        false => (OTHER_FORMAT, path),
    };
    what.replace("lines", purpose.features()).replace("FILE", &named.display().to_string())
}

/// What to say about a file in the folder of a FileGDB.
const IN_GDB: &str = "is part of an Esri file geodatabase, which only its own programs read in full: convert it first, for example with \
                      `ogr2ogr lines.gpkg FILE`";

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    fn read_bytes(name: &str, bytes: &[u8]) -> Result<LineFile> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        read_lines(&path, &toml::from_str("files = [\"a\"]").unwrap(), 1 << 30)
    }

    #[test]
    fn formats_are_told_by_their_first_bytes() {
        let json = br#" {"type": "LineString", "coordinates": [[0, 0, 1], [1, 0, 1]]}"#;
        assert_eq!(read_bytes("a.txt", json).unwrap().features.len(), 1);
        for (name, bytes, word) in [
            ("a.kml", &b"<kml>"[..], "ogr2ogr lines.gpkg "),
            ("roads.gdb/a00000001.gdbtable", &[3, 0, 0, 0, 1], "roads.gdb`"),
            ("a.shp", &[], "is empty"),
            ("a.shp", &[0, 0, 0x27, 0x0a], "cut off in its header"),
            ("a.gpkg", b"SQLite format 3\0", "GeoPackage"),
            ("a.geojson", b"{", "GeoJSON"),
        ] {
            let error = read_bytes(name, bytes).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Input);
            assert!(error.to_string().contains(word), "{error}");
        }
        assert!(is_side_file(Path::new("a/b.DBF")) && is_side_file(Path::new("b.shp.xml")));
        assert!(!is_side_file(Path::new("b.shp")) && !is_side_file(Path::new("b.gpkg")));
    }
}
