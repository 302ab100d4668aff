//! The inside of lakes, by exact tests.

use crate::box_tree::BoxTree;
use crate::exact::segment_box;
use delaunay::geometry::{Bounds, Site};

/// A point whose coordinates are whole numbers divided by `parts`: the middle of a segment has two parts, that of a triangle three.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fraction {
    pub(crate) sums: [i64; 2],
    pub(crate) parts: i64,
}

impl Fraction {
    /// Returns the point in the middle of `places`.
    pub(crate) fn middle_of(places: &[Site]) -> Fraction {
        let sums = [0, 1].map(|axis| places.iter().map(|place| i64::from(place[axis])).sum());
        Fraction { sums, parts: places.len() as i64 }
    }

    /// Returns whether a ray from here towards greater x can meet what is in the box.
    fn can_meet(&self, bounds: &Bounds<2>) -> bool {
        let scaled = |value: i32| i64::from(value) * self.parts;
        let [x, y] = self.sums;
        scaled(bounds.min[1]) <= y && y <= scaled(bounds.max[1]) && x <= scaled(bounds.max[0])
    }

    /// Returns whether a ray from here towards greater x crosses the segment. The lower end of a segment belongs to it, the upper one does
    /// not, so that a ray through a vertex is counted rightly.
    fn crosses(&self, [a, b]: [Site; 2]) -> bool {
        let [low, high] = if a[1] < b[1] { [a, b] } else { [b, a] };
        let from = |place: Site, axis: usize| i128::from(self.sums[axis] - i64::from(place[axis]) * self.parts);
        let along = |axis: usize| i128::from(high[axis]) - i128::from(low[axis]);
        from(low, 1) >= 0 && from(high, 1) < 0 && along(0) * from(low, 1) - along(1) * from(low, 0) > 0
    }
}

/// The number of a lake, and an edge of its shore.
pub(crate) type Shore = (u32, [Site; 2]);

/// The shores of lakes. A point is inside a lake if a ray from it crosses the lake's shore an odd number of times.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lakes {
    boxes: BoxTree<u32>,
    shores: Vec<BoxTree<[Site; 2]>>,
}

impl Lakes {
    /// Returns `count` lakes with these shores, which are closed: at every place an even number of a lake's segments end.
    pub(crate) fn new(count: u32, shores: impl IntoIterator<Item = Shore>) -> Lakes {
        let mut of_lake: Vec<Vec<(Bounds<2>, [Site; 2])>> = vec![Vec::new(); count as usize];
        for (lake, [a, b]) in shores {
            of_lake[lake as usize].push((segment_box(a, b), [a, b]));
        }
        let joined = |shore: &[(Bounds<2>, [Site; 2])]| shore.iter().map(|(bounds, _)| *bounds).reduce(Bounds::union);
        let boxes = of_lake.iter().zip(0..).filter_map(|(shore, lake)| Some((joined(shore)?, lake))).collect();
        Lakes { boxes: BoxTree::new(boxes), shores: of_lake.into_iter().map(BoxTree::new).collect() }
    }

    /// Returns whether there is no lake.
    pub(crate) fn is_empty(&self) -> bool {
        self.boxes.len() == 0
    }

    /// Returns whether the point is inside a lake that passes `wanted`. On a shore either may be true.
    pub(crate) fn hold(&self, point: Fraction, wanted: impl Fn(u32) -> bool) -> bool {
        self.boxes.any(|bounds| point.can_meet(bounds), |lake| wanted(lake) && self.is_inside(point, lake))
    }

    /// Returns the first lake that the point is inside and that passes `wanted`.
    pub(crate) fn first_around(&self, point: Fraction, wanted: impl Fn(u32) -> bool) -> Option<u32> {
        let mut first: Option<u32> = None;
        self.boxes.any(
            |bounds| point.can_meet(bounds),
            |lake| {
                let is_earlier = first.is_none_or(|first| lake < first);
                if is_earlier && wanted(lake) && self.is_inside(point, lake) {
                    first = Some(lake);
                }
                false
            },
        );
        first
    }

    fn is_inside(&self, point: Fraction, lake: u32) -> bool {
        let mut inside = false;
        self.shores[lake as usize].any(
            |bounds| point.can_meet(bounds),
            |shore| {
                inside ^= point.crosses(shore);
                false
            },
        );
        inside
    }

    /// Returns all segments of all shores.
    pub(crate) fn shores(&self) -> impl Iterator<Item = Shore> + '_ {
        (0..).zip(&self.shores).flat_map(|(lake, shore)| shore.items().map(move |ends| (lake, ends)))
    }
}
