//! The options of a configuration as `configs/full.toml` lists them: the words of messages come from there. Old names and keys that only
//! jobs set are not in it, so no message names them.

use crate::config::least::{is_taken, refusal};
use crate::config::nearest::nearest;
use std::collections::HashSet;
use std::sync::LazyLock;
use toml::Value;

/// Every option with its default, and with what it does in comments.
const FULL: &str = include_str!("../../configs/full.toml");

/// A word that no option knows.
const NO_WORD: &str = "no such word";

/// All options. The command line asks for several at every start.
static OPTIONS: LazyLock<Vec<ConfigOption>> = LazyLock::new(listed);

/// A key of a configuration.
#[derive(Clone, Debug)]
pub(crate) struct ConfigOption {
    /// Its table as a configuration has it, such as `[input.csv]` or `[[breaklines]]`.
    pub(crate) table: &'static str,
    pub(crate) key: &'static str,
    /// A value that it may have, as TOML has it.
    pub(crate) example: String,
    /// What is said about it.
    words: Vec<&'static str>,
}

impl ConfigOption {
    /// Returns the option of this name, if there is one. It may be a table within another one.
    pub(crate) fn find(table: &str, key: &str) -> Option<ConfigOption> {
        let named = OPTIONS.iter().find(|option| option.table == table && option.key == key);
        named.cloned().or_else(|| ConfigOption::of_inner_table(table, key))
    }

    /// Returns the table of this name in another one as an option of that.
    fn of_inner_table(table: &str, key: &str) -> Option<ConfigOption> {
        let (key, inner) = inner_tables(table).into_iter().find(|(name, _)| *name == key)?;
        let table = tables().into_iter().find(|outer| *outer == table)?;
        let first = options().into_iter().find(|option| option.table == inner)?;
        Some(ConfigOption { table, key, example: format!("{{ {} }}", first.line()), words: Vec::new() })
    }

    /// Returns a line that sets the option.
    pub(crate) fn line(&self) -> String {
        format!("{} = {}", self.key, self.example)
    }

    /// Returns whether the option takes other words than those that are listed.
    pub(crate) fn is_open(&self) -> bool {
        !refusal(self.table, self.key, &NO_WORD.into()).is_some_and(|said| said.starts_with("unknown variant"))
    }

    /// Returns the words that are listed for the option, if it does not take any.
    pub(crate) fn choices(&self) -> Vec<String> {
        if self.takes(NO_WORD) || self.takes_list(NO_WORD) {
            return Vec::new();
        }
        let quoted = self.words.iter().flat_map(|line| quoted(line));
        let mut known = HashSet::new();
        quoted.filter(|word| known.insert(word.clone()) && (self.takes(word) || self.takes_list(word))).collect()
    }

    fn takes(&self, word: &str) -> bool {
        is_taken(self.table, self.key, &Value::from(word))
    }

    /// Returns whether the option takes lists of words with this one.
    pub(crate) fn takes_list(&self, word: &str) -> bool {
        is_taken(self.table, self.key, &Value::Array(vec![word.into()]))
    }

    /// Returns the word that the user may have meant.
    pub(crate) fn nearest_choice(&self, word: &str) -> Option<String> {
        let choices = self.choices();
        nearest(word, choices.iter().map(String::as_str)).map(String::from)
    }
}

/// Returns all options.
pub(crate) fn options() -> Vec<ConfigOption> {
    OPTIONS.clone()
}

/// Reads all options from the list.
fn listed() -> Vec<ConfigOption> {
    let (mut table, mut words, mut found) = ("", Vec::new(), Vec::new());
    for line in FULL.lines() {
        let text = line.strip_prefix("# ").unwrap_or(line);
        if is_header(text) {
            table = text;
            words.clear();
        } else if let Some((key, example, note)) = assignment(text) {
            words.push(note);
            found.push(ConfigOption { table, key, example: example.to_string(), words: std::mem::take(&mut words) });
        } else if text.is_empty() {
            words.clear();
        } else {
            words.push(text);
        }
    }
    found
}

/// Returns the tables, each once, in their order.
pub(crate) fn tables() -> Vec<&'static str> {
    let mut tables: Vec<&str> = FULL.lines().map(|line| line.strip_prefix("# ").unwrap_or(line)).collect();
    tables.retain(|line| is_header(line));
    tables
}

