//! Which nodes of the tree viewers see as tiles of `tileset.json`: all leaves, and of the inner nodes those that a coarser level
//! needs. A level has a quarter of the sites of the one below, so all of them together cost about a third of the leaves.

use crate::job::partition::tree::{Kind, Tree};

/// Bytes that a site takes while the meshes below a tile are joined and simplified.
pub const BYTES_PER_LEVEL_SITE: u64 = 550;

/// Bytes that the process and what its allocator keeps of the steps before take.
const KEPT: u64 = 104 << 20;

/// What a tile of the tileset is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// The exact tile of this number.
    Leaf(usize),
    /// An inner tile, by its place in [`Pyramid::inner`].
    Inner(usize),
}

/// A coarser tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inner {
    /// Its node of the tree.
    pub node: usize,
    /// What it is made of.
    pub children: Vec<Child>,
    /// 1 above leaves alone, else one more than the highest of its children.
    pub height: usize,
    /// Points in its children's meshes, about.
    pub sites: u64,
    /// Whether it has content: not where that takes more memory than there is, nor above such a tile.
    pub content: bool,
}

/// The tiles of the tileset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pyramid {
    /// The coarser tiles; children come before their parent, the root last. None where one tile holds everything.
    pub inner: Vec<Inner>,
}

/// How large coarser tiles are to be.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Sites in one, at the most, unless its children are so large that it would have less than a sixteenth of theirs.
    pub sites: u64,
    /// Bytes of memory that making one may take.
    pub memory: u64,
}

impl Sizes {
    /// Tiles of at most so many `sites`, fewer where four of them do not fit the part of the job's `memory` that the allocator does
    /// not keep from the steps before.
    pub fn new(sites: u64, memory: u64) -> Sizes {
        let memory = memory.saturating_sub(KEPT).max(memory / 5).min(memory / 4 * 3);
        Sizes { sites: sites.min(memory / (4 * BYTES_PER_LEVEL_SITE)).max(1), memory }
    }

    /// About how many triangles a tile is to have whose children together have `triangles`.
    pub fn target(self, triangles: usize) -> usize {
        (triangles / 4).min((2 * self.sites as usize).max(triangles / 16)).max(1)
    }
}

impl Pyramid {
    /// For `tree`, whose tiles have so many `points`.
    pub fn new(tree: &Tree, points: &[u64], sizes: Sizes) -> Pyramid {
        let mut builder = Builder { tree, sites: sites_below(tree, points), points, sizes, inner: Vec::new() };
        if !tree.nodes.is_empty() {
            builder.grow(0, None);
        }
        Pyramid { inner: builder.inner }
    }

    /// The inner tiles by height, lowest first: those of one height need only those before.
    pub fn by_height(&self) -> Vec<Vec<usize>> {
        let highest = self.inner.iter().map(|inner| inner.height).max().unwrap_or(0);
        let at = |height: usize| (0..self.inner.len()).filter(|&i| self.inner[i].height == height).collect();
        (1..=highest).map(at).collect()
    }

    /// Bytes of memory that the largest of them takes.
    pub fn largest(&self) -> u64 {
        let with_content = self.inner.iter().filter(|inner| inner.content);
        with_content.map(|inner| inner.sites.saturating_mul(BYTES_PER_LEVEL_SITE)).max().unwrap_or(0)
    }
}

/// The points below every node.
fn sites_below(tree: &Tree, points: &[u64]) -> Vec<u64> {
    let mut sites = vec![0; tree.nodes.len()];
    // Children come after their parent.
    for (node, of) in tree.nodes.iter().enumerate().rev() {
        if let Kind::Leaf(tile) = of.kind {
            sites[node] = points[tile];
        }
        if let Some(parent) = of.parent {
            sites[parent] += sites[node];
        }
    }
    sites
}

struct Builder<'a> {
    tree: &'a Tree,
    /// Points below each node.
    sites: Vec<u64>,
    points: &'a [u64],
    sizes: Sizes,
    inner: Vec<Inner>,
}

