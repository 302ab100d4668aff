//! What vertices may carry of the points that they stand for, for viewers to style by.

use serde::{Deserialize, Serialize};

const CLASSIFICATION: &str = "classification";
const INTENSITY: &str = "intensity";

/// Which attributes of their points vertices carry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct AttributeChoice {
    /// The class.
    pub classification: bool,
    /// The strength of the return.
    pub intensity: bool,
}

impl AttributeChoice {
    /// Returns whether vertices carry none.
    #[inline]
    pub fn is_none(&self) -> bool {
        *self == AttributeChoice::default()
    }

    /// Returns the attributes of this choice or of the other.
    #[must_use]
    pub(crate) fn or(self, other: AttributeChoice) -> AttributeChoice {
        AttributeChoice {
            classification: self.classification || other.classification,
            intensity: self.intensity || other.intensity,
        }
    }
}

impl TryFrom<Vec<String>> for AttributeChoice {
    type Error = String;

    fn try_from(names: Vec<String>) -> Result<AttributeChoice, String> {
        let mut choice = AttributeChoice::default();
        for name in names {
            match name.as_str() {
                CLASSIFICATION => choice.classification = true,
                INTENSITY => choice.intensity = true,
                _ => {
                    return Err(format!(
                        "attributes is a list of \"{CLASSIFICATION}\", \"{INTENSITY}\", both or neither, such as [\"{INTENSITY}\"]; {name:?} is not known"
                    ));
                }
            }
        }
        Ok(choice)
    }
}

impl From<AttributeChoice> for Vec<String> {
    fn from(choice: AttributeChoice) -> Vec<String> {
        let names = [(choice.classification, CLASSIFICATION), (choice.intensity, INTENSITY)];
        names.into_iter().filter(|(is_chosen, _)| *is_chosen).map(|(_, name)| name.to_owned()).collect()
    }
}

/// The attributes of the points that the vertices of a mesh stand for, vertex by vertex; `None` for what they do not carry.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PointAttributes {
    /// The classes, as LAS numbers them.
    pub classification: Option<Vec<u8>>,
    /// The strengths of the returns.
    pub intensity: Option<Vec<u16>>,
}

impl PointAttributes {
    /// Returns no values of the attributes of `choice`.
    pub(crate) fn empty(choice: AttributeChoice) -> PointAttributes {
        PointAttributes {
            classification: choice.classification.then(Vec::new),
            intensity: choice.intensity.then(Vec::new),
        }
    }

    /// Returns which attributes there are.
    pub(crate) fn choice(&self) -> AttributeChoice {
        AttributeChoice { classification: self.classification.is_some(), intensity: self.intensity.is_some() }
    }

    /// Appends the attributes of one more vertex, as far as vertices carry them.
    pub fn push(&mut self, classification: u8, intensity: u16) {
        self.classification.iter_mut().for_each(|all| all.push(classification));
        self.intensity.iter_mut().for_each(|all| all.push(intensity));
    }

    /// Appends the attributes of vertex `v` of another mesh, which has those that these vertices carry.
    pub(crate) fn push_from(&mut self, others: &PointAttributes, v: usize) {
        if let (Some(all), Some(theirs)) = (&mut self.classification, &others.classification) {
            all.push(theirs[v]);
        }
        if let (Some(all), Some(theirs)) = (&mut self.intensity, &others.intensity) {
            all.push(theirs[v]);
        }
    }

    /// Returns the attributes of these vertices.
    pub(crate) fn pick(&self, vertices: &[u32]) -> PointAttributes {
        fn pick<T: Copy>(all: &[T], vertices: &[u32]) -> Vec<T> {
            vertices.iter().map(|&v| all[v as usize]).collect()
        }
        PointAttributes {
            classification: self.classification.as_ref().map(|all| pick(all, vertices)),
            intensity: self.intensity.as_ref().map(|all| pick(all, vertices)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_names_does_not_matter_and_others_are_refused() {
        let read =
            |names: &[&str]| AttributeChoice::try_from(names.iter().map(|name| name.to_string()).collect::<Vec<_>>());
        let both = AttributeChoice { classification: true, intensity: true };
        assert_eq!(read(&["intensity", "classification"]), Ok(both));
        assert_eq!(Vec::<String>::from(both), ["classification", "intensity"]);
        assert_eq!(read(&[]), Ok(AttributeChoice::default()));
        for name in ["class", "Intensity", ""] {
            assert!(read(&["intensity", name]).unwrap_err().contains(&format!("{name:?} is not known")));
        }
    }
}
