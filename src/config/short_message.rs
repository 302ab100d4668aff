//! Messages about the text of a configuration, of which lines may be long: what they show of it is short.

/// The most characters of a line of the text that are shown.
const MOST: usize = 160;

/// How many characters are shown at the beginning and at the end of what is said about it, which may have a value of any length, and lists
/// what is known there.
const ENDS: [usize; 2] = [300, 1000];

/// How many characters are shown before the place of the error, if the line is longer.
const BEFORE: usize = 60;

/// What stands for what is left out.
const DOTS: &str = "...";

/// Returns a message of the TOML parser with short lines. It shows a line of the text, and another with marks below the error: of both, the
/// same part stays.
pub(crate) fn shortened(message: &str) -> String {
    let marks = message.lines().filter_map(split).find_map(|(_, shown)| place_of_marks(shown)).unwrap_or(0);
    let start = if marks.saturating_add(BEFORE) < MOST { 0 } else { marks.saturating_sub(BEFORE) };
    let short = |line: &str| match split(line) {
        Some((gutter, shown)) => format!("{gutter}{}", part(shown, start)),
        None => ends(line),
    };
    message.lines().map(short).collect::<Vec<_>>().join("\n")
}

/// Returns the lines of a message that show the text and the place of the error.
pub(crate) fn shown_lines(message: &str) -> String {
    message.lines().filter(|line| split(line).is_some()).collect::<Vec<_>>().join("\n")
}

/// Splits a line that shows some of the text behind the bar that stands before it.
fn split(line: &str) -> Option<(&str, &str)> {
    let (number, _) = line.split_once('|')?;
    let is_gutter = number.chars().all(|c| c == ' ' || c.is_ascii_digit());
    is_gutter.then(|| line.split_at(number.len().saturating_add(1)))
}

/// Returns the number of characters before the marks; `None` if the line has other signs.
fn place_of_marks(shown: &str) -> Option<usize> {
    let has_marks = shown.contains('^') && shown.chars().all(|c| c == ' ' || c == '^');
    has_marks.then(|| shown.find('^')).flatten()
}

/// Returns the characters from `start` on, as many as are shown.
fn part(line: &str, start: usize) -> String {
    let mut rest = line.chars().skip(start);
    let shown: String = rest.by_ref().take(MOST).collect();
    let (before, after) = (if start > 0 { DOTS } else { "" }, if rest.next().is_some() { DOTS } else { "" });
    // Marks are far to the right of nothing.
    let before = if shown.trim_matches([' ', '^']).is_empty() { " ".repeat(before.len()) } else { before.into() };
    format!("{before}{shown}{after}")
}

/// Returns a line without its middle, if it is long.
fn ends(line: &str) -> String {
    let length = line.chars().count();
    let [first, last] = ENDS;
    if length <= first.saturating_add(last) {
        return line.into();
    }
    let start: String = line.chars().take(first).collect();
    let end: String = line.chars().skip(length.saturating_sub(last)).collect();
    format!("{start}{DOTS}{end}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        toml::from_str::<toml::Table>(text).unwrap_err().to_string()
    }

    #[test]
    fn a_short_message_stays() {
        let message = error("a = 1\nb = = 2\n");
        assert_eq!(shortened(&message), message.trim_end());
    }

    #[test]
    fn the_marks_stay_below_the_error() {
        let filler = "ü".repeat(1000);
        let message = error(&format!("a = 1\nb = [\"{filler}\", =, \"{filler}\"]\n"));
        let short = shortened(&message);
        let lines: Vec<&str> = short.lines().collect();
        let marks = lines.iter().position(|line| line.contains('^')).unwrap();
        let place = lines[marks].chars().position(|c| c == '^').unwrap();
        assert_eq!(lines[marks - 1].chars().nth(place), Some('='), "{short}");
        assert!(
            lines.iter().all(|line| line.chars().count() < 200) && lines[0] == message.lines().next().unwrap(),
            "{short}"
        );
    }

    #[test]
    fn what_is_said_is_short_too() {
        let message = format!(
            "TOML parse error at line 1, column 1\n  |\n1 | a\n  | ^\ninvalid type: string \"{}\"",
            "x".repeat(50_000_000)
        );
        assert!(shortened(&message).len() < 1500);
    }
}
