//! Coordinate reference systems, as far as a terrain needs them: the units, a text for readers, and whether two agree.

mod definition;
mod geotiff;
mod wkt;

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::input::file::Positioned;
use crate::input::las::vlr::Vlr;

/// A unit of x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// The metre.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The foot of the US survey, 1200/3937 m.
    UsFoot,
    /// Degrees of longitude and latitude, or another angle.
    Degree,
    /// Another unit of so many metres.
    Other(f64),
    /// The file does not say.
    #[default]
    Unknown,
}

impl Unit {
    /// Metres of the foot of the US survey.
    pub const US_FOOT: f64 = 1200.0 / 3937.0;

    /// The unit of so many metres. The two feet differ by 6e-7 m; texts give them with 9 digits or more.
    fn of(metres: Option<f64>) -> Unit {
        let near = |value: f64, other: f64| (value - other).abs() < 1e-8;
        match metres {
            None => Unit::Unknown,
            Some(value) if near(value, 1.0) => Unit::Metre,
            Some(value) if near(value, 0.3048) => Unit::Foot,
            Some(value) if near(value, Unit::US_FOOT) => Unit::UsFoot,
            Some(value) => Unit::Other(value),
        }
    }

    /// Metres of one unit; `None` for angles and where it is not known.
    pub fn metres_per_unit(&self) -> Option<f64> {
        match self {
            Unit::Metre => Some(1.0),
            Unit::Foot => Some(0.3048),
            Unit::UsFoot => Some(Unit::US_FOOT),
            Unit::Other(metres) => Some(*metres),
            Unit::Degree | Unit::Unknown => None,
        }
    }

    /// The unit's name for a reader.
    pub fn name(&self) -> String {
        match self {
            Unit::Metre => "metre".into(),
            Unit::Foot => "foot".into(),
            Unit::UsFoot => "US survey foot".into(),
            Unit::Degree => "degree".into(),
            Unit::Other(metres) => format!("{metres} m"),
            Unit::Unknown => "unknown".into(),
        }
    }
}

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
        definition::definition(self)
    }

    /// The name of the system of its heights, where the text gives one.
    pub fn vertical_name(&self) -> Option<String> {
        wkt::vertical_name(self.wkt.as_deref()?)
    }

    fn same_name(&self, other: &Crs) -> bool {
        !differ(self.name.as_deref(), other.name.as_deref(), |own, others| plain(own) == plain(others))
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

/// Letters and digits of a name in lower case: writers disagree on the rest.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The system of an EPSG code.
fn from_epsg(code: u32) -> Option<Crs> {
    let definition = crs_definitions::from_code(u16::try_from(code).ok()?)?;
    let crs = wkt::parse(definition.wkt)?;
    Some(Crs { epsg: Some(code), ..crs })
}

/// The users under which well-known text is stored: LAS 1.4's, and that of libLAS before it.
const TEXT_RECORDS: [(&str, u16); 2] = [("LASF_Projection", 2112), ("liblas", 2112)];

/// The system that the records of `file` describe. Text wins over GeoTIFF keys; an empty one counts as none.
pub(crate) fn read(file: &Positioned, vlrs: &[Vlr], warnings: &mut Vec<String>) -> Result<Crs> {
    let text = read_text(file, vlrs, warnings)?;
    let keys = geotiff::parse(&geotiff::Records {
        directory: record(file, vlrs, 34735)?,
        doubles: record(file, vlrs, 34736)?,
        texts: record(file, vlrs, 34737)?,
    });
    if let (Some(text), Some(keys)) = (&text, &keys)
        && !text.same_as(keys)
    {
        warnings.push(format!(
            "its two coordinate systems differ: {} in {} as text (used), {} in {} as GeoTIFF keys",
            text.label(),
            text.horizontal.name(),
            keys.label(),
            keys.horizontal.name()
        ));
    }
    Ok(text.or(keys).unwrap_or_default())
}

fn read_text(file: &Positioned, vlrs: &[Vlr], warnings: &mut Vec<String>) -> Result<Option<Crs>> {
    for (user, id) in TEXT_RECORDS {
        for vlr in vlrs.iter().filter(|vlr| vlr.is(user, id)) {
            let bytes = vlr.read(file)?;
            let text = String::from_utf8_lossy(&bytes);
            match wkt::parse(&text) {
                Some(crs) => return Ok(Some(crs)),
                None if text.trim_matches(['\0', ' ', '"', '\'']).is_empty() => {}
                None => warnings.push("its coordinate system is not well-known text that can be read".to_string()),
            }
        }
    }
    Ok(None)
}

fn record(file: &Positioned, vlrs: &[Vlr], id: u16) -> Result<Vec<u8>> {
    vlrs.iter().find(|vlr| vlr.is("LASF_Projection", id)).map_or(Ok(Vec::new()), |vlr| vlr.read(file))
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn the_two_feet_are_told_apart() {
        assert_eq!(Unit::of(Some(0.3048)), Unit::Foot);
        assert_eq!(Unit::of(Some(0.304800609601219)), Unit::UsFoot);
        assert_eq!(Unit::of(Some(0.3048006096)), Unit::UsFoot);
    }
}
