//! The options of `[input.csv]`.

use serde::{Deserialize, Serialize};

/// `[input.csv]`: how a text file is laid out. An option that is not given is detected.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextOptions {
    /// The character between columns; a space stands for any run of spaces and tabs.
    pub delimiter: Option<char>,
    /// Whether the first line names the columns.
    pub header: Option<bool>,
    /// The names of the columns from left to right, which replace the names of a header. The columns x, y, z are used, and r, g, b,
    /// class and intensity if they are there and wanted; all others are skipped.
    pub columns: Option<Vec<String>>,
    /// Lines that begin with this text are skipped. The default is `#` or `//`; an empty text skips no line.
    pub comment: Option<String>,
}
