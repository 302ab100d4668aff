//! Reading GeoPackages: tables of an SQLite database, and views of them.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rusqlite::types::ValueRef;
use rusqlite::{Connection, OptionalExtension, Row};

use crate::lines::attribute::{Attribute, NAME_FIELD, WantedAttributes, no_attribute};
use crate::lines::collector::FeatureCollector;
use crate::lines::feature::RawGeometry;
use crate::lines::guarded_sqlite;
use crate::lines::guarded_sqlite::{Column, TableName};
use crate::lines::options::{LineOptions, LinePurpose};
use crate::lines::wkb;
use crs::from_wkt::{from_epsg, parse};
use crs::system::Crs;
use sys::{Error, Result, interrupt};

/// Held while a file is read.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A table of features, or a view of some.
struct Layer {
    table: String,
    geometry: String,
    srs: i64,
    /// All its columns.
    columns: Vec<String>,
    /// The column that numbers its features; a view has none.
    key: Option<String>,
}

/// Hands the features of the file at `path`, which has `size` bytes, to `collector`. Returns the coordinate reference system of its layer.
/// The job may take `memory` bytes.
///
/// # Errors
/// `Input` if the file is damaged, has no such layer, or lacks attributes that the options name.
pub(super) fn read(
    path: &Path,
    size: u64,
    memory: u64,
    options: &LineOptions,
    collector: &mut FeatureCollector,
) -> Result<Crs> {
    refuse_open_journal(path)?;
    // SQLite's limit of memory holds for all connections together: side by side, files would fail that can be read one after the other.
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let broken = |error: rusqlite::Error| guarded_sqlite::broken(path, &error);
    let (file, tables) = guarded_sqlite::open(path, size, memory).map_err(broken)?;
    let layer = find_layer(path, &file, &tables, options)?;
    let mut statement = file.prepare(&query_of(path, &file, &layer, options)?).map_err(broken)?;
    let mut rows = statement.query([]).map_err(broken)?;
    let (mut place, mut bytes) = (0u64, 0u64);
    while let Some(row) = rows.next().map_err(broken)? {
        interrupt::check()?;
        place = place.saturating_add(1);
        let length = row.get_ref(1).map_err(broken)?.as_blob_or_null().ok().flatten().map_or(0, <[u8]>::len);
        bytes = bytes.saturating_add(1).saturating_add(length as u64);
        if bytes > size {
            let what = format!(
                "its layer {:?} holds more than the file does, so that it must repeat or compute it: write it again as a plain table, for \
                 example with `ogr2ogr lines.gpkg {}`",
                layer.table,
                path.display()
            );
            return Err(Error::input(path, what));
        }
        add(row, layer.key.is_none().then_some(place), collector).map_err(broken)??;
    }
    if options.crs.is_read() { crs(path, &file, layer.srs, options.purpose) } else { Ok(Crs::default()) }
}

/// Returns the query for the number, the geometry, the kind, the height and the name of all features.
fn query_of(path: &Path, file: &Connection, layer: &Layer, options: &LineOptions) -> Result<String> {
    for name in options.kind_field.iter().chain(&options.height_field) {
        if layer.column(name).is_none() {
            let there: Vec<String> =
                layer.columns.iter().filter(|column| **column != layer.geometry).cloned().collect();
            return Err(Error::input(path, no_attribute(name, &there)));
        }
    }
    let wanted = |name: &Option<String>| match name.as_ref().and_then(|name| layer.column(name)) {
        Some(column) => quoted(column),
        None => "NULL".into(),
    };
    let (number, order) = match &layer.key {
        None => ("0".into(), String::new()),
        Some(key) => {
            let number = number_of(file, layer, key).map_err(|error| guarded_sqlite::broken(path, &error))?;
            (number, format!(" ORDER BY {}", quoted(key)))
        }
    };
    Ok(format!(
        "SELECT {number}, {}, {}, {}, {} FROM {}{order}",
        quoted(&layer.geometry),
        wanted(&options.kind_field),
        wanted(&options.height_field),
        wanted(&options.purpose.has_names().then(|| NAME_FIELD.into())),
        quoted(&layer.table)
    ))
}

