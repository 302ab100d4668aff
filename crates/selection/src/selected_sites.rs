//! All selected points. What the memory does not hold waits in a file.

use crate::area::{Area, is_in};
use crate::disc::Disc;
use crate::site_cells::SiteCells;
use crate::source::SelectionStore;
use crate::stored_sites::StoredSites;
use delaunay::geometry::{Bounds, Site};
use sys::Result;

/// All selected points of a cloud.
#[derive(Debug)]
pub struct SelectedSites<'a> {
    /// Those in memory, among them all that were added last.
    cells: SiteCells,
    /// The others, in the order in which they went to the file.
    stored: Vec<StoredSites>,
    store: Option<&'a dyn SelectionStore>,
    /// The most points that stay in memory from round to round.
    most_in_memory: u64,
}

impl<'a> SelectedSites<'a> {
    /// Returns no point of a cloud of `points` points in `bounds`.
    pub(crate) fn none(
        bounds: Bounds<2>,
        points: u64,
        store: Option<&'a dyn SelectionStore>,
        most_in_memory: u64,
    ) -> SelectedSites<'a> {
        SelectedSites { cells: SiteCells::none(bounds, points), stored: Vec::new(), store, most_in_memory }
    }

    /// Returns no point of the same cloud.
    pub(crate) fn emptied(&self) -> SelectedSites<'a> {
        SelectedSites { cells: self.cells.emptied(), stored: Vec::new(), ..*self }
    }

    /// Adds points that are none of it.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the file.
    pub(crate) fn add(&mut self, points: impl IntoIterator<Item = [i32; 3]>) -> Result<()> {
        self.cells.settle();
        if let Some(store) = self.store.filter(|_| self.cells.count() > self.most_in_memory) {
            let mut stored = StoredSites::default();
            self.cells.for_each_row(|points| stored.add(points, store))?;
            self.stored.push(stored);
            self.cells = self.cells.emptied();
        }
        self.cells.add(points);
        Ok(())
    }

    /// Gives the space of those in the file back.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the file.
    pub(crate) fn free(self) -> Result<()> {
        let Some(store) = self.store else { return Ok(()) };
        self.stored.into_iter().try_for_each(|stored| stored.free(store))
    }

    /// Returns the number of points.
    pub fn count(&self) -> u64 {
        self.cells.count() + self.stored.iter().map(StoredSites::count).sum::<u64>()
    }

    /// Returns the bytes of memory that it takes, about.
    pub(crate) fn bytes(&self) -> u64 {
        self.cells.bytes() + self.stored.iter().map(StoredSites::bytes).sum::<u64>()
    }

    /// Returns the side of a cell in lattice steps.
    pub(crate) fn side(&self) -> i64 {
        self.cells.side()
    }

    /// Returns the number of points in `bounds`, and some near it.
    pub(crate) fn near(&self, bounds: Bounds<2>) -> usize {
        let mut count = self.stored.iter().map(|stored| stored.near(&bounds)).sum();
        self.cells.for_each_cell(&bounds, |points| count += points.len());
        count
    }

    /// Returns the number of points in `bounds`, and some near it, that were added last.
    pub(crate) fn newly_near(&self, bounds: Bounds<2>) -> usize {
        let mut count = 0;
        self.cells.for_each_grown_cell(&bounds, |points| count += points.len());
        count
    }

    /// Returns the points in `bounds`, in no particular order.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the file of those that are not in memory.
    pub fn within(&self, bounds: Bounds<2>) -> Result<Vec<[i32; 3]>> {
        let mut within = Vec::new();
        self.visit(&bounds, |points| within.extend(points.iter().filter(|point| is_in(&bounds, point))))?;
        Ok(within)
    }

    /// Returns the points in `bounds` that were added last, neighbours in the plane one after the other.
    pub(crate) fn newly_within(&self, bounds: Bounds<2>) -> Vec<[i32; 3]> {
        let mut within = Vec::new();
        let add = |points: &[[i32; 3]]| within.extend(points.iter().filter(|point| is_in(&bounds, point)));
        self.cells.for_each_grown_cell(&bounds, add);
        within
    }

    /// Tells whether one of the points that were added last lies in `bounds`.
    pub(crate) fn has_newly_within(&self, bounds: Bounds<2>) -> bool {
        self.cells.has_newly(&bounds, |point| is_in(&bounds, point))
    }

    /// Tells whether one of the points that were added last lies in `outer`, but not in `inner`.
    pub(crate) fn has_newly_between(&self, inner: Bounds<2>, outer: Bounds<2>) -> bool {
        self.cells.has_newly(&outer, |point| is_in(&outer, point) && !is_in(&inner, point))
    }

    /// Returns the point that lies deepest inside the circle of the triangle of `corners`, which is `disc`, or `None` if there is none. None of
    /// the corners is looked at.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the file of those that are not in memory.
    pub(crate) fn deepest_inside(&self, corners: [Site; 3], disc: Disc) -> Result<Option<[i32; 3]>> {
        // A disc may hold most of the cloud. If a smaller one about the same centre has a point, no other is deeper.
        let quarters = std::iter::successors(Some(disc.reach / 4.0), |reach| Some(reach / 4.0));
        let smaller: Vec<f64> = quarters.take_while(|reach| *reach > self.side() as f64).collect();
        for reach in smaller.into_iter().rev() {
            let found = self.deepest_within(corners, disc.with_reach(reach))?;
            if found.is_some() {
                return Ok(found);
            }
        }
        self.deepest_within(corners, disc)
    }

    /// Returns the point nearest to the centre of a disc among those in it that lie inside the circle of the triangle of `corners`.
    fn deepest_within(&self, corners: [Site; 3], disc: Disc) -> Result<Option<[i32; 3]>> {
        let mut deepest: Option<(f64, [i32; 3])> = None;
        self.visit(&disc, |points| {
            for &point in points {
                let from_centre = disc.squared_distance_from_centre(point);
                if deepest.is_none_or(|(least, _)| from_centre < least) && disc.has_inside(corners, point) {
                    deepest = Some((from_centre, point));
                }
            }
        })?;
        Ok(deepest.map(|(_, point)| point))
    }

    /// Tells whether one of the points that were added last lies in a disc, but for rounding.
    pub(crate) fn has_newly_near(&self, disc: &Disc) -> bool {
        let most = disc.reach * disc.reach;
        self.cells.has_newly(disc, |point| disc.squared_distance_from_centre(*point) <= most)
    }

    /// Tells whether one of the points that were added last lies inside the circle of the triangle of `corners`, which is `disc`.
    pub(crate) fn has_newly_inside(&self, corners: [Site; 3], disc: Disc) -> bool {
        self.cells.has_newly(&disc, |&point| disc.has_inside(corners, point))
    }

    /// Shows `look` all points in an area, and some near it.
    fn visit(&self, area: &impl Area, mut look: impl FnMut(&[[i32; 3]])) -> Result<()> {
        self.cells.for_each_cell(area, &mut look);
        let Some(store) = self.store else { return Ok(()) };
        self.stored.iter().try_for_each(|stored| stored.visit(area, store, &mut look))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Waiting;
    use delaunay::geometry::predicates::in_circle;
    use std::collections::BTreeSet;

    /// Those in cells that are divided, and those that wait in a file.
    #[test]
    fn crowded_and_stored_points_are_found() {
        let spread = (0..2_000).map(|i| [i * 7_919 % 40_009 - 20_000, i * 104_729 % 39_989 - 20_000, i]);
        let crowd = (0..6_000).map(|i| [-333 + i % 77, 15_000 + i / 77, i]);
        let all: Vec<[i32; 3]> = spread.chain(crowd).collect();
        let bounds = Bounds::of_points(all.iter().map(|p| [p[0], p[1]])).unwrap();
        for (most_in_memory, runs) in [(10_000, 0), (4_000, 1), (100, 5)] {
            let waiting = Waiting::default();
            let mut sites = SelectedSites::none(bounds, all.len() as u64, Some(&waiting), most_in_memory);
            for (number, newly) in all.chunks(1_500).enumerate() {
                sites.add(newly.iter().copied()).unwrap();
                let known = &all[..1_500 * number + newly.len()];
                assert_eq!(sites.count(), known.len() as u64);
                finds_all_in_boxes(&sites, bounds, known, newly);
                finds_all_in_discs(&sites, known, newly);
            }
            assert_eq!(sites.stored.len(), runs);
            assert!(sites.stored.iter().all(|stored| stored.bytes() < 24 * stored.count() / 20), "{sites:?}");
        }
    }

    fn finds_all_in_boxes(sites: &SelectedSites, bounds: Bounds<2>, known: &[[i32; 3]], newly: &[[i32; 3]]) {
        for area in [bounds, Bounds { min: [-340, 15_010], max: [-300, 15_020] }, Bounds::of_point([5, 5])] {
            let of = |points: &[[i32; 3]]| points.iter().copied().filter(|p| is_in(&area, p)).collect::<BTreeSet<_>>();
            let unique = |points: Vec<[i32; 3]>| points.into_iter().collect::<BTreeSet<_>>();
            assert!(unique(sites.within(area).unwrap()) == of(known), "{area:?}");
            assert!(unique(sites.newly_within(area)) == of(newly), "{area:?}");
            assert_eq!(sites.has_newly_within(area), !of(newly).is_empty());
            assert!(sites.near(area) >= of(known).len() && sites.newly_near(area) >= of(newly).len());
        }
    }

    fn finds_all_in_discs(sites: &SelectedSites, known: &[[i32; 3]], newly: &[[i32; 3]]) {
        for triangle in [[[-330, 15_003], [-301, 15_007], [-313, 15_044]], [[-9_000, -7], [9_000, 0], [3, 18_000]]] {
            let [a, b, c] = triangle;
            let is_inside = |p: &&[i32; 3]| !triangle.contains(&[p[0], p[1]]) && in_circle(a, b, c, [p[0], p[1]]);
            let disc = Disc::of(triangle);
            let deepest = known.iter().filter(is_inside).map(|&p| disc.squared_distance_from_centre(p));
            let found = sites.deepest_inside(triangle, disc).unwrap().map(|p| disc.squared_distance_from_centre(p));
            assert_eq!(found, deepest.reduce(f64::min));
            assert_eq!(sites.has_newly_inside(triangle, disc), newly.iter().any(|p| is_inside(&p)));
        }
    }
}
