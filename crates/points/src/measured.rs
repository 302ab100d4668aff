//! What a look at all points of a binary file has shown, where its header does not tell: where they lie, and which of them lie so far from
//! all others that they are mistakes.

use serde::{Deserialize, Serialize};

use crate::points::raw_box::RawBox;
use crate::text::outliers::Outliers;

/// Where the points lie that a job wants of a binary file.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct MeasuredPoints {
    /// Points outside this box are mistakes; `None` if there are none.
    pub plausible: Option<RawBox>,
    /// What tells the file from others, whatever its name.
    pub content: String,
    /// The mistakes.
    pub outliers: Outliers,
    /// The first chunk with one: the message about it says what to do.
    pub first_in: Option<usize>,
    /// The number of all points, mistakes included.
    pub points: u64,
    /// The box of those that are no mistakes, its least and its greatest x, y, z; `None` if there is none.
    pub rest: Option<[[f64; 3]; 2]>,
    /// The box of all.
    pub all: Option<[[f64; 3]; 2]>,
    /// Where the others lie, and what to do about the mistakes.
    pub remedy: String,
}

impl MeasuredPoints {
    /// Returns whether so many points of this file alone are no mistakes.
    pub(crate) fn has_frequent_outliers(&self) -> bool {
        self.outliers.rows > 0 && !self.outliers.are_rare(self.points, false)
    }
}

/// The points of a file that are no mistakes, as a report names them for those who read the file again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlausiblePoints {
    /// What tells the file from others, whatever its name.
    pub content: String,
    /// Their raw integers.
    #[serde(flatten)]
    pub within: RawBox,
}
