//! The k-d tree that cuts the plane into tiles, and the half-open cells of its nodes.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;
use serde::{Deserialize, Serialize};

/// A half-open rectangle of lattice points, `min <= (x, y) < max`. The outermost cells reach to [`Cell::FAR`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cell {
    /// The least x and y inside.
    pub min: [i64; 2],
    /// The least x and y beyond.
    pub max: [i64; 2],
}

impl Cell {
    /// Infinity: no disc and no site reaches it.
    pub const FAR: i64 = i64::MAX;

    /// The whole plane.
    pub const PLANE: Cell = Cell { min: [-Cell::FAR; 2], max: [Cell::FAR; 2] };

    /// Returns the cell, or `None` if it is the whole plane.
    pub fn with_border(self) -> Option<Cell> {
        (self != Cell::PLANE).then_some(self)
    }

    /// Cuts the cell at coordinate `at` of `axis`; a point at `at` is in the second part.
    pub fn cut(&self, axis: usize, at: i64) -> [Cell; 2] {
        let (mut low, mut high) = (*self, *self);
        low.max[axis] = at;
        high.min[axis] = at;
        [low, high]
    }

    /// Tells whether the circumscribed disc of the counterclockwise triangle abc certainly lies strictly inside the cell: then no
    /// site outside the cell is in or on its circle. Returns `false` where floating point leaves a doubt.
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
        // The area is exact except for its last digit. Cancellation costs the numerators a few units in the last place of their
        // larger term; for slivers that is more than the numerator itself.
        let magnitude = (bb * c[0].abs().max(c[1].abs()) + cc * b[0].abs().max(b[1].abs())) * scale;
        let doubt = 16.0 * f64::EPSILON * magnitude;
        // Not `hypot`, which guards against overflow: nothing here overflows, and this runs for every triangle.
        let reach = (center[0] * center[0] + center[1] * center[1]).sqrt() * (1.0 + 4.0 * f64::EPSILON) + 4.0 * doubt;
        (0..2).all(|axis| {
            let low = self.min[axis] as f64 - a[axis] as f64;
            let high = self.max[axis] as f64 - a[axis] as f64;
            center[axis] - reach >= low && center[axis] + reach < high
        })
    }

    /// Decides most triangles without a division: tells whether the border is farther from `a` than the disc's diameter, which is
    /// the product of the sides' lengths divided by twice the area. The arguments are the squares of the lengths.
    fn is_far_from_border(&self, a: Site, double_area: f64, ab: f64, ac: f64, bc: f64) -> bool {
        let room = (0..2).fold(f64::INFINITY, |room, axis| {
            let at = a[axis] as f64;
            room.min(at - self.min[axis] as f64).min(self.max[axis] as f64 - 1.0 - at)
        });
        let margin = 1.0 + 1e-9;
        room > 0.0 && ab * ac * bc * margin < double_area * double_area * room * room
    }
}

/// Whether a tree node is a tile or has children.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NodeKind {
    /// A tile.
    Leaf(TileIndex),
    /// An inner node and its two children.
    Inner([NodeIndex; 2]),
}

/// A node of the tree.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TreeNode {
    /// The part of the plane that it decides.
    pub cell: Cell,
    /// The node that it was cut from; `None` at the root.
    pub parent: Option<NodeIndex>,
    /// Leaf or inner.
    pub kind: NodeKind,
}

/// The k-d tree of a part. Node 0 is the root, and tiles are numbered in depth-first order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tree {
    /// The part of the job that it cuts.
    pub part: PartIndex,
    /// All nodes. Children come after their parent.
    pub nodes: Vec<TreeNode>,
    /// The node of every tile.
    pub leaves: Vec<NodeIndex>,
}

/// In a part, frontiers are merged at the root, at its grandchildren and at every third inner node below those, eight at a time where the
/// tree is full. Merging two at every node would triangulate most frontier sites more than twice as often. The root merges only
/// four, because other threads have little to do meanwhile. Above the parts two are merged at every node: frontiers grow with the job
/// there, so the largest merge decides how much memory it needs.
const MERGE_STRIDE: usize = 3;

impl Tree {
    /// Returns the node with this index.
    pub fn node(&self, node: NodeIndex) -> &TreeNode {
        &self.nodes[node.get()]
    }

    /// Returns the node of a tile.
    pub fn leaf(&self, tile: TileIndex) -> NodeIndex {
        self.leaves[tile.get()]
    }

    /// Returns all tiles, ascending.
    pub fn tiles(&self) -> impl DoubleEndedIterator<Item = TileIndex> + ExactSizeIterator + Clone {
        let part = self.part;
        (0..self.leaves.len()).map(move |index| part.tile(index))
    }

    /// Returns the nodes above `node`, nearest first.
    fn ancestors(&self, node: NodeIndex) -> impl Iterator<Item = NodeIndex> {
        std::iter::successors(self.node(node).parent, |&n| self.node(n).parent)
    }

    /// Tells whether `node` merges the frontiers below it.
    pub fn is_merge(&self, node: NodeIndex) -> bool {
        let is_inner = matches!(self.node(node).kind, NodeKind::Inner(_));
        let depth = self.ancestors(node).count();
        is_inner && (depth == 0 || self.is_above_parts() || (depth + 1).is_multiple_of(MERGE_STRIDE))
    }

    /// Tells whether the leaves are the parts of a job, not the tiles of one.
    fn is_above_parts(&self) -> bool {
        let first = self.leaves.first().map(|&leaf| &self.node(leaf).kind);
        matches!(first, Some(NodeKind::Leaf(tile)) if tile.part() != self.part)
    }

    /// Returns the merge nodes above `node`, nearest first.
    pub fn merges_above(&self, node: NodeIndex) -> impl Iterator<Item = NodeIndex> {
        self.ancestors(node).filter(|&n| self.is_merge(n))
    }

    /// Returns the nodes whose frontiers merge node `node` merges, in the order of their tiles.
    pub fn merged_by(&self, node: NodeIndex) -> Vec<NodeIndex> {
        let mut merged = Vec::new();
        let mut pending = vec![node];
        while let Some(at) = pending.pop() {
            match self.node(at).kind {
                NodeKind::Inner([low, high]) if at == node || !self.is_merge(at) => pending.extend([high, low]),
                _ => merged.push(at),
            }
        }
        merged
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::fingerprint::LAYOUT;
    use delaunay::geometry::predicates::{in_circle_determinant, orient2d};
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
    fn a_change_of_merge_nodes_changes_the_layout_version() {
        let inner = |number: usize| TreeNode {
            cell: Cell::PLANE,
            parent: number.checked_sub(1).map(NodeIndex::new),
            kind: NodeKind::Inner([NodeIndex::new(number + 1); 2]),
        };
        let tree = Tree { nodes: (0..12).map(inner).collect(), ..Tree::default() };
        let merges: Vec<usize> = (0..12).filter(|&node| tree.is_merge(NodeIndex::new(node))).collect();
        assert_eq!((LAYOUT, merges), (48, vec![0, 2, 5, 8, 11]));
        let mut above = Tree { part: PartIndex::new(1), leaves: vec![NodeIndex::new(12)], ..tree };
        above.nodes.push(TreeNode { kind: NodeKind::Leaf(PartIndex::FIRST.tile(0)), ..inner(12) });
        assert!((0..12).all(|node| above.is_merge(NodeIndex::new(node))));
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