/// Returns what numbers the rows of the layer: its key, or, where this is not always a whole number above 0, the place of the row in their
/// order by key.
fn number_of(file: &Connection, layer: &Layer, key: &str) -> rusqlite::Result<String> {
    let [key, table] = [key, &layer.table].map(quoted);
    let query = format!("SELECT EXISTS (SELECT 1 FROM {table} WHERE typeof({key}) <> 'integer' OR {key} < 0)");
    let is_odd: bool = file.query_row(&query, [], |row| row.get(0))?;
    Ok(if is_odd { format!("row_number() OVER (ORDER BY {key})") } else { key })
}

/// What another program has written, and not yet put into the file, must not be missed; and what it has begun to write must not be read.
fn refuse_open_journal(path: &Path) -> Result<()> {
    let beside = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let has_log = beside("-wal").metadata().is_ok_and(|meta| meta.len() > 0);
    // One that is not needed any more begins with zeros, or is empty.
    let mut start = [0; 1];
    let has_journal = File::open(beside("-journal")).is_ok_and(|mut file| file.read_exact(&mut start).is_ok());
    let ending = match (has_log, has_journal && start != [0]) {
        (true, _) => "-wal",
        (_, true) => "-journal",
        _ => return Ok(()),
    };
    let what = format!(
        "is open in another program, or was not closed (there is a file {ending} next to it): close it there first, or open and close \
         it once in QGIS"
    );
    Err(Error::input(path, what))
}

/// Finds the layer that the options name, or the only one.
fn find_layer(path: &Path, file: &Connection, tables: &[TableName], options: &LineOptions) -> Result<Layer> {
    let broken = |error: rusqlite::Error| guarded_sqlite::broken(path, &error);
    plain_columns(path, file, "gpkg_geometry_columns", |_| true)?;
    let query = "SELECT table_name, column_name, srs_id FROM gpkg_geometry_columns ORDER BY table_name";
    let mut statement = file.prepare(query).map_err(broken)?;
    let found = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?))).map_err(broken)?;
    let mut layers: Vec<(String, String, i64)> = found.collect::<rusqlite::Result<_>>().map_err(broken)?;
    layers.retain(|(table, ..)| find_table(tables, table).is_some());
    let names = layers.iter().map(|(table, ..)| format!("{table:?}")).collect::<Vec<_>>().join(", ");
    let is_wanted = |table: &str| match &options.layer {
        Some(name) => name.eq_ignore_ascii_case(table),
        // Views show again what tables hold.
        None => layers.len() == 1 || find_table(tables, table).is_some_and(|table| !table.is_view),
    };
    let mut wanted = layers.iter().filter(|(table, ..)| is_wanted(table));
    let (table, geometry, srs) = match (wanted.next(), wanted.next(), &options.layer) {
        (Some(layer), None, _) => layer.clone(),
        (None, _, Some(name)) => return Err(Error::input(path, format!("has no layer {name:?}: it has {names}"))),
        (None, _, None) if layers.is_empty() => {
            return Err(Error::input(path, "is a database without a layer of features"));
        }
        _ => {
            let what = match options.purpose {
                LinePurpose::Breaklines => "has several layers: name one of them with layer".to_string(),
                LinePurpose::Clip | LinePurpose::Places => format!(
                    "has several layers: write one of them alone, with `ogr2ogr area.gpkg {} LAYER`",
                    path.display()
                ),
            };
            return Err(Error::input(path, format!("{what}: {names}")));
        }
    };
    let is_named = |column: &Column, name: &String| column.name.eq_ignore_ascii_case(name);
    let is_read = |column: &Column| {
        let mut names = [&geometry].into_iter().chain(&options.kind_field).chain(&options.height_field);
        let is_name = options.purpose.has_names() && column.name.eq_ignore_ascii_case(NAME_FIELD);
        column.is_key || is_name || names.any(|name| is_named(column, name))
    };
    let columns = plain_columns(path, file, &table, is_read)?;
    let is_view = find_table(tables, &table).is_some_and(|table| table.is_view);
    if !is_view {
        refuse_damage(path, file, &table)?;
    }
    if is_view {
        tables
            .iter()
            .filter(|table| !table.is_view)
            .try_for_each(|table| plain_columns(path, file, &table.name, |_| true).map(drop))?;
    }
    let key = columns.iter().find(|column| column.is_key).map_or("rowid".into(), |column| column.name.clone());
    let columns = columns.into_iter().map(|column| column.name).collect();
    Ok(Layer { table, geometry, srs, columns, key: (!is_view).then_some(key) })
}

