//! A tree of boxes, which finds items near a place.

use crate::exact::meet;
use delaunay::geometry::{Bounds, z_order};

/// The number of children of a node.
const FAN: usize = 8;

/// Items with a box each, in a tree of boxes. Items are sorted along a curve that fills the plane, so that neighbours share nodes.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree<T> {
    items: Vec<(Bounds<2>, T)>,
    /// The boxes of nodes. Each of the first level holds `FAN` items, each of the next `FAN` nodes of the level before.
    levels: Vec<Vec<Bounds<2>>>,
}

impl<T> Default for BoxTree<T> {
    fn default() -> BoxTree<T> {
        BoxTree { items: Vec::new(), levels: Vec::new() }
    }
}

impl<T: Copy> BoxTree<T> {
    /// Returns the tree of these items.
    pub(crate) fn new(mut items: Vec<(Bounds<2>, T)>) -> BoxTree<T> {
        items.sort_by_cached_key(|(bounds, _)| z_order(bounds.middle()));
        let mut levels: Vec<Vec<Bounds<2>>> = Vec::new();
        if items.len() > FAN {
            levels.push(items.chunks(FAN).filter_map(|chunk| joined(chunk.iter().map(|item| item.0))).collect());
        }
        while let Some(last) = levels.last().filter(|level| level.len() > FAN) {
            let next = last.chunks(FAN).filter_map(|chunk| joined(chunk.iter().copied())).collect();
            levels.push(next);
        }
        BoxTree { items, levels }
    }

    /// Returns the number of items.
    pub(crate) fn len(&self) -> usize {
        self.items.len()
    }

    /// Returns the items, without an order that means anything.
    pub(crate) fn items(&self) -> impl Iterator<Item = T> + '_ {
        self.items.iter().map(|(_, item)| *item)
    }

    /// Returns the items with their boxes, without an order that means anything.
    fn into_items(self) -> Vec<(Bounds<2>, T)> {
        self.items
    }

    /// Calls `found` with every item whose box passes `wanted`, until it returns true. Returns whether it did. `wanted` must pass a box if
    /// it passes a smaller one inside it.
    #[inline]
    pub(crate) fn any(&self, wanted: impl Fn(&Bounds<2>) -> bool, mut found: impl FnMut(T) -> bool) -> bool {
        let top = self.levels.len();
        let count = self.levels.last().map_or(self.items.len(), Vec::len);
        self.any_below(top, 0..count, &wanted, &mut found)
    }

    /// Looks at the nodes `range` of the level below `level`; those of level 0 are the items.
    fn any_below(
        &self,
        level: usize,
        range: std::ops::Range<usize>,
        wanted: &impl Fn(&Bounds<2>) -> bool,
        found: &mut impl FnMut(T) -> bool,
    ) -> bool {
        let Some(below) = level.checked_sub(1) else {
            return self.items[range].iter().any(|(bounds, item)| wanted(bounds) && found(*item));
        };
        let children = self.levels.get(below.wrapping_sub(1)).map_or(self.items.len(), Vec::len);
        range.into_iter().any(|node| {
            let range = node * FAN..((node + 1) * FAN).min(children);
            wanted(&self.levels[below][node]) && self.any_below(below, range, wanted, found)
        })
    }

    /// Calls `found` with every item whose box meets `bounds`.
    pub(crate) fn meeting(&self, bounds: &Bounds<2>, mut found: impl FnMut(T)) {
        self.any(
            |other| meet(bounds, other),
            |item| {
                found(item);
                false
            },
        );
    }
}

fn joined(boxes: impl Iterator<Item = Bounds<2>>) -> Option<Bounds<2>> {
    boxes.reduce(Bounds::union)
}

/// A tree that grows: a few trees, each more than twice as large as the next, so that an item is sorted a few times only.
#[derive(Clone, Debug)]
pub(crate) struct GrowingTree<T> {
    trees: Vec<BoxTree<T>>,
}

impl<T> Default for GrowingTree<T> {
    fn default() -> GrowingTree<T> {
        GrowingTree { trees: Vec::new() }
    }
}

impl<T: Copy> GrowingTree<T> {
    /// Adds items. Items already there that fail `keep` may be forgotten.
    pub(crate) fn add(&mut self, mut items: Vec<(Bounds<2>, T)>, keep: impl Fn(T) -> bool) {
        while let Some(last) = self.trees.pop_if(|last| last.len() <= 2 * items.len()) {
            items.extend(last.into_items().into_iter().filter(|(_, item)| keep(*item)));
        }
        if !items.is_empty() {
            self.trees.push(BoxTree::new(items));
        }
    }

    /// Calls `found` with every item whose box meets `bounds`.
    pub(crate) fn meeting(&self, bounds: &Bounds<2>, mut found: impl FnMut(T)) {
        self.trees.iter().for_each(|tree| tree.meeting(bounds, &mut found));
    }
}
