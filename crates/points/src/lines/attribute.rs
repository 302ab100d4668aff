//! Values of a feature's attributes.

/// The value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Attribute {
    Text(String),
    Number(f64),
    /// The feature has no value there.
    Missing,
}

impl Attribute {
    /// Returns the value as a text; `None` without one.
    pub(super) fn text(&self) -> Option<String> {
        match self {
            Attribute::Text(text) => Some(text.trim().to_string()).filter(|text| !text.is_empty()),
            Attribute::Number(number) => Some(number.to_string()),
            Attribute::Missing => None,
        }
    }

    /// Returns the value as a number; `None` if it is none.
    pub(super) fn number(&self) -> Option<f64> {
        let number = match self {
            Attribute::Text(text) => text.trim().parse().ok(),
            Attribute::Number(number) => Some(*number),
            Attribute::Missing => None,
        };
        number.filter(|number: &f64| number.is_finite())
    }
}

/// The attribute with the name of a feature, in small or capital letters.
pub(super) const NAME_FIELD: &str = "name";

/// The attributes of a feature that the options ask for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WantedAttributes {
    pub(super) kind: Attribute,
    pub(super) height: Attribute,
    /// Its name, which no feature has to have.
    pub(super) name: Attribute,
}

impl WantedAttributes {
    /// Nothing, where the options ask for nothing.
    pub(super) const NONE: WantedAttributes =
        WantedAttributes { kind: Attribute::Missing, height: Attribute::Missing, name: Attribute::Missing };
}

/// Says that a file has no attribute of this name, and which ones it has.
pub(super) fn no_attribute(name: &str, there: &[String]) -> String {
    const MOST_NAMES: usize = 20;
    let mut names = there.iter().take(MOST_NAMES).map(String::as_str).collect::<Vec<_>>().join(", ");
    if there.len() > MOST_NAMES {
        names.push_str(", ...");
    }
    let has = if there.is_empty() { "it has none".to_string() } else { format!("it has {names}") };
    format!("has no attribute {name:?}, which [[breaklines]] names: {has}")
}
