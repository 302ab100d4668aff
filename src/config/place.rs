//! Where something stands in a configuration: its table and its key.

use std::ops::Range;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

/// A table and a key, as far as they are known.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Place {
    /// The table as a configuration has it; empty above all tables.
    pub(crate) table: String,
    pub(crate) key: Option<String>,
    /// The value of the key.
    pub(crate) value: Option<Value>,
}

impl Place {
    /// Returns the place of what stands at `span` in a configuration.
    pub(crate) fn of(text: &str, file: &DeTable<'_>, span: &Range<usize>) -> Place {
        let Some((mut names, value)) = names_at(file, span.start) else { return Place::default() };
        let key = names.pop();
        Place { table: header(file, &names), key, value: value_in(text, &value) }
    }

    /// Returns the place of what stands at byte `at` of a text that is no TOML, by its lines.
    pub(crate) fn in_text(text: &str, at: usize) -> Place {
        let before = text.get(..at).unwrap_or(text);
        let is_header = |line: &&str| line.starts_with('[') && line.contains(']') && !line.contains('=');
        let table = before.lines().map(str::trim).rev().find(is_header).unwrap_or_default();
        let start = before.rfind('\n').map_or(0, |end| end + 1);
        let line = text.get(start..).and_then(|rest| rest.lines().next()).unwrap_or_default();
        let key = line.split(['=', ':']).next().map(str::trim).filter(|key| is_key(key));
        Place { table: table.into(), key: key.map(String::from), value: None }
    }

    /// Returns a sentence with the place before it.
    pub(crate) fn before(&self, what: &str) -> String {
        match (&self.table[..], &self.key) {
            // The sentence is about the key already.
            (table, Some(key)) if !table.is_empty() && what.starts_with(&format!("{key} ")) => {
                format!("{table} {what}")
            }
            ("", None) => what.into(),
            ("", Some(key)) => format!("{key}: {what}"),
            (table, None) => format!("{table}: {what}"),
            (table, Some(key)) => format!("{table} {key}: {what}"),
        }
    }
}

fn is_key(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"_-".contains(&byte))
}

/// Returns the names that lead to what stands at byte `at`, and the span of its value.
fn names_at(table: &DeTable<'_>, at: usize) -> Option<(Vec<String>, Range<usize>)> {
    let below = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
        let (mut names, span) = names_below(value, at)?;
        names.insert(0, name(key));
        Some((names, span))
    };
    // A table that is written by its header has keys outside of its own span.
    let own = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
        let is_here = key.span().contains(&at) || value.span().contains(&at);
        is_here.then(|| (vec![name(key)], value.span()))
    };
    table.iter().find_map(below).or_else(|| table.iter().find_map(own))
}

fn name(key: &Spanned<std::borrow::Cow<'_, str>>) -> String {
    key.get_ref().to_string()
}

fn names_below(value: &Spanned<DeValue<'_>>, at: usize) -> Option<(Vec<String>, Range<usize>)> {
    match value.get_ref() {
        DeValue::Table(table) => names_at(table, at),
        DeValue::Array(values) => values.iter().find_map(|value| names_below(value, at)),
        _ => None,
    }
}

/// Returns the table to which names lead, as a configuration has it.
fn header(file: &DeTable<'_>, names: &[String]) -> String {
    let Some(first) = names.first() else { return String::new() };
    let is_list = file.iter().any(|(key, value)| name(key) == *first && value.get_ref().is_array());
    if is_list { format!("[[{}]]", names.join(".")) } else { format!("[{}]", names.join(".")) }
}

fn value_in(text: &str, span: &Range<usize>) -> Option<Value> {
    format!("it = {}", text.get(span.clone())?).parse::<Table>().ok()?.remove("it")
}
