//! `[input] nodata`: which heights stand for "nothing measured".

use serde::{Deserialize, Serialize};

/// Which heights are left out because they stand for nodata, as in a grid that has -9999 in cells without a height.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "NodataText")]
pub enum NodataChoice {
    /// The numbers that programs write for nodata, where they lie far from all other heights.
    #[default]
    Auto,
    /// None: every height is one.
    None,
    /// These, and those of [`NodataChoice::Auto`].
    Heights(Vec<f64>),
}

/// As a user writes it.
#[derive(Serialize)]
#[serde(untagged)]
enum NodataText {
    Word(&'static str),
    Heights(Vec<f64>),
}

impl NodataChoice {
    /// Returns whether this is the default.
    pub fn is_auto(&self) -> bool {
        *self == NodataChoice::Auto
    }

    /// Returns whether heights are left out.
    pub fn is_on(&self) -> bool {
        *self != NodataChoice::None
    }

    /// Returns the heights that the user names.
    pub fn heights(&self) -> &[f64] {
        if let NodataChoice::Heights(heights) = self { heights } else { &[] }
    }
}

impl TryFrom<toml::Value> for NodataChoice {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<NodataChoice, String> {
        let heights = match &value {
            toml::Value::String(word) if word == "auto" => return Ok(NodataChoice::Auto),
            toml::Value::String(word) if word == "none" => return Ok(NodataChoice::None),
            toml::Value::Array(numbers) => numbers.iter().map(height).collect(),
            number => height(number).map(|height| vec![height]),
        };
        let heights = heights.filter(|heights: &Vec<f64>| !heights.is_empty());
        let what =
            "nodata is \"auto\", \"none\", or the heights to leave out: a number such as -9999, or a list of numbers";
        heights.map(NodataChoice::Heights).ok_or_else(|| what.to_string())
    }
}

/// Returns a finite number.
fn height(value: &toml::Value) -> Option<f64> {
    let number = value.as_float().or_else(|| value.as_integer().map(|number| number as f64));
    number.filter(|number| number.is_finite())
}

impl From<NodataChoice> for NodataText {
    fn from(choice: NodataChoice) -> NodataText {
        match choice {
            NodataChoice::Auto => NodataText::Word("auto"),
            NodataChoice::None => NodataText::Word("none"),
            NodataChoice::Heights(heights) => NodataText::Heights(heights),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Serialize, Deserialize)]
    struct Table {
        nodata: NodataChoice,
    }

    #[test]
    fn words_and_numbers_are_read_back_as_they_were_written() {
        for (text, expected) in [
            ("\"auto\"", NodataChoice::Auto),
            ("\"none\"", NodataChoice::None),
            ("-9999", NodataChoice::Heights(vec![-9999.0])),
            ("[0, -3.4028235e38]", NodataChoice::Heights(vec![0.0, -3.4028235e38])),
        ] {
            let table: Table = toml::from_str(&format!("nodata = {text}")).unwrap();
            assert_eq!(table.nodata, expected);
            let read: Table = serde_json::from_str(&serde_json::to_string(&table).unwrap()).unwrap();
            assert_eq!(read.nodata, expected);
        }
        for text in ["\"some\"", "nan", "[]", "[\"0\"]", "true"] {
            let error = toml::from_str::<Table>(&format!("nodata = {text}")).unwrap_err().to_string();
            assert!(error.contains("such as -9999"), "{error}");
        }
    }
}
