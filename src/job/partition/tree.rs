//! The k-d tree that cuts the plane into tiles, and the half-open cells of its nodes.

use crate::geometry::{Site, predicates::orient2d};
use serde::{Deserialize, Serialize};

/// A half-open rectangle of lattice points, `min <= (x, y) < max`; cells on the outside reach to [`Cell::FAR`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cell {
    /// The least x and y inside.
    pub min: [i64; 2],
    /// The least x and y beyond.
    pub max: [i64; 2],
}

impl Cell {
    /// Stands for infinity: no disc and no site reaches it.
    pub const FAR: i64 = i64::MAX;

    /// The whole plane.
    pub const PLANE: Cell = Cell { min: [-Cell::FAR; 2], max: [Cell::FAR; 2] };

    /// The two parts below and from `at` on along `axis`.
    pub fn cut(&self, axis: usize, at: i64) -> [Cell; 2] {
        let (mut low, mut high) = (*self, *self);
        low.max[axis] = at;
        high.min[axis] = at;
        [low, high]
    }

    /// Whether the circumscribed disc of the counterclockwise triangle abc certainly lies strictly inside the cell, so
    /// that no site outside the cell can be in or on its circle. Conservative: `false` when floating point is in doubt.
    pub fn holds_disc(&self, a: Site, b: Site, c: Site) -> bool {
        let double_area = orient2d(a, b, c) as f64;
        let diff = |p: Site| [(p[0] as i64 - a[0] as i64) as f64, (p[1] as i64 - a[1] as i64) as f64];
        let (b, c) = (diff(b), diff(c));
        let (bb, cc) = (b[0] * b[0] + b[1] * b[1], c[0] * c[0] + c[1] * c[1]);
        if self.is_far_from_border(a, double_area, bb, cc, (b[0] - c[0]).powi(2) + (b[1] - c[1]).powi(2)) {
            return true;
        }
        let scale = 0.5 / double_area;
        let center = [(bb * c[1] - cc * b[1]) * scale, (cc * b[0] - bb * c[0]) * scale];
        // The area is exact but for its last place; the numerators lose a few units in the last place of their larger
        // term to cancellation, which for slivers is more than the numerator itself.
        let magnitude = (bb * c[0].abs().max(c[1].abs()) + cc * b[0].abs().max(b[1].abs())) * scale;
        let doubt = 16.0 * f64::EPSILON * magnitude;
        // Not `hypot`: the range of f64 is far from sight, and this runs for every triangle.
        let reach = (center[0] * center[0] + center[1] * center[1]).sqrt() * (1.0 + 4.0 * f64::EPSILON) + 4.0 * doubt;
        (0..2).all(|axis| {
            let low = self.min[axis] as f64 - a[axis] as f64;
            let high = self.max[axis] as f64 - a[axis] as f64;
            center[axis] - reach >= low && center[axis] + reach < high
        })
    }

    /// Settles most triangles without a division: whether the border is farther from `a` than the disc's diameter, which is
    /// the product of the sides' lengths by twice the area. The squares of the lengths are given.
    fn is_far_from_border(&self, a: Site, double_area: f64, ab: f64, ac: f64, bc: f64) -> bool {
        let room = (0..2).fold(f64::INFINITY, |room, axis| {
            let at = a[axis] as f64;
            room.min(at - self.min[axis] as f64).min(self.max[axis] as f64 - 1.0 - at)
        });
        let margin = 1.0 + 1e-9;
        room > 0.0 && ab * ac * bc * margin < double_area * double_area * room * room
    }
}

/// What a node of the tree is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// A tile, by its number.
    Leaf(usize),
    /// An inner node with the node numbers of its two children.
    Inner([usize; 2]),
}

/// A node: its cell, its parent (`None` at the root) and what it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Node {
    /// The part of the plane it is responsible for.
    pub cell: Cell,
    /// The node it was cut from.
    pub parent: Option<usize>,
    /// Leaf or inner.
    pub kind: Kind,
}

