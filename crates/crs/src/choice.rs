//! The coordinate reference system that a user names for all inputs.

use crate::crs_name::CrsName;
use crate::from_wkt::parse;
use crate::system::Crs;
use serde::{Deserialize, Serialize};

/// The value of `[input] crs`: which coordinate reference system the inputs are in.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum CrsChoice {
    /// What the files say, if all that say it agree.
    #[default]
    Auto,
    /// What the first file says that says anything. The others are taken to be in it too.
    First,
    /// None: the coordinates are a plane.
    None,
    /// This one, whatever the files say.
    Given {
        /// As the user wrote it: codes or well-known text.
        text: String,
        /// What it means.
        crs: Box<Crs>,
    },
}

impl TryFrom<String> for CrsChoice {
    type Error = String;

    fn try_from(text: String) -> Result<CrsChoice, String> {
        match text.trim() {
            "auto" => Ok(CrsChoice::Auto),
            "first" => Ok(CrsChoice::First),
            "none" => Ok(CrsChoice::None),
            name => match named(name)? {
                Some(crs) => Ok(CrsChoice::Given { crs: Box::new(crs), text }),
                None => Err(format!(
                    "crs is \"auto\", \"first\", \"none\", an EPSG code such as \"EPSG:26915\" or \"EPSG:26915+5703\", or \
                     well-known text, not {text:?}"
                )),
            },
        }
    }
}

impl From<CrsChoice> for String {
    fn from(choice: CrsChoice) -> String {
        match choice {
            CrsChoice::Auto => "auto".into(),
            CrsChoice::First => "first".into(),
            CrsChoice::None => "none".into(),
            CrsChoice::Given { text, .. } => text,
        }
    }
}

/// Returns the system of codes or of well-known text; `None` if the text is of another kind.
pub(crate) fn named(text: &str) -> Result<Option<Crs>, String> {
    let unknown = |code: u32| format!("crs: EPSG:{code} is not in the list of known codes; give its well-known text");
    match CrsName::read(text) {
        Some(name) => name.system().map(Some).map_err(unknown),
        None => Ok(parse(text)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::Unit;

    fn given(text: &str) -> Crs {
        match CrsChoice::try_from(text.to_string()).unwrap() {
            CrsChoice::Given { crs, .. } => *crs,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn codes_and_texts_are_read() {
        assert_eq!(given("EPSG:26915").epsg, Some(26915));
        assert_eq!(given("urn:ogc:def:crs:EPSG::26915"), given("EPSG:26915"));
        let compound = given("epsg:26915+6360");
        assert_eq!((compound.horizontal, compound.vertical), (Unit::Metre, Some(Unit::US_FOOT)));
        assert_eq!(
            given(r#"PROJCS["P",GEOGCS["G",UNIT["degree",0.0174]],UNIT["foot",0.3048]]"#).horizontal,
            Unit::Foot
        );
        for (text, word) in [("EPSG:1", "EPSG:1 is not"), ("EPSG:26915+1", "EPSG:1 is not"), ("UTM 15N", "EPSG:26915")]
        {
            let error = CrsChoice::try_from(text.to_string()).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn a_choice_is_read_back_as_it_was_written() {
        for text in ["auto", "first", "none", "EPSG:2949"] {
            let choice = CrsChoice::try_from(text.to_string()).unwrap();
            assert_eq!(String::from(choice.clone()), text);
            let written = serde_json::to_string(&choice).unwrap();
            assert_eq!(serde_json::from_str::<CrsChoice>(&written).unwrap(), choice);
        }
    }
}
