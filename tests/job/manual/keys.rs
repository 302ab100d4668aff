//! The keys of a configuration: what the program knows, and what the manual says.

use std::collections::BTreeSet;
use std::fs;

use toml::{Table, Value};

const LEAST: &str = "[input]\nfiles = [\"a.laz\"]\n[output]\ndirectory = \"out\"\n";

/// The tables of a configuration.
pub(super) const TABLES: [&str; 11] = [
    "[input]",
    "[input.bare_earth]",
    "[input.csv]",
    "[[breaklines]]",
    "[triangulation]",
    "[gpu]",
    "[output]",
    "[output.raster]",
    "[output.contours]",
    "[output.terrain]",
    "[limits]",
];

/// A key and its table.
pub(super) type Key = (String, String);

/// Returns the keys that the manual has to explain: those that the program lists when it is asked for one that is not there. Old names are
/// not among them.
pub(super) fn to_explain() -> BTreeSet<Key> {
    let mut keys = BTreeSet::new();
    for table in TABLES {
        let said = load(table, "no_such_key", Value::Integer(1)).unwrap_err();
        let list =
            said.lines().next().and_then(|line| line.split_once(": it takes ")).unwrap_or_else(|| panic!("{said}"));
        keys.extend(list.1.split(", ").map(|key| (table.to_owned(), key.to_owned())));
    }
    keys
}

/// Tells whether the program knows a key, under whatever name.
pub(super) fn is_known(table: &str, key: &str) -> bool {
    load(table, key, Value::Integer(1)).err().is_none_or(|said| !said.contains("has no key"))
}

/// Reads a configuration with this key in it, as the program does.
pub(super) fn load(table: &str, key: &str, value: Value) -> Result<(), String> {
    let mut whole: Table = LEAST.parse().unwrap();
    let names: Vec<&str> = table.trim_matches(['[', ']']).split('.').collect();
    let mut place = Table::new();
    match table {
        "[input.bare_earth]" => {
            drop(whole["input"].as_table_mut().unwrap().insert("surface".into(), "bare-earth".into()))
        }
        "[[breaklines]]" => drop(place.insert("files".into(), vec!["a.gpkg"].into())),
        "[output.contours]" if key != "levels" => drop(place.insert("interval".into(), Value::Float(1.0))),
        "[output.terrain]" => drop(place.insert("format".into(), "quantized-mesh".into())),
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
