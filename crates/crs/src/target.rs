//! The coordinate reference systems that a user names for something else than all inputs as they are.

use crate::choice::named;
use crate::system::Crs;
use serde::{Deserialize, Serialize};

/// A system by codes or by well-known text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct NamedCrs {
    /// As the user wrote it.
    text: String,
    /// What it means.
    pub crs: Box<Crs>,
}

impl TryFrom<String> for NamedCrs {
    type Error = String;

    fn try_from(text: String) -> Result<NamedCrs, String> {
        match named(text.trim())? {
            Some(crs) => Ok(NamedCrs { text, crs: Box::new(crs) }),
            None => Err(format!(
                "a CRS is an EPSG code such as \"EPSG:26915\" or \"EPSG:26915+5703\", or well-known text, not {text:?}"
            )),
        }
    }
}

impl From<NamedCrs> for String {
    fn from(named: NamedCrs) -> String {
        named.text
    }
}

/// The value of `[input] to_crs`: the system that the job wants all points in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum TargetCrs {
    /// The UTM zone of the middle of the data.
    Utm,
    /// This one.
    Named(NamedCrs),
}

impl TryFrom<String> for TargetCrs {
    type Error = String;

    fn try_from(text: String) -> Result<TargetCrs, String> {
        if text.trim().eq_ignore_ascii_case("utm") {
            return Ok(TargetCrs::Utm);
        }
        NamedCrs::try_from(text).map(TargetCrs::Named).map_err(|why| format!("to_crs may be \"utm\" or a CRS: {why}"))
    }
}

impl From<TargetCrs> for String {
    fn from(target: TargetCrs) -> String {
        match target {
            TargetCrs::Utm => "utm".into(),
            TargetCrs::Named(named) => named.into(),
        }
    }
}
