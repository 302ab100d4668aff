//! Which points a job keeps, and where they land on the lattice.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use crate::points::optional_fields::OptionalFields;
use crate::points::raw_bounds::RawBounds;
use crate::points::returns::KeptReturns;
use lattice::{AxisMap, LatticeArea};

/// What decoding a source needs to know of the job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointRules {
    /// The maps from the source's axes x, y and z to the lattice.
    pub maps: [AxisMap; 3],
    /// Whether the job keeps points of each classification code.
    #[serde(with = "class_list")]
    pub classes: [bool; 256],
    /// Which returns of its pulses the job keeps.
    #[serde(default)]
    pub returns: KeptReturns,
    /// Keep only points with raw integers within these bounds in x and y.
    pub bounds: Option<RawBounds>,
    /// Keep only points within this area. All sources of a job share it, so the plan writes it down once for all.
    #[serde(skip)]
    pub clip: Option<Arc<LatticeArea>>,
    /// The number in the whole job of the source's first record.
    pub first_order: u64,
    /// Whether points keep their numbers in the job. Without them they take less room.
    pub numbered: bool,
    /// What the job wants of the points besides place and class.
    pub fields: OptionalFields,
}

/// Classes are written as the list of the codes that are kept.
mod class_list {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(classes: &[bool; 256], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((0..=u8::MAX).filter(|&class| classes[class as usize]))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[bool; 256], D::Error> {
        let mut classes = [false; 256];
        Vec::<u8>::deserialize(deserializer)?.into_iter().for_each(|class| classes[class as usize] = true);
        Ok(classes)
    }
}
