//! What is wrong with the name of a key or of a table: where it belongs, and what the user may have meant.

use crate::config::least::is_taken;
use crate::config::nearest::nearest;
use crate::config::option_list::{ConfigOption, inner_tables, options, tables};
use toml::Value;

/// No value of the user is repeated that is longer.
const LONGEST: usize = 100;

/// Returns what is wrong with a key that the table does not have, or, without a `value`, with the name of a table in it. Above all tables,
/// `table` is empty.
pub(crate) fn about_name(table: &str, name: &str, value: Option<&Value>) -> String {
    let value = value.filter(|value| !value.is_table());
    match (table, value) {
        ("", None) => about_table(name),
        ("", Some(_)) => about_lost_key(name),
        _ => about_key(table, name, value),
    }
}

fn about_key(table: &str, name: &str, value: Option<&Value>) -> String {
    let missing = format!("{table} has no key {name}");
    let elsewhere = tables_with(name);
    if !elsewhere.is_empty() {
        return format!("{missing}: it is a key of {}, so move it there", elsewhere.join(" or "));
    }
    let inner = inner_tables(table).into_iter().filter(|_| value.is_none()).collect::<Vec<_>>();
    let near = nearest(name, inner.iter().map(|(inner, _)| *inner));
    if let Some((_, inner)) = inner.iter().find(|(inner, _)| Some(*inner) == near) {
        return format!("{missing}; did you mean the table {inner}?");
    }
    let own: Vec<ConfigOption> = options().into_iter().filter(|option| option.table == table).collect();
    match nearest_option(name, &own) {
        Some(near) => format!("{missing}; did you mean {}?", line_of(near, value)),
        None => format!("{missing}: it takes {}", own.iter().map(|option| option.key).collect::<Vec<_>>().join(", ")),
    }
}

/// Returns an example of the option of a table that the user may have meant by a name.
pub(crate) fn line_meant(table: &str, name: &str) -> Option<String> {
    let own: Vec<ConfigOption> = options().into_iter().filter(|option| option.table == table).collect();
    nearest_option(name, &own).map(ConfigOption::line)
}

/// Returns what is wrong with a key above all tables.
fn about_lost_key(name: &str) -> String {
    let lost = format!("{name} is in no table");
    if let [table, ..] = tables_with(name)[..] {
        return format!("{lost}: it is a key of {table}, so write {table} on a line above it");
    }
    match nearest_option(name, &options()) {
        Some(near) => format!("{lost}; did you mean {}, a key of {}?", near.key, near.table),
        None => format!("{lost}: the tables are {}", tables().join(", ")),
    }
}

/// Returns what is wrong with the name of a table.
fn about_table(name: &str) -> String {
    let all: Vec<(&str, &str)> = tables().into_iter().map(|table| (last_name(table), table)).collect();
    let near = nearest(name, all.iter().map(|(last, _)| *last));
    match all.iter().find(|(last, _)| Some(*last) == near) {
        Some((_, table)) => format!("there is no table [{name}]; did you mean {table}?"),
        None => format!("there is no table [{name}]: the tables are {}", tables().join(", ")),
    }
}

/// Returns the last name of a table, such as `csv` of `[input.csv]`.
fn last_name(table: &str) -> &str {
    table.trim_matches(['[', ']']).rsplit('.').next().unwrap_or_default()
}

/// Returns a line that sets an option to the value of the user, if the option takes it.
fn line_of(option: &ConfigOption, value: Option<&Value>) -> String {
    match value.filter(|value| is_taken(option.table, option.key, value)).map(Value::to_string) {
        Some(value) if value.len() <= LONGEST => format!("{} = {value}", option.key),
        _ => format!("{}, as in {}", option.key, option.line()),
    }
}

fn nearest_option<'a>(name: &str, among: &'a [ConfigOption]) -> Option<&'a ConfigOption> {
    let near = nearest(name, among.iter().map(|option| option.key))?;
    among.iter().find(|option| option.key == near)
}

/// Returns the tables that have this key.
fn tables_with(key: &str) -> Vec<&'static str> {
    options().into_iter().filter(|option| option.key == key).map(|option| option.table).collect()
}

/// Returns what is wrong if none of `tables` has the key of this name, which one of them needs, or if the configuration has no such table.
pub(crate) fn about_missing(tables: &[&str], name: &str) -> String {
    let missing = format!("[{name}]");
    let needed = tables.iter().find_map(|table| ConfigOption::find(table, name));
    let first = options().into_iter().find(|option| option.table == missing);
    match (needed, first) {
        (Some(option), _) => format!("{} has no key {name}: add a line such as {}", option.table, option.line()),
        (None, Some(first)) => {
            // The example of a directory is where the sample goes.
            let line = if first.key == "directory" { "directory = \"out\"".into() } else { first.line() };
            format!("there is no table {missing}: add it, with a line such as {line} below it")
        }
        (None, None) => format!("{name} is missing: add it"),
    }
}
