//! The properties of a GeoJSON feature: the wanted ones are taken out of the text, and the others are passed over.

use std::fmt;

use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::Value;
use serde_json::value::RawValue;

use crate::lines::attribute::Attribute;

/// So many names are kept for messages.
const MOST_NAMES: usize = 21;

/// A longer text of a value is no kind and no height.
const LONGEST_VALUE: usize = 1 << 16;

/// What is wanted of the properties.
pub(super) struct Properties {
    /// The value of each wanted name; `None` if there is no such property.
    pub(super) values: [Option<Attribute>; 3],
    /// The names of the first properties.
    pub(super) names: Vec<String>,
}

/// Returns the properties of these names in `text`, the last one of each.
///
/// # Errors
/// If it is no object.
pub(super) fn properties(text: &RawValue, wanted: [Option<&str>; 3]) -> serde_json::Result<Properties> {
    let empty = Properties { values: [None, None, None], names: Vec::new() };
    match text.get() {
        "null" => Ok(empty),
        text => serde_json::Deserializer::from_str(text).deserialize_map(PropertiesVisitor { wanted, found: empty }),
    }
}

struct PropertiesVisitor<'a> {
    wanted: [Option<&'a str>; 3],
    found: Properties,
}

impl<'de> Visitor<'de> for PropertiesVisitor<'_> {
    type Value = Properties;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("properties, such as {\"TYPE\": \"river\"}")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Properties, A::Error> {
        let PropertiesVisitor { wanted, mut found } = self;
        while let Some(name) = members.next_key::<String>()? {
            if wanted.contains(&Some(&name)) {
                let value = attribute(members.next_value::<&RawValue>()?.get());
                for (place, _) in found.values.iter_mut().zip(wanted).filter(|(_, wanted)| *wanted == Some(&name)) {
                    *place = Some(value.clone());
                }
            } else {
                members.next_value::<IgnoredAny>()?;
            }
            if found.names.len() < MOST_NAMES && !found.names.contains(&name) {
                found.names.push(name);
            }
        }
        Ok(found)
    }
}

fn attribute(text: &str) -> Attribute {
    if text.len() > LONGEST_VALUE {
        return Attribute::Missing;
    }
    match serde_json::from_str(text) {
        Ok(Value::String(text)) => Attribute::Text(text),
        Ok(Value::Number(number)) => number.as_f64().map_or(Attribute::Missing, Attribute::Number),
        Ok(Value::Null) | Err(_) => Attribute::Missing,
        Ok(other) => Attribute::Text(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wanted_ones_are_found() {
        let text = r#"{"b": [[1, 2], {"a": 7}], "Z": 4.5, "a": null, "T": "a \"river\""}"#;
        let read = |wanted| properties(serde_json::from_str(text).unwrap(), wanted).unwrap();
        let found = read([Some("T"), Some("Z"), None]);
        assert_eq!(found.values, [Some(Attribute::Text("a \"river\"".into())), Some(Attribute::Number(4.5)), None]);
        assert_eq!(found.names, ["b", "Z", "a", "T"]);
        assert_eq!(read([Some("Z"), Some("Z"), None]).values[0], Some(Attribute::Number(4.5)));
        assert_eq!(read([Some("a"), Some("t"), None]).values, [Some(Attribute::Missing), None, None]);
        assert!(properties(serde_json::from_str("[1]").unwrap(), [None; 3]).is_err());
    }
}
