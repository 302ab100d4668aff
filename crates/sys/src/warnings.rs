//! Warnings: what a user should know although the job goes on.

use crate::terminal::one_line;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// What stands between a warning and its remedy.
const FIX: &str = "; fix: ";

/// A warning as people see it: a line with what it is, and another with what to do about it, if it has a remedy.
#[derive(Clone, Copy, Debug)]
pub struct ShownWarning<'a>(pub &'a str);

impl<'a> ShownWarning<'a> {
    /// Returns what it is, without the remedy.
    pub fn what(self) -> &'a str {
        self.parts().0
    }

    fn parts(self) -> (&'a str, Option<&'a str>) {
        self.0.rsplit_once(FIX).map_or((self.0, None), |(what, fix)| (what, Some(fix)))
    }
}

impl fmt::Display for ShownWarning<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.parts() {
            (what, Some(fix)) => write!(f, "warning: {}\n  fix: {}", one_line(what), one_line(fix)),
            (what, None) => write!(f, "warning: {}", one_line(what)),
        }
    }
}

/// Returns how a warning about `some` of `all` inputs begins: with the `first` of them.
pub fn of_inputs(some: usize, all: usize, first: &Path) -> String {
    if all == 1 {
        format!("{}: ", first.display())
    } else {
        format!("{some} of {all} inputs, such as {}: ", first.display())
    }
}

/// Returns an error as people see it: what is wrong, and, on a line of its own, what to do about it, if it says so.
pub fn with_remedy_below(error: &str) -> String {
    match error.rsplit_once(FIX) {
        Some((what, fix)) => format!("{what}\n  fix: {fix}"),
        None => error.into(),
    }
}

/// Warnings in the order in which they were found. Each is a full sentence without a final full stop, and may go on with `; fix: ` and what
/// to do.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Warnings(Vec<String>);

impl Warnings {
    /// Adds a warning.
    pub fn push(&mut self, warning: impl Into<String>) {
        self.0.push(warning.into());
    }

    /// Adds the warnings about the file at `path`, each with the path before it.
    pub fn extend_from_file(&mut self, path: &Path, warnings: &Warnings) {
        self.0.extend(warnings.0.iter().map(|warning| format!("{}: {warning}", path.display())));
    }

    /// Keeps the first `most` warnings and adds one that says how many more there were: thousands would hide the others.
    pub fn shorten(&mut self, most: usize) {
        if self.0.len() > most {
            let more = self.0.len() - most;
            self.0.truncate(most);
            self.0.push(format!("... and {more} more warnings about the inputs"));
        }
    }

    /// Returns all warnings.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }

    /// Returns all warnings, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut String> {
        self.0.iter_mut()
    }

    /// Returns whether there are no warnings.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remedy_has_a_line_of_its_own() {
        assert_eq!(ShownWarning("unit unknown; fix: set\nit").to_string(), "warning: unit unknown\n  fix: set\\nit");
        assert_eq!(ShownWarning("rounded").to_string(), "warning: rounded");
        assert_eq!(with_remedy_below("line 2:\n  a; fix: b"), "line 2:\n  a\n  fix: b");
        assert_eq!(with_remedy_below("gone"), "gone");
        assert_eq!(of_inputs(1, 1, Path::new("a.laz")), "a.laz: ");
        assert_eq!(of_inputs(1, 2, Path::new("a.laz")), "1 of 2 inputs, such as a.laz: ");
    }
}
