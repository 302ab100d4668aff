//! Coordinate reference systems, as far as a terrain needs them: the units, a text for readers, and whether two agree.

use serde::{Deserialize, Serialize};

use crate::input::crs::proj4;
use crate::input::crs::unit::Unit;
use crate::input::crs::wkt::{self, comparable_name};

/// What a file says of its coordinate reference system.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crs {
    /// Its well-known text, version 1 or 2; where the file has only a code, the text of that code.
    pub wkt: Option<String>,
    /// The EPSG code of the horizontal system.
    pub epsg: Option<u32>,
    /// The unit of x and y.
    pub horizontal: Unit,
    /// Metres of one unit of z, where the file says it.
    pub vertical: Option<f64>,
    /// The name of the horizontal system.
    pub name: Option<String>,
}

impl Crs {
    /// Metres of one unit of x and y; `None` for degrees and where it is not known.
    pub fn metres_per_unit(&self) -> Option<f64> {
        self.horizontal.metres_per_unit()
    }

    /// Whether nothing says that the two differ: what one does not know agrees with anything. Compared are the units, the
    /// EPSG codes; where one has no code, texts by the parameters of their projections or their names, and names alone where
    /// neither has a text.
    pub fn same_as(&self, other: &Crs) -> bool {
        if !same_unit(self.horizontal, other.horizontal) || differ(self.vertical, other.vertical, close) {
            return false;
        }
        if let (Some(own), Some(others)) = (self.epsg, other.epsg) {
            return own == others;
        }
        match (&self.wkt, &other.wkt) {
            (Some(own), Some(others)) => same_text(own, others) || self.same_name(other),
            (None, None) => self.same_name(other),
            _ => true,
        }
    }

    /// Its definition in the way of PROJ.4, which leads to longitude and latitude; `None` where that is not known.
    pub fn definition(&self) -> Option<String> {
        proj4::definition(self.epsg, self.wkt.as_deref())
    }

    /// The name of the system of its heights, where the text gives one.
    pub fn vertical_name(&self) -> Option<String> {
        wkt::vertical_name(self.wkt.as_deref()?)
    }

    fn same_name(&self, other: &Crs) -> bool {
        !differ(self.name.as_deref(), other.name.as_deref(), |own, others| {
            comparable_name(own) == comparable_name(others)
        })
    }

    /// A short name for messages.
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

fn differ<T: Copy>(own: Option<T>, others: Option<T>, same: impl Fn(T, T) -> bool) -> bool {
    matches!((own, others), (Some(own), Some(others)) if !same(own, others))
}

fn close(own: f64, others: f64) -> bool {
    (own - others).abs() <= 1e-8 * own.abs().max(others.abs()).max(1e-3)
}

/// Whether both project, and with the same parameters. Writers leave out some and spell others differently, so only those
/// of one name are compared.
fn same_text(own: &str, others: &str) -> bool {
    let (own, others) = (wkt::parameters(own), wkt::parameters(others));
    let both = !own.is_empty() && !others.is_empty();
    both && own.iter().all(|(name, value)| others.iter().all(|(other, theirs)| name != other || close(*value, *theirs)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::crs::from_wkt::from_epsg;

    #[test]
    fn what_is_not_known_agrees_and_what_differs_does_not() {
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
