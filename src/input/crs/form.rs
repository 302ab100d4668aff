//! The form in which systems are compared: what decides where a place has its coordinates, and no name of the system.

use crate::input::crs::datum::Datum;
use crate::input::crs::projection::Projection;
use crate::input::crs::wkt::{BASE, GEOGRAPHIC, PROJECTED, find};

/// The datum and the projection of a system. The unit is not a part of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CrsForm {
    datum: Option<Datum>,
    /// `None` for a system without a projection.
    projection: Option<Projection>,
}

impl CrsForm {
    /// Returns the form of the system that `text` describes; `None` if it has neither a datum nor a projection.
    pub(crate) fn of_text(text: &str) -> Option<CrsForm> {
        if let Some(system) = find(text, &PROJECTED) {
            // Without the method, nothing is known of where its places are.
            let projection = Some(Projection::of(&system)?);
            return Some(CrsForm { datum: system.child(&BASE).and_then(Datum::of), projection });
        }
        let datum = Datum::of(&find(text, &GEOGRAPHIC)?)?;
        Some(CrsForm { datum: Some(datum), projection: None })
    }

    /// Returns the form of the system of an EPSG code.
    pub(crate) fn of_code(code: u32) -> Option<CrsForm> {
        CrsForm::of_text(text_of_code(code)?)
    }

    /// Returns the name of the datum, if the text gives one.
    pub(crate) fn datum_name(&self) -> Option<&str> {
        self.datum.as_ref()?.name()
    }

    /// Says in what the two differ: an entry for the datum and one for the projection. A text without a datum agrees with any.
    pub(crate) fn differences(&self, other: &CrsForm) -> Vec<String> {
        let datum = self.datum.as_ref().zip(other.datum.as_ref()).and_then(|(own, others)| own.difference(others));
        let projections = self.projection.as_ref().zip(other.projection.as_ref());
        let projection = projections.and_then(|(own, others)| own.difference(others));
        datum.into_iter().chain(projection).collect()
    }
}

/// Returns the well-known text of an EPSG code; `None` for a code that is not in the list of known ones.
pub(crate) fn text_of_code(code: u32) -> Option<&'static str> {
    Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.wkt)
}
