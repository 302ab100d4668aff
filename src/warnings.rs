//! Warnings: what a user should know, though it does not stop the job.

use serde::{Deserialize, Serialize};
use std::path::Path;

/// Warnings in the order in which they were found. Each is a full sentence without a final full stop.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Warnings(Vec<String>);

impl Warnings {
    /// Adds one.
    pub fn push(&mut self, warning: impl Into<String>) {
        self.0.push(warning.into());
    }

    /// Adds those of the file at `path`, each with the file's name before it.
    pub fn extend_from_file(&mut self, path: &Path, warnings: &Warnings) {
        self.0.extend(warnings.0.iter().map(|warning| format!("{}: {warning}", path.display())));
    }

    /// Keeps at most `most` of them, and says how many more there were: thousands would hide the rest.
    pub fn shorten(&mut self, most: usize) {
        if self.0.len() > most {
            let more = self.0.len() - most;
            self.0.truncate(most);
            self.0.push(format!("... and {more} more warnings about the inputs"));
        }
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Extend<String> for Warnings {
    fn extend<I: IntoIterator<Item = String>>(&mut self, warnings: I) {
        self.0.extend(warnings);
    }
}

impl IntoIterator for Warnings {
    type Item = String;
    type IntoIter = std::vec::IntoIter<String>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}
