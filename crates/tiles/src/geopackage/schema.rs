//! The tables of a GeoPackage with one layer of lines.

use crate::geopackage::btree::{TableTree, add_index};
use crate::geopackage::page_file::{PAGE, PageFile};
use crate::geopackage::record::{Value, record};
use crate::raster::geokeys::RasterSystem;
use std::io::Result;

/// The name of the layer.
const LAYER: &str = "contours";

/// Version 1.4 of the format.
const USER_VERSION: u32 = 10400;
const APPLICATION: &[u8; 4] = b"GPKG";

/// The version of SQLite that databases without newer features may name.
const SQLITE_VERSION: u32 = 3_008_000;

/// The same in every file, so that the same lines have the same bytes.
const LAST_CHANGE: &str = "2000-01-01T00:00:00.000Z";

/// The number of a system that has no EPSG code.
const OWN_SYSTEM: i32 = 100_000;
const UNKNOWN_SYSTEM: i32 = -1;
const WGS_84: i32 = 4326;

const WGS_84_TEXT: &str = r#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AXIS["Latitude",NORTH],AXIS["Longitude",EAST],AUTHORITY["EPSG","4326"]]"#;

const SYSTEMS_SQL: &str = "CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, \
     organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT)";

const CONTENTS_SQL: &str = "CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, \
     identifier TEXT UNIQUE, description TEXT DEFAULT '', \
     last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')), \
     min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER, \
     CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id))";

const COLUMNS_SQL: &str = "CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL, \
     geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL, \
     CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name), \
     CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name), \
     CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id))";

const EXTENSIONS_SQL: &str = "CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, \
     definition TEXT NOT NULL, scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name))";

const LAYER_SQL: &str = "CREATE TABLE contours (fid INTEGER PRIMARY KEY NOT NULL, geom LINESTRING, height REAL, is_index BOOLEAN, \
     is_closed BOOLEAN)";

const INDEX_EXTENSION: &str = "http://www.geopackage.org/spec140/#extension_rtree";

/// The tables of the spatial index, each with the page at its top: of nodes, of their parents, and of the nodes of lines.
pub(super) struct IndexTables {
    pub(super) node: u32,
    pub(super) parent: u32,
    pub(super) rowid: u32,
}

/// What a layer says about itself.
#[derive(Clone, Copy, Debug)]
pub struct LayerAbout<'a> {
    /// The system of its coordinates.
    pub system: &'a RasterSystem,
    /// Whose the data are.
    pub copyright: Option<&'a str>,
}

impl LayerAbout<'_> {
    /// Returns the number of the system, as geometries have it.
    pub fn system_number(&self) -> i32 {
        match (self.system.code, &self.system.text) {
            (Some(code), _) => code.into(),
            (None, Some(_)) => OWN_SYSTEM,
            (None, None) => UNKNOWN_SYSTEM,
        }
    }

    /// Returns the systems by their numbers: name, number, organization, the number there, and the definition.
    fn systems(&self) -> Vec<(&str, i32, &'static str, &str)> {
        let mut systems = vec![
            ("Undefined Cartesian SRS", UNKNOWN_SYSTEM, "NONE", "undefined"),
            ("Undefined geographic SRS", 0, "NONE", "undefined"),
            ("WGS 84", WGS_84, "EPSG", WGS_84_TEXT),
        ];
        let own = self.system_number();
        if systems.iter().all(|(_, number, ..)| *number != own) {
            let name = self.system.name.as_deref().unwrap_or("unnamed");
            let organization = if self.system.code.is_some() { "EPSG" } else { "NONE" };
            systems.push((name, own, organization, self.system.text.as_deref().unwrap_or("undefined")));
        }
        systems.sort_by_key(|(_, number, ..)| *number);
        systems
    }
}

/// A box around lines: least x, least y, greatest x, greatest y.
pub(super) type Extent = [f64; 4];

