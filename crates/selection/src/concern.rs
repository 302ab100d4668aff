//! The part of the plane where what is selected concerns a block.

use crate::area::Area;
use crate::disc::Disc;
use crate::selected_sites::SelectedSites;
use delaunay::geometry::Bounds;

/// A box and some discs. A box around all would be that of the whole cloud where a triangle is thin.
#[derive(Debug)]
pub(crate) struct Concern {
    bounds: Bounds<2>,
    discs: Vec<Disc>,
}

impl Concern {
    /// The most discs, so that the memory which a block takes between rounds is bounded.
    const MOST_DISCS: usize = 16;

    /// Returns what holds a box and discs: the largest of these as they are, and the boxes of the others.
    pub(crate) fn new(bounds: Bounds<2>, mut discs: Vec<Disc>) -> Concern {
        discs.sort_unstable_by(|a, b| b.reach.total_cmp(&a.reach));
        let small = discs.split_off(discs.len().min(Concern::MOST_DISCS));
        discs.shrink_to_fit();
        let bounds = small.iter().fold(bounds, |bounds, disc| bounds.union(disc.bounds()));
        Concern { bounds, discs }
    }

    /// Returns what holds this and another.
    pub(crate) fn join(self, other: Concern) -> Concern {
        Concern::new(self.bounds.union(other.bounds), [self.discs, other.discs].concat())
    }

    /// Tells whether it lies in a box that is a part of the box of `all` points, as far as there are points.
    pub(crate) fn lies_in(&self, part: Bounds<2>, all: Bounds<2>) -> bool {
        let boxes = self.discs.iter().map(Disc::bounds).chain([self.bounds]);
        boxes.reduce(Bounds::union).is_some_and(|concern| {
            (0..2).all(|axis| {
                (part.min[axis] <= concern.min[axis] || part.min[axis] <= all.min[axis])
                    && (concern.max[axis] <= part.max[axis] || all.max[axis] <= part.max[axis])
            })
        })
    }

    /// Tells whether it meets a box. Of one near it this may be told too.
    pub(crate) fn meets(&self, bounds: &Bounds<2>) -> bool {
        self.bounds.meets(bounds) || self.discs.iter().any(|disc| disc.meets(bounds))
    }

    /// Tells whether one of the points that were added last to what is `selected` may lie in it.
    pub(crate) fn has_newly(&self, selected: &SelectedSites) -> bool {
        selected.has_newly_within(self.bounds) || self.discs.iter().any(|disc| selected.has_newly_near(disc))
    }
}
