//! What is wrong with a text that is no TOML, in the words of people who do not know TOML.

use crate::config::place::Place;

/// Quotes that word processors put in the place of straight ones.
const CURLY: [char; 8] = ['“', '”', '„', '‘', '’', '‚', '«', '»'];

/// Returns what is wrong at `at`, of which the parser says `said`.
pub(crate) fn about_syntax(text: &str, at: usize, said: &str) -> String {
    let place = Place::in_text(text, at);
    let line = line_at(text, at);
    let what = match said {
        _ if is_unquoted(said) && line.contains(CURLY) => {
            format!("write straight quotes: {}", line.replace(CURLY, "\""))
        }
        _ if is_escape(said) => about_backslash(line),
        _ if said.starts_with("duplicate key") => return about_twice(&place, line),
        _ if is_unquoted(said) => format!("put the text in quotes{}", quoted_line(line)),
        _ if said.starts_with("invalid boolean") => {
            format!("write true or false in small letters: {}", line.to_lowercase())
        }
        _ if is_unclosed(said) => "a text has no closing quote".into(),
        _ if said.starts_with("missing comma between array elements") => about_list(text, at, line).into(),
        _ if said.starts_with("unclosed array table") => "close the name of the table, as in [[breaklines]]".into(),
        _ if said.starts_with("unclosed table") => "close the name of the table, as in [input]".into(),
        _ if said.starts_with("unclosed array") => "close the list with ]".into(),
        _ if said.starts_with("unclosed inline table") => "close the table with }".into(),
        _ if said.starts_with("key with no value") || said.starts_with("invalid unquoted key") => about_no_value(line),
        _ if said.starts_with("unexpected key or value") => about_rest(line),
        said => format!("this is not valid TOML ({said})"),
    };
    place.before(&what)
}

/// Returns the line of the text at a byte.
fn line_at(text: &str, at: usize) -> &str {
    let start = text.get(..at).and_then(|before| before.rfind('\n')).map_or(0, |end| end + 1);
    text.get(start..).and_then(|rest| rest.lines().next()).unwrap_or_default().trim()
}

/// Tells whether the parser speaks of a text without quotes.
fn is_unquoted(said: &str) -> bool {
    said.starts_with("string values must be quoted")
}

/// Tells whether the parser speaks of a text on one line that does not end, rather than of a character in it.
fn is_unclosed(said: &str) -> bool {
    ["invalid basic string, expected `\"`", "invalid literal string, expected `'`"].contains(&said)
}

/// Tells whether the parser speaks of an escape.
fn is_escape(said: &str) -> bool {
    ["missing escaped value", "too few unicode value digits", "invalid value, expected unicode"]
        .iter()
        .any(|start| said.starts_with(start))
}

/// Returns what to write instead of backslashes.
fn about_backslash(line: &str) -> String {
    let path = line.split('"').find(|part| part.contains('\\'));
    let example = path
        .map_or(String::new(), |path| format!(": \"{}\" or '{path}'", path.replace("\\\\", "/").replace('\\', "/")));
    format!("a backslash has a meaning of its own in double quotes; write slashes, or single quotes{example}")
}

fn about_twice(place: &Place, line: &str) -> String {
    match line.starts_with('[') {
        true => format!("the table {line} appears twice: put all its keys under one"),
        false => place.before("it is set twice: keep one line"),
    }
}

/// Returns what is wrong where a comma is missing in a list.
fn about_list(text: &str, at: usize, line: &str) -> &'static str {
    let begins_line = text.get(..at).is_some_and(|before| before.trim_end_matches(' ').ends_with('\n'));
    match begins_line && (line.starts_with('[') || line.contains('=')) {
        true => "close the list above with ]",
        false => "put a comma between two values of a list, as in [\"a.laz\", \"b.laz\"]",
    }
}

/// Returns the line with its value in quotes, or with each value of its list.
fn quoted_line(line: &str) -> String {
    let setting = line.split(" #").next().unwrap_or_default();
    let Some((key, value)) = setting.split_once('=') else { return String::new() };
    let quoted = |value: &str| format!("\"{}\"", value.trim().trim_matches(['"', '\'']));
    let values: Vec<String> = value.trim().trim_matches(['[', ']']).split(',').map(quoted).collect();
    let is_list = value.contains(['[', ',']);
    let value = if is_list { format!("[{}]", values.join(", ")) } else { values.concat() };
    format!(": {} = {value}", key.trim())
}

fn about_no_value(line: &str) -> String {
    match line.split_once(':') {
        Some((key, value)) => {
            format!("put an equals sign between the key and its value: {} = {}", key.trim(), value.trim())
        }
        None => "give the key a value, as in surface = \"ground\"; a comment begins with #".into(),
    }
}

/// Returns what is wrong with what stands behind a value.
fn about_rest(line: &str) -> String {
    let value = line.split_once('=').map_or("", |(_, value)| value.trim());
    let is_decimal =
        value.split_once(',').is_some_and(|(one, other)| one.parse::<i64>().is_ok() && other.parse::<u64>().is_ok());
    match is_decimal {
        true => format!("write a decimal point: {}", line.replace(',', ".")),
        false => "a line has one key and one value; the next key begins on a new line, and a comment with #".into(),
    }
}
