//! The options of `[input.csv]`.

use serde::{Deserialize, Serialize};

/// How a text file is laid out; what is not given is detected. The table `[input.csv]` of the configuration.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextOptions {
    /// The character between columns; a space stands for any run of spaces and tabs.
    pub delimiter: Option<char>,
    /// Whether the first line names the columns.
    pub header: Option<bool>,
    /// The names of the columns from left to right, in place of those of a header. Used are x, y, z, and where there are
    /// such, r, g, b and class; all others are skipped.
    pub columns: Option<Vec<String>>,
    /// What a line to be skipped begins with; `#` or `//` if not given, nothing if empty.
    pub comment: Option<String>,
}
