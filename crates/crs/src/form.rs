//! The form in which systems are compared: what decides where a place has its coordinates, and no name of the system.

use crate::codes::text_of_code;
use crate::datum::{Datum, Sameness};
use crate::projection::Projection;
use crate::wkt::{BASE, GEOGRAPHIC, PROJECTED, bound_shift, find};

/// The datum and the projection of a system. The unit is not a part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct CrsForm {
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
            let datum = system.child(&BASE).and_then(Datum::of).map(|datum| with_shift(datum, text));
            return Some(CrsForm { datum, projection });
        }
        let datum = Datum::of(&find(text, &GEOGRAPHIC)?)?;
        Some(CrsForm { datum: Some(with_shift(datum, text)), projection: None })
    }

    /// Returns the form of the system of an EPSG code.
    pub(crate) fn of_code(code: u32) -> Option<CrsForm> {
        CrsForm::of_text(text_of_code(code)?)
    }

    /// Returns the name of the datum, if the text gives one.
    pub(crate) fn datum_name(&self) -> Option<&str> {
        self.datum.as_ref()?.name()
    }

    /// Returns the datum, if the text gives one.
    pub fn datum(&self) -> Option<&Datum> {
        self.datum.as_ref()
    }

    /// Returns the projection; `None` for a system of longitude and latitude.
    pub fn projection(&self) -> Option<&Projection> {
        self.projection.as_ref()
    }

    /// Returns the false easting and northing in metres; `None` for a system without a projection.
    pub fn false_origin(&self) -> Option<[f64; 2]> {
        Some(self.projection.as_ref()?.false_origin())
    }

    /// Says in what the two differ: an entry for the datum and one for the projection. A text without a datum agrees with any.
    pub(crate) fn differences(&self, other: &CrsForm) -> Vec<String> {
        let datum = self.datum.as_ref().zip(other.datum.as_ref()).and_then(|(own, others)| own.difference(others));
        datum.into_iter().chain(self.difference_in_projection(other)).collect()
    }

    /// Returns how sure it is that the two have their places in common, where [`CrsForm::differences`] finds nothing. A text without a
    /// datum may have any.
    pub(crate) fn sameness(&self, other: &CrsForm) -> Sameness {
        if self.projection.is_some() != other.projection.is_some() {
            return Sameness::Refuted("the kind of coordinates".into());
        }
        match (&self.datum, &other.datum) {
            (Some(own), Some(others)) => own.sameness(others),
            _ => Sameness::Assumed,
        }
    }

    /// As [`CrsForm::differences`] of two systems with the same code. The dataset renames its datums, so that names do not count.
    pub(crate) fn differences_in_parameters(&self, other: &CrsForm) -> Vec<String> {
        let datums = self.datum.as_ref().zip(other.datum.as_ref());
        let ellipsoid = datums.and_then(|(own, others)| own.difference_in_ellipsoid(others));
        ellipsoid.into_iter().chain(self.difference_in_projection(other)).collect()
    }

    fn difference_in_projection(&self, other: &CrsForm) -> Option<String> {
        let (own, others) = self.projection.as_ref().zip(other.projection.as_ref())?;
        own.difference(others)
    }
}

fn with_shift(mut datum: Datum, text: &str) -> Datum {
    datum.set_shift(bound_shift(text));
    datum
}
