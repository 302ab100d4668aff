//! A configuration that is being found: the clouds, and the lines that they need.

use crate::config;
use crate::init::config_folder::ConfigFolder;
use job::options::JobOptions;
use serde::Serialize;
use std::path::{Path, PathBuf};
use sys::Result;
use sys::terminal::is_obeyed;

/// A line of the configuration that the clouds need, or the machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NeededLine {
    /// The table.
    pub table: &'static str,
    /// The key.
    pub key: &'static str,
    /// The value as TOML has it.
    pub value: String,
    /// Why it is needed.
    pub why: String,
}

impl NeededLine {
    /// Returns a line that the user has chosen on the command line.
    pub(crate) fn chosen(table: &'static str, key: &'static str, value: &toml::Value) -> NeededLine {
        NeededLine { table, key, value: value.to_string(), why: "Set on the command line.".into() }
    }

    pub(crate) fn of_input(key: &'static str, value: impl Into<toml::Value>, why: &str) -> NeededLine {
        NeededLine { table: "input", key, value: value.into().to_string(), why: why.into() }
    }

    /// Tells whether the user decides on this line, because it loses points that another copy of the file may have.
    fn loses_points(&self) -> bool {
        ["max_malformed_fraction", "nodata"].contains(&self.key)
    }

    /// Tells whether this line leaves bad files out.
    fn loses_files(&self) -> bool {
        self.key == "on_bad_file"
    }

    pub(crate) fn of_limits(key: &'static str, value: impl Into<toml::Value>, why: &str) -> NeededLine {
        NeededLine { table: "limits", key, value: value.into().to_string(), why: why.into() }
    }
}

/// What the configuration will say.
#[derive(Clone, Debug)]
pub(crate) struct Draft {
    /// `[input] files`.
    pub(crate) files: Vec<String>,
    /// `[output] directory`.
    pub(crate) directory: String,
    /// The lines that the user has chosen.
    pub(crate) chosen: Vec<NeededLine>,
    /// The lines that are needed.
    pub(crate) needed: Vec<NeededLine>,
    /// The lines without which the job stops, but which lose points: the user decides on them, so they are written as comments.
    pub(crate) choices: Vec<NeededLine>,
    /// Whether the user also decides on leaving bad files out.
    pub(crate) stops_at_bad_files: bool,
    /// The folder of the configuration.
    pub(crate) folder: PathBuf,
}

impl Draft {
    pub(crate) fn new(files: Vec<String>, directory: String, folder: &ConfigFolder) -> Draft {
        Draft {
            files,
            directory,
            chosen: Vec::new(),
            needed: Vec::new(),
            choices: Vec::new(),
            stops_at_bad_files: false,
            folder: folder.path.clone(),
        }
    }

    /// Returns the draft with these lines too.
    pub(crate) fn with(&self, lines: impl IntoIterator<Item = NeededLine>) -> Draft {
        let mut draft = self.clone();
        for line in lines {
            let is_choice = line.loses_points() || self.stops_at_bad_files && line.loses_files();
            if is_choice { draft.choices.push(line) } else { draft.needed.push(line) }
        }
        // A file that has lost points is a bad one: it would be left out whole before the user has decided.
        if !draft.choices.is_empty() {
            let (of_files, needed): (Vec<_>, Vec<_>) = draft.needed.into_iter().partition(NeededLine::loses_files);
            draft.choices.splice(0..0, of_files);
            draft.needed = needed;
        }
        draft
    }

    /// Returns the draft as it is until the user has decided.
    pub(crate) fn undecided(&self) -> Draft {
        Draft { choices: Vec::new(), ..self.clone() }
    }

    /// Returns the lines that the user has chosen, those that are needed, and those on which the user decides.
    pub(crate) fn all_lines(&self) -> impl Iterator<Item = &NeededLine> {
        self.chosen.iter().chain(&self.needed).chain(&self.choices)
    }

    /// Returns whether one of the lines sets `key`.
    pub(crate) fn sets(&self, key: &str) -> bool {
        self.all_lines().any(|line| line.key == key)
    }

    /// Returns whether the user has chosen `key`.
    pub(crate) fn chooses(&self, key: &str) -> bool {
        self.chosen.iter().any(|line| line.key == key)
    }

    /// Returns the chosen and the needed lines of a table.
    pub(crate) fn lines_of(&self, table: &str) -> impl Iterator<Item = &NeededLine> {
        self.chosen.iter().chain(&self.needed).filter(move |line| line.table == table)
    }

    /// Returns the options of the job, as the program reads them from the configuration once the user has taken the choices.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if it does not take what is written here.
    pub(crate) fn options(&self) -> Result<JobOptions> {
        let lines = |table: &str| -> String {
            let lines = self.all_lines().filter(|line| line.table == table);
            lines.map(|NeededLine { key, value, .. }| format!("{key} = {value}\n")).collect()
        };
        let text = format!(
            "[input]\nfiles = {}\n{}[output]\ndirectory = {}\n{}[limits]\n{}",
            toml::Value::from(self.files.clone()),
            lines("input"),
            quoted(&self.directory),
            lines("output"),
            lines("limits")
        );
        options_of(&text, &self.folder)
    }
}

/// Returns the options of a configuration that this program has written. Names of files in it are the user's.
///
/// # Errors
/// [`sys::Error::Config`] if the program does not take it.
pub(crate) fn options_of(text: &str, folder: &Path) -> Result<JobOptions> {
    config::of_text(text, folder)
}

/// Returns a text as TOML has it.
pub(crate) fn quoted(text: &str) -> String {
    if !text.contains(is_obeyed) {
        return toml::Value::from(text).to_string();
    }
    // TOML allows some characters as they are that a terminal would obey, or not show.
    let sign = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        c if is_obeyed(c) => format!("\\U{:08X}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(sign).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_quoted_without_control_characters() {
        for text in ["a", "it's \"b\"", "c\\d\t", "\u{1b}[31m\n\u{9b}\u{7f}\"'\\", "\u{200b}\u{e0001}"] {
            let value = quoted(text);
            assert!(!value.contains(is_obeyed), "{value:?}");
            assert_eq!(format!("a = {value}").parse::<toml::Table>().unwrap()["a"].as_str(), Some(text));
        }
    }
}
