//! Which rows of a text a job wants. The others have no say about the lattice.

use serde::{Deserialize, Serialize};

use crate::points::kept_heights::KeptHeights;
use crate::points::nodata_choice::NodataChoice;
use crate::points::optional_fields::OptionalFields;
use crate::points::returns::{KeptReturns, PulseReturn};
use crate::text::number::Number;

/// How a job has read its texts, as far as the options of `[input]` do not say it. Whoever reads them in the same way finds the same
/// points.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct TextReading {
    /// Whether colours were read. If they were, a row without them is malformed.
    pub colors: bool,
    /// Whether intensities were read, likewise.
    #[serde(default, skip_serializing_if = "is_false")]
    pub intensity: bool,
    /// Whether rows were left out that lie far from all others.
    pub outliers_left_out: bool,
    /// Whether they were left out of a file too in which such rows are not rare: of a few rows one, or as many as are rare in all files.
    pub even_among_few: bool,
}

impl TextReading {
    /// Returns what was read besides place and class.
    pub fn fields(&self) -> OptionalFields {
        OptionalFields { rgb: self.colors, intensity: self.intensity }
    }
}

fn is_false(value: &bool) -> bool {
    !value
}

/// Which rows of a text a job wants.
#[derive(Clone, Debug)]
pub struct RowChoice {
    /// Only rows within this rectangle: least x and y, greatest x and y.
    pub bounds: Option<[f64; 4]>,
    /// Whether the job transforms coordinates, so that degrees are nothing to warn about.
    pub is_transformed: bool,
    /// Whether the job says the unit of the coordinates.
    pub has_unit: bool,
    /// Whether the user states which foot the coordinates are in.
    pub is_foot_stated: bool,
    /// Whether the user states what the coordinates are in, of all files or of those that name no CRS.
    pub is_crs_stated: bool,
    /// Only rows of these classes.
    pub classes: [bool; 256],
    /// Whether the user has said which classes. If not, a class that cannot be read counts as 0.
    pub strict_classes: bool,
    /// Only rows of these returns.
    pub returns: KeptReturns,
    /// Only rows between these heights. A LAS file leaves the others out too.
    pub heights: Option<KeptHeights>,
    /// Which heights are left out because they stand for nodata. A LAS file leaves them out too.
    pub nodata: NodataChoice,
    /// Whether the index of a file of another format may tell what lies out of the bounds of the job. Without it, everything is decoded.
    pub use_index: bool,
    /// What is read besides place and class if the text has it.
    pub fields: OptionalFields,
}

impl RowChoice {
    /// Returns the choice of all rows, with their colours.
    pub fn all() -> RowChoice {
        RowChoice {
            bounds: None,
            is_transformed: false,
            has_unit: false,
            is_foot_stated: false,
            is_crs_stated: false,
            classes: [true; 256],
            strict_classes: false,
            returns: KeptReturns::All,
            heights: None,
            nodata: NodataChoice::Auto,
            use_index: false,
            fields: OptionalFields::RGB,
        }
    }

    /// Returns whether every row is wanted.
    pub(crate) fn is_all(&self) -> bool {
        let has_box = self.bounds.is_some() || self.heights.is_some();
        !has_box && self.returns == KeptReturns::All && self.classes.iter().all(|&wanted| wanted)
    }

    /// Returns whether the row with these x, y, z, this class and this return is wanted.
    pub(crate) fn wants(&self, numbers: &[Number; 3], class: u8, pulse_return: PulseReturn) -> bool {
        let is_kept = self.classes[class as usize] && self.returns.has(pulse_return);
        let z = &numbers[2];
        let has_height = self.heights.is_none_or(|heights| !z.is_too_large() && heights.hold(z.value()));
        is_kept && has_height && self.bounds.is_none_or(|bounds| is_within(bounds, numbers))
    }
}

/// Returns whether x and y lie within these bounds, borders included.
#[inline]
pub(crate) fn is_within([x_min, y_min, x_max, y_max]: [f64; 4], numbers: &[Number; 3]) -> bool {
    let (x, y) = (numbers[0].value(), numbers[1].value());
    x >= x_min && x <= x_max && y >= y_min && y <= y_max
}
