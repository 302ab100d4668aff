//! A page of TOML: comments, lines that count, and options that stand there as comments.

use crate::init::draft::NeededLine;
use sys::terminal::is_obeyed;

/// No line of prose is longer, apart from a word that is.
const WIDTH: usize = 100;

/// Comments behind options begin here, if the option leaves room.
const COLUMN: usize = 36;

/// The text of a configuration as it grows.
#[derive(Debug, Default)]
pub(crate) struct Page(String);

impl Page {
    /// Writes a sentence as a comment.
    pub(crate) fn say(&mut self, sentence: &str) {
        let mut line = String::from("#");
        for word in sentence.split(' ').map(escape_controls).filter(|word| !word.is_empty()) {
            if line.len() > 1 && line.chars().count() + 1 + word.chars().count() > WIDTH {
                self.line(&line);
                line = String::from("#");
            }
            line.push(' ');
            line.push_str(&word);
        }
        self.line(&line);
    }

    /// Writes a command as a comment, and what it does.
    pub(crate) fn show(&mut self, command: &str, what: &str) {
        let command = format!("#   {}", escape_controls(command));
        self.line(&format!("{command:<COLUMN$} {what}"));
    }

    /// Writes an option that does not count until its # is removed, and what it does.
    pub(crate) fn offer(&mut self, option: &str, what: &str) {
        let option = format!("#{option}");
        self.line(&format!("{option:<COLUMN$} # {}", escape_controls(what)));
    }

    /// Writes a line that counts.
    pub(crate) fn set(&mut self, line: &str) {
        self.line(line);
    }

    /// Writes lines that are needed, each after its reason.
    pub(crate) fn need<'a>(&mut self, lines: impl Iterator<Item = &'a NeededLine>) {
        for NeededLine { key, value, why, .. } in lines {
            self.blank();
            self.say(why);
            self.set(&format!("{key} = {value}"));
        }
    }

    /// Writes lines on which the user decides, each after its reason.
    pub(crate) fn choose<'a>(&mut self, lines: impl Iterator<Item = &'a NeededLine>) {
        for NeededLine { key, value, why, .. } in lines {
            self.blank();
            self.say(why);
            self.set(&format!("#{key} = {value}"));
        }
    }

    /// Leaves a line empty.
    pub(crate) fn blank(&mut self) {
        self.line("");
    }

    /// Returns the text.
    pub(crate) fn into_text(self) -> String {
        self.0
    }

    fn line(&mut self, line: &str) {
        self.0.push_str(line);
        self.0.push('\n');
    }
}

/// Returns a text without characters that would end a comment, that TOML allows in none, or that a terminal would obey. Names of files
/// and of systems may have them.
pub(crate) fn escape_controls(text: &str) -> String {
    text.chars().map(|c| if is_obeyed(c) { '\u{fffd}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_leaves_its_comment() {
        let mut page = Page::default();
        page.say("a file \"x\ny = 1\r\u{0}\u{7f}.laz\", and a tab\tand more words that go on until the line is full and another begins");
        page.offer("a = 1", "what\nb = 2");
        page.set("c = 3");
        let text = page.into_text();
        let table: toml::Table = text.parse().unwrap_or_else(|e| panic!("{e}: {text}"));
        assert_eq!(table.keys().collect::<Vec<_>>(), ["c"], "{text}");
        assert!(text.lines().count() == 4 && text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
    }
}
