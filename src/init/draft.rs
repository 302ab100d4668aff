//! A configuration that is being found: the clouds, and the lines that they need.

use crate::config;
use crate::init::config_folder::ConfigFolder;
use crate::job::options::JobOptions;
use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};

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
    pub(crate) fn of_input(key: &'static str, value: impl Into<toml::Value>, why: &str) -> NeededLine {
        NeededLine { table: "input", key, value: value.into().to_string(), why: why.into() }
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
    /// The lines that are needed.
    pub(crate) needed: Vec<NeededLine>,
    /// The folder of the configuration.
    pub(crate) folder: PathBuf,
}

impl Draft {
    pub(crate) fn new(files: Vec<String>, directory: String, folder: &ConfigFolder) -> Draft {
        Draft { files, directory, needed: Vec::new(), folder: folder.path.clone() }
    }

    /// Returns the draft with these lines too.
    pub(crate) fn with(&self, lines: impl IntoIterator<Item = NeededLine>) -> Draft {
        let mut draft = self.clone();
        draft.needed.extend(lines);
        draft
    }

    /// Returns whether one of the lines sets `key`.
    pub(crate) fn sets(&self, key: &str) -> bool {
        self.needed.iter().any(|line| line.key == key)
    }

    /// Returns the lines of a table.
    pub(crate) fn lines_of(&self, table: &str) -> impl Iterator<Item = &NeededLine> {
        self.needed.iter().filter(move |line| line.table == table)
    }

    /// Returns the options of the job, as the program reads them from the configuration.
    ///
    /// # Errors
    /// [`Error::Broken`] if it does not take what is written here.
    pub(crate) fn options(&self) -> Result<JobOptions> {
        let lines = |table: &str| -> String {
            self.lines_of(table).map(|NeededLine { key, value, .. }| format!("{key} = {value}\n")).collect()
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

/// Returns the options that a configuration says which this program has written.
///
/// # Errors
/// [`Error::Broken`] if the program does not take it.
pub(crate) fn options_of(text: &str, folder: &Path) -> Result<JobOptions> {
    config::of_text(text, folder).map_err(|error| Error::Broken(format!("the configuration of init: {error}")))
}

/// Returns a text as TOML has it.
pub(crate) fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
