//! All mistakes of a configuration at once. The parser stops at the first, so what it stops at is blanked, and the rest is read again.

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

/// An entry that was blanked.
struct Blank {
    table: String,
    at: usize,
}

/// Returns what is wrong with the text, of which the parser has said `first`: one message for each mistake.
pub(crate) fn all_explained(text: &str, first: Error) -> String {
    let mut told = vec![message(text, &first)];
    let (mut rest, mut error, mut blanks) = (text.to_string(), first, Vec::new());
    while told.len() < MOST {
        let Some((next, blank)) = without_mistake(&rest, &error) else { break };
        rest = next;
        blanks.push(blank);
        let Some(found) = next_mistake(&mut rest, &mut blanks) else { break };
        told.push(message(&rest, &found));
        error = found;
    }
    told.sort_by_key(|(line, _)| *line);
    told.into_iter().map(|(_, message)| message).collect::<Vec<_>>().join("\n")
}

/// Returns what is wrong with a text, and the line.
fn message(text: &str, error: &Error) -> (usize, String) {
    let start = error.span().map_or(0, |span| span.start);
    (text.get(..start).unwrap_or_default().matches('\n').count(), explained(text, error))
}

/// Returns the text without the entry that the error is about, or with the option in its place that the user may have meant; `None` if that is no single entry, or the rest cannot be read.
fn without_mistake(text: &str, error: &Error) -> Option<(String, Blank)> {
    if ["missing field", "duplicate field"].iter().any(|kind| error.message().starts_with(kind)) {
        return None;
    }
    let span = error.span()?;
    let (file, wrong) = DeTable::parse_recoverable(text);
    let entry = entry_at(file.get_ref(), span.start).filter(|_| wrong.is_empty())?;
    let Place { table, key, .. } = Place::of(text, file.get_ref(), &span);
    let is_unknown = error.message().starts_with("unknown field");
    let meant = key.filter(|_| is_unknown).and_then(|key| line_meant(&table, &key)).unwrap_or_default();
    let [before, wrong, after] = [text.get(..entry.start)?, text.get(entry.clone())?, text.get(entry.end..)?];
    let blanks: String = wrong.bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }).collect();
    // An option that is set already, and a comma that is left over in an inline table, are no mistakes of the user.
    let texts = [meant.as_str(), ""].into_iter().map(|line| format!("{before}{line}{blanks}{after}"));
    let rest = texts.into_iter().find(|text| DeTable::parse_recoverable(text).1.is_empty())?;
    Some((rest, Blank { table, at: entry.start }))
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

/// Returns what is wrong with the rest of a text. A key that is missing because its entry was blanked gets its example there.
fn next_mistake(rest: &mut String, blanks: &mut Vec<Blank>) -> Option<Error> {
    loop {
        let error = toml::from_str::<ConfigFile>(rest).err()?;
        let Some(key) = in_backticks(error.message(), "missing field") else { return Some(error) };
        let fits = |blank: &Blank| ConfigOption::find(&blank.table, key).filter(|option| option.table == blank.table);
        let (number, option) = blanks.iter().enumerate().find_map(|(number, blank)| Some((number, fits(blank)?)))?;
        let (line, at) = (option.line(), blanks.remove(number).at);
        rest.insert_str(at, &line);
        let later = blanks.iter_mut().filter(|blank| blank.at > at);
        later.for_each(|blank| blank.at = blank.at.saturating_add(line.len()));
    }
}
