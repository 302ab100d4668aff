//! The least configuration with one more key, which shows whether the program takes its value.

use crate::config::config_file::ConfigFile;
use toml::{Table, Value};

/// Returns whether the program takes a value of a key. The table is named as a configuration has it, such as `[input.csv]`.
pub(crate) fn is_taken(table: &str, key: &str, value: &Value) -> bool {
    refusal(table, key, value).is_none()
}

/// Returns what the parser says about a value of a key, if it refuses it.
pub(crate) fn refusal(table: &str, key: &str, value: &Value) -> Option<String> {
    let names: Vec<&str> = table.trim_matches(['[', ']']).split('.').collect();
    let mut own = needed_keys(table);
    if (table, key) == ("[output.contours]", "levels") {
        // There is one or the other.
        own.remove("interval");
    }
    own.insert(key.into(), value.clone());
    let mut own: Value = if table.starts_with("[[") { vec![own].into() } else { own.into() };
    let [first, inner @ ..] = &names[..] else { return None };
    if let [inner] = inner {
        let mut outer = needed_keys(&format!("[{first}]"));
        outer.insert((*inner).into(), own);
        own = outer.into();
    }
    let mut file = Table::new();
    for name in ["input", "output"] {
        file.insert(name.into(), needed_keys(&format!("[{name}]")).into());
    }
    file.insert((*first).into(), own);
    file.try_into::<ConfigFile>().err().map(|error| error.message().to_string())
}

/// Returns the keys that a table cannot do without.
fn needed_keys(table: &str) -> Table {
    let files = || Value::Array(vec!["a".into()]);
    let needed = match table {
        "[input]" | "[[breaklines]]" => Some(("files", files())),
        "[output]" => Some(("directory", "a".into())),
        "[output.contours]" => Some(("interval", Value::Float(1.0))),
        "[output.raster]" => Some(("resolution", Value::Float(1.0))),
        "[output.terrain]" => Some(("format", "quantized-mesh".into())),
        _ => None,
    };
    needed.into_iter().map(|(key, value)| (key.to_string(), value)).collect()
}