impl Builder<'_> {
    /// The tiles at or below `node`, whose nearest tile above is of level `above`.
    fn grow(&mut self, node: usize, above: Option<u32>) -> Vec<Child> {
        match self.tree.nodes[node].kind {
            Kind::Leaf(tile) => vec![Child::Leaf(tile)],
            Kind::Inner(children) => {
                let level = self.level(node);
                let below = children.map(|child| self.grow(child, Some(level))).concat();
                if above == Some(level) { below } else { vec![self.tile(node, below)] }
            }
        }
    }

    /// How many times the sites below `node` have to be quartered until a tile can hold them.
    fn level(&self, node: usize) -> u32 {
        let mut room = self.sizes.sites.max(1);
        let mut level = 0;
        while room < self.sites[node] {
            room = room.saturating_mul(4);
            level += 1;
        }
        level.max(1)
    }

    fn tile(&mut self, node: usize, children: Vec<Child>) -> Child {
        let inner = |child: &Child| if let Child::Inner(at) = *child { Some(&self.inner[at]) } else { None };
        let height = children.iter().filter_map(inner).map(|inner| inner.height).max().unwrap_or(0) + 1;
        let sites = children.iter().map(|child| match *child {
            Child::Leaf(tile) => self.points[tile],
            Child::Inner(at) => self.sizes.target(2 * self.inner[at].sites as usize) as u64 / 2,
        });
        let sites: u64 = sites.sum();
        let fits = sites.saturating_mul(BYTES_PER_LEVEL_SITE) <= self.sizes.memory;
        let content = fits && children.iter().filter_map(inner).all(|inner| inner.content);
        self.inner.push(Inner { node, children, height, sites, content });
        Child::Inner(self.inner.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::partition::tree::{Cell, Node};

    /// A tree of `depth` cuts, its leaves in order.
    fn balanced(depth: u32) -> Tree {
        fn grow(tree: &mut Tree, parent: Option<usize>, depth: u32) -> usize {
            let number = tree.nodes.len();
            tree.nodes.push(Node { cell: Cell::PLANE, parent, kind: Kind::Leaf(tree.leaves.len()) });
            if depth == 0 {
                tree.leaves.push(number);
            } else {
                let children = [0; 2].map(|_| grow(tree, Some(number), depth - 1));
                tree.nodes[number].kind = Kind::Inner(children);
            }
            number
        }
        let mut tree = Tree::default();
        grow(&mut tree, None, depth);
        tree
    }

    fn pyramid(depth: u32, points: u64, sites: u64, memory: u64) -> Pyramid {
        let tree = balanced(depth);
        Pyramid::new(&tree, &vec![points; tree.leaves.len()], Sizes { sites, memory })
    }

    #[test]
    fn four_leaves_make_a_tile_and_four_tiles_the_next() {
        for points in [26_000, 37_500, 50_000] {
            let pyramid = pyramid(4, points, 50_000, u64::MAX);
            assert_eq!(pyramid.by_height().iter().map(Vec::len).collect::<Vec<_>>(), [4, 1], "{points}");
            assert!(pyramid.inner.iter().all(|inner| inner.children.len() == 4 && inner.content));
            assert_eq!(pyramid.inner[0].children, [0, 1, 2, 3].map(Child::Leaf));
        }
    }

    #[test]
    fn small_leaves_come_in_dozens_and_large_ones_in_fours_or_twos() {
        assert_eq!(pyramid(5, 5_000, 50_000, u64::MAX).inner[0].children.len(), 32);
        let large = pyramid(4, 1_000_000, 50_000, u64::MAX);
        assert!(large.inner.iter().all(|inner| (2..=4).contains(&inner.children.len())), "{large:?}");
    }

    #[test]
    fn what_does_not_fit_has_no_content_nor_has_what_is_above() {
        let pyramid = pyramid(4, 50_000, 50_000, 1_000_000);
        assert!(pyramid.inner.iter().all(|inner| !inner.content));
        assert_eq!(pyramid.largest(), 0);
    }

    #[test]
    fn one_leaf_needs_no_levels() {
        assert_eq!(pyramid(0, 100, 50_000, u64::MAX), Pyramid::default());
    }
}
