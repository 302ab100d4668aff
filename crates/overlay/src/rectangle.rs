//! Rectangles along the axes.

/// A closed rectangle along the axes, in lattice steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// The least x and y.
    pub min: [i64; 2],
    /// The greatest x and y.
    pub max: [i64; 2],
}

impl Rectangle {
    /// A rectangle without any point: the start of a union.
    pub const EMPTY: Rectangle = Rectangle { min: [i64::MAX; 2], max: [i64::MIN; 2] };

    /// Returns the smallest rectangle around some places.
    pub fn around(places: impl IntoIterator<Item = [i64; 2]>) -> Rectangle {
        places.into_iter().fold(Rectangle::EMPTY, |all, place| all.joined(Rectangle { min: place, max: place }))
    }

    /// Returns the smallest rectangle around both.
    #[inline]
    pub fn joined(self, other: Rectangle) -> Rectangle {
        Rectangle {
            min: [0, 1].map(|k| self.min[k].min(other.min[k])),
            max: [0, 1].map(|k| self.max[k].max(other.max[k])),
        }
    }

    /// Returns what both have in common, which may be empty.
    pub fn common(self, other: Rectangle) -> Rectangle {
        Rectangle {
            min: [0, 1].map(|k| self.min[k].max(other.min[k])),
            max: [0, 1].map(|k| self.max[k].min(other.max[k])),
        }
    }

    /// Tells whether both have an area in common. Rectangles that only touch have none.
    #[inline(always)]
    pub fn overlaps(&self, other: &Rectangle) -> bool {
        (self.min[0] < other.max[0])
            & (other.min[0] < self.max[0])
            & (self.min[1] < other.max[1])
            & (other.min[1] < self.max[1])
    }

    /// Tells whether both have a point in common.
    #[inline(always)]
    pub fn meets(&self, other: &Rectangle) -> bool {
        (self.min[0] <= other.max[0])
            & (other.min[0] <= self.max[0])
            & (self.min[1] <= other.max[1])
            & (other.min[1] <= self.max[1])
    }

    /// Returns the longer side, of a rectangle that is not empty.
    #[inline]
    pub fn extent(&self) -> i64 {
        (self.max[0] - self.min[0]).max(self.max[1] - self.min[1])
    }
}
