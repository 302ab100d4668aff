//! GeoPackages, read with SQLite.

use crate::geopackage::lines::{LayerAbout, LineAttributes, LineLayer, LineRow};
use crate::raster::geokeys::RasterSystem;
use rusqlite::Connection;
use std::path::Path;

/// Writes lines of these numbers of points into a new file, and opens it.
fn written(folder: &Path, lengths: &[usize], about: LayerAbout) -> Connection {
    let new = |name: &str| sys::disk::create(&folder.join(name)).unwrap();
    let (file, boxes) = (new("lines.gpkg"), new("boxes"));
    let mut layer = LineLayer::new(&file, &boxes, about);
    for (number, length) in lengths.iter().enumerate() {
        layer.add(&LineRow::new(&points(number, *length), attributes(number), about.system_number())).unwrap();
    }
    assert_eq!(layer.finish().unwrap(), lengths.len() as u64);
    Connection::open(folder.join("lines.gpkg")).unwrap()
}

fn points(number: usize, length: usize) -> Vec<[f64; 2]> {
    (0..length).map(|n| [number as f64 + 0.1 * n as f64, -0.3 * number as f64]).collect()
}

fn attributes(number: usize) -> LineAttributes {
    LineAttributes { height: number as f64 / 4.0, is_index: number.is_multiple_of(5), is_closed: number % 2 == 1 }
}

#[track_caller]
fn is_sound(database: &Connection, lengths: &[usize]) {
    let text = |sql: &str| database.query_row(sql, [], |row| row.get::<_, String>(0)).unwrap();
    assert_eq!(text("PRAGMA integrity_check"), "ok");
    assert_eq!(text("SELECT rtreecheck('rtree_contours_geom')"), "ok");
    assert!(database.prepare("PRAGMA foreign_key_check").unwrap().query([]).unwrap().next().unwrap().is_none());
    let mut found =
        database.prepare("SELECT fid, geom, height, is_index, is_closed FROM contours ORDER BY fid").unwrap();
    let mut rows = found.query([]).unwrap();
    for (number, length) in lengths.iter().enumerate() {
        let row = rows.next().unwrap().unwrap();
        let expected = attributes(number);
        assert_eq!(row.get::<_, i64>(0).unwrap(), number as i64 + 1);
        let found = LineAttributes {
            height: row.get(2).unwrap(),
            is_index: row.get(3).unwrap(),
            is_closed: row.get(4).unwrap(),
        };
        assert_eq!(found, expected);
        let geometry: Vec<u8> = row.get(1).unwrap();
        let numbers: Vec<f64> =
            geometry[49..].chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
        let of_points = points(number, *length).into_iter().flat_map(|[x, y]| [x, y, expected.height]);
        assert!(numbers.into_iter().eq(of_points), "line {number}");
    }
    assert!(rows.next().unwrap().is_none());
}

#[test]
fn sqlite_reads_lines_of_any_number_and_length() {
    let folder = tempfile::tempdir().unwrap();
    let system = RasterSystem { code: Some(26915), text: Some("PROJCS[\"x\"]".into()), ..RasterSystem::default() };
    let about = LayerAbout { system: &system, copyright: Some("(c) us") };
    // Rows around the longest that stay in their leaf, and some with many pages.
    let around: Vec<usize> = (150..190).collect();
    let many: Vec<usize> = (0..30_000).map(|n| 2 + n % 7).collect();
    for lengths in [&[][..], &[2], &[2; 51], &[2; 52], &[3; 2_700], &around, &[2, 40_000, 3, 170, 1_000], &many] {
        let database = written(folder.path(), lengths, about);
        is_sound(&database, lengths);
    }
}

#[test]
fn the_index_finds_the_lines_of_a_window() {
    let folder = tempfile::tempdir().unwrap();
    let about = LayerAbout { system: &RasterSystem::default(), copyright: None };
    let database = written(folder.path(), &[11; 20_000], about);
    let sql = "SELECT count(*), min(id), max(id) FROM rtree_contours_geom WHERE minx <= 7000.05 AND maxx >= 6990.95";
    let found: [i64; 3] = database.query_row(sql, [], |row| Ok([row.get(0)?, row.get(1)?, row.get(2)?])).unwrap();
    // Lines 6990 to 7000, whose rows count from one.
    assert_eq!(found, [11, 6991, 7001]);
}

#[test]
fn the_head_says_what_the_file_is_and_where_the_lines_are() {
    let folder = tempfile::tempdir().unwrap();
    let text = Some("PROJCS[\"Grid\"]".to_string());
    let of = |code, text: &Option<String>| RasterSystem { code, text: text.clone(), ..RasterSystem::default() };
    for (system, number, organization, definition) in [
        (of(Some(26915), &text), 26915, "EPSG", "PROJCS[\"Grid\"]"),
        (of(None, &text), 100_000, "NONE", "PROJCS[\"Grid\"]"),
        (of(None, &None), -1, "NONE", "undefined"),
        (of(Some(26915), &None), 26915, "EPSG", "undefined"),
    ] {
        let database = written(folder.path(), &[3, 3], LayerAbout { system: &system, copyright: Some("(c) us") });
        let number_of = |sql: &str| database.query_row(sql, [], |row| row.get::<_, i64>(0)).unwrap();
        assert_eq!(number_of("PRAGMA application_id"), 0x4750_4b47);
        assert_eq!(number_of("PRAGMA user_version"), 10400);
        assert_eq!(
            number_of("SELECT srs_id FROM gpkg_geometry_columns WHERE table_name = 'contours' AND z = 1"),
            number
        );
        assert_eq!(number_of("SELECT count(*) FROM gpkg_extensions WHERE table_name = 'contours'"), 1);
        let sql = "SELECT organization, definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?";
        let found: [String; 2] = database.query_row(sql, [number], |row| Ok([row.get(0)?, row.get(1)?])).unwrap();
        assert_eq!(found, [organization, definition]);
        let sql =
            "SELECT min_x, min_y, max_x, max_y, srs_id, description FROM gpkg_contents WHERE identifier = 'contours'";
        let found = database.query_row(sql, [], |row| {
            Ok(([0, 1, 2, 3].map(|n| row.get::<_, f64>(n).unwrap()), row.get::<_, i64>(4)?, row.get::<_, String>(5)?))
        });
        assert_eq!(found.unwrap(), ([0.0, -0.3, 1.2, 0.0], number, "(c) us".into()));
    }
}
