//! Dividing a tileset among several files: the main one and external tilesets below it, so that a viewer of a huge terrain need not
//! read the list of all its tiles, and no file is too large to read at once.

use crate::tiles3d::tileset::TilesetNode;

/// The most tiles in one file. A tile takes at most some 800 bytes, with a transform and all digits of every number, and mostly 350:
/// so no file is larger than a megabyte.
const MOST_TILES: usize = 1000;

/// Divides the tileset below `root`, so that no file lists more than a thousand tiles. Whole subtrees go to files of their own,
/// larger ones first, and are listed as one tile where they were. Children that are too many even so are joined in groups without
/// content. Returns the number of external tilesets, which are numbered from the root down.
pub fn divide(root: &mut TilesetNode) -> usize {
    divide_by(root, MOST_TILES)
}

fn divide_by(root: &mut TilesetNode, most: usize) -> usize {
    mark(root, most);
    let mut count = 0;
    number(root, &mut count);
    count
}

/// Marks the tiles that begin a file of their own, and returns the number of tiles that the file of `node` lists from it down.
fn mark(node: &mut TilesetNode, most: usize) -> usize {
    let mut counts: Vec<usize> = node.children.iter_mut().map(|child| mark(child, most)).collect();
    let mut total = 1 + counts.iter().sum::<usize>();
    // Of equal ones the first.
    let mut largest: Vec<usize> = (0..counts.len()).collect();
    largest.sort_by_key(|&child| std::cmp::Reverse(counts[child]));
    for child in largest {
        if total <= most || counts[child] == 1 {
            break;
        }
        node.children[child].file = Some(0);
        total -= counts[child] - 1;
        counts[child] = 1;
    }
    while 1 + node.children.len() > most {
        join_in_groups(node, most);
        total = 1 + node.children.len();
    }
    total
}

/// Puts the children of `node` into groups that each fill a file.
fn join_in_groups(node: &mut TilesetNode, most: usize) {
    let mut children = std::mem::take(&mut node.children).into_iter();
    while let Some(first) = children.next() {
        let group: Vec<TilesetNode> = std::iter::once(first).chain(children.by_ref().take(most - 2)).collect();
        node.children.extend(TilesetNode::group(group));
    }
}

/// Numbers the files from `node` down.
fn number(node: &mut TilesetNode, count: &mut usize) {
    if let Some(file) = &mut node.file {
        *file = *count;
        *count += 1;
    }
    node.children.iter_mut().for_each(|child| number(child, count));
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::geometry::Bounds;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn tile(name: usize, children: Vec<TilesetNode>) -> TilesetNode {
        let at = name as i32;
        TilesetNode {
            uri: Some(name.to_string()),
            bounds: Bounds { min: [-at; 3], max: [at; 3] },
            drawn: Bounds { min: [-at; 3], max: [at; 3] },
            middle: [at; 2],
            error: 0.0,
            greatest_error: 0.0,
            transform: None,
            file: None,
            children,
        }
    }

    /// Returns a tree whose tile `i` has `parents[i]`, which is lower, as its parent.
    fn tree(parents: &[usize]) -> TilesetNode {
        let mut children = vec![Vec::new(); parents.len()];
        for i in (0..parents.len()).rev() {
            let mut below: Vec<TilesetNode> = std::mem::take(&mut children[i]);
            below.reverse();
            let node = tile(i, below);
            if i == 0 {
                return node;
            }
            children[parents[i]].push(node);
        }
        tile(0, Vec::new())
    }

    /// Returns each tile's name and that of the nearest tile with a name above it, in order. Groups are looked through.
    fn content(node: &TilesetNode, above: Option<&str>) -> Vec<(String, Option<String>)> {
        let own = node.uri.iter().map(|uri| (uri.clone(), above.map(str::to_owned)));
        let above = node.uri.as_deref().or(above);
        own.chain(node.children.iter().flat_map(|child| content(child, above))).collect()
    }

    /// Returns the number of tiles that each file lists.
    fn sizes(root: &TilesetNode) -> Vec<usize> {
        fn count(node: &TilesetNode, file: usize, sizes: &mut Vec<usize>) {
            sizes[file] += 1;
            let mut own = file;
            if let Some(number) = node.file {
                own = number + 1;
                sizes.resize(sizes.len().max(own + 1), 0);
                sizes[own] += 1;
            }
            node.children.iter().for_each(|child| count(child, own, sizes));
        }
        let mut sizes = vec![0];
        count(root, 0, &mut sizes);
        sizes
    }

    proptest! {
        #[test]
        fn no_file_lists_too_many_tiles_and_the_tree_stays(
            parents in prop::collection::vec(0usize..1000, 1..300),
            spread in 1usize..300,
            most in 4usize..40,
        ) {
            // A large spread makes one tile the parent of very many.
            let parents: Vec<usize> =
                parents.iter().enumerate().map(|(i, p)| (p % i.max(1)) / spread).collect();
            let whole = tree(&parents);
            let mut divided = whole.clone();
            let count = divide_by(&mut divided, most);
            prop_assert_eq!(content(&whole, None), content(&divided, None));
            let sizes = sizes(&divided);
            prop_assert_eq!(sizes.len(), count + 1);
            prop_assert!(sizes.iter().all(|&size| size <= most), "{:?}", sizes);
            // A file of its own is worth it.
            prop_assert!(sizes[1..].iter().all(|&size| size > 1), "{:?}", sizes);
            prop_assert_eq!(count == 0, parents.len() <= most);
        }
    }

    #[test]
    fn files_are_filled() {
        let parents: Vec<usize> = (0..100_000usize).map(|i| i.saturating_sub(1) / 4).collect();
        let mut root = tree(&parents);
        let count = divide(&mut root);
        let sizes = sizes(&root);
        assert!(sizes.iter().all(|&size| size <= MOST_TILES));
        assert!((100..400).contains(&count), "{count}");
    }

    #[test]
    fn a_group_holds_its_children() {
        let mut root = tree(&[0; 50]);
        divide_by(&mut root, 10);
        assert!(root.children.len() < 10 && root.children.iter().all(|group| group.uri.is_none()));
        let names: BTreeSet<String> = content(&root, None).into_iter().map(|(name, _)| name).collect();
        assert_eq!(names.len(), 50);
        for group in &root.children {
            assert!(group.children.iter().all(|child| group.bounds.union(child.bounds) == group.bounds));
            assert!(group.children.iter().all(|child| group.drawn.union(child.drawn) == group.drawn));
        }
    }
}
