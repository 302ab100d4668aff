//! Boxes as texts, with the feature `serde`.

use crate::geometry::Bounds;
use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, Serializer};

/// Written as `[min, max]`.
impl<const N: usize> Serialize for Bounds<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        [&self.min[..], &self.max[..]].serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for Bounds<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Bounds<N>, D::Error> {
        let [min, max] = <[Vec<i32>; 2]>::deserialize(deserializer)?;
        let corner = |values: Vec<i32>| {
            let count = values.len();
            values.try_into().map_err(|_| D::Error::custom(format!("a corner has {count} coordinates, not {N}")))
        };
        Ok(Bounds { min: corner(min)?, max: corner(max)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_read_back_as_they_were_written() {
        let bounds = Bounds { min: [0, -1, 4], max: [3, 5, 4] };
        let text = serde_json::to_string(&bounds).unwrap();
        assert_eq!(text, "[[0,-1,4],[3,5,4]]");
        assert_eq!(serde_json::from_str::<Bounds<3>>(&text).unwrap(), bounds);
        assert!(serde_json::from_str::<Bounds<2>>(&text).is_err());
    }
}
