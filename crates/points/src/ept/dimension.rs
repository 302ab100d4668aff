//! A value of each point, as the schema of an EPT has it.

use serde::Deserialize;

/// A value that every point has.
#[derive(Clone, Deserialize)]
pub(crate) struct Dimension {
    pub(crate) name: String,
    /// `signed`, `unsigned` or `floating`.
    #[serde(rename = "type")]
    pub(crate) kind: String,
    /// Its bytes.
    pub(crate) size: usize,
    #[serde(default)]
    pub(crate) scale: Option<f64>,
    #[serde(default)]
    pub(crate) offset: Option<f64>,
}