fn find_table<'t>(tables: &'t [TableName], name: &str) -> Option<&'t TableName> {
    tables.iter().find(|table| table.name.eq_ignore_ascii_case(name))
}

/// Fails if pages of a table are damaged.
fn refuse_damage(path: &Path, file: &Connection, table: &str) -> Result<()> {
    let found = guarded_sqlite::damage_of(file, table).map_err(|error| guarded_sqlite::broken(path, &error))?;
    found.map_or(Ok(()), |what| {
        Err(Error::input(
            path,
            format!("its table {table:?} is damaged ({what}): copy the file again, or write it again from its source"),
        ))
    })
}

/// Returns the columns of a table, and refuses one that is wanted and that SQLite would have to compute.
fn plain_columns(
    path: &Path,
    file: &Connection,
    table: &str,
    is_wanted: impl Fn(&Column) -> bool,
) -> Result<Vec<Column>> {
    let columns = guarded_sqlite::columns_of(file, table).map_err(|error| guarded_sqlite::broken(path, &error))?;
    match columns.iter().find(|column| column.is_computed && is_wanted(column)) {
        None => Ok(columns),
        Some(column) => Err(Error::input(
            path,
            format!(
                "its table {table:?} has the column {:?}, which is computed (GENERATED ALWAYS) and not read: write it again with plain columns, \
                 for example with `ogr2ogr lines.gpkg {}`",
                column.name,
                path.display()
            ),
        )),
    }
}

impl Layer {
    fn column(&self, name: &str) -> Option<&str> {
        self.columns.iter().find(|column| column.eq_ignore_ascii_case(name)).map(String::as_str)
    }
}

/// Adds a row: its key, or the `place` that numbers it, its geometry, kind, height and name. The outer result is SQLite's.
fn add(row: &Row, place: Option<u64>, collector: &mut FeatureCollector) -> rusqlite::Result<Result<()>> {
    let number = place.unwrap_or(u64::try_from(row.get::<_, i64>(0)?).unwrap_or(0));
    let geometry = match row.get_ref(1)? {
        ValueRef::Null => Ok(RawGeometry::Empty),
        ValueRef::Blob(bytes) => geometry(bytes),
        _ => Err("has an invalid geometry: it is not a blob".into()),
    };
    let wanted = WantedAttributes {
        kind: attribute(row.get_ref(2)?),
        height: attribute(row.get_ref(3)?),
        name: attribute(row.get_ref(4)?),
    };
    let geometry = geometry.map_err(|what: String| collector.refuse(number, what));
    Ok(geometry.and_then(|geometry| collector.add(number, geometry, &wanted)))
}

fn attribute(value: ValueRef) -> Attribute {
    match value {
        ValueRef::Integer(number) => Attribute::Number(number as f64),
        ValueRef::Real(number) => Attribute::Number(number),
        ValueRef::Text(text) => Attribute::Text(String::from_utf8_lossy(text).into_owned()),
        ValueRef::Null | ValueRef::Blob(_) => Attribute::Missing,
    }
}

/// Returns the geometry in a blob: a header with a box, whose form is in its flags, and then well-known binary.
fn geometry(blob: &[u8]) -> std::result::Result<RawGeometry, String> {
    let damaged = || "has a geometry that is damaged: it does not begin as one".to_string();
    let Some(([b'G', b'P', _, flags], rest)) = blob.split_at_checked(4) else { return Err(damaged()) };
    let box_bytes = match flags >> 1 & 7 {
        0 => 0,
        1 => 32,
        2 | 3 => 48,
        4 => 64,
        _ => return Err(damaged()),
    };
    match flags >> 4 & 1 {
        1 => Ok(RawGeometry::Empty),
        // Before the box is the number of the CRS.
        _ => wkb::read(rest.get(4 + box_bytes..).ok_or_else(damaged)?),
    }
}

