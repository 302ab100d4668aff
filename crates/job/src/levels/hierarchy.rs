//! Which nodes of the tree viewers see as tiles of `tileset.json`: all leaves, and the inner nodes that become coarser tiles. A level
//! has about a fifth of the sites of the one below, so all levels together cost about a quarter of the leaves.

use crate::index::{NodeIndex, PartIndex, TileIndex};
use crate::partition::tree::{NodeKind, Tree};

/// Bytes that a vertex takes while the meshes of a tile's children are joined and simplified.
pub(crate) const BYTES_PER_LEVEL_VERTEX: u64 = 550;

/// Bytes that the process takes, including what its allocator keeps from earlier steps.
const KEPT: u64 = 104 << 20;

/// Tiles share their vertices if the same tile is so many levels above them. With one level, woods are an eighth further from the exact mesh;
/// with three, an update of one tile would change 64.
const SHARED_BELOW: usize = 2;

/// A child of a coarser tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChildTile {
    /// An exact tile.
    Exact(TileIndex),
    /// The topmost tile of a part.
    Part(PartIndex),
    /// A coarser tile, by its index in [`Hierarchy::tiles`].
    Coarse(usize),
}

impl ChildTile {
    /// Returns the index of a coarser tile.
    fn coarse(self) -> Option<usize> {
        if let ChildTile::Coarse(at) = self { Some(at) } else { None }
    }
}

/// A coarser tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CoarseTile {
    /// Its node of the tree.
    pub node: NodeIndex,
    /// The tiles that it is made from.
    pub children: Vec<ChildTile>,
    /// 1 if all children are exact tiles, else one more than the highest child.
    pub height: usize,
    /// If all children are exact tiles: those of its kind that share their vertices with it, itself among them.
    pub sharing: Vec<usize>,
}

/// The tiles of the tileset, or those of one part, or those above the parts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Hierarchy {
    /// The coarser tiles. Children come before their parent, and the root is last. Empty if one tile holds everything.
    pub tiles: Vec<CoarseTile>,
}

/// How large coarser tiles are to be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelSizes {
    /// The most sites in one, unless its children are so large that it would have less than a sixteenth of theirs.
    pub sites: u64,
    /// Bytes of memory that making all that are made at one time may take.
    pub memory: u64,
}

impl LevelSizes {
    /// Returns the sizes for tiles of at most `sites` sites. They are smaller if five tiles do not fit the part of the job's `memory`
    /// that earlier steps leave free.
    pub(crate) fn new(sites: u64, memory: u64) -> LevelSizes {
        let memory = memory.saturating_sub(KEPT).max(memory / 5).min(memory / 4 * 3);
        // Tiles have vertices on their borders besides their sites, so there is room for a fifth one.
        let sizes = LevelSizes { sites, memory };
        LevelSizes { sites: sites.min(sizes.most_sites()).max(1), memory }
    }

    /// Returns the most sites of a tile of which four fit the memory together.
    pub(crate) fn most_sites(self) -> u64 {
        self.memory / (5 * BYTES_PER_LEVEL_VERTEX)
    }

    /// Returns about how many triangles a tile gets whose children together have `triangles`. Skirts and vertices along the borders come on top
    /// of them, so it is less than a fifth.
    pub(crate) fn target(self, triangles: usize) -> usize {
        (triangles * 7 / 40).min((2 * self.sites as usize).max(triangles / 16)).max(1)
    }
}

impl Hierarchy {
    /// Builds the hierarchy over `tree`; `points` is the number of points of every leaf, in their order.
    pub(crate) fn new(tree: &Tree, points: &[u64], sizes: LevelSizes) -> Hierarchy {
        Hierarchy::over(tree, points, sizes, ChildTile::Exact)
    }

    /// Builds the hierarchy above the parts, whose numbers of points are `points`.
    pub(crate) fn above_parts(tree: &Tree, points: &[u64], sizes: LevelSizes) -> Hierarchy {
        Hierarchy::over(tree, points, sizes, |tile| ChildTile::Part(tile.part()))
    }

    fn over(tree: &Tree, points: &[u64], sizes: LevelSizes, leaf: fn(TileIndex) -> ChildTile) -> Hierarchy {
        let mut builder = HierarchyBuilder { tree, sites: sites_below(tree, points), sizes, leaf, tiles: Vec::new() };
        if !tree.nodes.is_empty() {
            builder.grow(NodeIndex::ROOT, None);
        }
        let mut hierarchy = Hierarchy { tiles: builder.tiles };
        hierarchy.let_neighbours_share();
        hierarchy
    }

    /// Lets tiles share vertices if all their children are exact and the same tile is [`SHARED_BELOW`] levels above them.
    fn let_neighbours_share(&mut self) {
        let mut parents: Vec<usize> = (0..self.tiles.len()).collect();
        for (parent, tile) in self.tiles.iter().enumerate() {
            tile.children.iter().filter_map(|child| child.coarse()).for_each(|child| parents[child] = parent);
        }
        let above = |index: usize| (0..SHARED_BELOW).fold(index, |index, _| parents[index]);
        let is_lowest = |index: &usize| matches!(self.tiles[*index].children[..], [ChildTile::Exact(_), ..]);
        let mut groups = vec![Vec::new(); self.tiles.len()];
        let lowest = (0..self.tiles.len()).filter(|index| self.tiles[*index].height == 1).filter(is_lowest);
        lowest.for_each(|index| groups[above(index)].push(index));
        for group in groups {
            group.iter().for_each(|&index| self.tiles[index].sharing = group.clone());
        }
    }

