//! Which fields of a record are read besides its place and its class.

use serde::{Deserialize, Serialize};

/// Which fields of points a job wants besides place and class. The others are 0, and layered LAZ decodes faster without them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OptionalFields {
    /// Red, green and blue.
    pub rgb: bool,
    /// The strength of the return.
    pub intensity: bool,
}

impl OptionalFields {
    /// Colours, and nothing else.
    pub const RGB: OptionalFields = OptionalFields { rgb: true, intensity: false };
}
