//! Text for people: without signs that a terminal obeys, which names of files may hold, and without lines that fill the screen.

use std::path::Path;

/// The most characters of a line that is shown whole.
const LONGEST: usize = 4000;

/// How many characters of a longer line are shown at its beginning, and at its end.
const ENDS: [usize; 2] = [2000, 500];

/// Returns a text with control characters written as in `\u{1b}`, and without the middle of very long lines. Its lines and tabs stay.
pub fn escape_controls(text: &str) -> String {
    text.split('\n').map(|line| shortened(&escaped(line, |c| c == '\t'))).collect::<Vec<_>>().join("\n")
}

/// Returns a text on one line, with all control characters written as in `\n`.
pub fn one_line(text: &str) -> String {
    escaped(text, |_| false)
}

/// Returns what messages call the file at `path`.
pub fn name(path: &Path) -> String {
    one_line(&path.display().to_string())
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if is_obeyed(c) && !stays(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out
}

/// Tells whether a terminal does something at this character instead of showing it, or shows nothing: control characters, those that end
/// lines or change the direction of writing, and those without a width, by which names differ that look alike.
pub fn is_obeyed(c: char) -> bool {
    c.is_control() || is_invisible(c)
}

/// Tells whether a character has no form of its own. Accents and the variants of signs are none.
fn is_invisible(c: char) -> bool {
    matches!(c,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{180b}'..='\u{180f}'
        | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{3164}'
        | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}'
        | '\u{e0000}'..='\u{e0fff}')
}

fn shortened(line: &str) -> String {
    // No character has less than a byte.
    let length = if line.len() <= LONGEST { 0 } else { line.chars().count() };
    if length <= LONGEST {
        return line.into();
    }
    let [first, last] = ENDS;
    let left_out = length.saturating_sub(first).saturating_sub(last);
    let start: String = line.chars().take(first).collect();
    let end: String = line.chars().skip(first.saturating_add(left_out)).collect();
    format!("{start} ... [{left_out} characters left out] ... {end}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_obeys_nothing() {
        assert_eq!(escape_controls("a\u{1b}[31m b\tc\nd\r\u{9b}\u{202e}e"), "a\\u{1b}[31m b\tc\nd\\r\\u{9b}\\u{202e}e");
        assert_eq!(one_line("a\nb\tc ü"), "a\\nb\\tc ü");
        assert_eq!(one_line("a\u{200b}b\u{feff}c\u{2060}d\u{ad}"), "a\\u{200b}b\\u{feff}c\\u{2060}d\\u{ad}");
        assert_eq!(name(Path::new("x\u{7}.laz")), "x\\u{7}.laz");
    }

    #[test]
    fn a_long_line_loses_its_middle() {
        let whole = "ü".repeat(LONGEST);
        assert_eq!(escape_controls(&format!("a\n{whole}")), format!("a\n{whole}"));
        let short = escape_controls(&format!("{whole}xyz\nb"));
        assert!(short.contains("[1503 characters left out]") && short.ends_with("xyz\nb"), "{short}");
        assert!(escape_controls(&"x".repeat(50_000_000)).len() < 3000);
    }
}