/// Returns the names of the tables in a table, and these tables.
pub(crate) fn inner_tables(table: &str) -> Vec<(&'static str, &'static str)> {
    let start = format!("{}.", table.trim_end_matches(']'));
    let inner = |table: &'static str| Some((table.strip_prefix(start.as_str())?.trim_end_matches(']'), table));
    tables().into_iter().filter_map(inner).collect()
}

/// Tells whether a line begins a table.
fn is_header(line: &str) -> bool {
    let name = line.trim_matches(['[', ']']);
    line.starts_with('[')
        && line.ends_with(']')
        && name.bytes().all(|byte| byte.is_ascii_lowercase() || b"._".contains(&byte))
}

/// Returns the key, the value and the comment of a line that sets a key.
fn assignment(line: &'static str) -> Option<(&'static str, &'static str, &'static str)> {
    let (setting, note) = line.split_once("  #").unwrap_or((line, ""));
    let (key, value) = setting.split_once(" = ")?;
    let is_key = key.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
    // A sentence may begin with a setting.
    (is_key && line.parse::<toml::Table>().is_ok()).then_some((key, value.trim(), note.trim()))
}

/// Returns the words in quotes, apart from those that are values of other options.
fn quoted(line: &str) -> Vec<String> {
    let parts: Vec<&str> = line.split('"').collect();
    let pairs = parts.chunks_exact(2).filter(|pair| !pair[0].ends_with("= "));
    pairs.map(|pair| pair[1].to_string()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Old names, and a key that a job sets for itself.
    const HIDDEN: [(&str, &str); 7] = [
        ("[input]", "malformed_share"),
        ("[input]", "without_ignored_ground"),
        ("[triangulation]", "sites_per_tile"),
        ("[triangulation]", "voronoi"),
        ("[triangulation]", "adapter"),
        ("[triangulation]", "texture"),
        ("[output]", "level_sites"),
    ];

    #[test]
    fn every_key_of_the_program_is_in_the_list_or_hidden() {
        for table in tables() {
            let said = refusal(table, "no_such_key", &Value::Integer(1)).unwrap();
            let mut keys: Vec<&str> = said.split('`').skip(3).step_by(2).collect();
            keys.retain(|key| !inner_tables(table).iter().any(|(inner, _)| inner == key));
            let hidden: Vec<&str> = HIDDEN.iter().filter(|(of, _)| *of == table).map(|(_, key)| *key).collect();
            let listed: Vec<&str> =
                options().iter().filter(|option| option.table == table).map(|option| option.key).collect();
            assert!(!listed.is_empty() && hidden.iter().all(|key| !listed.contains(key)), "{table} {listed:?}");
            let all: HashSet<&str> = listed.into_iter().chain(hidden).collect();
            assert_eq!(all, keys.into_iter().collect(), "{table}");
        }
    }

    #[test]
    fn the_list_has_keys_values_and_choices() {
        let all = options();
        assert!(all.len() >= 60, "{}", all.len());
        for option in &all {
            let value = format!("it = {}", option.example).parse::<toml::Table>().unwrap()["it"].clone();
            assert!(is_taken(option.table, option.key, &value), "{option:?}");
        }
        for (table, key, choices) in [
            ("[input]", "unit", &["auto", "metre", "foot", "us-foot"][..]),
            ("[input]", "duplicates", &["lowest", "highest", "first"]),
            ("[input]", "files", &[]),
            ("[[breaklines]]", "kind", &["line", "river", "lake"]),
            ("[output]", "attributes", &["classification", "intensity"]),
            ("[output]", "export", &["landxml", "dxf", "obj", "ply"]),
            ("[output]", "format", &["3dtiles", "glb", "auto"]),
            ("[output.raster]", "compression", &["deflate", "none"]),
            ("[output.raster]", "products", &["height", "hillshade", "slope", "aspect"]),
            ("[output.raster]", "pmtiles", &["terrarium", "terrain-rgb"]),
            ("[output.terrain]", "scheme", &["geographic", "web-mercator"]),
            ("[output]", "copyright", &[]),
            ("[output]", "imagery", &[]),
        ] {
            assert_eq!(ConfigOption::find(table, key).unwrap().choices(), choices, "{table} {key}");
        }
        let tables = [
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
        assert_eq!(super::tables(), tables);
    }
}