/// Writes all tables but those of the lines and of their index, and with the first page ends the file.
///
/// # Errors
/// Those of the disk.
pub(super) fn finish(
    mut pages: PageFile,
    about: &LayerAbout,
    extent: Option<Extent>,
    layer: u32,
    index: &IndexTables,
) -> Result<u32> {
    let systems = add_systems(&mut pages, about)?;
    let number = Value::Integer(about.system_number().into());
    let [min_x, min_y, max_x, max_y] = extent.map_or([Value::Null; 4], |extent| extent.map(Value::Real));
    let (name, column) = (Value::Text(LAYER), Value::Text("geom"));
    let description = about.copyright.unwrap_or_default();
    let contents = [
        name,
        Value::Text("features"),
        name,
        Value::Text(description),
        Value::Text(LAST_CHANGE),
        min_x,
        min_y,
        max_x,
        max_y,
        number,
    ];
    let contents = add_row(&mut pages, &contents)?;
    let by_name = [(); 3].map(|()| add_index(&mut pages, &[record(&[name, Value::Integer(1)])]));
    let [by_table, by_identifier, by_layer] = by_name;
    let columns = [name, column, Value::Text("LINESTRING"), number, Value::Integer(1), Value::Integer(0)];
    let columns = add_row(&mut pages, &columns)?;
    let by_column = add_index(&mut pages, &[record(&[name, column, Value::Integer(1)])])?;
    let extension = Value::Text("gpkg_rtree_index");
    let extensions = [name, column, extension, Value::Text(INDEX_EXTENSION), Value::Text("write-only")];
    let extensions = add_row(&mut pages, &extensions)?;
    let by_extension = add_index(&mut pages, &[record(&[name, column, extension, Value::Integer(1)])])?;
    let mut schema = Schema { tree: TableTree::new(), rows: 0 };
    let triggers = triggers();
    let of = |kind, name, table, page, sql| SchemaRow { kind, name, table, page, sql };
    let table = |name, page, sql| of("table", name, name, page, Some(sql));
    let index_of = |name, table, page| of("index", name, table, page, None);
    for row in [
        table("gpkg_spatial_ref_sys", systems, SYSTEMS_SQL),
        table("gpkg_contents", contents, CONTENTS_SQL),
        index_of("sqlite_autoindex_gpkg_contents_1", "gpkg_contents", by_table?),
        index_of("sqlite_autoindex_gpkg_contents_2", "gpkg_contents", by_identifier?),
        table("gpkg_geometry_columns", columns, COLUMNS_SQL),
        index_of("sqlite_autoindex_gpkg_geometry_columns_1", "gpkg_geometry_columns", by_column),
        index_of("sqlite_autoindex_gpkg_geometry_columns_2", "gpkg_geometry_columns", by_layer?),
        table("gpkg_extensions", extensions, EXTENSIONS_SQL),
        index_of("sqlite_autoindex_gpkg_extensions_1", "gpkg_extensions", by_extension),
        table(LAYER, layer, LAYER_SQL),
        table(
            "rtree_contours_geom",
            0,
            "CREATE VIRTUAL TABLE \"rtree_contours_geom\" USING rtree(id, minx, maxx, miny, maxy)",
        ),
        table(
            "rtree_contours_geom_rowid",
            index.rowid,
            "CREATE TABLE \"rtree_contours_geom_rowid\"(rowid INTEGER PRIMARY KEY,nodeno)",
        ),
        table(
            "rtree_contours_geom_node",
            index.node,
            "CREATE TABLE \"rtree_contours_geom_node\"(nodeno INTEGER PRIMARY KEY,data)",
        ),
        table(
            "rtree_contours_geom_parent",
            index.parent,
            "CREATE TABLE \"rtree_contours_geom_parent\"(nodeno INTEGER PRIMARY KEY,parentnode)",
        ),
    ] {
        schema.add(&mut pages, &row)?;
    }
    for (name, sql) in &triggers {
        schema.add(&mut pages, &of("trigger", name, LAYER, 0, Some(sql)))?;
    }
    let mut first = schema.tree.finish_as_first(&mut pages)?;
    pages.finish(|count| {
        first[..100].copy_from_slice(&head(count));
        first
    })
}

fn add_systems(pages: &mut PageFile, about: &LayerAbout) -> Result<u32> {
    let mut tree = TableTree::new();
    for (name, number, organization, definition) in about.systems() {
        // The number is that of the row.
        let row = [
            Value::Text(name),
            Value::Null,
            Value::Text(organization),
            Value::Integer(number.into()),
            Value::Text(definition),
            Value::Null,
        ];
        tree.add(pages, number.into(), &record(&row))?;
    }
    tree.finish(pages)
}

