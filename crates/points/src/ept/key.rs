//! The place of a node in the octree.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::points::octree::MOST_LEVELS;

/// The level of a node, and its number there along x, y and z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct NodeKey(pub(crate) u32, pub(crate) [u32; 3]);

impl NodeKey {
    /// Returns the key that a hierarchy writes so; `None` for no place in an octree.
    pub(crate) fn parse(text: &str) -> Option<NodeKey> {
        let mut numbers = text.split('-').map(|number| number.parse::<u32>().ok());
        let mut next = || numbers.next().flatten();
        let (level, place) = (next()?, [next()?, next()?, next()?]);
        let is_key = level <= MOST_LEVELS && place.iter().all(|number| *number < 1 << level);
        (is_key && numbers.next().is_none()).then_some(NodeKey(level, place))
    }

    /// Tells whether this node is `other`, or lies below it.
    pub(crate) fn is_within(self, other: NodeKey) -> bool {
        let NodeKey(level, place) = other;
        self.0 >= level && (0..3).all(|axis| self.1[axis] >> (self.0 - level) == place[axis])
    }
}

impl fmt::Display for NodeKey {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let NodeKey(level, [x, y, z]) = self;
        write!(f, "{level}-{x}-{y}-{z}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_places_in_an_octree() {
        let key = NodeKey::parse("2-3-0-1").unwrap();
        assert_eq!((key, key.to_string()), (NodeKey(2, [3, 0, 1]), "2-3-0-1".into()));
        for text in ["", "1-0-0", "1-0-0-0-0", "1-2-0-0", "31-0-0-0", "1--1-0-0", "a-0-0-0"] {
            assert_eq!(NodeKey::parse(text), None, "{text}");
        }
        let above = |text: &str| key.is_within(NodeKey::parse(text).unwrap());
        assert!(above("0-0-0-0") && above("1-1-0-0") && above("2-3-0-1"));
        assert!(!above("1-0-0-0") && !above("2-3-0-0") && !above("3-6-0-2"));
    }
}