    /// Returns the coarser tiles by height, lowest first: tiles of one height need only lower ones.
    pub(crate) fn by_height(&self) -> Vec<Vec<usize>> {
        let highest = self.tiles.iter().map(|tile| tile.height).max().unwrap_or(0);
        let at = |height: usize| (0..self.tiles.len()).filter(|&i| self.tiles[i].height == height).collect();
        (1..=highest).map(at).collect()
    }
}

/// Returns the number of points below every node.
fn sites_below(tree: &Tree, points: &[u64]) -> Vec<u64> {
    let mut sites = vec![0; tree.nodes.len()];
    tree.leaves.iter().zip(points).for_each(|(leaf, &points)| sites[leaf.get()] = points);
    // Children come after their parent.
    for (node, of) in tree.nodes.iter().enumerate().rev() {
        if let Some(parent) = of.parent {
            sites[parent.get()] += sites[node];
        }
    }
    sites
}

struct HierarchyBuilder<'a> {
    tree: &'a Tree,
    /// Points below each node.
    sites: Vec<u64>,
    sizes: LevelSizes,
    leaf: fn(TileIndex) -> ChildTile,
    tiles: Vec<CoarseTile>,
}

impl HierarchyBuilder<'_> {
    /// Returns the tiles at or below `node`; `above` is the level of the nearest tile above.
    fn grow(&mut self, node: NodeIndex, above: Option<u32>) -> Vec<ChildTile> {
        match self.tree.node(node).kind {
            NodeKind::Leaf(tile) => vec![(self.leaf)(tile)],
            NodeKind::Inner(children) => {
                let level = self.level(node);
                let below = children.map(|child| self.grow(child, Some(level))).concat();
                if above == Some(level) { below } else { vec![self.add_tile(node, below)] }
            }
        }
    }

    /// Returns how many times the sites below `node` must be quartered until a tile can hold them.
    fn level(&self, node: NodeIndex) -> u32 {
        let mut room = self.sizes.sites.max(1);
        let mut level = 0;
        while room < self.sites[node.get()] {
            room = room.saturating_mul(4);
            level += 1;
        }
        level.max(1)
    }

    fn add_tile(&mut self, node: NodeIndex, children: Vec<ChildTile>) -> ChildTile {
        let coarse = children.iter().filter_map(|child| child.coarse());
        let height = coarse.map(|at| self.tiles[at].height).max().unwrap_or(0) + 1;
        self.tiles.push(CoarseTile { node, children, height, sharing: Vec::new() });
        ChildTile::Coarse(self.tiles.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::partition::tree::{Cell, TreeNode};

    /// Returns a tree of `depth` cuts with its leaves in order.
    fn balanced(depth: u32) -> Tree {
        fn grow(tree: &mut Tree, parent: Option<NodeIndex>, depth: u32) -> NodeIndex {
            let node = NodeIndex::new(tree.nodes.len());
            let kind = NodeKind::Leaf(PartIndex::FIRST.tile(tree.leaves.len()));
            tree.nodes.push(TreeNode { cell: Cell::PLANE, parent, kind });
            if depth == 0 {
                tree.leaves.push(node);
            } else {
                let children = [0; 2].map(|_| grow(tree, Some(node), depth - 1));
                tree.nodes[node.get()].kind = NodeKind::Inner(children);
            }
            node
        }
        let mut tree = Tree::default();
        grow(&mut tree, None, depth);
        tree
    }

    fn hierarchy(depth: u32, points: u64, sites: u64) -> Hierarchy {
        let tree = balanced(depth);
        Hierarchy::new(&tree, &vec![points; tree.leaves.len()], LevelSizes { sites, memory: u64::MAX })
    }

    #[test]
    fn four_leaves_make_a_tile_and_four_tiles_the_next() {
        for points in [26_000, 37_500, 50_000] {
            let hierarchy = hierarchy(4, points, 50_000);
            assert_eq!(hierarchy.by_height().iter().map(Vec::len).collect::<Vec<_>>(), [4, 1], "{points}");
            assert!(hierarchy.tiles.iter().all(|tile| tile.children.len() == 4));
            assert_eq!(hierarchy.tiles[0].children, [0, 1, 2, 3].map(|tile| ChildTile::Exact(TileIndex(tile))));
        }
    }

    #[test]
    fn small_leaves_are_grouped_in_dozens_and_large_ones_in_fours_or_twos() {
        assert_eq!(hierarchy(5, 5_000, 50_000).tiles[0].children.len(), 32);
        let large = hierarchy(4, 1_000_000, 50_000);
        assert!(large.tiles.iter().all(|tile| (2..=4).contains(&tile.children.len())), "{large:?}");
    }

    /// Otherwise a tile that was made as large as the memory allows would be left out.
    #[test]
    fn four_tiles_fit_the_memory_with_the_vertices_on_their_borders() {
        for memory in (100..300).map(|mebibytes| mebibytes << 20) {
            let LevelSizes { sites, memory } = LevelSizes::new(1 << 40, memory);
            assert!(4 * (sites + sites / 10) * BYTES_PER_LEVEL_VERTEX <= memory);
        }
    }

    #[test]
    fn sixteen_of_the_finest_share() {
        let hierarchy = hierarchy(8, 30_000, 50_000);
        assert_eq!(hierarchy.by_height().iter().map(Vec::len).collect::<Vec<_>>(), [64, 16, 4, 1]);
        for (index, tile) in hierarchy.tiles.iter().enumerate() {
            assert_eq!(tile.sharing.len(), if tile.height == 1 { 16 } else { 0 });
            assert!(tile.height > 1 || tile.sharing.contains(&index));
        }
        assert_eq!(super::tests::hierarchy(2, 30_000, 50_000).tiles[0].sharing, [0]);
    }

    #[test]
    fn one_leaf_needs_no_levels() {
        assert_eq!(hierarchy(0, 100, 50_000), Hierarchy::default());
    }
}
