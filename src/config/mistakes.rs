//! All mistakes of a configuration at once. The parser stops at the first, so the lines of the entry that it stops at are emptied, and the
//! rest is read again. An entry that shares its line with another one ends this.

use crate::config::config_file::ConfigFile;
use crate::config::mistake::{explained, in_backticks};
use crate::config::option_list::ConfigOption;
use crate::config::place::Place;
use crate::config::wrong_name::line_meant;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};

/// At most so many mistakes are told.
const MOST: usize = 20;

/// Returns what is wrong with the text, of which the parser has said `first`: one message for each mistake.
pub(crate) fn all_explained(text: &str, first: Error) -> String {
    let mut told = vec![message(text, &first)];
    let mut rest = Rest { lines: text.split('\n').map(String::from).collect(), emptied: Vec::new() };
    let mut next = rest.without(&first).and_then(|()| rest.mistake());
    while let Some(error) = next.take_if(|_| told.len() < MOST) {
        told.push(message(&rest.text(), &error));
        next = rest.without(&error).and_then(|()| rest.mistake());
    }
    told.sort_by_key(|(line, _)| *line);
    let mut messages: Vec<String> = told.into_iter().map(|(_, message)| message).collect();
    if next.is_some() {
        messages.push("there are more mistakes".into());
    }
    messages.join("\n")
}

/// Returns what is wrong with a text, and the line. What is on no line comes last.
fn message(text: &str, error: &Error) -> (usize, String) {
    let what = explained(text, error);
    let line = error.span().filter(|_| what.starts_with("line ")).map(|span| line_at(text, span.start));
    (line.unwrap_or(usize::MAX), what)
}

/// Returns the number of the line with byte `at`, from 0.
fn line_at(text: &str, at: usize) -> usize {
    text.bytes().take(at).filter(|&byte| byte == b'\n').count()
}

/// What is left of a text. Every line keeps its number.
struct Rest {
    lines: Vec<String>,
    emptied: Vec<EmptiedEntry>,
}

/// An entry whose lines are empty now.
struct EmptiedEntry {
    table: String,
    key: String,
    /// Whether no option has this name, so it may have been any.
    is_unknown: bool,
    line: usize,
}

impl Rest {
    fn text(&self) -> String {
        self.lines.join("\n")
    }

    /// Empties the lines of the entry that the error is about, or writes the option there that the user may have meant. Returns `None` if it is
    /// no single entry on lines of its own.
    fn without(&mut self, error: &Error) -> Option<()> {
        let said = error.message();
        if ["missing field", "duplicate field"].iter().any(|kind| said.starts_with(kind)) {
            return None;
        }
        let (text, span) = (self.text(), error.span()?);
        let (file, wrong) = DeTable::parse_recoverable(&text);
        let entry = entry_at(file.get_ref(), span.start).filter(|_| wrong.is_empty())?;
        let before = text.get(..entry.start)?.rsplit('\n').next()?;
        let after = text.get(entry.end..)?.split('\n').next()?.trim();
        if !before.trim().is_empty() || !(after.is_empty() || after.starts_with('#')) {
            return None;
        }
        let Place { table, key, .. } = Place::of(&text, file.get_ref(), &span);
        let (key, is_unknown) = (key?, said.starts_with("unknown field"));
        let line = line_at(&text, entry.start);
        let lines = self.lines.get_mut(line..=line_at(&text, entry.end))?;
        lines.iter_mut().for_each(String::clear);
        if let Some(meant) = line_meant(&table, &key).filter(|_| is_unknown) {
            self.write(line, meant);
            if self.is_toml() {
                return Some(());
            }
            // The option is set already.
            self.write(line, String::new());
        }
        self.emptied.push(EmptiedEntry { table, key, is_unknown, line });
        self.is_toml().then_some(())
    }

    /// Returns what is wrong with the rest. An option that is missing because its lines are empty gets its example there.
    fn mistake(&mut self) -> Option<Error> {
        loop {
            let error = toml::from_str::<ConfigFile>(&self.text()).err()?;
            let Some(key) = in_backticks(error.message(), "missing field") else { return Some(error) };
            let found = self.emptied.iter().enumerate().find_map(|(number, entry)| {
                let option = ConfigOption::find(&entry.table, key).filter(|option| option.table == entry.table)?;
                (entry.is_unknown || entry.key == key).then(|| (number, option.line()))
            });
            let Some((number, line)) = found else { return Some(error) };
            let at = self.emptied.remove(number).line;
            self.write(at, line);
        }
    }

    fn write(&mut self, line: usize, text: String) {
        if let Some(place) = self.lines.get_mut(line) {
            *place = text;
        }
    }

    fn is_toml(&self) -> bool {
        DeTable::parse_recoverable(&self.text()).1.is_empty()
    }
}

/// Returns where the innermost entry stands that is at byte `at`: from its key to the end of its value. A table with a header is none.
fn entry_at(table: &DeTable<'_>, at: usize) -> Option<Range<usize>> {
    let of = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
        let own = key.span().start..value.span().end;
        let is_here = own.contains(&at) && !value.get_ref().is_table();
        entry_below(value, at).or_else(|| is_here.then_some(own))
    };
    table.iter().find_map(of)
}

fn entry_below(value: &Spanned<DeValue<'_>>, at: usize) -> Option<Range<usize>> {
    match value.get_ref() {
        DeValue::Table(table) => entry_at(table, at),
        DeValue::Array(values) => values.iter().find_map(|value| entry_below(value, at)),
        _ => None,
    }
}
