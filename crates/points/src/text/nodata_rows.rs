//! Rows whose heights stand for nodata.

use serde::{Deserialize, Serialize};

use crate::points::nodata::FoundNodata;
use crate::points::nodata_choice::NodataChoice;
use crate::points::nodata_number::{NO_HEIGHT, is_nodata_number};

/// The heights of a text that stand for nodata.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct NodataRows {
    heights: Vec<f64>,
    /// Whether all numbers for nodata are among them that are too large for any height.
    huge: bool,
}

impl NodataRows {
    /// Returns those that `choice` names.
    pub(crate) fn named(choice: &NodataChoice) -> NodataRows {
        NodataRows { heights: choice.heights().to_vec(), huge: choice.is_on() }
    }

    /// Returns whether a row with this height has none.
    #[inline(always)]
    pub(crate) fn has(&self, height: f64) -> bool {
        (self.huge && height.abs() >= NO_HEIGHT && is_nodata_number(height))
            || (!self.heights.is_empty() && self.heights.contains(&height))
    }

    /// Adds those that a survey found, and returns whether the rows are to be surveyed again without them.
    pub(crate) fn add(&mut self, found: &FoundNodata) -> bool {
        let before = self.heights.len();
        let heights = found.heights.iter().map(|height| height.value);
        self.heights.extend(heights.filter(|height| height.abs() < NO_HEIGHT));
        self.heights.len() > before
    }
}
