//! What is wrong with the text of a configuration, in people's words: the line, the key with its table, what it takes, an example, and the
//! nearest name.

use crate::config::option_list::{ConfigOption, tables};
use crate::config::place::Place;
use crate::config::short_message::{shortened, shown_lines};
use crate::config::syntax::about_syntax;
use crate::config::wrong_name::{about_missing, about_name};
use crate::config::wrong_value::about_value;
use toml::de::{DeTable, Error};

/// Returns what is wrong with the text, of which the parser has said `error`.
pub(crate) fn explained(text: &str, error: &Error) -> String {
    let (file, mut errors) = DeTable::parse_recoverable(text);
    errors.sort_by_key(start);
    let (what, error) = match errors.into_iter().next() {
        Some(first) => (about_syntax(text, start(&first), first.message()), first),
        None => (about_option(text, file.get_ref(), error), error.clone()),
    };
    if let Some(name) = in_backticks(error.message(), "missing field").filter(|name| is_table(name)) {
        // It is on no line.
        return about_missing(&[], name);
    }
    let shown = shown_lines(&with_input(error.clone(), text).to_string());
    let line = 1 + text.get(..start(&error)).unwrap_or_default().matches('\n').count();
    shortened(&format!("line {line}: {what}\n{shown}"))
}

/// Tells whether a configuration needs a table of this name.
fn is_table(name: &str) -> bool {
    tables().contains(&format!("[{name}]").as_str())
}

/// Returns the first byte that an error is about.
fn start(error: &Error) -> usize {
    error.span().map_or(0, |span| span.start)
}

fn with_input(mut error: Error, text: &str) -> Error {
    error.set_input(Some(text));
    error
}

/// Returns what is wrong with a key, a value or a table.
fn about_option(text: &str, file: &DeTable<'_>, error: &Error) -> String {
    let said = error.message();
    let place = error.span().map_or_else(Place::default, |span| Place::of(text, file, &span));
    let Place { table, key, value } = &place;
    let key = key.as_deref().unwrap_or_default();
    let own = if table.is_empty() { format!("[{key}]") } else { format!("{}.{key}]", table.trim_end_matches(']')) };
    let listed = format!("[[{key}]]");
    if said.starts_with("unknown field") {
        return about_name(table, key, value.as_ref());
    }
    if let Some(name) = in_backticks(said, "missing field") {
        return about_missing(&[&own, &listed, table], name);
    }
    if let Some(name) = in_backticks(said, "duplicate field") {
        return format!("{name} is set under two names: keep one");
    }
    match ConfigOption::find(table, key) {
        Some(option) => place.before(&about_value(&option, value.as_ref(), said)),
        None if tables().contains(&listed.as_str()) => {
            format!(
                "there can be several tables of {key}: write {listed} in double brackets, once for each kind of file"
            )
        }
        None if tables().contains(&own.as_str()) => {
            format!("{key} is a table: write {own} on a line of its own, and its keys below it")
        }
        None => place.before(said),
    }
}

/// Returns the name that a message has behind `start`.
pub(super) fn in_backticks<'a>(said: &'a str, start: &str) -> Option<&'a str> {
    said.strip_prefix(start)?.split('`').nth(1)
}
