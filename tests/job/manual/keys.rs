//! The keys of a configuration: what the program knows, and what the manual says.

use std::collections::BTreeSet;
use std::fs;

use toml::{Table, Value};

const LEAST: &str = "[input]\nfiles = [\"a.laz\"]\n[output]\ndirectory = \"out\"\n";

/// The tables of a configuration.
pub(super) const TABLES: [&str; 8] =
    ["[input]", "[input.csv]", "[[breaklines]]", "[triangulation]", "[gpu]", "[output]", "[output.raster]", "[limits]"];

/// Old names, which the manual need not explain, and one that a job sets for itself.
const UNSAID: [(&str, &str); 7] = [
    ("[input]", "malformed_share"),
    ("[input]", "without_ignored_ground"),
    ("[triangulation]", "sites_per_tile"),
    ("[triangulation]", "voronoi"),
    ("[triangulation]", "adapter"),
    ("[triangulation]", "texture"),
    ("[output]", "level_sites"),
];

/// A key and its table.
pub(super) type Key = (String, String);

/// Returns all keys that the program knows: it lists them when it is asked for one that is not there.
pub(super) fn known() -> BTreeSet<Key> {
    let mut keys = BTreeSet::new();
    for table in TABLES {
        let said = load(table, "no_such_key", Value::Integer(1)).unwrap_err();
        let (_, list) = said.split_once("expected one of").unwrap_or_else(|| panic!("{said}"));
        // Some keys are tables, which have keys of their own.
        let is_key = |key: &String| !TABLES.contains(&format!("{}.{key}]", table.trim_end_matches(']')).as_str());
        keys.extend(super::markdown::code(list).into_iter().filter(is_key).map(|key| (table.to_owned(), key)));
    }
    keys
}

/// Returns the keys that the manual has to explain.
pub(super) fn to_explain() -> BTreeSet<Key> {
    let mut keys = known();
    for (table, key) in UNSAID {
        assert!(keys.remove(&(table.into(), key.into())), "{table} {key} is gone: UNSAID need not have it");
    }
    keys
}

/// Reads a configuration with this key in it, as the program does.
pub(super) fn load(table: &str, key: &str, value: Value) -> Result<(), String> {
    let mut whole: Table = LEAST.parse().unwrap();
    let names: Vec<&str> = table.trim_matches(['[', ']']).split('.').collect();
    let mut place = Table::new();
    match table {
        "[[breaklines]]" => drop(place.insert("files".into(), vec!["a.gpkg"].into())),
        "[output.raster]" => drop(place.insert("resolution".into(), Value::Float(1.0))),
        _ if names.len() == 1 => {
            place = whole.get(names[0]).and_then(Value::as_table).cloned().unwrap_or_default();
        }
        _ => {}
    }
    place.insert(key.into(), value);
    let place: Value = if table.starts_with("[[") { vec![place].into() } else { place.into() };
    match names[..] {
        [name] => drop(whole.insert(name.into(), place)),
        [outer, inner] => drop(whole[outer].as_table_mut().unwrap().insert(inner.into(), place)),
        _ => panic!("{table}"),
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    fs::write(&path, toml::to_string(&whole).unwrap()).unwrap();
    gdt_batch::config::load(&path).map(drop).map_err(|error| error.to_string())
}

/// Returns the value that TOML reads in `text`, if it is one.
pub(super) fn value(text: &str) -> Option<Value> {
    format!("it = {text}").parse::<Table>().ok()?.remove("it")
}

/// Takes `[output] page = true` apart: a table, a key, and what stands after the equals sign.
pub(super) fn parted(code: &str) -> Option<(&str, &str, Option<&str>)> {
    let table = TABLES.into_iter().find(|table| code.starts_with(table))?;
    let rest = code[table.len()..].trim();
    let (key, value) = match rest.split_once('=') {
        Some((key, value)) => (key.trim(), Some(value.trim())),
        None => (rest, None),
    };
    let is_key = !key.is_empty() && key.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
    is_key.then_some((table, key, value))
}