fn crs(path: &Path, file: &Connection, srs: i64, purpose: LinePurpose) -> Result<Crs> {
    let broken = |error: rusqlite::Error| Error::input(path, format!("its table of CRSs cannot be read: {error}"));
    plain_columns(path, file, "gpkg_spatial_ref_sys", |_| true)?;
    // Negative numbers and 0 say that the CRS is not known.
    if srs <= 0 {
        return Ok(Crs::default());
    }
    let query = "SELECT organization, organization_coordsys_id, definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?1";
    let row = |row: &Row| Ok((row.get::<_, String>(0)?, row.get::<_, i64>(1)?, row.get::<_, Option<String>>(2)?));
    let found = file.query_row(query, [srs], row).optional().map_err(broken)?;
    let Some((organization, code, text)) = found else {
        return Err(Error::input(
            path,
            format!("its CRS {srs} is not in its table of CRSs: {}", purpose.remedy_of_crs(path)),
        ));
    };
    let code = u32::try_from(code).ok().filter(|_| organization.eq_ignore_ascii_case("EPSG"));
    let of_text = || text.as_deref().and_then(parse).map(|crs| Crs { epsg: crs.epsg.or(code), ..crs });
    let crs = code.and_then(from_epsg).or_else(of_text);
    Ok(crs.unwrap_or(Crs { epsg: code, name: text.filter(|text| text != "undefined"), ..Crs::default() }))
}