/// The tree. Node 0 is the root; tiles are numbered in depth-first order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tree {
    /// All nodes; children come after their parent.
    pub nodes: Vec<Node>,
    /// The node number of every tile.
    pub leaves: Vec<usize>,
}

/// Frontiers are merged at the root, at its grandchildren and at every third inner node below those, eight at a time where the
/// tree is full: joining two at every node would triangulate most frontier sites once a node, more than twice as often in
/// all. At the root only four, as there is no other work beside it.
const MERGE_STRIDE: usize = 3;

impl Tree {
    /// The nodes above node `node`, nearest first.
    fn ancestors(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.nodes[node].parent, |&n| self.nodes[n].parent)
    }

    /// Whether `node` merges the frontiers of what is below it.
    pub fn is_merge(&self, node: usize) -> bool {
        let is_inner = matches!(self.nodes[node].kind, Kind::Inner(_));
        let depth = self.ancestors(node).count();
        is_inner && (depth == 0 || (depth + 1).is_multiple_of(MERGE_STRIDE))
    }

    /// The merge nodes above node `node`, nearest first.
    pub fn merges_above(&self, node: usize) -> impl Iterator<Item = usize> {
        self.ancestors(node).filter(|&n| self.is_merge(n))
    }

    /// Whose frontiers merge node `node` merges, from the lowest tile to the highest.
    pub fn merged_by(&self, node: usize) -> Vec<usize> {
        let mut merged = Vec::new();
        let mut pending = vec![node];
        while let Some(at) = pending.pop() {
            match self.nodes[at].kind {
                Kind::Inner([low, high]) if at == node || !self.is_merge(at) => pending.extend([high, low]),
                _ => merged.push(at),
            }
        }
        merged
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::predicates::{in_circle_determinant, orient2d};
    use crate::job::plan::fingerprint::LAYOUT;
    use proptest::prelude::*;

    #[test]
    fn a_disc_is_held_only_with_room_on_every_side() {
        let cell = Cell { min: [-10, -10], max: [11, 11] };
        assert!(cell.holds_disc([5, 0], [0, 5], [-5, 0]));
        assert!(!cell.holds_disc([11, 0], [0, 11], [-11, 0]));
        assert!(!cell.holds_disc([0, 0], [10, 1], [5, 1]), "a sliver's disc is far larger than the sliver");
        assert!(Cell::PLANE.holds_disc([0, 0], [10, 1], [5, 1]));
    }

    #[test]
    fn other_merges_are_another_layout() {
        let inner = |number: usize| Node {
            cell: Cell::PLANE,
            parent: number.checked_sub(1),
            kind: Kind::Inner([number + 1, number + 1]),
        };
        let tree = Tree { nodes: (0..12).map(inner).collect(), leaves: Vec::new() };
        let merges: Vec<usize> = (0..12).filter(|&node| tree.is_merge(node)).collect();
        assert_eq!((LAYOUT, merges), (4, vec![0, 2, 5, 8, 11]));
    }

    proptest! {
        /// If a disc is held, no lattice point just outside the cell is in or on the circle.
        #[test]
        fn a_held_disc_reaches_no_site_outside(
            points in prop::array::uniform3(prop::array::uniform2(-1000i32..1000)),
            along in -3000i32..3000,
            room in 0i64..2000,
        ) {
            let [a, b, c] = points;
            prop_assume!(orient2d(a, b, c) > 0);
            let cell = Cell { min: [-room, -room], max: [room + 1, room + 1] };
            if cell.holds_disc(a, b, c) {
                let beyond = room as i32 + 1;
                for d in [[along, beyond], [along, -beyond], [beyond, along], [-beyond, along]] {
                    prop_assert!(in_circle_determinant(a, b, c, d) < 0);
                }
            }
        }
    }
}
