//! What a file says about its coordinate reference system, and whether two files agree.

use serde::{Deserialize, Serialize};

use crate::input::crs::proj4;
use crate::input::crs::unit::Unit;
use crate::input::crs::wkt::{self, comparable_name};

/// What a file says about its coordinate reference system.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crs {
    /// Its well-known text, version 1 or 2. If the file has only an EPSG code, this is the text of that code.
    pub wkt: Option<String>,
    /// The EPSG code of the horizontal system.
    pub epsg: Option<u32>,
    /// The unit of x and y.
    pub horizontal: Unit,
    /// The length of one unit of z in metres, if the file gives it.
    pub vertical: Option<f64>,
    /// The name of the horizontal system.
    pub name: Option<String>,
}

impl Crs {
    /// Returns the length of one unit of x and y in metres; `None` for degrees and for an unknown unit.
    pub fn metres_per_unit(&self) -> Option<f64> {
        self.horizontal.metres_per_unit()
    }

    /// Returns whether nothing says that the two systems differ: what one file does not say agrees with anything. Units must
    /// agree. If both have an EPSG code, the codes decide. If both have a text, the parameters of the projections or the names
    /// must agree. If neither has a text, the names must agree.
    pub fn same_as(&self, other: &Crs) -> bool {
        if !same_unit(self.horizontal, other.horizontal) || differ(self.vertical, other.vertical, close) {
            return false;
        }
        if let (Some(own), Some(others)) = (self.epsg, other.epsg) {
            return own == others;
        }
        match (&self.wkt, &other.wkt) {
            (Some(own), Some(others)) => same_projection(own, others) || self.same_name(other),
            (None, None) => self.same_name(other),
            _ => true,
        }
    }

    /// Returns the system's definition as a PROJ.4 string, from which longitude and latitude can be computed; `None` if neither
    /// the code nor the text gives one.
    pub fn proj4_definition(&self) -> Option<String> {
        proj4::definition(self.epsg, self.wkt.as_deref())
    }

    /// Returns the name of the vertical system, if the text gives one.
    pub fn vertical_name(&self) -> Option<String> {
        wkt::vertical_name(self.wkt.as_deref()?)
    }

    fn same_name(&self, other: &Crs) -> bool {
        let same = |own, others| comparable_name(own) == comparable_name(others);
        !differ(self.name.as_deref(), other.name.as_deref(), same)
    }

    /// Returns a short name for messages.
    pub fn label(&self) -> String {
        match (&self.name, self.epsg) {
            (Some(name), Some(code)) => format!("{name} (EPSG:{code})"),
            (Some(name), None) => name.clone(),
            (None, Some(code)) => format!("EPSG:{code}"),
            (None, None) => "unknown".to_string(),
        }
    }
}

fn same_unit(own: Unit, others: Unit) -> bool {
    match (own, others) {
        (Unit::Unknown, _) | (_, Unit::Unknown) => true,
        (Unit::Other(own), Unit::Other(others)) => close(own, others),
        (own, others) => own == others,
    }
}

/// Returns whether both are known and not the same.
fn differ<T: Copy>(own: Option<T>, others: Option<T>, same: impl Fn(T, T) -> bool) -> bool {
    matches!((own, others), (Some(own), Some(others)) if !same(own, others))
}

fn close(own: f64, others: f64) -> bool {
    (own - others).abs() <= 1e-8 * own.abs().max(others.abs()).max(1e-3)
}

/// Returns whether both texts describe a projection with the same parameters. Writers leave out some parameters and spell others
/// differently, so only parameters that have the same name in both texts are compared.
fn same_projection(own: &str, others: &str) -> bool {
    let (own, others) = (wkt::parameters(own), wkt::parameters(others));
    let both = !own.is_empty() && !others.is_empty();
    both && own.iter().all(|(name, value)| others.iter().all(|(other, theirs)| name != other || close(*value, *theirs)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::crs::from_wkt::from_epsg;

    #[test]
    fn unknown_parts_agree_and_different_parts_do_not() {
        let utm = from_epsg(26915).unwrap();
        let named = Crs { epsg: None, ..utm.clone() };
        assert!(Crs::default().same_as(&utm) && utm.same_as(&Crs::default()));
        assert!(utm.same_as(&named) && named.same_as(&utm));
        assert!(!utm.same_as(&from_epsg(26916).unwrap()));
        assert!(!named.same_as(&Crs { epsg: None, ..from_epsg(26916).unwrap() }));
        assert!(!utm.same_as(&Crs { horizontal: Unit::Foot, ..utm.clone() }));
        assert!(!Crs { vertical: Some(1.0), ..utm.clone() }.same_as(&Crs { vertical: Some(0.3048), ..utm.clone() }));
    }
}