/// Returns a name as SQL takes it.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::feature::{LineFeature, LineShape};
    use sys::ErrorKind;

    /// Writes a file with the layers `a` and, if wanted, `b`, each with one line, and returns its bytes.
    fn package(has_two: bool) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        let file = Connection::open(&path).unwrap();
        file.execute_batch(
            "CREATE TABLE gpkg_spatial_ref_sys (srs_id INTEGER PRIMARY KEY, organization TEXT, organization_coordsys_id INTEGER, definition TEXT);
             CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, srs_id INTEGER);
             INSERT INTO gpkg_spatial_ref_sys VALUES (7, 'EPSG', 25832, 'undefined');",
        )
        .unwrap();
        let numbers = [1.0f64, 2.0, 3.0, 4.0, 5.0, 6.0].map(f64::to_le_bytes).concat();
        let line = [&[1][..], &1002u32.to_le_bytes(), &2u32.to_le_bytes(), &numbers].concat();
        // A box in x and y, which is skipped.
        let blob = [&b"GP\0\x03\0\0\0\0"[..], &[9; 32], &line].concat();
        for table in ["a", "b"].iter().take(1 + usize::from(has_two)) {
            file.execute_batch(&format!(
                "CREATE TABLE \"{table}\" (id INTEGER PRIMARY KEY, shape BLOB, sort TEXT);
                 INSERT INTO gpkg_geometry_columns VALUES ('{table}', 'shape', 7);
                 INSERT INTO \"{table}\" (id, sort) VALUES (3, 'line');"
            ))
            .unwrap();
            file.execute(&format!("INSERT INTO \"{table}\" VALUES (8, ?1, 'river')"), [&blob]).unwrap();
        }
        file.close().unwrap();
        std::fs::read(path).unwrap()
    }

    fn read_bytes(bytes: &[u8], rest: &str) -> Result<(Crs, Vec<LineFeature>)> {
        let folder = tempfile::tempdir().unwrap();
        // SQLite takes the path as a URI.
        let path = folder.path().join("a #1?%20.gpkg");
        std::fs::write(&path, bytes).unwrap();
        let options: LineOptions = toml::from_str(&format!("files = [\"a\"]\n{rest}")).unwrap();
        let mut collector = FeatureCollector::new(&path, &options);
        let crs = read(&path, bytes.len() as u64, 1 << 30, &options, &mut collector)?;
        let folder = std::fs::read_dir(folder.path()).unwrap();
        assert_eq!(folder.count(), 1, "nothing is left beside the file");
        Ok((crs, collector.finish().0))
    }

    #[test]
    fn a_layer_is_read_with_its_system() {
        let (crs, features) = read_bytes(&package(false), "kind_field = \"SORT\"").unwrap();
        assert_eq!((crs.epsg, features.len(), features[0].number), (Some(25832), 1, 8));
        assert_eq!(features[0].shape, LineShape::Line(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]));
        let two = package(true);
        assert!(read_bytes(&two, "").unwrap_err().to_string().contains("\"a\", \"b\""));
        assert_eq!(read_bytes(&two, "layer = \"B\"").unwrap().1.len(), 1);
        let error = read_bytes(&two, "layer = \"a\"\nheight_field = \"z\"").unwrap_err().to_string();
        assert!(error.contains("it has id, sort"), "{error}");
    }

    #[test]
    fn rows_whose_keys_are_no_numbers_are_numbered() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        std::fs::write(&path, package(false)).unwrap();
        let numbers = |sql: &str| {
            let file = Connection::open(&path).unwrap();
            file.execute_batch(sql).unwrap();
            file.close().unwrap();
            let (_, features) = read_bytes(&std::fs::read(&path).unwrap(), "").unwrap();
            features.iter().map(|feature| feature.number).collect::<Vec<_>>()
        };
        assert_eq!(numbers("INSERT INTO a SELECT 2, shape, sort FROM a WHERE id = 8"), [2, 8]);
        // The row without a geometry is the third.
        assert_eq!(numbers("INSERT INTO a SELECT -2, shape, sort FROM a WHERE id = 8"), [1, 2, 4]);
        let texts = "CREATE TABLE t (id TEXT PRIMARY KEY, shape BLOB, sort TEXT);
                     INSERT INTO t SELECT 'key ' || id, shape, sort FROM a;
                     DROP TABLE a; ALTER TABLE t RENAME TO a;";
        assert_eq!(numbers(texts), [1, 2, 4]);
    }

    /// Reads a file in which `sql` has changed something.
    fn read_changed(sql: &str, rest: &str) -> Result<Vec<LineFeature>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        std::fs::write(&path, package(false)).unwrap();
        let file = Connection::open(&path).unwrap();
        file.execute_batch(sql).unwrap();
        file.close().unwrap();
        read_bytes(&std::fs::read(&path).unwrap(), rest).map(|(_, features)| features)
    }

    #[test]
    fn damaged_pages_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        std::fs::write(&path, package(false)).unwrap();
        let file = Connection::open(&path).unwrap();
        let many = "WITH RECURSIVE c(n) AS (SELECT 10 UNION ALL SELECT n + 1 FROM c WHERE n < 3000)
                    INSERT INTO a SELECT n, (SELECT shape FROM a WHERE id = 8), 'line' FROM c";
        file.execute_batch(many).unwrap();
        let size: u32 = file.query_row("PRAGMA page_size", [], |row| row.get(0)).unwrap();
        let size = size as usize;
        file.close().unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        assert!(read_bytes(&bytes, "").unwrap().1.len() > 2000);
        // A leaf of a table with rows begins with 13; its number of cells follows after two bytes.
        let leaf = |page: &usize| bytes[page * size] == 13 && bytes[page * size + 4] > 20;
        let leaf = (1..bytes.len() / size).rev().find(leaf).unwrap();
        bytes[leaf * size + 4] /= 2;
        let error = read_bytes(&bytes, "").map(drop).unwrap_err();
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("is damaged ("), "{error}");
    }

    /// Registers the view or table `v` as a layer.
    const AND_REGISTER: &str = "; INSERT INTO gpkg_geometry_columns VALUES ('v', 'shape', 7)";

    #[test]
    fn views_that_choose_among_columns_and_rows_are_layers() {
        for view in [
            "SELECT id, shape, sort FROM a",
            "SELECT id AS OGC_FID, shape, upper(sort) AS sort FROM a WHERE id > 0",
            "SELECT b.shape, a.sort FROM a JOIN a AS b USING (id) ORDER BY id",
        ] {
            let sql = format!("CREATE VIEW v AS {view}{AND_REGISTER}");
            let features = read_changed(&sql, "layer = \"v\"\nkind_field = \"sort\"").unwrap();
            // Its rows are numbered: the first has no geometry.
            assert_eq!((features.len(), features[0].number), (1, 2), "{view}");
            assert_eq!(features[0].kind, breaklines::FeatureKind::River);
            // A view of a table is not another layer without a name.
            assert_eq!(read_changed(&sql, "").unwrap()[0].number, 8);
        }
    }

    /// None of them may take memory or time that the file's size does not explain.
    #[test]
    fn what_sqlite_would_have_to_compute_is_refused() {
        let view = |query: &str| format!("CREATE VIEW v AS {query}{AND_REGISTER}");
        let doubled = (0..18).fold("SELECT id, shape FROM a".to_string(), |query, _| {
            format!("SELECT id, shape || shape AS shape FROM ({query})")
        });
        let many = "WITH RECURSIVE c(n) AS (SELECT 10 UNION ALL SELECT n + 1 FROM c WHERE n < 300)
                    INSERT INTO a SELECT n, (SELECT shape FROM a WHERE id = 8), 'line' FROM c;";
        let endless = "WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c) SELECT n AS id, shape FROM c, a";
        let computed = "zeroblob(100000000)) VIRTUAL; UPDATE gpkg_geometry_columns SET column_name = 'big'";
        for (sql, word) in [
            (format!("ALTER TABLE a ADD COLUMN big BLOB GENERATED ALWAYS AS ({computed}"), "GENERATED ALWAYS"),
            (view("SELECT id, zeroblob(100000000) AS shape FROM a"), "zeroblob"),
            (view("SELECT id, randomblob(100000000) AS shape FROM a"), "randomblob"),
            (view("SELECT id, printf('%100000000d', 1) AS shape FROM a"), "printf"),
            (view("SELECT a.id, shape FROM a, json_each('[1, 2, 3]')"), "not authorized"),
            (view("SELECT load_extension('a.so') AS id, shape FROM a"), "load_extension"),
            (view(endless), "would have SQLite compute"),
            (view(&doubled), "would have SQLite compute"),
            (
                format!(
                    "CREATE VIEW w AS SELECT id, sort || sort AS sort, shape FROM a; {}",
                    view("SELECT id, shape, sort FROM w")
                ),
                "would have SQLite compute",
            ),
            (view("SELECT id, shape FROM a WHERE sort LIKE '%a%a%a%b'"), "not authorized"),
            (format!("{many}{}", view("SELECT a.id, a.shape FROM a, a AS b, a AS c")), "holds more than the file"),
            (
                format!(
                    "{many}{}",
                    view("SELECT a.id, a.shape FROM a, a b, a c, a d WHERE a.id + b.id + c.id + d.id < 0")
                ),
                "takes too long",
            ),
            (
                format!("{many}{}", view("SELECT 1 AS id, NULL AS shape FROM a, a b, a c, a d")),
                "holds more than the file",
            ),
            (format!("CREATE VIRTUAL TABLE v USING fts5(shape){AND_REGISTER}"), "has no layer"),
            (
                "ALTER TABLE gpkg_geometry_columns RENAME TO g;
              CREATE VIEW gpkg_geometry_columns AS SELECT hex(zeroblob(9)) AS table_name, column_name, srs_id FROM g"
                    .into(),
                "not authorized",
            ),
        ] {
            let layer = if sql.contains("'v', 'shape'") { "layer = \"v\"" } else { "" };
            let error = read_changed(&sql, layer).map(drop).unwrap_err();
            assert!(error.kind() == ErrorKind::Input && error.to_string().contains(word), "{sql}: {error}");
        }
        // An attribute that is not read may be computed.
        let beside = "ALTER TABLE a ADD COLUMN more TEXT GENERATED ALWAYS AS (sort || sort) VIRTUAL";
        assert_eq!(read_changed(beside, "").unwrap().len(), 1);
        assert!(read_changed(beside, "kind_field = \"more\"").unwrap_err().to_string().contains("GENERATED"));
    }

    #[test]
    fn a_journal_beside_the_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gpkg");
        for (ending, bytes, is_open) in [
            ("-journal", &[0xd9u8, 0xd5][..], true),
            ("-journal", &[0; 9], false),
            ("-wal", &[1], true),
            ("-wal", &[], false),
        ] {
            let beside = folder.path().join(format!("a.gpkg{ending}"));
            std::fs::write(&beside, bytes).unwrap();
            let found = refuse_open_journal(&path);
            assert_eq!(found.is_err_and(|error| error.to_string().contains(ending)), is_open, "{ending} {bytes:?}");
            std::fs::remove_file(beside).unwrap();
        }
    }

    #[test]
    fn a_damaged_file_is_named() {
        let sound = package(true);
        let cut = (16..sound.len()).step_by(1777).map(|length| read_bytes(&sound[..length], "layer = \"b\""));
        // The last pages may be empty.
        let errors: Vec<Error> = cut.filter_map(Result::err).collect();
        assert!(errors.len() > 5 && errors.iter().all(|error| error.kind() == ErrorKind::Input), "{errors:?}");
        for at in (100..sound.len()).step_by(631) {
            let mut damaged = sound.clone();
            damaged[at..(at + 40).min(sound.len())].fill(0xa5);
            // It may not matter, but nothing panics.
            let _ = read_bytes(&damaged, "layer = \"b\"\nkind_field = \"sort\"");
        }
    }
}
