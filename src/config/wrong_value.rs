//! What is wrong with the value of an option: what it takes, an example, and what the user may have meant.

use crate::config::least::is_taken;
use crate::config::option_list::{ConfigOption, options};
use toml::{Table, Value};

/// What the parser says of a value whose form is wrong. What the options themselves say is for people.
const JARGON: [&str; 5] = ["invalid type", "invalid value", "invalid length", "unknown variant", "wanted "];

/// No suggestion is longer.
const LONGEST: usize = 120;

/// Returns what is wrong with `value`, of which the parser says `said`.
pub(crate) fn about_value(option: &ConfigOption, value: Option<&Value>, said: &str) -> String {
    let is_jargon = JARGON.iter().any(|start| said.starts_with(start));
    let takes = if is_jargon { format!("{} takes {}", option.key, form(option, said)) } else { said.to_string() };
    // A date without quotes is text that lacks them.
    let value = match value {
        Some(Value::Datetime(date)) => Some(Value::String(date.to_string())),
        value => value.cloned(),
    };
    let meant = value.and_then(|value| meant(option, &value)).filter(|meant| meant.len() <= LONGEST);
    // What the user has meant is an example, and what says more than what the option takes has its own advice.
    let has_example = takes.contains("such as") || meant.as_ref().is_some_and(|meant| meant.starts_with(option.key));
    let needs_example = takes.starts_with(option.key) && !has_example;
    let example = if needs_example { format!(", such as {}", option.line()) } else { String::new() };
    let meant = meant.map_or(String::new(), |meant| format!("; did you mean {meant}?"));
    format!("{takes}{example}{meant}")
}

/// Returns what an option takes.
fn form(option: &ConfigOption, said: &str) -> String {
    let choices = option.choices();
    match &choices[..] {
        [] => {}
        [first, ..] if option.takes_list(first) => return format!("a list of {} in brackets", listed(&choices)),
        _ if option.is_open() => return format!("text such as {}", listed(&choices)),
        _ => return listed(&choices),
    }
    let whole = [("u8", "255"), ("u32", "4294967295")].into_iter().find(|(kind, _)| said.ends_with(kind));
    let numbers = |numbers: &str| match whole {
        Some((_, most)) => format!("whole {numbers} from 0 to {most}"),
        None => numbers.to_string(),
    };
    match value_of(&option.example) {
        Some(Value::Array(values)) if values.iter().all(|value| !value.is_str()) => {
            format!("a list of {} in brackets", numbers("numbers"))
        }
        Some(Value::Array(_)) => "a list of texts in brackets".into(),
        Some(Value::Boolean(_)) => "true or false".into(),
        Some(Value::Integer(_) | Value::Float(_)) => match whole {
            Some(_) => format!("a {}", numbers("number")),
            None => "a number".into(),
        },
        Some(Value::Table(_)) => "a table in braces".into(),
        _ => "text in quotes".into(),
    }
}

/// Returns words in quotes, as a sentence has them.
fn listed(words: &[String]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
    match &quoted[..] {
        [all @ .., last] if !all.is_empty() => format!("{} or {last}", all.join(", ")),
        all => all.join(", "),
    }
}

/// Returns the value that TOML reads in a text.
fn value_of(text: &str) -> Option<Value> {
    format!("it = {text}").parse::<Table>().ok()?.remove("it")
}

/// Returns the line that the user may have meant, which the program takes.
fn meant(option: &ConfigOption, value: &Value) -> Option<String> {
    let ConfigOption { table, key, .. } = option;
    let similar = similar_values(option, value).into_iter().find(|similar| is_taken(table, key, similar));
    similar.map(|similar| format!("{key} = {similar}")).or_else(|| of_other_option(option, value))
}

/// Returns values that look like this one, in other forms.
fn similar_values(option: &ConfigOption, value: &Value) -> Vec<Value> {
    let list = Value::Array(vec![value.clone()]);
    let table = |option: &ConfigOption| Value::Table(Table::from_iter([(option.key.to_string(), value.clone())]));
    let inner = format!("{}.{}]", option.table.trim_end_matches(']'), option.key);
    let tables = options().into_iter().filter(|option| option.table == inner).map(|option| table(&option));
    of_other_type(option, value).into_iter().chain(tables).chain([list]).collect()
}

/// Returns values of other types that are written like this one.
fn of_other_type(option: &ConfigOption, value: &Value) -> Vec<Value> {
    match value {
        Value::String(text) => of_text(option, text),
        Value::Integer(number @ 0..=1) => vec![Value::Boolean(*number == 1), value.to_string().into()],
        Value::Integer(number) => {
            vec![format!("EPSG:{number}").into(), format!("{number} GiB").into(), value.to_string().into()]
        }
        Value::Float(number) => vec![number.to_string().into()],
        Value::Array(values) => {
            let nearest = |value: &Value| value.as_str().and_then(|word| option.nearest_choice(word)).map(Value::from);
            let corrected = values.iter().map(|value| nearest(value).unwrap_or_else(|| value.clone())).collect();
            [Some(Value::Array(corrected)), values.first().cloned()].into_iter().flatten().collect()
        }
        _ => Vec::new(),
    }
}

/// Returns the choice, the numbers or the truth that a text may stand for.
fn of_text(option: &ConfigOption, text: &str) -> Vec<Value> {
    let number = |text: &str| value_of(text).filter(|value| value.is_integer() || value.is_float());
    let numbers: Option<Vec<Value>> = text.split([',', ' ', ';']).filter(|part| !part.is_empty()).map(number).collect();
    let truth = match text.to_lowercase().as_str() {
        "true" | "yes" | "on" => Some(true),
        "false" | "no" | "off" => Some(false),
        _ => None,
    };
    let choice = option.nearest_choice(text).map(Value::from);
    let values = [choice, truth.map(Value::Boolean), number(text), numbers.map(Value::Array)];
    values.into_iter().flatten().collect()
}

/// Returns the line of another option of the table that has this word as one of its choices.
fn of_other_option(option: &ConfigOption, value: &Value) -> Option<String> {
    let word = match value {
        Value::Array(values) => values.first()?.as_str()?,
        value => value.as_str()?,
    };
    let others = options().into_iter().filter(|other| other.table == option.table && other.key != option.key);
    let other = others.into_iter().find(|other| other.choices().iter().any(|choice| choice == word))?;
    Some(format!("{} = \"{word}\"", other.key))
}