/// Adds a table of one row.
fn add_row(pages: &mut PageFile, values: &[Value]) -> Result<u32> {
    let mut tree = TableTree::new();
    tree.add(pages, 1, &record(values))?;
    tree.finish(pages)
}

struct Schema {
    tree: TableTree,
    rows: i64,
}

struct SchemaRow<'a> {
    kind: &'a str,
    name: &'a str,
    table: &'a str,
    page: u32,
    sql: Option<&'a str>,
}

impl Schema {
    fn add(&mut self, pages: &mut PageFile, row: &SchemaRow) -> Result<()> {
        let values = [
            Value::Text(row.kind),
            Value::Text(row.name),
            Value::Text(row.table),
            Value::Integer(row.page.into()),
            row.sql.map_or(Value::Null, Value::Text),
        ];
        self.rows += 1;
        self.tree.add(pages, self.rows, &record(&values))
    }
}

/// Returns the triggers that keep the index true when a program edits the lines, as the format has them: names and texts.
fn triggers() -> Vec<(String, String)> {
    let index = "\"rtree_contours_geom\"";
    let is_there = |row: &str| format!("({row}.geom NOTNULL AND NOT ST_IsEmpty({row}.geom))");
    let is_missing = |row: &str| format!("({row}.geom ISNULL OR ST_IsEmpty({row}.geom))");
    let insert = "VALUES (NEW.fid, ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom))";
    let update =
        "SET minx = ST_MinX(NEW.geom), maxx = ST_MaxX(NEW.geom), miny = ST_MinY(NEW.geom), maxy = ST_MaxY(NEW.geom)";
    let (new, old, no_new, no_old) = (is_there("NEW"), is_there("OLD"), is_missing("NEW"), is_missing("OLD"));
    let all = [
        ("insert", "INSERT", new.clone(), format!("INSERT OR REPLACE INTO {index} {insert};")),
        (
            "update2",
            "UPDATE OF geom",
            format!("OLD.fid = NEW.fid AND {no_new}"),
            format!("DELETE FROM {index} WHERE id = OLD.fid;"),
        ),
        (
            "update4",
            "UPDATE",
            format!("OLD.fid != NEW.fid AND {no_new}"),
            format!("DELETE FROM {index} WHERE id IN (OLD.fid, NEW.fid);"),
        ),
        (
            "update5",
            "UPDATE",
            format!("OLD.fid != NEW.fid AND {new}"),
            format!("DELETE FROM {index} WHERE id = OLD.fid; INSERT OR REPLACE INTO {index} {insert};"),
        ),
        (
            "update6",
            "UPDATE OF geom",
            format!("OLD.fid = NEW.fid AND {new} AND {old}"),
            format!("UPDATE {index} {update} WHERE id = NEW.fid;"),
        ),
        (
            "update7",
            "UPDATE OF geom",
            format!("OLD.fid = NEW.fid AND {new} AND {no_old}"),
            format!("INSERT INTO {index} {insert};"),
        ),
        ("delete", "DELETE", "OLD.geom NOT NULL".into(), format!("DELETE FROM {index} WHERE id = OLD.fid;")),
    ];
    let trigger = |(name, event, when, work): (&str, &str, String, String)| {
        let name = format!("rtree_contours_geom_{name}");
        let sql = format!("CREATE TRIGGER \"{name}\" AFTER {event} ON \"contours\" WHEN {when} BEGIN {work} END");
        (name, sql)
    };
    all.into_iter().map(trigger).collect()
}

/// Returns the first 100 bytes of a database of so many pages.
fn head(pages: u32) -> [u8; 100] {
    let mut head = [0; 100];
    head[..16].copy_from_slice(b"SQLite format 3\0");
    head[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
    // No write-ahead log; the fractions of payload are fixed.
    head[18..24].copy_from_slice(&[1, 1, 0, 64, 32, 32]);
    // Changes of the file, its pages, free pages, changes of the schema, the format of the schema, and UTF-8.
    for (at, number) in
        [(24, 1), (28, pages), (40, 1), (44, 4), (56, 1), (60, USER_VERSION), (92, 1), (96, SQLITE_VERSION)]
    {
        head[at..at + 4].copy_from_slice(&number.to_be_bytes());
    }
    head[68..72].copy_from_slice(APPLICATION);
    head
}
